"""How near vehicles in one lane came: extremes over all neighbours, from pieces, in closed form.

Neighbours change only where a vehicle comes into a lane or leaves it. Between two knots a distance
is a parabola in time; so is the margin over Eq. 1, on each side of the moment of equal speeds.
"""

import math
from typing import NamedTuple

import numpy as np

from coramp._kernel import BoolArray, FloatArray, IntArray, kernel
from coramp.audit.orders import Motion, place_in, under_way
from coramp.checker.distances import (
    LENGTH,
    MASS,
    POSITIONING,
    Bounds,
    Needs,
    following_distance_m,
    lane_change_distance_m,
    needs_of,
)

MARGIN, MERGE_FRONT, MERGE_REAR, TTC, DRAC, SEVERITY, GAP, VIOLATION_COUNT = range(8)
"""Places among the extremes of a lane: margins (m) over Eq. 1, 15 and 16, TTC (s), DRAC (m/s2),
severity (m2/s4), gap (m), and how many violations."""
ROUNDING_M = 1e-8
"""By so much a margin may be below 0, for rounding."""
COLLISION_S = 0.2
"""Eq. 8: a collision lasts 0.2 s."""


class Stays(NamedTuple):
    """Who was in a lane from when to when (s); ``joins`` where it came by a lane change."""

    vehicle: IntArray
    from_s: FloatArray
    until_s: FloatArray
    joins: BoolArray


class Pairs(NamedTuple):
    """Extremes of a lane, and its violations: time (s), front and rear vehicle, margin (m)."""

    extremes: FloatArray
    violations: FloatArray


def extremes_in_lane(motion: Motion, traits: FloatArray, stays: Stays, bounds: Bounds) -> Pairs:
    """Returns what is extreme among neighbours in a lane, overlaps included.

    ``traits`` has one row per vehicle (``checker.distances``). Severity is that of Eq. 5, 7 and 9
    as printed, at lane changes, with the speed along the lane, for the lighter of two vehicles.
    """
    used = np.flatnonzero(stays.from_s < stays.until_s)
    stays = Stays._make(column[used] for column in stays)
    count = len(used)
    times_s = np.concatenate([stays.until_s, stays.from_s])
    comes = np.repeat([0, 1], count)  # at one time, who leaves is gone before others come
    stay = np.tile(np.arange(count), 2)
    order = np.lexsort((stay, comes, times_s))
    extremes = np.zeros(8)
    extremes[[MARGIN, MERGE_FRONT, MERGE_REAR, TTC, GAP]] = math.inf
    noted = np.empty((4 * count + 4, 4))
    _pass_through(
        motion, traits, stays, times_s[order], comes[order], stay[order], bounds, extremes, noted
    )
    return Pairs(extremes, noted[: int(extremes[VIOLATION_COUNT])])


class _Lane(NamedTuple):
    """A lane as a chain of stays: who is ahead of each, who behind, -1 at its ends, and the last.

    ``since_s`` is since when a stay has had the one ahead of it.
    """

    ahead: IntArray
    behind: IntArray
    since_s: FloatArray
    last: IntArray


@kernel
def _pass_through(
    motion: Motion,
    traits: FloatArray,
    stays: Stays,
    times_s: FloatArray,
    comes: IntArray,
    who: IntArray,
    bounds: Bounds,
    extremes: FloatArray,
    noted: FloatArray,
) -> None:
    """Goes through comings and goings, and looks at each pair until it is none any more."""
    count = len(stays.vehicle)
    lane = _Lane(np.full(count, -1), np.full(count, -1), np.zeros(count), np.full(1, -1))
    for e in range(len(times_s)):
        now_s, stay = times_s[e], who[e]
        if comes[e] == 1:
            front, rear = _place_for(motion, stays, lane, stay, now_s)
        else:
            front, rear = lane.ahead[stay], lane.behind[stay]
        pairs = ((front, rear), (-1, -1))
        if comes[e] == 0:
            pairs = ((front, stay), (stay, rear))
        for before, after in pairs:
            if before >= 0 and after >= 0:
                since_s = lane.since_s[after]
                _look(motion, traits, stays, before, after, since_s, now_s, bounds, extremes, noted)
        if comes[e] == 0:
            _link(lane, front, rear, now_s)
            continue
        _link(lane, front, stay, now_s)
        _link(lane, stay, rear, now_s)
        if stays.joins[stay]:
            for other in (front, rear):
                if other >= 0:
                    _look_at_merge(
                        motion, traits, stays, stay, other, now_s, bounds, extremes, noted
                    )


