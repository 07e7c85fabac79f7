"""How a vehicle reaches the common speed of its lane, stops before the nose, or comes to it late.

All functions write a trajectory into ``out`` and return its length, or 0 where there is none.
"""

import math

from coramp._kernel import FloatArray, kernel
from coramp.kinematics.trajectory import (
    ACCEL,
    SPEED,
    STATION,
    TIME,
    begin,
    clip_end,
    clip_start,
    drive,
    drive_to_speed,
    piece_end_s,
    time_at_station,
    time_to_cover,
)
from coramp.road.rules import MotionLimits, Road


@kernel
def change_speed(out: FloatArray, n: int, target_mps: float, motion: MotionLimits) -> int:
    """Appends the stretch that brings the trajectory to ``target_mps``, up or down."""
    if out[n - 1, SPEED] < target_mps:
        return drive_to_speed(out, n, motion.speed_up_mps2, target_mps)
    return drive_to_speed(out, n, -motion.slow_down_mps2, target_mps)


@kernel
def harmonise(
    out: FloatArray,
    time_s: float,
    station_m: float,
    speed_mps: float,
    delay_s: float,
    brake_s: float,
    target_mps: float,
    motion: MotionLimits,
) -> int:
    """Writes: keep speed for ``delay_s``, brake for ``brake_s``, then go to the target and cruise.

    A longer brake gives a smaller station and speed at every later time, so that what is safe
    behind a leader with one brake is safe with every longer one. A vehicle that has braked to a
    stand waits for the rest of ``brake_s``.
    """
    n = begin(out, time_s, station_m, speed_mps)
    n = drive(out, n, 0.0, delay_s)
    standing_after_s = speed_mps / motion.slow_down_mps2
    n = drive(out, n, -motion.slow_down_mps2, min(brake_s, standing_after_s))
    if brake_s >= standing_after_s:
        out[n - 1, SPEED] = 0.0
        n = drive(out, n, 0.0, brake_s - standing_after_s)
    return change_speed(out, n, target_mps, motion)


@kernel
def append_stop(out: FloatArray, n: int, stop_station_m: float, braking_mps2: float) -> int:
    """Makes the trajectory in ``out`` come to a stand at ``stop_station_m``, as late as possible.

    Braking (m/s2, positive) starts where ``station + speed^2 / (2 braking)`` reaches the stop.
    Returns 0 where even braking at once overshoots, ``n`` unchanged where the trajectory never
    comes so far.
    """
    for k in range(n):
        speed_mps, accel_mps2 = out[k, SPEED], out[k, ACCEL]
        left_m = stop_station_m - out[k, STATION] - 0.5 * speed_mps * speed_mps / braking_mps2
        if left_m < -1e-9:
            return 0
        growth = 1.0 + accel_mps2 / braking_mps2
        after_s = time_to_cover(max(0.0, left_m), speed_mps * growth, accel_mps2 * growth)
        if out[k, TIME] + after_s <= piece_end_s(out[:n], k):
            n = clip_end(out, n, out[k, TIME] + after_s)
            n = drive_to_speed(out, n, -braking_mps2, 0.0)
            out[n - 1, STATION] = stop_station_m
            return n
    return n


@kernel
def stop_starts_s(pieces: FloatArray) -> float:
    """Returns when the braking to the final stand begins, infinity for one that ends driving."""
    last = len(pieces) - 1
    if pieces[last, SPEED] > 0.0:
        return math.inf
    if last > 0 and pieces[last - 1, ACCEL] < 0.0:
        return float(pieces[last - 1, TIME])
    return float(pieces[last, TIME])


@kernel
def stop_of_m(pieces: FloatArray) -> float:
    """Returns the station (m) at which a trajectory that ends in a stand does so."""
    return float(pieces[len(pieces) - 1, STATION])


@kernel
def approach_without_stop(
    pieces: FloatArray, from_s: float, road: Road, motion: MotionLimits, out: FloatArray
) -> int:
    """Writes a ramp vehicle's commitment from ``from_s`` to the nose, its final stop left out.

    From where the stop would begin, or has begun, it goes to the ramp's speed again.
    """
    leave_s = max(from_s, stop_starts_s(pieces))
    n = clip_start(pieces, from_s, out)
    if not math.isinf(leave_s):
        n = clip_end(out, n, leave_s)
    n = change_speed(out, n, road.ramp_speed_mps, motion)
    return clip_end(out, n, time_at_station(out[:n], 0.0))


