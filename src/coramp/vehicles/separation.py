"""The exact smallest margin between two vehicles in one lane, over all of a time span.

The margin is the bumper distance less the safe distance of Eq. 1. Over a stretch in which neither
vehicle changes its acceleration it is a polynomial of second degree on each side of the moment at
which their speeds are equal, so its minimum is at an end, at that moment or at a vertex.
"""

import math

from coramp._kernel import FloatArray, kernel
from coramp.equations.safe_distance import braking_distance_m, safe_distance_m
from coramp.kinematics.trajectory import ACCEL, SPEED, STATION, TIME, piece_at, piece_end_s
from coramp.road.rules import SafetyBudget


@kernel
def smallest_of_quadratic(
    constant: float, slope: float, curvature: float, duration: float
) -> tuple[float, float]:
    """Returns the minimum of ``constant + slope x + curvature x^2`` on [0, duration], and its x.

    The duration may be infinite; a polynomial that falls for ever has minimum minus infinity.
    """
    best, where = constant, 0.0
    if curvature > 0.0 and slope < 0.0 and -slope < 2.0 * curvature * duration:
        where = -0.5 * slope / curvature
        return constant + 0.5 * slope * where, where
    if math.isinf(duration):
        if curvature < 0.0 or (curvature == 0.0 and slope < -1e-12):
            return -math.inf, math.inf
        return best, where
    at_end = constant + duration * (slope + curvature * duration)
    if at_end < best:
        return at_end, duration
    return best, where


@kernel
def smallest_margin_m(
    front: FloatArray,
    front_length_m: float,
    rear: FloatArray,
    start_s: float,
    end_s: float,
    safety: SafetyBudget,
) -> tuple[float, float]:
    """Returns the smallest distance (m) beyond Eq. 1 within [start, end], and when it is reached.

    ``front`` and ``rear`` are trajectories, ``end_s`` may be infinite. The execution allowance is
    not subtracted. Returns infinity for an empty span.
    """
    smallest_m, when_s = math.inf, start_s
    if end_s < start_s:
        return smallest_m, when_s
    kappa = braking_distance_m(1.0, safety.adhesion, safety.resistance)
    i, j = piece_at(front, start_s), piece_at(rear, start_s)
    now_s = start_s
    while True:
        next_s = min(end_s, piece_end_s(front, i), piece_end_s(rear, j))
        front_x, rear_x = now_s - front[i, TIME], now_s - rear[j, TIME]
        front_mps2, rear_mps2 = front[i, ACCEL], rear[j, ACCEL]
        front_mps = front[i, SPEED] + front_mps2 * front_x
        rear_mps = rear[j, SPEED] + rear_mps2 * rear_x
        distance_m = (
            front[i, STATION]
            + 0.5 * (front[i, SPEED] + front_mps) * front_x
            - rear[j, STATION]
            - 0.5 * (rear[j, SPEED] + rear_mps) * rear_x
            - front_length_m
        )
        margin_m, x = _smallest_within_pieces(
            distance_m,
            front_mps,
            rear_mps,
            front_mps2,
            rear_mps2,
            next_s - now_s,
            kappa,
            safety,
        )
        if margin_m < smallest_m:
            smallest_m, when_s = margin_m, now_s + x
        if next_s >= end_s:
            return smallest_m, when_s
        now_s = next_s
        if piece_end_s(front, i) <= now_s:
            i += 1
        if piece_end_s(rear, j) <= now_s:
            j += 1


@kernel
def _smallest_within_pieces(
    distance_m: float,
    front_mps: float,
    rear_mps: float,
    front_mps2: float,
    rear_mps2: float,
    duration_s: float,
    kappa: float,
    safety: SafetyBudget,
) -> tuple[float, float]:
    opening_mps, opening_mps2 = front_mps - rear_mps, front_mps2 - rear_mps2
    constant = (
        distance_m
        - safe_distance_m(front_mps, rear_mps, safety)
        + kappa * min(0.0, opening_mps) ** 2
    )
    slope = (
        opening_mps
        - safety.clock_error_s * (front_mps2 + rear_mps2)
        - safety.follower_clock_extra_s * rear_mps2
        - safety.time_gap_s * rear_mps2
    )
    curvature = 0.5 * opening_mps2
    equal_s = math.inf
    if opening_mps * opening_mps2 < 0.0:
        equal_s = -opening_mps / opening_mps2
    closing = opening_mps < 0.0 or (opening_mps == 0.0 and opening_mps2 < 0.0)
    first_s = min(duration_s, equal_s)
    smallest_m, where_s = _smallest_of_branch(
        constant, slope, curvature, opening_mps, opening_mps2, first_s, kappa, closing
    )
    if equal_s < duration_s:
        shifted = constant + equal_s * (slope + curvature * equal_s)
        margin_m, x = _smallest_of_branch(
            shifted,
            slope + 2.0 * curvature * equal_s,
            curvature,
            0.0,
            opening_mps2,
            duration_s - equal_s,
            kappa,
            not closing,
        )
        if margin_m < smallest_m:
            smallest_m, where_s = margin_m, equal_s + x
    return smallest_m, where_s


@kernel
def _smallest_of_branch(
    constant: float,
    slope: float,
    curvature: float,
    opening_mps: float,
    opening_mps2: float,
    duration_s: float,
    kappa: float,
    closing: bool,
) -> tuple[float, float]:
    if closing:
        constant -= kappa * opening_mps * opening_mps
        slope -= 2.0 * kappa * opening_mps * opening_mps2
        curvature -= kappa * opening_mps2 * opening_mps2
    return smallest_of_quadratic(constant, slope, curvature, duration_s)
