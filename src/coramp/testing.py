"""The contract that every strategy keeps, to be checked on one of your own."""

from collections.abc import Iterable
from typing import Any

import numpy as np

from coramp.coordination.coordinator import Coordinator
from coramp.coordination.guard import Guarded
from coramp.demand.arrivals import arrivals_of
from coramp.messages.feed import RequestFeed
from coramp.scenarios.loading import load_scenario
from coramp.scenarios.model import Scenario
from coramp.strategies.base import (
    Decision,
    FollowTrajectory,
    Memory,
    Strategy,
    View,
    entry_policy_of,
    is_metered,
    period_of,
)
from coramp.vehicles.merge_state import is_waiting

LATEST_EXIT_S = 600.0
"""By then everyone who comes within a minute must be gone."""
FLOWS_VEH_H = ((800.0, 200.0), (1800.0, 500.0), (2600.0, 900.0))


class Twice:
    """Asks a strategy twice; it must answer the same, and leave what it is shown alone.

    ``asked`` counts its decisions. Trajectories must start in time and be the strategy's own.
    """

    def __init__(self, strategy: type[Strategy]) -> None:
        self.name, self.cooperative = strategy.name, strategy.cooperative
        self.period_s = period_of(strategy())
        self.metered = is_metered(strategy())
        self.entry_policy = entry_policy_of(strategy())
        self.asked = 0
        self._strategy = strategy

    def decide(self, view: View, memory: Memory) -> Decision:
        """Returns the decision; raises AssertionError where the contract is broken."""
        self.asked += 1
        reports = view.reports
        stated = (reports.time_s, reports.station_m, reports.speed_mps, reports.std_m)
        shown: list[Any] = [*stated, *view.fleet, *view.acknowledged]
        copies = [array.copy() for array in shown]
        decision = self._strategy().decide(view, memory)
        again = self._strategy().decide(view, memory)
        for array, copy in zip(shown, copies, strict=True):
            np.testing.assert_array_equal(array, copy, f"{self.name} writes into its view")
        if repr(decision) != repr(again):
            raise AssertionError(f"{self.name} answers the same question differently")
        for command in decision.commands:
            if isinstance(command, FollowTrajectory):
                self._check(command, view)
        return decision

    def _check(self, command: FollowTrajectory, view: View) -> None:
        earliest_s = view.time_s + view.rules.control.actuation_delay_s
        if command.pieces[0, 0] < earliest_s - 1e-9:
            raise AssertionError(f"{self.name} commands what should have begun already")
        if command.pieces[0, 0] > earliest_s + 1e-9:
            raise AssertionError(f"{self.name} leaves out what is driven before its first piece")
        if np.shares_memory(command.pieces, view.fleet.pieces):
            raise AssertionError(f"{self.name} commands with the view's own arrays")


def check_strategy(strategy: type[Strategy], seeds: Iterable[int] = (1, 2, 3)) -> None:
    """Runs a strategy over flows low and high and checks what every strategy promises.

    It answers every view, the same each time, changes nothing that it is shown, commands only who
    is there, nothing that is not finite, and lets everyone through. Raises AssertionError or
    CorampError, naming the strategy, where it does not.
    """
    for mainline_veh_h, ramp_veh_h in FLOWS_VEH_H:
        flows = {"mainline.flow_veh_h": mainline_veh_h, "ramp.flow_veh_h": ramp_veh_h}
        scenario = load_scenario("paper", {**flows, "simulation.horizon_s": 60.0})
        for seed in seeds:
            _check(Twice(strategy), scenario, seed)


def _check(watched: Twice, scenario: Scenario, seed: int) -> None:
    coordinator = Coordinator(
        Guarded(watched),
        scenario.rules(),
        RequestFeed(arrivals_of(scenario, seed)),
        scenario.fastest_mainline_entry_mps,
    )
    coordinator.expect_arrivals()
    coordinator.run(round(LATEST_EXIT_S / scenario.control.step_s))
    if watched.cooperative and not watched.asked:
        raise AssertionError(f"{watched.name} was never asked")
    if not watched.cooperative:
        return
    ledger = coordinator.ledger
    undecided = [row for row in ledger.fleet.live if is_waiting(ledger.merge_time_s(row))]
    if undecided:
        raise AssertionError(f"{watched.name} leaves {len(undecided)} ramp vehicles waiting")
    if outside := len(coordinator.waiting()):
        raise AssertionError(f"{watched.name} lets {outside} vehicles wait outside for ever")
    if left := sum(ledger.exit_time_s(row) > LATEST_EXIT_S for row in range(len(ledger))):
        raise AssertionError(f"{watched.name} keeps {left} vehicles on the road for ever")