@kernel
def _place_for(
    motion: Motion, stays: Stays, lane: _Lane, stay: int, now_s: float
) -> tuple[int, int]:
    """Returns between which two of the lane a stay begins, -1 for none."""
    front, rear = lane.last[0], -1
    own_m, _ = _state(motion, stays.vehicle[stay], now_s)
    while front >= 0 and _state(motion, stays.vehicle[front], now_s)[0] < own_m:
        front, rear = lane.ahead[front], front
    return front, rear


@kernel
def _link(lane: _Lane, front: int, rear: int, now_s: float) -> None:
    """Makes two neighbours from now on; -1 stands for nobody."""
    if front >= 0:
        lane.behind[front] = rear
    if rear >= 0:
        lane.ahead[rear], lane.since_s[rear] = front, now_s
    else:
        lane.last[0] = front


@kernel
def _state(motion: Motion, vehicle: int, time_s: float) -> tuple[float, float]:
    piece = under_way(motion.rows, motion.first[vehicle], motion.first[vehicle + 1], time_s)
    return place_in(motion.rows, piece, time_s)


@kernel
def _note(
    extremes: FloatArray, noted: FloatArray, time_s: float, front: int, rear: int, margin_m: float
) -> None:
    k = int(extremes[VIOLATION_COUNT])
    if k < len(noted):
        noted[k, 0], noted[k, 1], noted[k, 2], noted[k, 3] = time_s, front, rear, margin_m
    extremes[VIOLATION_COUNT] += 1.0


@kernel
def _look_at_merge(
    motion: Motion,
    traits: FloatArray,
    stays: Stays,
    stay: int,
    other: int,
    now_s: float,
    bounds: Bounds,
    extremes: FloatArray,
    noted: FloatArray,
) -> None:
    own, theirs = stays.vehicle[stay], stays.vehicle[other]
    own_m, own_mps = _state(motion, own, now_s)
    other_m, other_mps = _state(motion, theirs, now_s)
    front, rear, gap_m, side = theirs, own, other_m - traits[theirs, LENGTH] - own_m, MERGE_FRONT
    if other_m < own_m:
        front, rear, gap_m, side = own, theirs, own_m - traits[own, LENGTH] - other_m, MERGE_REAR
    errors_m = traits[own, POSITIONING] + traits[theirs, POSITIONING]
    margin_m = gap_m - lane_change_distance_m(own_mps, other_mps, errors_m, bounds)
    extremes[side] = min(extremes[side], margin_m)
    if margin_m < -ROUNDING_M:
        _note(extremes, noted, now_s, front, rear, margin_m)
    along_mps = own_mps * bounds.cos_merge_angle
    faster_mps, slower_mps = max(along_mps, other_mps), min(along_mps, other_mps)
    if faster_mps > slower_mps:
        lighter_kg = min(traits[own, MASS], traits[theirs, MASS])
        ratio = lighter_kg / max(traits[own, MASS], traits[theirs, MASS])
        collision_mps2 = (faster_mps - slower_mps) / ((1.0 + ratio) * COLLISION_S)
        urgent_mps2 = math.inf
        if gap_m > 0.0:
            urgent_mps2 = (faster_mps**2 - slower_mps**2) / (2.0 * gap_m)
        extremes[SEVERITY] = max(extremes[SEVERITY], collision_mps2 * urgent_mps2)


@kernel
def _look(
    motion: Motion,
    traits: FloatArray,
    stays: Stays,
    front_stay: int,
    rear_stay: int,
    start_s: float,
    end_s: float,
    bounds: Bounds,
    extremes: FloatArray,
    noted: FloatArray,
) -> None:
    """Looks at a pair from knot to knot, as long as both are neighbours."""
    front, rear, rows = stays.vehicle[front_stay], stays.vehicle[rear_stay], motion.rows
    front_end, rear_end = motion.first[front + 1], motion.first[rear + 1]
    i = under_way(rows, motion.first[front], front_end, start_s)
    j = under_way(rows, motion.first[rear], rear_end, start_s)
    needs = needs_of(traits[front], traits[rear])
    least_m, least_s, now_s = math.inf, start_s, start_s
    while True:
        until_s = end_s
        if i + 1 < front_end:
            until_s = min(until_s, rows[i + 1, 0])
        if j + 1 < rear_end:
            until_s = min(until_s, rows[j + 1, 0])
        margin_m, when_s = _between_knots(rows, i, j, now_s, until_s, needs, bounds, extremes)
        if margin_m < least_m:
            least_m, least_s = margin_m, when_s
        if until_s >= end_s:
            break
        now_s = until_s
        while i + 1 < front_end and rows[i + 1, 0] <= now_s:
            i += 1
        while j + 1 < rear_end and rows[j + 1, 0] <= now_s:
            j += 1
    extremes[MARGIN] = min(extremes[MARGIN], least_m)
    if least_m < -ROUNDING_M:
        _note(extremes, noted, least_s, front, rear, least_m)


