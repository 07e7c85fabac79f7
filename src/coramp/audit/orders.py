"""What vehicles were told to drive, and what they drive by that: the last order in force."""

import math
from typing import NamedTuple

import numpy as np

from coramp._kernel import BoolArray, FloatArray, IntArray, kernel

SLIVER_S = 1e-9
"""An order that takes over within this time of a knot leaves no piece of that length behind."""


class Askers(NamedTuple):
    """Who asked to enter, one entry a vehicle, in the order of their requests."""

    on_ramp: BoolArray
    time_s: FloatArray
    speed_mps: FloatArray
    length_m: FloatArray
    traits: FloatArray
    lane: IntArray


class Orders(NamedTuple):
    """All trajectories that were commanded, one entry each, in their order.

    Order k is ``pieces[first[k] : first[k + 1]]``. ``merge_s`` is as
    ``checker.merging`` reads it. ``change_s`` is when it begins to change to the next lane of the
    mainline, infinity where it tells of no change.
    """

    vehicle: IntArray
    time_s: FloatArray
    enters: BoolArray
    merge_s: FloatArray
    change_s: FloatArray
    first: IntArray
    pieces: FloatArray


class Motion(NamedTuple):
    """What vehicles drive: vehicle i's pieces are ``rows[first[i] : first[i + 1]]``, as orders'."""

    first: IntArray
    rows: FloatArray


class Passages(NamedTuple):
    """When each vehicle entered, came onto the mainline and left (s); nan for never.

    ``change_s`` is when it began to change to the next lane of the mainline, infinity for never.
    """

    entry_s: FloatArray
    merge_s: FloatArray
    exit_s: FloatArray
    change_s: FloatArray


def motion_of(orders: Orders, vehicles: int) -> Motion:
    """Returns what vehicles drive: each order until the next one of its vehicle takes over."""
    order = np.argsort(orders.vehicle, kind="stable")
    first, rows = _in_force(
        orders.vehicle[order],
        orders.first[:-1][order],
        orders.first[1:][order],
        orders.pieces,
        vehicles,
    )
    return Motion(first, rows)


@kernel
def _in_force(
    vehicle: IntArray, begin: IntArray, end: IntArray, pieces: FloatArray, vehicles: int
) -> tuple[IntArray, FloatArray]:
    first = np.zeros(vehicles + 1, np.int64)
    rows = np.empty((len(pieces), 4))
    n = 0
    for k in range(len(vehicle)):
        until_s = math.inf
        if k + 1 < len(vehicle) and vehicle[k + 1] == vehicle[k]:
            until_s = pieces[begin[k + 1], 0]
        for i in range(begin[k], end[k]):
            stop_s = until_s
            if i + 1 < end[k]:
                stop_s = min(until_s, pieces[i + 1, 0])
            if stop_s - pieces[i, 0] > SLIVER_S:
                rows[n] = pieces[i]
                n += 1
        first[vehicle[k] + 1] = n
    for v in range(vehicles):
        first[v + 1] = max(first[v], first[v + 1])
    return first, rows[:n].copy()


def passages_of(
    orders: Orders, motion: Motion, vehicles: int, zone_end_m: float, end_s: float
) -> Passages:
    """Returns who passed when by the orders, up to the end of the run."""
    entry_s, merge_s = np.full(vehicles, np.nan), np.full(vehicles, np.nan)
    merge_s[orders.vehicle] = orders.merge_s  # the last order of each vehicle stands
    entry_s[orders.vehicle[orders.enters]] = orders.time_s[orders.enters]
    exit_s = exits_s(motion.first, motion.rows, zone_end_m)
    exit_s[exit_s > end_s] = np.nan
    change_s = np.full(vehicles, np.inf)
    np.minimum.at(change_s, orders.vehicle, orders.change_s)
    return Passages(entry_s, merge_s, exit_s, change_s)


@kernel
def exits_s(first: IntArray, rows: FloatArray, zone_end_m: float) -> FloatArray:
    """Returns when each vehicle's front passes the end of the zone, infinity for never."""
    found = np.full(len(first) - 1, math.inf)
    for v in range(len(found)):
        if first[v + 1] > first[v]:
            found[v] = passes_s(rows[first[v] : first[v + 1]], zone_end_m)
    return found


@kernel
def passes_s(pieces: FloatArray, station_m: float) -> float:
    """Returns when a station is passed, infinity for never; speeds are at least 0.

    The way d takes ``2 d / (v + sqrt(v^2 + 2 a d))``, a form that holds for the smallest a too.
    """
    for k in range(len(pieces)):
        t, s, v, a = pieces[k]
        way_m = station_m - s
        if way_m <= 0.0:
            return float(t)
        under = v * v + 2.0 * a * way_m
        if under < 0.0 or v + math.sqrt(under) <= 0.0:
            continue
        passed_s = t + 2.0 * way_m / (v + math.sqrt(under))
        if k + 1 == len(pieces) or passed_s <= pieces[k + 1, 0]:
            return float(passed_s)
    return math.inf


@kernel
def under_way(rows: FloatArray, begin: int, end: int, time_s: float) -> int:
    """Returns the piece of ``rows[begin:end]`` that is under way, ``begin`` before the first."""
    low, high = begin, end
    while high - low > 1:
        middle = (low + high) // 2
        if rows[middle, 0] <= time_s:
            low = middle
        else:
            high = middle
    return low


@kernel
def place_in(rows: FloatArray, piece: int, time_s: float) -> tuple[float, float]:
    """Returns station (m) and speed (m/s) by one piece."""
    after_s, a = time_s - rows[piece, 0], rows[piece, 3]
    v = rows[piece, 2]
    return rows[piece, 1] + v * after_s + a * after_s * after_s / 2.0, v + a * after_s
