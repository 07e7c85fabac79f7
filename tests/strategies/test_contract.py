"""The contract that every registered strategy keeps, whatever it is shown."""

import numpy as np
import pytest
from hypothesis import given, settings

from coramp.coordination.coordinator import Coordinator
from coramp.errors import CorampError
from coramp.strategies.base import Decision, FollowTrajectory, ReleaseToDriver
from coramp.strategies.registry import register, strategies, strategy_named
from tests.situations import situations

NAMES = list(strategies())


class Watched:
    """Asks a strategy twice, and looks for everything that it must not do."""

    summary, cooperative = "", True

    def __init__(self, name):
        self.name = name
        self.strategy = strategy_named(name)()
        self.asked = 0

    def decide(self, view, memory):
        self.asked += 1
        shown = self.arrays(view)
        copies = [array.copy() for array in shown]
        decision = self.strategy.decide(view, memory)
        again = strategy_named(self.name)().decide(view, memory)
        for array, copy in zip(shown, copies, strict=True):
            np.testing.assert_array_equal(array, copy)
        assert repr(decision) == repr(again)
        self.check(decision, view)
        hash(decision.memory)
        return decision if strategy_named(self.name).cooperative else Decision()

    @staticmethod
    def arrays(view):
        found = [getattr(view.reports, name) for name in ("time_s", "station_m", "speed_mps")]
        return [*found, *view.fleet, *view.acknowledged]

    @staticmethod
    def check(decision, view):
        live = set(view.fleet.live.tolist())
        for command in decision.commands:
            assert command.row in live
            if isinstance(command, ReleaseToDriver):
                continue
            assert isinstance(command, FollowTrajectory)
            assert np.isfinite(command.pieces).all()
            assert command.pieces.shape[1] == 4
            assert not np.isnan(command.merge_time_s)
            delay_s = view.rules.control.actuation_delay_s
            assert command.pieces[0, 0] >= view.time_s + delay_s - 1e-9
            assert not np.shares_memory(command.pieces, view.fleet.pieces)
        for wake_s, row in decision.wakes_s:
            assert wake_s >= view.time_s
            assert row in live


@pytest.mark.parametrize("name", NAMES)
@settings(max_examples=40)
@given(situation=situations())
def test_total_deterministic_finite_and_pure(name, situation):
    scenario, arrivals, _ = situation
    watched = Watched(name)
    coordinator = Coordinator(
        watched, scenario.rules(), arrivals, scenario.fastest_mainline_entry_mps
    )
    coordinator.expect_arrivals()
    coordinator.run(2000)
    assert watched.asked > 0
    assert coordinator.refusals == []


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