@kernel
def _between_knots(
    rows: FloatArray,
    i: int,
    j: int,
    start_s: float,
    end_s: float,
    needs: Needs,
    bounds: Bounds,
    extremes: FloatArray,
) -> tuple[float, float]:
    """Returns the least margin (m) while neither changes its acceleration, and when it is."""
    opening_mps = place_in(rows, i, start_s)[1] - place_in(rows, j, start_s)[1]
    opening_mps2 = rows[i, 3] - rows[j, 3]
    middle_s = end_s
    if opening_mps * opening_mps2 < 0.0:
        middle_s = min(end_s, start_s - opening_mps / opening_mps2)
    least_m, least_s = _least_of_parabola(rows, i, j, start_s, middle_s, needs, bounds)
    if middle_s < end_s:
        later_m, later_s = _least_of_parabola(rows, i, j, middle_s, end_s, needs, bounds)
        if later_m < least_m:
            least_m, least_s = later_m, later_s
    if end_s > start_s:
        _closing(rows, i, j, start_s, end_s, needs.front_length_m, extremes)
    return least_m, least_s


@kernel
def _margin_m(
    rows: FloatArray, i: int, j: int, time_s: float, needs: Needs, bounds: Bounds
) -> float:
    front_m, front_mps = place_in(rows, i, time_s)
    rear_m, rear_mps = place_in(rows, j, time_s)
    needed_m = following_distance_m(front_mps, rear_mps, needs, bounds)
    return front_m - needs.front_length_m - rear_m - needed_m


@kernel
def _least_of_parabola(
    rows: FloatArray,
    i: int,
    j: int,
    start_s: float,
    end_s: float,
    needs: Needs,
    bounds: Bounds,
) -> tuple[float, float]:
    half_s = 0.5 * (end_s - start_s)
    at_start = _margin_m(rows, i, j, start_s, needs, bounds)
    at_middle = _margin_m(rows, i, j, start_s + half_s, needs, bounds)
    at_end = _margin_m(rows, i, j, end_s, needs, bounds)
    least_m, least_s = at_start, start_s
    if at_end < least_m:
        least_m, least_s = at_end, end_s
    bend = at_start - 2.0 * at_middle + at_end
    if bend > 0.0:
        vertex = (at_start - at_end) / (2.0 * bend)  # -1 at the start, 1 at the end
        if abs(vertex) < 1.0:
            at_vertex = at_middle - 0.5 * bend * vertex * vertex
            if at_vertex < least_m:
                least_m, least_s = at_vertex, start_s + half_s * (1.0 + vertex)
    return least_m, least_s


@kernel
def _closing(
    rows: FloatArray,
    i: int,
    j: int,
    start_s: float,
    end_s: float,
    length_m: float,
    extremes: FloatArray,
) -> None:
    """Takes in TTC = g / c and DRAC = c^2 / (2 g), and the gap g itself.

    With c the closing speed and b the rate at which it falls, ``K = c^2 - 2 b g`` is constant:
    ``g' = -c`` and ``c' = -b``. So DRAC is monotone, and TTC = (c - K / c) / (2 b) is least, where
    b > 0 and K < 0, at ``c = sqrt(-K)``, and is then ``sqrt(-K) / b``.
    """
    opening_mps2 = rows[i, 3] - rows[j, 3]
    closing = np.empty(2)
    for k in range(2):
        time_s = start_s if k == 0 else end_s
        front_m, front_mps = place_in(rows, i, time_s)
        rear_m, rear_mps = place_in(rows, j, time_s)
        gap_m, c = front_m - length_m - rear_m, rear_mps - front_mps
        closing[k] = c
        extremes[GAP] = min(extremes[GAP], gap_m)
        if c > 0.0 and gap_m > 0.0:
            extremes[TTC] = min(extremes[TTC], gap_m / c)
            extremes[DRAC] = max(extremes[DRAC], c * c / (2.0 * gap_m))
        constant = c * c - 2.0 * opening_mps2 * gap_m
    if opening_mps2 > 0.0 and constant < 0.0:
        at_least = math.sqrt(-constant)
        if closing[1] < at_least < closing[0]:
            extremes[TTC] = min(extremes[TTC], at_least / opening_mps2)
    if opening_mps2 > 0.0 and closing[1] < 0.0 < closing[0]:  # nearest where both are as fast
        extremes[GAP] = min(extremes[GAP], -constant / (2.0 * opening_mps2))
