"""Who used which lane when, from an outcome."""

import math

import numpy as np

from coramp._kernel import BoolArray, FloatArray, IntArray
from coramp.coordination.driven import MAINLINE
from coramp.metrics.separations import LaneUse
from coramp.records.outcome import Outcome


def lane_uses(outcome: Outcome, traits: FloatArray) -> tuple[LaneUse, LaneUse]:
    """Returns who used the mainline, and who the ramp with its acceleration lane.

    ``traits`` has one row per vehicle.

    Cooperative vehicles change lanes once, as planned. SUMO's drivers are where they were seen:
    when the mainline stands, some of them overtake on the acceleration lane. So are cooperative
    vehicles that SUMO did not carry as planned.
    """
    passages, driven = outcome.passages, outcome.driven
    until_s = np.where(np.isnan(passages.exit_s), outcome.end_s, passages.exit_s)
    until_s = np.where(np.isnan(passages.entry_s), -math.inf, until_s)
    road = driven.first, driven.rows, traits
    lane = outcome.driven_lane
    if lane is not None:
        until_s = _last_seen_s(outcome)
    elif not outcome.cooperative:
        lane = outcome.lane
    if lane is not None:
        vehicle, on_mainline, from_s, to_s, again = _stays(outcome, lane, until_s)
        mainline, ramp = (
            LaneUse(vehicle[here], *road, from_s[here], to_s[here], again[here] & on_mainline[here])
            for here in (on_mainline, ~on_mainline)
        )
        return mainline, ramp
    everyone, never = np.arange(len(passages)), np.zeros(len(passages), np.bool_)
    on_mainline_s = np.where(passages.on_ramp, passages.merge_s, passages.entry_s)
    off_ramp_s = np.where(np.isnan(passages.merge_s), until_s, passages.merge_s)
    on_ramp_s = np.where(passages.on_ramp, passages.entry_s, np.nan)
    return (
        LaneUse(everyone, *road, on_mainline_s, until_s, passages.on_ramp),
        LaneUse(everyone, *road, on_ramp_s, off_ramp_s, never),
    )


def _last_seen_s(outcome: Outcome) -> FloatArray:
    """When each vehicle was seen last (s), minus infinity for one that never was."""
    first, times_s = outcome.driven.first, outcome.driven.rows[:, 0]
    last_s = np.full(len(first) - 1, -math.inf)
    seen = first[1:] > first[:-1]
    last_s[seen] = times_s[first[1:][seen] - 1]
    return last_s


def _stays(
    outcome: Outcome, lane: IntArray, until_s: FloatArray
) -> tuple[IntArray, BoolArray, FloatArray, FloatArray, BoolArray]:
    """Stretches in one lane: vehicle, whether on the mainline, from when to when (s), not first."""
    first, times_s = outcome.driven.first, outcome.driven.rows[:, 0]
    vehicle_of = np.repeat(np.arange(len(first) - 1), np.diff(first))
    on_mainline = lane == MAINLINE
    same_vehicle = vehicle_of[1:] == vehicle_of[:-1]
    begins = np.append(True, ~same_vehicle | (on_mainline[1:] != on_mainline[:-1]))
    starts = np.flatnonzero(begins[: len(times_s)])
    vehicle = vehicle_of[starts]
    goes_on = np.append(vehicle[1:] == vehicle[:-1], False)[: len(starts)]
    to_s = np.where(
        goes_on, np.append(times_s[starts[1:]], np.nan)[: len(starts)], until_s[vehicle]
    )
    again = starts != first[vehicle]
    return vehicle, on_mainline[starts], times_s[starts], to_s, again
