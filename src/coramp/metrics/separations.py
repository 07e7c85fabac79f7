"""How near vehicles came: exact extremes over all pairs of neighbours in a lane, from pieces.

Neighbours change only when a vehicle enters a lane, leaves it or leaves the zone. Between two such
moments each pair of pieces gives its smallest margin, time to collision and largest deceleration
rate to avoid a collision in closed form. Vehicles that are no neighbours are further apart than
neighbours are, as long as nobody overlaps.
"""

import math
from typing import NamedTuple

import numpy as np

from coramp._kernel import BoolArray, FloatArray, IntArray, kernel
from coramp.equations.conflict_risk import severity_of_masses_m2ps4
from coramp.metrics.margins import (
    TIME,
    budget_of,
    least_margin_m,
    margin_at_lane_change_m,
    piece_under_way,
    state_in_piece,
)
from coramp.road.rules import SafetyBudget
from coramp.vehicles.traits import LENGTH, MASS

LEAVE, ENTER = 0, 1
"""Kinds of events; at one time vehicles leave before others enter."""
MARGIN, TTC, DRAC, SEVERITY, VIOLATION_COUNT, MERGE_FRONT, MERGE_REAR = range(7)
EXACT_M = 1e-8
"""What rounding may take from a distance that the checker has measured to 1e-9 m."""
FIGURE_COUNT, NOTED = 7, 4
"""How many figures there are, and how many numbers tell of one violation."""


class LaneUse(NamedTuple):
    """Stays in a lane: who uses it when. Vehicle v drives ``rows[first[v] : first[v + 1]]``.

    What it can do is ``traits[v]``.

    Stay i is that of ``vehicle[i]``, from ``from_s[i]`` (nan: never) to ``until_s[i]``; it began
    with a lane change if ``merges[i]``. A vehicle may come to a lane more than once.
    """

    vehicle: IntArray
    first: IntArray
    rows: FloatArray
    traits: FloatArray
    from_s: FloatArray
    until_s: FloatArray
    merges: BoolArray


@kernel
def lane_extremes(
    lane: LaneUse, merge_angle_rad: float, safety: SafetyBudget, room: int = 0
) -> FloatArray:
    """Returns min margin (m), min TTC (s), max DRAC (m/s2), max severity (m2/s4), violations.

    The margin is over Eq. 1. Then come the least margins (m) at lane changes: over Eq. 15, to the
    vehicle in front, and over Eq. 16, to the one behind. A violation is a pair of neighbours that
    come nearer than one of these. The first ``room`` of them follow, four numbers each:
    time (s) of the least margin, front vehicle, rear vehicle, margin (m).
    """
    extremes = np.zeros(FIGURE_COUNT + NOTED * room)
    extremes[MARGIN] = extremes[TTC] = math.inf
    extremes[MERGE_FRONT] = extremes[MERGE_REAR] = math.inf
    times_s, kinds, vehicles = lane_events(lane)
    order = np.empty(len(lane.from_s), np.int64)
    since_s = np.empty(len(lane.from_s))
    count = 0
    for e in range(len(times_s)):
        now_s, vehicle = times_s[e], vehicles[e]
        place = _place_of(lane, order, count, vehicle, kinds[e], now_s)
        if kinds[e] == LEAVE:
            if place > 0:
                _end_pair(
                    extremes, lane, order[place - 1], vehicle, since_s[vehicle], now_s, safety
                )
            if place + 1 < count:
                rear = order[place + 1]
                _end_pair(extremes, lane, vehicle, rear, since_s[rear], now_s, safety)
                since_s[rear] = now_s
            count = _remove(order, count, place)
            continue
        if place < count:
            rear = order[place]
            if place > 0:
                _end_pair(extremes, lane, order[place - 1], rear, since_s[rear], now_s, safety)
            since_s[rear] = now_s
        if lane.merges[vehicle]:
            for k in (place - 1, place):
                if 0 <= k < count:
                    _look_at_merge(
                        extremes, lane, vehicle, order[k], now_s, merge_angle_rad, safety
                    )
        count = _insert(order, count, place, vehicle)
        since_s[vehicle] = now_s
    return extremes


@kernel
def _insert(order: IntArray, count: int, place: int, vehicle: int) -> int:
    """Puts a vehicle at its place among the first ``count``; returns how many there are then."""
    for k in range(count, place, -1):
        order[k] = order[k - 1]
    order[place] = vehicle
    return count + 1


