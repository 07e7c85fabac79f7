"""Whether vehicles were where they said they were: their reports against the order in force."""

import math

import numpy as np

from coramp._kernel import BoolArray, FloatArray, IntArray, kernel
from coramp.audit.orders import Motion, Orders, passes_s, place_in, under_way

NEAR_THE_END_M = 0.3
"""Who is nearer to the zone's end than this may have left, or not: a report is not missed."""
BEFORE_EXIT_M = 0.2
"""SUMO is not asked for a vehicle that is nearer: it may have taken it off the road."""
ON_GRID = 1e-6


@kernel
def off_the_order(
    motion: Motion,
    vehicle: IntArray,
    time_s: FloatArray,
    station_m: FloatArray,
    speed_mps: FloatArray,
) -> FloatArray:
    """Returns how far (m) and how much faster (m/s) each report is than ordered, shape (n, 2).

    nan for who has not entered by then.
    """
    off = np.full((len(vehicle), 2), math.nan)
    for k in range(len(vehicle)):
        begin, end = motion.first[vehicle[k]], motion.first[vehicle[k] + 1]
        if end == begin or time_s[k] < motion.rows[begin, 0]:
            continue
        piece = under_way(motion.rows, begin, end, time_s[k])
        due_m, due_mps = place_in(motion.rows, piece, time_s[k])
        off[k, 0], off[k, 1] = station_m[k] - due_m, speed_mps[k] - due_mps
    return off


@kernel
def due_reports(
    motion: Motion, zone_end_m: float, step_s: float, period: int, end_step: int
) -> IntArray:
    """Returns who must report when, shape (n, 2): vehicle and step, each period after its entry."""
    vehicles = len(motion.first) - 1
    begins, ends = np.zeros(vehicles, np.int64), np.zeros(vehicles, np.int64)
    for v in range(vehicles):
        own = motion.rows[motion.first[v] : motion.first[v + 1]]
        if len(own) == 0:
            continue
        begins[v] = round(own[0, 0] / step_s) // period + 1
        last_s = min(passes_s(own, zone_end_m - NEAR_THE_END_M), end_step * step_s)
        ends[v] = max(begins[v], math.floor(last_s / step_s / period + 1e-9) + 1)
    found = np.empty((np.sum(ends - begins), 2), np.int64)
    n = 0
    for v in range(vehicles):
        for k in range(begins[v], ends[v]):
            found[n, 0], found[n, 1] = v, k * period
            n += 1
    return found


def steps_from(time_s: FloatArray, step_s: float) -> FloatArray:
    """Returns the first step of the control clock at or after each time."""
    return np.asarray(np.ceil(time_s / step_s - ON_GRID))


def expected_in_sumo(
    orders: Orders, zone_end_m: float, step_s: float, end_step: int
) -> tuple[IntArray, IntArray]:
    """Returns who reports that an order begins, and who is compared with its plan, and when.

    Both of shape (n, 2): vehicle and step. The comparisons are at the step in which a vehicle
    changes lanes, and at the last one before it is 0.2 m from the end of the zone, as long as the
    order for that is in force. An order that begins later than that is not reported.
    """
    starts = np.rint(orders.pieces[orders.first[:-1], 0] / step_s)
    until = np.full(len(starts), math.inf)
    by_vehicle = np.argsort(orders.vehicle, kind="stable")
    same = orders.vehicle[by_vehicle[1:]] == orders.vehicle[by_vehicle[:-1]]
    until[by_vehicle[:-1][same]] = starts[by_vehicle[1:][same]]
    merges = steps_from(orders.merge_s, step_s)
    exits_s = np.array(
        [
            passes_s(orders.pieces[begin:end], zone_end_m - BEFORE_EXIT_M)
            for begin, end in zip(orders.first[:-1], orders.first[1:], strict=True)
        ]
    )
    lasts = steps_from(exits_s, step_s) - 1.0
    merged = _chosen(orders, merges, (merges - 1.0 >= starts) & (merges < until), end_step)
    left = _chosen(orders, lasts, (lasts >= starts) & (lasts < until), end_step)
    begun = _chosen(orders, starts, (lasts >= starts) & (starts < until), end_step)
    return begun, np.unique(np.concatenate([merged, left]), axis=0)


def _chosen(orders: Orders, steps: FloatArray, chosen: BoolArray, end_step: int) -> IntArray:
    chosen = chosen & (np.abs(steps) <= end_step)
    return np.column_stack([orders.vehicle[chosen], steps[chosen].astype(np.int64)])
