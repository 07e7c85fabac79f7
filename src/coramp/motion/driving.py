"""Driving with a commanded acceleration for a while, and the safe way to go on from there.

All functions write a trajectory into ``out`` and return its length, or 0 where there is none.
"""

import math

from coramp._kernel import FloatArray, kernel
from coramp.equations.gaps import least_acceleration_mps2
from coramp.kinematics.trajectory import (
    ACCEL,
    SPEED,
    STATION,
    TIME,
    begin,
    clip_end,
    drive,
    drive_to_speed,
    station_and_speed,
    time_at_station,
)
from coramp.motion.approach import append_stop, change_speed
from coramp.road.rules import Rules
from coramp.vehicles.fleet import Fleet, committed


@kernel
def drive_within_limit(
    out: FloatArray, n: int, accel_mps2: float, duration_s: float, limit_mps: float
) -> int:
    """Appends a stretch of acceleration that ends early where the speed reaches 0 or the limit.

    The rest of the duration is driven at that speed. A vehicle above the limit is not sped up.
    """
    speed_mps = out[n - 1, SPEED]
    if accel_mps2 > 0.0:
        room_s = max(0.0, limit_mps - speed_mps) / accel_mps2
    elif accel_mps2 < 0.0:
        room_s = -speed_mps / accel_mps2
    else:
        room_s = math.inf
    if room_s >= duration_s:
        return drive(out, n, accel_mps2, duration_s)
    n = drive(out, n, accel_mps2, room_s)
    out[n - 1, SPEED] = 0.0 if accel_mps2 < 0.0 else max(speed_mps, limit_mps)
    return drive(out, n, 0.0, duration_s - room_s)


@kernel
def begin_hold(
    out: FloatArray,
    before: FloatArray,
    from_s: float,
    accel_mps2: float,
    hold_s: float,
    limit_mps: float,
) -> int:
    """Starts a trajectory that leaves ``before`` at ``from_s`` and holds an acceleration."""
    station_m, speed_mps = station_and_speed(before, from_s)
    n = begin(out, from_s, station_m, speed_mps)
    return drive_within_limit(out, n, accel_mps2, hold_s, limit_mps)


@kernel
def hold_then_cruise(
    fleet: Fleet,
    row: int,
    accel_mps2: float,
    hold_s: float,
    from_s: float,
    rules: Rules,
    out: FloatArray,
) -> int:
    """Writes a mainline vehicle's way: hold, then back to v0."""
    v0 = rules.road.mainline_speed_mps
    n = begin_hold(out, committed(fleet, row), from_s, accel_mps2, hold_s, v0)
    return change_speed(out, n, v0, rules.motion)


@kernel
def hold_then_merge(
    fleet: Fleet,
    row: int,
    accel_mps2: float,
    hold_s: float,
    from_s: float,
    rules: Rules,
    out: FloatArray,
) -> int:
    """Writes a ramp vehicle's way: hold, to the nose at v_R0, then up to v0; it merges at the end.

    On the acceleration lane it takes free movement's acceleration, or more if the lane's end asks
    for it. Returns 0 where no allowed acceleration is enough.
    """
    road, motion = rules.road, rules.motion
    before = committed(fleet, row)
    station_m, _ = station_and_speed(before, from_s)
    limit_mps = road.ramp_limit_mps
    if station_m >= 0.0:
        limit_mps = road.mainline_speed_mps
        accel_mps2 = min(accel_mps2, motion.ramp_acceleration_mps2)
    n = begin_hold(out, before, from_s, accel_mps2, hold_s, limit_mps)
    if out[n - 1, STATION] < 0.0:
        n = change_speed(out, n, road.ramp_speed_mps, motion)
        n = clip_end(out, n, time_at_station(out[:n], 0.0))
    left_m = road.last_merge_station_m - max(0.0, out[n - 1, STATION])
    if left_m <= 0.0:
        return 0
    v0, speed_mps = road.mainline_speed_mps, out[n - 1, SPEED]
    least_mps2 = least_acceleration_mps2(v0, speed_mps, left_m)
    if least_mps2 > motion.ramp_acceleration_mps2:
        return 0
    n = drive_to_speed(out, n, max(motion.free_acceleration_mps2, least_mps2), v0)
    return n if out[n - 1, ACCEL] == 0.0 and out[n - 1, TIME] > from_s else 0


@kernel
def hold_then_stop(
    fleet: Fleet,
    row: int,
    accel_mps2: float,
    hold_s: float,
    from_s: float,
    stop_m: float,
    rules: Rules,
    out: FloatArray,
) -> int:
    """Writes a ramp vehicle's way: hold, on at v_R0, and a stop at ``stop_m``.

    Returns 0 where it can no longer stop there.
    """
    road, motion = rules.road, rules.motion
    n = begin_hold(out, committed(fleet, row), from_s, accel_mps2, hold_s, road.ramp_limit_mps)
    n = change_speed(out, n, road.ramp_speed_mps, motion)
    return append_stop(out, n, stop_m, motion.stop_mps2)