@kernel
def _remove(order: IntArray, count: int, place: int) -> int:
    """Takes who has a place out of the first ``count``; returns how many there are then."""
    for k in range(place, count - 1):
        order[k] = order[k + 1]
    return count - 1


@kernel
def lane_events(lane: LaneUse) -> tuple[FloatArray, IntArray, IntArray]:
    """Returns times (s), kinds and stays of all comings and goings in a lane, in their order."""
    n = len(lane.from_s)
    times_s, kinds = np.empty(2 * n), np.empty(2 * n, np.int64)
    vehicles = np.empty(2 * n, np.int64)
    count = 0
    for i in range(n):
        if lane.from_s[i] < lane.until_s[i]:
            times_s[count], kinds[count], vehicles[count] = lane.until_s[i], LEAVE, i
            times_s[count + 1], kinds[count + 1], vehicles[count + 1] = lane.from_s[i], ENTER, i
            count += 2
    by_kind = np.argsort(kinds[:count], kind="mergesort")
    by_time = np.argsort(times_s[:count][by_kind], kind="mergesort")
    order = by_kind[by_time]
    return times_s[:count][order], kinds[:count][order], vehicles[:count][order]


@kernel
def driven(lane: LaneUse, stay: int) -> FloatArray:
    """Returns the pieces that the vehicle of a stay drove."""
    vehicle = lane.vehicle[stay]
    return lane.rows[lane.first[vehicle] : lane.first[vehicle + 1]]


@kernel
def _length_m(lane: LaneUse, stay: int) -> float:
    return float(lane.traits[lane.vehicle[stay], LENGTH])


@kernel
def _place_of(
    lane: LaneUse, order: IntArray, count: int, vehicle: int, kind: int, now_s: float
) -> int:
    place = 0
    if kind == LEAVE:
        while order[place] != vehicle:
            place += 1
        return place
    own_m, _ = _state_at(driven(lane, vehicle), now_s)
    while place < count:
        other_m, _ = _state_at(driven(lane, order[place]), now_s)
        if other_m < own_m:
            break
        place += 1
    return place


@kernel
def _end_pair(
    extremes: FloatArray,
    lane: LaneUse,
    front: int,
    rear: int,
    start_s: float,
    end_s: float,
    safety: SafetyBudget,
) -> None:
    ahead, behind, length_m = driven(lane, front), driven(lane, rear), _length_m(lane, front)
    pair = budget_of(lane.traits[lane.vehicle[front]], lane.traits[lane.vehicle[rear]], safety)
    margin_m, least_s = least_margin_m(ahead, length_m, behind, start_s, end_s, pair)
    extremes[MARGIN] = min(extremes[MARGIN], margin_m)
    if margin_m < -EXACT_M:
        _note_violation(extremes, least_s, lane.vehicle[front], lane.vehicle[rear], margin_m)
    ttc_s, drac_mps2 = closing_extremes(ahead, length_m, behind, start_s, end_s)
    extremes[TTC] = min(extremes[TTC], ttc_s)
    extremes[DRAC] = max(extremes[DRAC], drac_mps2)


@kernel
def _note_violation(
    extremes: FloatArray, time_s: float, front: int, rear: int, margin_m: float
) -> None:
    place = FIGURE_COUNT + NOTED * int(extremes[VIOLATION_COUNT])
    if place < len(extremes):
        extremes[place], extremes[place + 1] = time_s, front
        extremes[place + 2], extremes[place + 3] = rear, margin_m
    extremes[VIOLATION_COUNT] += 1.0


