"""The contract that every registered strategy keeps, whatever it is shown."""

import pytest
from hypothesis import given, settings

from coramp.coordination.coordinator import Coordinator
from coramp.coordination.guard import Guarded
from coramp.errors import CorampError
from coramp.messages.feed import RequestFeed
from coramp.strategies.base import period_of
from coramp.strategies.registry import register, strategies, strategy_named
from coramp.testing import Twice, check_strategy
from tests.situations import situations

NAMES = list(strategies())


@pytest.mark.parametrize("name", NAMES)
def test_total_deterministic_finite_and_pure(name):
    @settings(max_examples=40 if period_of(strategy_named(name)()) is None else 10)
    @given(situation=situations())
    def keeps_it(situation):
        scenario, arrivals, _ = situation
        watched = Twice(strategy_named(name))
        coordinator = Coordinator(
            Guarded(watched),
            scenario.rules(),
            RequestFeed(arrivals),
            scenario.fastest_mainline_entry_mps,
        )
        coordinator.expect_arrivals()
        coordinator.run(2000)
        assert watched.asked > 0
        assert coordinator.refusals == []

    keeps_it()  # one that is asked every half a second is asked hundreds of times an example


@pytest.mark.parametrize("name", [n for n in NAMES if strategies()[n].cooperative])
def test_everyone_gets_through_at_low_and_high_flows(name):
    check_strategy(strategy_named(name), seeds=(1,))


@pytest.mark.parametrize("name", NAMES)
def test_it_says_what_it_is(name):
    strategy = strategies()[name]
    assert strategy.name == name
    assert strategy.summary
    assert strategy.cooperative in (True, False)


def test_names_are_unique():
    with pytest.raises(CorampError, match="registered twice"):
        register(strategies()["mainline-priority"])


def test_a_strategy_of_ones_own_can_take_its_own_place_but_not_that_of_ours(monkeypatch):
    monkeypatch.setattr("coramp.strategies.registry._STRATEGIES", strategies())
    mine, again = (type("Mine", (), {"name": "mine", "summary": "x"}) for _ in range(2))
    register(mine)
    with pytest.raises(CorampError, match=r"'mine' is registered twice; .* replace=True"):
        register(again)
    assert strategy_named("mine") is mine
    register(again, replace=True)
    assert strategy_named("mine") is again
    ours = strategies()["mainline-priority"]
    with pytest.raises(CorampError, match="coramp's own"):
        register(type("Theirs", (), {"name": ours.name}), replace=True)
    assert strategy_named(ours.name) is ours


def test_an_unknown_name_lists_those_that_there_are():
    with pytest.raises(CorampError, match="allowed are mainline-priority, ramp-priority"):
        strategy_named("mainline-prority")
