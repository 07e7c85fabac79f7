"""The contract that every registered strategy keeps, whatever it is shown."""

import numpy as np
import pytest
from hypothesis import given, settings

import coramp
from coramp.coordination.coordinator import Coordinator
from coramp.coordination.guard import Guarded
from coramp.errors import CorampError
from coramp.messages.feed import RequestFeed
from coramp.strategies.base import period_of
from coramp.strategies.mixed_slots import MixedSlots
from coramp.strategies.registry import register, strategies, strategy_named
from coramp.testing import Twice, check_strategy
from tests.situations import lane_traffic, situations

NAMES = list(strategies())
IN_LANES = ("mainline-priority", "ramp-priority", "mixed-slots", "uncontrolled", "alinea")
"""Those that run on several lanes."""
STEERS = "mixed-slots"
"""This one steers there; what it decides about plans is for one lane."""


@pytest.mark.parametrize("name", NAMES)
def test_total_deterministic_finite_and_pure(name):
    @settings(max_examples=40 if period_of(strategy_named(name)()) is None else 10)
    @given(situation=situations())
    def keeps_it(situation):
        watch(name, *situation[:2])

    keeps_it()  # one that is asked every half a second is asked hundreds of times an example


@pytest.mark.parametrize("name", [name for name in IN_LANES if name != STEERS])
@settings(max_examples=10)
@given(traffic=lane_traffic())
def test_so_it_is_on_several_lanes(name, traffic):
    watch(name, *traffic)


def watch(name, scenario, arrivals):
    """Runs a strategy that is asked everything twice; it must be asked, and never refused."""
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


@pytest.mark.parametrize("name", [n for n in NAMES if strategies()[n].cooperative])
def test_everyone_gets_through_at_low_and_high_flows(name):
    check_strategy(strategy_named(name), seeds=(1,))


@pytest.mark.parametrize("name", NAMES)
def test_in_sumo_everyone_gets_through_on_several_lanes_or_it_is_refused_in_a_line(
    name, monkeypatch
):
    monkeypatch.setattr(MixedSlots, "steer", asked_twice(MixedSlots.steer))
    road = {"mainline.lanes": 2, "simulation.horizon_s": 20.0}
    flows = {"mainline_veh_h": 3000.0, "ramp_veh_h": 700.0}
    if name not in IN_LANES:
        with pytest.raises(CorampError) as error:
            coramp.run("paper", name, overrides=road, **flows)
        assert len(error.value.messages) == 1
        assert "allowed" in error.value.messages[0]
        return
    run = coramp.run("paper", name, overrides=road, **flows)
    assert run.summary["unserved"] == run.summary["collisions"] == 0
    assert run.broken_promises == []
    assert set(run.vehicles["stream"]) == {"mainline", "ramp"}


def asked_twice(steer):
    """``steer`` that is asked twice: it answers the same, and changes nothing that it is shown."""

    def answer(self, situation, places):
        copies = [column.copy() for column in situation.users]
        first, second = steer(self, situation, places), steer(self, situation, places)
        for one, other in zip(first[:2], second[:2], strict=True):
            np.testing.assert_array_equal(one, other)
        assert first.places == second.places
        for column, copy in zip(situation.users, copies, strict=True):
            np.testing.assert_array_equal(column, copy)
        return first

    return answer


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