@kernel
def _look_at_merge(
    extremes: FloatArray,
    lane: LaneUse,
    merging: int,
    other: int,
    now_s: float,
    merge_angle_rad: float,
    safety: SafetyBudget,
) -> None:
    own_m, own_mps = _state_at(driven(lane, merging), now_s)
    other_m, other_mps = _state_at(driven(lane, other), now_s)
    front, rear, equation = other, merging, MERGE_FRONT
    distance_m = other_m - _length_m(lane, other) - own_m
    if other_m < own_m:
        front, rear, equation = merging, other, MERGE_REAR
        distance_m = own_m - _length_m(lane, merging) - other_m
    own, theirs = lane.traits[lane.vehicle[merging]], lane.traits[lane.vehicle[other]]
    pair = budget_of(own, theirs, safety)
    margin_m = margin_at_lane_change_m(distance_m, own_mps, other_mps, merge_angle_rad, pair)
    extremes[equation] = min(extremes[equation], margin_m)
    if margin_m < -EXACT_M:
        _note_violation(extremes, now_s, lane.vehicle[front], lane.vehicle[rear], margin_m)
    along_mps = own_mps * math.cos(merge_angle_rad)
    masses = (own[MASS], theirs[MASS])
    severity, _ = severity_of_masses_m2ps4(along_mps, other_mps, distance_m, *masses)
    extremes[SEVERITY] = max(extremes[SEVERITY], severity)


@kernel
def closing_extremes(
    front: FloatArray, front_length_m: float, rear: FloatArray, start_s: float, end_s: float
) -> tuple[float, float]:
    """Returns the smallest TTC (s) and the largest DRAC (m/s2) of a pair within a span, exactly.

    TTC = gap / closing speed, DRAC = closing speed^2 / (2 gap) while the rear vehicle is faster;
    infinity and 0 if it never is.
    """
    ttc_s, drac_mps2 = math.inf, 0.0
    i, j = piece_under_way(front, start_s), piece_under_way(rear, start_s)
    now_s, found_s = start_s, np.empty(6)
    while now_s < end_s:
        next_s = min(end_s, _end_s(front, i), _end_s(rear, j))
        front_m, front_mps, front_mps2 = state_in_piece(front, i, now_s)
        rear_m, rear_mps, rear_mps2 = state_in_piece(rear, j, now_s)
        gap_m = front_m - front_length_m - rear_m
        opening_mps = front_mps - rear_mps
        opening_mps2 = front_mps2 - rear_mps2
        count = _candidates(gap_m, opening_mps, opening_mps2, next_s - now_s, found_s)
        for x in found_s[:count]:
            closing_mps = -(opening_mps + opening_mps2 * x)
            gap_then_m = gap_m + (opening_mps + 0.5 * opening_mps2 * x) * x
            if closing_mps > 0.0 and gap_then_m > 0.0:
                ttc_s = min(ttc_s, gap_then_m / closing_mps)
                drac_mps2 = max(drac_mps2, 0.5 * closing_mps * closing_mps / gap_then_m)
        now_s = next_s
        if _end_s(front, i) <= now_s:
            i += 1
        if _end_s(rear, j) <= now_s:
            j += 1
    return ttc_s, drac_mps2


@kernel
def _state_at(pieces: FloatArray, time_s: float) -> tuple[float, float]:
    station_m, speed_mps, _ = state_in_piece(pieces, piece_under_way(pieces, time_s), time_s)
    return station_m, speed_mps


@kernel
def _end_s(pieces: FloatArray, k: int) -> float:
    return float(pieces[k + 1, TIME]) if k + 1 < len(pieces) else math.inf


@kernel
def _candidates(
    gap_m: float, opening_mps: float, opening_mps2: float, duration_s: float, found_s: FloatArray
) -> int:
    """Writes when (s) TTC and DRAC can be extreme: the ends, and where their derivatives vanish.

    Returns how many there are.
    With gap g, closing speed c and c' = -opening_mps2, d(g/c) = 0 where c^2 = -g c', and
    d(c^2/g) = 0 where c^2 = -2 g c'. Both are quadratic in x.
    """
    found_s[0], found_s[1] = 0.0, duration_s
    n = 2
    if opening_mps2 > 0.0:
        for factor in (1.0, 2.0):
            # (o + a x)^2 = factor a (g + o x + a x^2 / 2)
            square = opening_mps2 * opening_mps2 * (1.0 - 0.5 * factor)
            linear = opening_mps * opening_mps2 * (2.0 - factor)
            constant = opening_mps * opening_mps - factor * opening_mps2 * gap_m
            discriminant = linear * linear - 4.0 * square * constant
            if square > 0.0 and discriminant >= 0.0:
                root = math.sqrt(discriminant)
                for x in ((-linear - root) / (2.0 * square), (-linear + root) / (2.0 * square)):
                    if 0.0 < x < duration_s:
                        found_s[n] = x
                        n += 1
    return n
