"""Whether orders can be driven: each begins where its vehicle is, and keeps to the limits."""

import math
from typing import NamedTuple

import numpy as np

from coramp._kernel import FloatArray, IntArray, kernel
from coramp.audit.orders import Askers, Orders
from coramp.checker.distances import (
    ACCELERATION,
    BRAKING,
    POWER,
    TOP_SPEED,
    Bounds,
    state_at,
)
from coramp.checker.merging import comes_onto_mainline

(
    FINE,
    ENTERS_TWICE,
    BEFORE_ENTRY,
    BEFORE_REQUEST,
    STARTS_AT,
    STATION,
    SPEED,
    TIMES,
    JUMPS,
    SPEED_JUMPS,
    BACKWARDS,
    TOO_FAST,
    TOO_HARD,
    PAST,
    LANE,
    NO_END,
) = range(16)
REASONS = (
    "",
    "the vehicle has entered already",
    "the vehicle has not entered yet",
    "the vehicle enters before it asked to",
    "begins at {given:.6f} s, but can act at {due:.6f} s",
    "begins at station {given:.6f} m, but the vehicle is then at {due:.6f} m",
    "begins at {given:.6f} m/s, but the vehicle drives {due:.6f} m/s then",
    "its times do not ascend at {given:.6f} s",
    "its pieces jump to station {given:.6f} m from {due:.6f} m",
    "its pieces jump to {given:.6f} m/s from {due:.6f} m/s",
    "drives backwards, at {given:.6f} m/s",
    "drives {given:.6f} m/s; allowed are {due:.6f} m/s",
    "accelerates or brakes by {given:.6f} m/s2; allowed are {due:.6f} m/s2",
    "changes a lane change that has happened, from {due:.6f} s to {given:.6f} s",
    "merges at station {given:.6f} m; allowed is up to {due:.6f} m, after the nose",
    "ends neither in a cruise on the mainline nor in a stop before the nose",
)
ROUNDING = 1e-6
"""By so much (s, m, m/s, m/s2) orders may be off, for rounding."""


class Road(NamedTuple):
    """Where each stream enters, and how long after its time a command can act."""

    mainline_start_m: float
    ramp_start_m: float
    delay_s: float


class Faults(NamedTuple):
    """One entry an order: a place in ``REASONS``, what is given, and what would be due."""

    code: IntArray
    given: FloatArray
    due: FloatArray


@kernel
def faults_of(orders: Orders, askers: Askers, road: Road, bounds: Bounds) -> Faults:
    """Returns what is wrong with each order, ``FINE`` for nothing.

    A wrong order counts as given, so that those after it are held to it.
    """
    count = len(orders.vehicle)
    found = Faults(np.zeros(count, np.int64), np.full(count, np.nan), np.full(count, np.nan))
    last = np.full(len(askers.on_ramp), -1)
    for k in range(count):
        vehicle = orders.vehicle[k]
        code, given, due = _takes_over(orders, askers, k, last[vehicle], road)
        pieces = orders.pieces[orders.first[k] : orders.first[k + 1]]
        if code == FINE:
            code, given, due = _joins(pieces)
        if code == FINE:
            able = askers.traits[vehicle]
            code, given, due = _keeps_limits(pieces, orders.merge_s[k], able, bounds)
        if code == FINE:
            code, given, due = _ends_well(pieces, orders.merge_s[k], bounds)
        found.code[k], found.given[k], found.due[k] = code, given, due
        last[vehicle] = k
    return found


