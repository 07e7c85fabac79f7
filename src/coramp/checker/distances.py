"""The checker's own reading of the safe distance and of trajectories made of pieces.

A trajectory is an array of shape (n, 4): time (s), station (m), speed (m/s) and acceleration
(m/s2) at the start of each piece, the last of which lasts for ever.
"""

import math
from typing import NamedTuple

from coramp._kernel import FloatArray, kernel

(
    LENGTH,
    POSITIONING,
    CLOCK,
    TIME_GAP,
    TOP_SPEED,
    ACCELERATION,
    POWER,
    BRAKING,
    MASS,
) = range(9)
TRAITS = 9
"""Columns of what a vehicle can do, and how many there are.

Length (m), errors of Eq. 1 (m, s), own time gap as a follower (s), top speed (m/s), largest
acceleration at rest (m/s2), power per mass (W/kg), hardest braking (m/s2), mass (kg). Infinity
where only the common bounds hold.
"""


class Bounds(NamedTuple):
    """What no plan may exceed; SI units, all positive but ``stop_station_m``.

    ``lanes`` are those of the mainline. Who changes from one to the next counts on both for
    ``lane_change_lasts_s``.
    """

    zone_end_m: float
    stop_station_m: float
    last_merge_station_m: float
    mainline_speed_mps: float
    ramp_limit_mps: float
    cos_merge_angle: float
    friction: float
    standstill_gap_m: float
    allowance_m: float
    comfort_mps2: float
    ramp_acceleration_mps2: float
    gap_speed_factor: float
    lanes: int = 1
    lane_change_lasts_s: float = math.inf


class Needs(NamedTuple):
    """What the distance of two vehicles depends on besides their speeds.

    That is the front one's length and the sum of their positioning errors (m), their clock errors
    and the follower's time gap (s).
    """

    front_length_m: float
    errors_m: float
    front_clock_s: float
    rear_clock_s: float
    time_gap_s: float


@kernel
def state_at(pieces: FloatArray, time_s: float) -> tuple[float, float, float]:
    """Returns station (m), speed (m/s) and acceleration (m/s2) at ``time_s``."""
    k = 0
    while k + 1 < pieces.shape[0] and pieces[k + 1, 0] <= time_s:
        k += 1
    dt = time_s - pieces[k, 0]
    a = pieces[k, 3]
    return pieces[k, 1] + pieces[k, 2] * dt + a * dt * dt / 2.0, pieces[k, 2] + a * dt, a


@kernel
def next_knot_s(pieces: FloatArray, time_s: float) -> float:
    """Returns the first knot after ``time_s``, infinity if there is none."""
    for k in range(pieces.shape[0]):
        if pieces[k, 0] > time_s:
            return float(pieces[k, 0])
    return math.inf


@kernel
def passes_s(pieces: FloatArray, station_m: float) -> float:
    """Returns when a vehicle that never drives backwards passes a station, infinity if never."""
    for k in range(pieces.shape[0]):
        _, s, v, a = pieces[k]
        lasts_s = math.inf if k + 1 == pieces.shape[0] else pieces[k + 1, 0] - pieces[k, 0]
        way_m = station_m - s
        if way_m <= 0.0:
            return float(pieces[k, 0])
        under = v * v + 2.0 * a * way_m  # the speed there, squared
        twice_mean_mps = v + math.sqrt(under) if under >= 0.0 else 0.0
        after_s = 2.0 * way_m / twice_mean_mps if twice_mean_mps > 0.0 else math.inf
        if 0.0 <= after_s <= lasts_s:
            return float(pieces[k, 0] + after_s)
    return math.inf


@kernel
def needs_of(front: FloatArray, rear: FloatArray) -> Needs:
    """Returns what two vehicles need of each other, from what they can do."""
    errors_m = front[POSITIONING] + rear[POSITIONING]
    return Needs(front[LENGTH], errors_m, front[CLOCK], rear[CLOCK], rear[TIME_GAP])


@kernel
def following_distance_m(v_front: float, v_rear: float, needs: Needs, bounds: Bounds) -> float:
    """Returns 2 L_1 + L_2 + L_3 in m (Eq. 1-3, speeds in m/s), plus the optional gaps.

    2 L_1 is the sum of the two vehicles' own errors; each clock error counts with its speed.
    """
    closing_km_h = 3.6 * (v_rear - v_front)
    braking_m = closing_km_h**2 / (254.0 * bounds.friction) if closing_km_h > 0.0 else 0.0
    if needs.front_clock_s == needs.rear_clock_s:
        clock_m = needs.front_clock_s * (v_front + v_rear)
    else:
        clock_m = needs.front_clock_s * v_front + needs.rear_clock_s * v_rear
    by_paper_m = needs.errors_m + clock_m + braking_m
    return by_paper_m + needs.time_gap_s * v_rear + bounds.standstill_gap_m


@kernel
def lane_change_distance_m(
    v_merging: float, v_other: float, errors_m: float, bounds: Bounds
) -> float:
    """Returns L_r-X, L_r-Y in m (Eq. 15, 16, speeds in m/s)."""
    along_km_h = 3.6 * (v_merging * bounds.cos_merge_angle - v_other)
    return errors_m + along_km_h**2 / (254.0 * bounds.friction)


@kernel
def margin_at_m(
    front: FloatArray, rear: FloatArray, time_s: float, needs: Needs, bounds: Bounds
) -> float:
    """Returns the bumper distance less the safe distance of Eq. 1 (m) at one moment."""
    s_front, v_front, _ = state_at(front, time_s)
    s_rear, v_rear, _ = state_at(rear, time_s)
    needed_m = following_distance_m(v_front, v_rear, needs, bounds)
    return s_front - needs.front_length_m - s_rear - needed_m


