"""Runs a scenario without a simulator: what is committed is what is driven, exactly."""

from dataclasses import replace

import numpy as np

from coramp.coordination.coordinator import Coordinator
from coramp.demand.arrivals import arrivals_of
from coramp.messages.channel import Channel
from coramp.messages.feed import RequestFeed
from coramp.messages.log import Told
from coramp.records.outcome import Outcome
from coramp.scenarios.model import Scenario
from coramp.strategies.base import Decider
from coramp.worlds.outcomes import cap_step_of, cooperative_outcome, step_after_last_exit
from coramp.worlds.telling import reports_of_pieces


def run_exact(
    scenario: Scenario, strategy: Decider, seed: int, keep_messages: bool = False
) -> Outcome:
    """Returns what happens with cooperative vehicles under a strategy.

    Arrivals, decisions and commitments are those of a run in SUMO; only the tracking error of the
    simulator is missing. ``keep_messages`` keeps what was told in the outcome.
    """
    arrivals = arrivals_of(scenario, seed)
    channel = Channel() if keep_messages else None
    coordinator = Coordinator(
        strategy,
        scenario.rules(),
        RequestFeed(arrivals),
        scenario.fastest_mainline_entry_mps,
        channel,
    )
    coordinator.expect_arrivals()
    cap_step, step_s = cap_step_of(scenario), scenario.control.step_s
    coordinator.run(cap_step)
    end_step = min(cap_step, step_after_last_exit(coordinator, step_s))
    as_planned = np.zeros(len(coordinator.ledger))
    outcome = cooperative_outcome(coordinator, arrivals, step_s, end_step, as_planned)
    if channel is None:
        return outcome
    reports = reports_of_pieces(outcome, step_s, end_step)
    return replace(outcome, told=Told(arrivals, channel.commands, reports, (), end_step))
