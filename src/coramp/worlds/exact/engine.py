"""Runs a scenario without a simulator: what is committed is what is driven, exactly."""

import numpy as np

from coramp.coordination.coordinator import Coordinator
from coramp.demand.arrivals import arrivals_of
from coramp.records.outcome import Outcome
from coramp.scenarios.model import Scenario
from coramp.strategies.base import Decider
from coramp.worlds.outcomes import cap_step_of, cooperative_outcome, step_after_last_exit


def run_exact(scenario: Scenario, strategy: Decider, seed: int) -> Outcome:
    """Returns what happens with cooperative vehicles under a strategy.

    Arrivals, decisions and commitments are those of a run in SUMO; only the tracking error of the
    simulator is missing.
    """
    arrivals = arrivals_of(scenario, seed)
    coordinator = Coordinator(
        strategy, scenario.rules(), arrivals, scenario.fastest_mainline_entry_mps
    )
    coordinator.expect_arrivals()
    cap_step, step_s = cap_step_of(scenario), scenario.control.step_s
    coordinator.run(cap_step)
    end_step = min(cap_step, step_after_last_exit(coordinator, step_s))
    as_planned = np.zeros(len(coordinator.ledger))
    return cooperative_outcome(coordinator, arrivals, step_s, end_step, as_planned)