@kernel
def least_between_m(
    front: FloatArray,
    rear: FloatArray,
    start_s: float,
    end_s: float,
    needs: Needs,
    bounds: Bounds,
) -> float:
    """Returns the least margin (m) on a span without knots and without a change of who is faster.

    There the margin is a parabola in time; three of its values give its vertex.
    """
    middle_s = 0.5 * (start_s + end_s)
    at_start = margin_at_m(front, rear, start_s, needs, bounds)
    at_middle = margin_at_m(front, rear, middle_s, needs, bounds)
    # the end belongs to the next piece; approach it from this one
    s_front, v_front, a_front = state_at(front, start_s)
    s_rear, v_rear, a_rear = state_at(rear, start_s)
    dt = end_s - start_s
    at_end = (
        s_front
        + v_front * dt
        + a_front * dt * dt / 2.0
        - needs.front_length_m
        - (s_rear + v_rear * dt + a_rear * dt * dt / 2.0)
        - following_distance_m(v_front + a_front * dt, v_rear + a_rear * dt, needs, bounds)
    )
    least = min(at_start, at_end)
    bend = at_start - 2.0 * at_middle + at_end
    if bend > 0.0:
        vertex = (at_start - at_end) / (2.0 * bend)  # -1 at the start, 1 at the end
        if abs(vertex) < 1.0:
            least = min(least, at_middle - 0.5 * bend * vertex * vertex)
    return least


@kernel
def least_margin_m(
    front: FloatArray,
    rear: FloatArray,
    start_s: float,
    end_s: float,
    needs: Needs,
    bounds: Bounds,
) -> float:
    """Returns the least margin (m) over Eq. 1 in [start, end]; ``end_s`` may be infinite.

    Minus infinity where the vehicles close in on each other for ever. Infinity for an empty span.
    """
    least = math.inf
    if end_s < start_s:
        return least
    now_s = start_s
    while True:
        until_s = min(end_s, next_knot_s(front, now_s), next_knot_s(rear, now_s))
        _, v_front, a_front = state_at(front, now_s)
        _, v_rear, a_rear = state_at(rear, now_s)
        opening, opening_rate = v_front - v_rear, a_front - a_rear
        if opening_rate != 0.0:
            equal_s = now_s - opening / opening_rate
            if now_s + 1e-9 < equal_s < until_s - 1e-9:
                until_s = equal_s
        if math.isinf(until_s):
            if abs(opening_rate) > 1e-12 or opening < -1e-9:
                return -math.inf
            return min(least, margin_at_m(front, rear, now_s, needs, bounds))
        least = min(least, least_between_m(front, rear, now_s, until_s, needs, bounds))
        if until_s >= end_s:
            return least
        now_s = until_s


class Envelope(NamedTuple):
    """Bounds from some time on, for ever: of ``station - v0 t`` (m) and of the speed (m/s)."""

    lowest_m: float
    highest_m: float
    slowest_mps: float
    fastest_mps: float


@kernel
def envelope_of(pieces: FloatArray, from_s: float, v0_mps: float) -> Envelope:
    """Returns the envelope of a trajectory from ``from_s`` on."""
    last = pieces.shape[0] - 1
    under_way = last  # most vehicles drive their last piece
    while under_way > 0 and pieces[under_way, 0] > from_s:
        under_way -= 1
    s, v, _ = state_at(pieces[under_way:], from_s)
    lowest_m = highest_m = s - v0_mps * from_s
    slowest = fastest = v
    for k in range(under_way, last + 1):
        t, s, v, a = pieces[k]
        ends_s = math.inf if k == last else pieces[k + 1, 0]
        if t > from_s:
            lowest_m, highest_m = min(lowest_m, s - v0_mps * t), max(highest_m, s - v0_mps * t)
            slowest, fastest = min(slowest, v), max(fastest, v)
        if a != 0.0:
            turns_after_s = (v0_mps - v) / a
            if max(t, from_s) < t + turns_after_s < ends_s:
                turn_m = s + (v - v0_mps) * turns_after_s + a * turns_after_s**2 / 2.0 - v0_mps * t
                lowest_m, highest_m = min(lowest_m, turn_m), max(highest_m, turn_m)
    _, _, v, a = pieces[last]
    if v < v0_mps or a < 0.0:
        lowest_m = -math.inf
    if v > v0_mps or a > 0.0:
        highest_m = fastest = math.inf
    return Envelope(lowest_m, highest_m, slowest, fastest)


@kernel
def margin_at_least_m(front: Envelope, rear: Envelope, needs: Needs, bounds: Bounds) -> float:
    """Returns what the margins over Eq. 1, 15 and 16 (m) never fall below, however times coincide.

    Meaningless, and negative, where ``front`` may be behind ``rear``.
    """
    following_m = following_distance_m(front.slowest_mps, rear.fastest_mps, needs, bounds)
    following_m += needs.front_clock_s * (front.fastest_mps - front.slowest_mps)
    slowest_mps = min(front.slowest_mps, rear.slowest_mps)
    fastest_mps = max(front.fastest_mps, rear.fastest_mps)
    errors_m = needs.errors_m
    lane_change_m = lane_change_distance_m(slowest_mps, fastest_mps, errors_m, bounds)
    if fastest_mps * bounds.cos_merge_angle > slowest_mps:
        other_m = lane_change_distance_m(fastest_mps, slowest_mps, errors_m, bounds)
        lane_change_m = max(lane_change_m, other_m)
    needed_m = max(following_m, lane_change_m)
    return front.lowest_m - needs.front_length_m - rear.highest_m - needed_m
