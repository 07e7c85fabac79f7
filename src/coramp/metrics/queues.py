"""When a merge breaks down, and what it carried before and carries after, as roads are measured.

A loop on the mainline upstream of the merge gives speeds, one at the zone's end gives flows, both
in intervals of 5 min. As in the Highway Capacity Manual (6th edition, chapter 26): breakdown is a
speed of at least 25 % below free flow for at least 15 min; the flow before it is that of the last
15 min; the discharge is the mean flow while the queue lasts.
"""

import math

import numpy as np

from coramp._kernel import BoolArray, FloatArray, IntArray
from coramp.kinematics.trajectory import ACCEL, SPEED, STATION, TIME
from coramp.records.outcome import Outcome, Pieces
from coramp.scenarios.model import Scenario

INTERVAL_S = 300.0
SUSTAINED = 3
"""Intervals that a queue must last to be a breakdown, and over which the flow before it counts."""
QUEUE_SPEED = 0.75
"""Share of v0 below which an interval is one of queueing."""
LOOP_M = -200.0
"""Station of the loop upstream; half-way to the zone's start where that is nearer."""


def queue_figures(outcome: Outcome, scenario: Scenario) -> dict[str, float | None]:
    """Returns when the merge broke down (s), and the flows before and after (veh/h).

    None for all where it did not, and for the flow before where it had no 15 min yet. Only
    intervals within the horizon count.
    """
    station_m = loop_station_m(scenario)
    intervals = int(scenario.simulation.horizon_s / INTERVAL_S + 1e-9)
    queued = _queued(outcome, station_m, QUEUE_SPEED * scenario.mainline.speed_mps, intervals)
    start = _breakdown(queued)
    if start is None:
        return dict.fromkeys(("breakdown_time_s", *FLOWS))
    exits = _counts(outcome.passages.exit_s, intervals)
    before = exits[start - SUSTAINED : start] if start >= SUSTAINED else exits[:0]
    after = exits[start:][queued[start:]]
    flows = (_flow_veh_h(before), _flow_veh_h(after))
    return {"breakdown_time_s": start * INTERVAL_S, **dict(zip(FLOWS, flows, strict=True))}


def loop_station_m(scenario: Scenario) -> float:
    """Returns the station (m) of the loop upstream."""
    return max(LOOP_M, 0.5 * scenario.mainline.start_m)


FLOWS = ("prebreakdown_flow_veh_h", "discharge_flow_veh_h")


def _flow_veh_h(counts: FloatArray) -> float | None:
    return float(counts.mean() * 3600.0 / INTERVAL_S) if len(counts) else None


def _counts(times_s: FloatArray, intervals: int) -> FloatArray:
    """How many times lie in each interval."""
    edges_s = np.arange(intervals + 1) * INTERVAL_S
    known_s = np.sort(times_s[~np.isnan(times_s)])
    return np.diff(np.searchsorted(known_s, edges_s)).astype(np.float64)


def _queued(outcome: Outcome, station_m: float, least_mps: float, intervals: int) -> BoolArray:
    """Whether the mainline's vehicles passed a station slower, interval by interval.

    Where nobody passes it is as it was: a queue may stand.
    """
    passages, driven = outcome.passages, outcome.driven
    time_s, speed_mps = crossings(driven, np.flatnonzero(~passages.on_ramp), station_m)
    inside = time_s < intervals * INTERVAL_S
    place = (time_s[inside] / INTERVAL_S).astype(np.int64)
    sums = np.bincount(place, speed_mps[inside], minlength=intervals).astype(np.float64)
    counts = np.bincount(place, minlength=intervals).astype(np.int64)
    return queued_intervals(sums, counts, least_mps)


def queued_intervals(sums_mps: FloatArray, counts: IntArray, least_mps: float) -> BoolArray:
    """Returns whether vehicles passed slower than ``least_mps`` on average, interval by interval.

    ``sums_mps`` are the sums of their speeds; where nobody passes it is as it was.
    """
    queued = np.zeros(len(counts), np.bool_)
    for k in range(len(counts)):
        queued[k] = sums_mps[k] < least_mps * counts[k] if counts[k] else k > 0 and queued[k - 1]
    return queued


def sustained(queued: BoolArray) -> BoolArray:
    """Returns which intervals belong to a queue that lasts for at least ``SUSTAINED`` of them."""
    lasts = np.zeros(len(queued), np.bool_)
    for k in range(len(queued) - SUSTAINED + 1):
        if queued[k : k + SUSTAINED].all():
            lasts[k : k + SUSTAINED] = True
    return lasts


def _breakdown(queued: BoolArray) -> int | None:
    """The first interval of a queue that lasts."""
    for k in range(len(queued) - SUSTAINED + 1):
        if queued[k : k + SUSTAINED].all():
            return k
    return None


def crossings(
    driven: Pieces, vehicles: IntArray, station_m: float
) -> tuple[FloatArray, FloatArray]:
    """Returns when (s) and how fast (m/s) those of some vehicles pass a station that reach it."""
    rows, per_vehicle = driven.rows, np.diff(driven.first)
    last = np.zeros(len(rows), np.bool_)
    last[driven.first[1:][per_vehicle > 0] - 1] = True
    wanted = np.zeros(len(per_vehicle), np.bool_)
    wanted[vehicles] = True
    next_m = np.where(last, math.inf, np.append(rows[1:, STATION], math.inf)[: len(rows)])
    here = (rows[:, STATION] <= station_m) & (station_m < next_m)
    here &= np.repeat(wanted, per_vehicle)
    left_m, speed_mps = station_m - rows[here, STATION], rows[here, SPEED]
    square = speed_mps**2 + 2.0 * rows[here, ACCEL] * left_m
    passing_mps = np.sqrt(np.maximum(0.0, square))
    passes = (speed_mps + passing_mps > 0.0) & ((square >= 0.0) | ~last[here])
    with np.errstate(over="ignore"):  # who creeps arrives never
        taken_s = 2.0 * left_m[passes] / (speed_mps + passing_mps)[passes]
    return rows[here, TIME][passes] + taken_s, passing_mps[passes]