@kernel
def late_approach(
    time_s: float,
    station_m: float,
    speed_mps: float,
    nose_s: float,
    road: Road,
    motion: MotionLimits,
    out: FloatArray,
) -> int:
    """Writes a ramp vehicle's way to pass the nose at ``nose_s`` with the ramp's speed.

    It slows down at once to the highest speed that comes late enough, keeps it, and speeds up
    again in time. Returns 0 where this takes a speed below ``slowest_ramp_speed_mps`` or the way
    is too short, or where ``nose_s`` is too early for it.
    """
    lowest_mps = _lowest_speed_on_the_way_mps(station_m, speed_mps, road, motion)
    highest_mps = min(speed_mps, road.ramp_speed_mps)
    if lowest_mps > highest_mps:
        return 0
    wanted_s = nose_s - time_s
    if _time_to_nose_s(station_m, speed_mps, lowest_mps, road, motion) < wanted_s:
        return 0
    if _time_to_nose_s(station_m, speed_mps, highest_mps, road, motion) > wanted_s:
        return 0
    for _ in range(60):
        middle_mps = 0.5 * (lowest_mps + highest_mps)
        if _time_to_nose_s(station_m, speed_mps, middle_mps, road, motion) < wanted_s:
            highest_mps = middle_mps
        else:
            lowest_mps = middle_mps
    n = begin(out, time_s, station_m, speed_mps)
    n = drive_to_speed(out, n, -motion.slow_down_mps2, lowest_mps)
    regain_m = _distance_between_speeds_m(lowest_mps, road.ramp_speed_mps, motion.speed_up_mps2)
    n = drive(out, n, 0.0, max(0.0, (-out[n - 1, STATION] - regain_m) / lowest_mps))
    n = drive_to_speed(out, n, motion.speed_up_mps2, road.ramp_speed_mps)
    return clip_end(out, n, max(out[n - 1, TIME], time_at_station(out[:n], 0.0)))


@kernel
def brake_and_go(
    time_s: float,
    station_m: float,
    speed_mps: float,
    nose_s: float,
    road: Road,
    motion: MotionLimits,
    out: FloatArray,
) -> int:
    """Writes a ramp vehicle's way to pass the nose at ``nose_s`` that loses its time at once.

    It brakes, to a stand and a wait if need be, and goes up to the ramp's speed r again. Against
    one at r it loses ``(r-u)^2 (1/(2d) + 1/(2a)) - (r-v)^2 / (2d)`` metres if it brakes by d from v
    to u and speeds up by a, and r metres a second while it stands. Returns 0 where the way is too
    short for that, or ``nose_s`` too early.
    """
    ramp_mps = road.ramp_speed_mps
    per_slowing, per_regaining = 0.5 / motion.slow_down_mps2, 0.5 / motion.speed_up_mps2
    lost_m = ramp_mps * (nose_s - time_s) + station_m
    square = (lost_m + (ramp_mps - speed_mps) ** 2 * per_slowing) / (per_slowing + per_regaining)
    if square < 0.0 or ramp_mps - math.sqrt(square) > speed_mps:
        return 0
    low_mps, wait_s = ramp_mps - math.sqrt(square), 0.0
    if low_mps < 0.0:
        standing_m = ramp_mps * ramp_mps * (per_slowing + per_regaining)
        standing_m -= (ramp_mps - speed_mps) ** 2 * per_slowing
        low_mps, wait_s = 0.0, (lost_m - standing_m) / ramp_mps
    brake_s = (speed_mps - low_mps) / motion.slow_down_mps2 + wait_s
    n = harmonise(out, time_s, station_m, speed_mps, 0.0, brake_s, ramp_mps, motion)
    if out[n - 1, STATION] > 0.0:
        return 0
    return clip_end(out, n, time_at_station(out[:n], 0.0))


@kernel
def late_start(
    pieces: FloatArray,
    from_s: float,
    wait_s: float,
    road: Road,
    motion: MotionLimits,
    out: FloatArray,
) -> int:
    """Writes a ramp vehicle's way to the nose that goes on to its stop, stands, and starts again.

    It stands for ``wait_s`` from when it is at its stop, or from ``from_s`` if it is by then.
    Returns 0 for a commitment that does not end in a stand.
    """
    if pieces[len(pieces) - 1, SPEED] > 0.0:
        return 0
    n = clip_start(pieces, from_s, out)
    n = drive(out, n, 0.0, wait_s)
    n = change_speed(out, n, road.ramp_speed_mps, motion)
    return clip_end(out, n, time_at_station(out[:n], 0.0))


@kernel
def _distance_between_speeds_m(slow_mps: float, fast_mps: float, rate_mps2: float) -> float:
    return 0.5 * (fast_mps * fast_mps - slow_mps * slow_mps) / rate_mps2


@kernel
def _lowest_speed_on_the_way_mps(
    station_m: float, speed_mps: float, road: Road, motion: MotionLimits
) -> float:
    per_slowing, per_regaining = 0.5 / motion.slow_down_mps2, 0.5 / motion.speed_up_mps2
    square = (
        speed_mps * speed_mps * per_slowing
        + road.ramp_speed_mps * road.ramp_speed_mps * per_regaining
        + station_m
    ) / (per_slowing + per_regaining)
    return max(motion.slowest_ramp_speed_mps, math.sqrt(max(0.0, square)))


@kernel
def _time_to_nose_s(
    station_m: float, speed_mps: float, low_mps: float, road: Road, motion: MotionLimits
) -> float:
    slowing_m = _distance_between_speeds_m(low_mps, speed_mps, motion.slow_down_mps2)
    regaining_m = _distance_between_speeds_m(low_mps, road.ramp_speed_mps, motion.speed_up_mps2)
    return (
        (speed_mps - low_mps) / motion.slow_down_mps2
        + (-station_m - slowing_m - regaining_m) / low_mps
        + (road.ramp_speed_mps - low_mps) / motion.speed_up_mps2
    )