@kernel
def _takes_over(
    orders: Orders, askers: Askers, k: int, before: int, road: Road
) -> tuple[int, float, float]:
    """Holds the first piece to what was ordered before, or to the request of one that enters."""
    vehicle, now_s = orders.vehicle[k], orders.time_s[k]
    start_s, start_m, start_mps, _ = orders.pieces[orders.first[k]]
    if orders.enters[k]:
        if before >= 0:
            return ENTERS_TWICE, math.nan, math.nan
        if now_s < askers.time_s[vehicle] - ROUNDING:
            return BEFORE_REQUEST, math.nan, math.nan
        due_s, due_mps = now_s, askers.speed_mps[vehicle]
        due_m = road.ramp_start_m if askers.on_ramp[vehicle] else road.mainline_start_m
    else:
        if before < 0:
            return BEFORE_ENTRY, math.nan, math.nan
        due_s = now_s + road.delay_s
        earlier = orders.pieces[orders.first[before] : orders.first[before + 1]]
        due_m, due_mps, _ = state_at(earlier, start_s)
        merge_s, was_s = orders.merge_s[k], orders.merge_s[before]
        if merge_s != was_s and min(merge_s, was_s) < start_s - ROUNDING:
            return PAST, merge_s, was_s
    if abs(start_s - due_s) > ROUNDING:
        return STARTS_AT, start_s, due_s
    if abs(start_m - due_m) > ROUNDING:
        return STATION, start_m, due_m
    if abs(start_mps - due_mps) > ROUNDING:
        return SPEED, start_mps, due_mps
    return FINE, math.nan, math.nan


@kernel
def _joins(pieces: FloatArray) -> tuple[int, float, float]:
    for i in range(1, len(pieces)):
        if pieces[i, 0] <= pieces[i - 1, 0]:
            return TIMES, pieces[i, 0], math.nan
        due_m, due_mps, _ = state_at(pieces[i - 1 : i], pieces[i, 0])
        if abs(pieces[i, 1] - due_m) > ROUNDING:
            return JUMPS, pieces[i, 1], due_m
        if abs(pieces[i, 2] - due_mps) > ROUNDING:
            return SPEED_JUMPS, pieces[i, 2], due_mps
    return FINE, math.nan, math.nan


@kernel
def _keeps_limits(
    pieces: FloatArray, merge_s: float, able: FloatArray, bounds: Bounds
) -> tuple[int, float, float]:
    """Speeds are extreme at knots. One that begins too fast, as some enter, may slow down.

    ``able`` is what the vehicle can do. With a power P per mass it speeds up by P / v at most,
    which is least at the end of a piece.
    """
    for i in range(len(pieces)):
        t, s, v, a = pieces[i]
        before_merge = t < merge_s
        limit_mps = bounds.mainline_speed_mps * bounds.gap_speed_factor
        if before_merge and s < -ROUNDING:
            limit_mps = bounds.ramp_limit_mps
        limit_mps = max(min(limit_mps, able[TOP_SPEED]), pieces[0, 2])
        most_mps2 = bounds.comfort_mps2
        if a > 0.0 and s > -ROUNDING and before_merge and comes_onto_mainline(merge_s):
            most_mps2 = bounds.ramp_acceleration_mps2
        if a > 0.0:
            ends_mps = pieces[i + 1, 2] if i + 1 < len(pieces) else v
            most_mps2 = min(most_mps2, able[ACCELERATION])
            if ends_mps > 0.0:
                most_mps2 = min(most_mps2, able[POWER] / ends_mps)
        else:
            most_mps2 = min(most_mps2, able[BRAKING])
        if v < -ROUNDING:
            return BACKWARDS, v, 0.0
        if v > limit_mps + ROUNDING:
            return TOO_FAST, v, limit_mps
        if abs(a) > most_mps2 + ROUNDING:
            return TOO_HARD, abs(a), most_mps2
    return FINE, math.nan, math.nan


@kernel
def _ends_well(pieces: FloatArray, merge_s: float, bounds: Bounds) -> tuple[int, float, float]:
    _, s, v, a = pieces[len(pieces) - 1]
    if a != 0.0:
        return NO_END, math.nan, math.nan
    if not comes_onto_mainline(merge_s):
        if abs(v) > ROUNDING or s > bounds.stop_station_m + ROUNDING:
            return NO_END, math.nan, math.nan
        return FINE, math.nan, math.nan
    if v <= 0.0 or v > bounds.mainline_speed_mps + ROUNDING:
        return NO_END, math.nan, math.nan
    if merge_s >= pieces[0, 0]:
        merge_m, _, _ = state_at(pieces, merge_s)
        if merge_m <= 0.0 or merge_m > bounds.last_merge_station_m + ROUNDING:
            return LANE, merge_m, bounds.last_merge_station_m
    return FINE, math.nan, math.nan
