"""What the engines share: when a run ends, and its outcome from the ledger."""

import math
from collections.abc import Sequence

import numpy as np

from coramp._kernel import FloatArray
from coramp.coordination.coordinator import Coordinator
from coramp.coordination.driven import driven_pieces
from coramp.coordination.plant import Arrival
from coramp.messages.events import columns_of
from coramp.motion.lane_change import lane_change_s
from coramp.records.lanes import planned_history, with_lanes_further_in
from coramp.records.outcome import Outcome, Passages, Pieces, until_s
from coramp.scenarios.model import Scenario

NEVER = 1 << 60


def cap_step_of(scenario: Scenario) -> int:
    """Returns the step at which a run is cut off."""
    simulation = scenario.simulation
    return round((simulation.horizon_s + simulation.drain_s) / scenario.control.step_s)


def step_after_last_exit(coordinator: Coordinator, step_s: float) -> int:
    """Returns a step at which everyone has left, ``NEVER`` where somebody stays."""
    ledger = coordinator.ledger
    if coordinator.waiting():
        return NEVER
    return step_after(float(np.max(ledger.book.exit_s[: len(ledger)], initial=0.0)), step_s)


def step_after(last_s: float, step_s: float) -> int:
    """Returns a step at which all is over whose last exit is at ``last_s``, maybe infinity."""
    return NEVER if math.isinf(last_s) else math.ceil(last_s / step_s) + 2


def cooperative_outcome(
    coordinator: Coordinator,
    arrivals: Sequence[Arrival],
    step_s: float,
    end_step: int,
    plan_error_m: FloatArray,
    driven: Pieces | None = None,
    collisions: int = 0,
) -> Outcome:
    """Returns the outcome of a cooperative run.

    ``plan_error_m`` has one entry a row. ``driven`` is what a simulator made of the plans, in which
    a lane change waits for the next step; without it they are driven as they are.
    """
    ledger, end_s = coordinator.ledger, end_step * step_s
    vehicle_of_row, entry_step = coordinator.entered()
    entry_s, merge_s, exit_s, error_m = (np.full(len(arrivals), np.nan) for _ in range(4))
    change_s = np.full(len(arrivals), np.inf)
    entry_s[vehicle_of_row] = entry_step * step_s
    merge_s[vehicle_of_row] = ledger.book.merge_time_s[: len(ledger)]
    if driven is not None:
        merge_s = lane_change_s(merge_s, step_s)
    exit_s[vehicle_of_row] = ledger.book.exit_s[: len(ledger)]
    error_m[vehicle_of_row] = plan_error_m
    change_s[vehicle_of_row] = ledger.book.change_s[: len(ledger)]
    merge_s[merge_s > end_s] = np.nan
    exit_s[exit_s > end_s] = np.nan
    first, lane, rows = driven_pieces(ledger, vehicle_of_row, len(arrivals), end_s)
    planned = Pieces(first, rows)
    passages = passages_of(arrivals, step_s, entry_s, merge_s, exit_s, error_m)
    left_s = until_s(exit_s, end_s)
    return Outcome(
        cooperative=True,
        passages=passages,
        pieces=planned,
        lane=lane,
        driven=driven or planned,
        lanes=with_lanes_further_in(
            planned_history(passages.on_ramp, entry_s, merge_s, left_s), passages.lane, change_s
        ),
        end_s=end_s,
        collisions=collisions,
        decisions=tuple(coordinator.decisions),
        refusals=tuple(coordinator.refusals),
        interventions=coordinator.interventions,
        vehicle_of_row=vehicle_of_row,
    )


def passages_of(
    arrivals: Sequence[Arrival],
    step_s: float,
    entry_s: FloatArray,
    merge_s: FloatArray,
    exit_s: FloatArray,
    plan_error_m: FloatArray,
) -> Passages:
    """Returns who passed when; arrays have one entry an arrival."""
    columns = columns_of(arrivals)
    return Passages(
        columns.vehicle_id,
        np.array(columns.on_ramp, np.bool_),
        np.array(columns.length_m, np.float64),
        np.array(columns.step, np.float64) * step_s,
        np.array(columns.speed_mps, np.float64),
        entry_s,
        merge_s,
        exit_s,
        plan_error_m,
        columns.vehicle_type,
        columns.traits,
        lane=np.array(columns.lane, np.int64),
    )
