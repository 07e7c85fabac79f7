"""How far beyond the safe distance two vehicles are, for the figures of a run.

This is a reading of Eq. 1-3 and 15, 16 of its own: planners have theirs in ``equations``, and the
checker has one as well. A mistake in one of them shows as a difference.
"""

import math

import numpy as np

from coramp._kernel import FloatArray, kernel
from coramp.road.rules import SafetyBudget
from coramp.vehicles.traits import CLOCK, POSITIONING, TIME_GAP

TIME, STATION, SPEED, ACCEL = range(4)
"""Columns of pieces."""
KM_H_PER_MPS = 3.6
BRAKING_UNITS = 254.0
"""2 g in the units of Eq. 3: (km/h)^2 / (254 (adhesion + resistance)) is a distance in m."""


@kernel
def state_in_piece(pieces: FloatArray, k: int, time_s: float) -> tuple[float, float, float]:
    """Returns station (m), speed (m/s) and acceleration (m/s2) of piece ``k`` at a time."""
    x, accel_mps2 = time_s - pieces[k, TIME], pieces[k, ACCEL]
    speed_mps = pieces[k, SPEED] + accel_mps2 * x
    return (
        pieces[k, STATION] + (pieces[k, SPEED] + 0.5 * accel_mps2 * x) * x,
        speed_mps,
        accel_mps2,
    )


@kernel
def piece_under_way(pieces: FloatArray, time_s: float) -> int:
    """Returns the last piece that has begun by a time, the first one before that."""
    k = 0
    while k + 1 < len(pieces) and pieces[k + 1, TIME] <= time_s:
        k += 1
    return k


@kernel
def budget_of(front: FloatArray, rear: FloatArray, safety: SafetyBudget) -> SafetyBudget:
    """Returns the budget of Eq. 1 for two vehicles, from rows of ``vehicles.traits``.

    2 L_1 is the sum of their positioning errors, dt (v_X + v_Y) becomes dt_X v_X + dt_Y v_Y, and
    the time gap is the follower's.
    """
    return SafetyBudget(
        (front[POSITIONING] + rear[POSITIONING]) / 2.0,
        front[CLOCK],
        safety.adhesion,
        safety.resistance,
        rear[TIME_GAP],
        safety.standstill_gap_m,
        safety.execution_allowance_m,
        rear[CLOCK] - front[CLOCK],
    )


@kernel
def distance_needed_m(front_mps: float, rear_mps: float, safety: SafetyBudget) -> float:
    """Returns what Eq. 1 asks for between bumpers (m), with the optional gaps.

    L_safe = 2 L_1 + dt (v_X + v_Y) + (3.6 (v_Y - v_X))^2 / (254 (phi + f)) + T_g v_Y + standstill
    gap; the third term only where the follower Y is faster.
    """
    closing_km_h = KM_H_PER_MPS * max(0.0, rear_mps - front_mps)
    braking_m = closing_km_h**2 / (BRAKING_UNITS * (safety.adhesion + safety.resistance))
    clock_m = safety.clock_error_s * (front_mps + rear_mps)
    clock_m += safety.follower_clock_extra_s * rear_mps
    gaps_m = safety.time_gap_s * rear_mps + safety.standstill_gap_m
    return 2.0 * safety.positioning_error_m + clock_m + braking_m + gaps_m


@kernel
def margin_at_lane_change_m(
    distance_m: float,
    merging_mps: float,
    other_mps: float,
    merge_angle_rad: float,
    safety: SafetyBudget,
) -> float:
    """Returns a bumper distance (m) less what Eq. 15 or 16 asks for.

    2 L_1 + (3.6 (v_R cos(angle) - v))^2 / (254 (phi + f)).
    """
    relative_km_h = KM_H_PER_MPS * (merging_mps * math.cos(merge_angle_rad) - other_mps)
    braking_m = relative_km_h**2 / (BRAKING_UNITS * (safety.adhesion + safety.resistance))
    return distance_m - 2.0 * safety.positioning_error_m - braking_m


@kernel
def least_margin_m(
    front: FloatArray,
    front_length_m: float,
    rear: FloatArray,
    start_s: float,
    end_s: float,
    safety: SafetyBudget,
) -> tuple[float, float]:
    """Returns the least distance (m) beyond Eq. 1 within [start, end], and when (s) it is reached.

    Infinity for an empty span. Within a pair of pieces the margin is a parabola while the follower
    is faster, and another one while it is not: it is least at an end, where they are equally fast,
    or at the vertex of one of them. All of these are looked at.
    """
    least_m, when_s = math.inf, start_s
    i, j = piece_under_way(front, start_s), piece_under_way(rear, start_s)
    now_s = start_s
    while now_s <= end_s:
        next_s = end_s
        if i + 1 < len(front):
            next_s = min(next_s, front[i + 1, TIME])
        if j + 1 < len(rear):
            next_s = min(next_s, rear[j + 1, TIME])
        for x in _moments_to_look_at(front, i, rear, j, now_s, next_s - now_s, safety):
            front_m, front_mps, _ = state_in_piece(front, i, now_s + x)
            rear_m, rear_mps, _ = state_in_piece(rear, j, now_s + x)
            needed_m = distance_needed_m(front_mps, rear_mps, safety)
            margin_m = front_m - front_length_m - rear_m - needed_m
            if margin_m < least_m:
                least_m, when_s = margin_m, now_s + x
        if next_s >= end_s:
            break
        now_s = next_s
        if i + 1 < len(front) and front[i + 1, TIME] <= now_s:
            i += 1
        if j + 1 < len(rear) and rear[j + 1, TIME] <= now_s:
            j += 1
    return least_m, when_s


@kernel
def _moments_to_look_at(
    front: FloatArray,
    i: int,
    rear: FloatArray,
    j: int,
    now_s: float,
    duration_s: float,
    safety: SafetyBudget,
) -> FloatArray:
    """Returns where (s after ``now_s``) the margin of a pair of pieces can be least."""
    _, front_mps, front_mps2 = state_in_piece(front, i, now_s)
    _, rear_mps, rear_mps2 = state_in_piece(rear, j, now_s)
    opening_mps, opening_mps2 = front_mps - rear_mps, front_mps2 - rear_mps2
    per_square = KM_H_PER_MPS**2 / (BRAKING_UNITS * (safety.adhesion + safety.resistance))
    clock_mps = safety.clock_error_s * (front_mps2 + rear_mps2)
    clock_mps += safety.follower_clock_extra_s * rear_mps2
    slope = opening_mps - clock_mps - safety.time_gap_s * rear_mps2
    found = np.empty(5)
    found[0], found[1] = 0.0, duration_s
    n = 2
    if opening_mps2 != 0.0:
        found[n] = -opening_mps / opening_mps2
        n += 1
    for braking in (0.0, per_square):
        slope_here = slope - 2.0 * braking * opening_mps * opening_mps2
        curvature = 0.5 * opening_mps2 - braking * opening_mps2 * opening_mps2
        if curvature > 0.0:
            found[n] = -0.5 * slope_here / curvature
            n += 1
    kept = 0
    for k in range(n):
        if 0.0 <= found[k] <= duration_s:
            found[kept] = found[k]
            kept += 1
    return found[:kept]
