"""Losing a given way behind v0 with one slower cruise, and being back at v0 at a given time.

A vehicle that must come later than it could drives at one speed v below v0 in between. From speed u
at station s it changes to v, keeps it, and speeds up with ``a`` so that it is at v0 at ``end_s`` on
its intercept I: ``station(t) = I + v0 t`` from then on. With W the time until then and X the way,

    X = I + v0 end_s - s,   A = 1 / (2 b) + 1 / (2 a),   B = W - u / b - v0 / a,
    A v^2 + B v + u^2 / (2 b) + v0^2 / (2 a) = X                      where v <= u (braking with b),
    v = (X - (v0^2 - u^2) / (2 a)) / (W - (v0 - u) / a)               where v > u.

The larger root is the one whose cruise lasts 0 s or longer.
"""

import math

from coramp._kernel import FloatArray, kernel
from coramp.kinematics.trajectory import (
    MAX_PIECES,
    SPEED,
    STATION,
    TIME,
    begin,
    drive,
    drive_to_speed,
)
from coramp.road.rules import MotionLimits

MOST_PERIODS = MAX_PIECES - 8
"""Pieces of a way of least effort; some are left for what comes after it."""
SHORTEST_HOLD_S = 0.5
SAME_MPS = 1e-9


@kernel
def slow_speed_mps(
    way_m: float,
    time_s: float,
    start_mps: float,
    v0_mps: float,
    brake_mps2: float,
    speed_up_mps2: float,
) -> tuple[float, float]:
    """Returns the slower speed v (m/s) and how long it is kept (s); nan where there is none.

    ``way_m`` is to be driven in ``time_s``, from ``start_mps`` to ``v0_mps`` at the end.
    """
    rising_s = (v0_mps - start_mps) / speed_up_mps2
    rising_m = 0.5 * (v0_mps * v0_mps - start_mps * start_mps) / speed_up_mps2
    if start_mps < v0_mps and time_s > rising_s:
        above_mps = (way_m - rising_m) / (time_s - rising_s)
        if start_mps < above_mps <= v0_mps:
            return above_mps, time_s - rising_s
    per_square = 0.5 / brake_mps2 + 0.5 / speed_up_mps2
    linear_s = time_s - start_mps / brake_mps2 - v0_mps / speed_up_mps2
    constant_m = 0.5 * start_mps * start_mps / brake_mps2 + 0.5 * v0_mps * v0_mps / speed_up_mps2
    square = linear_s * linear_s - 4.0 * per_square * (constant_m - way_m)
    if square < 0.0:
        return math.nan, math.nan
    kept_s = math.sqrt(square)
    below_mps = 0.5 * (kept_s - linear_s) / per_square
    if 0.0 < below_mps <= min(start_mps, v0_mps):
        return below_mps, kept_s
    return math.nan, math.nan


@kernel
def slow_phase(
    out: FloatArray,
    time_s: float,
    station_m: float,
    speed_mps: float,
    end_s: float,
    intercept_m: float,
    v0_mps: float,
    brake_mps2: float,
    speed_up_mps2: float,
) -> int:
    """Writes the slower cruise that ends at ``end_s`` on ``intercept_m``; returns its length.

    0 where no speed above 0 does it. From ``end_s`` on the vehicle cruises at v0.
    """
    way_m = intercept_m + v0_mps * end_s - station_m
    slow_mps, kept_s = slow_speed_mps(
        way_m, end_s - time_s, speed_mps, v0_mps, brake_mps2, speed_up_mps2
    )
    if math.isnan(slow_mps):
        return 0
    n = begin(out, time_s, station_m, speed_mps)
    rate_mps2 = speed_up_mps2 if slow_mps > speed_mps else -brake_mps2
    n = drive_to_speed(out, n, rate_mps2, slow_mps)
    n = drive(out, n, 0.0, kept_s)
    return drive_to_speed(out, n, speed_up_mps2, v0_mps)


@kernel
def least_effort_way(
    out: FloatArray,
    time_s: float,
    station_m: float,
    speed_mps: float,
    end_s: float,
    intercept_m: float,
    v0_mps: float,
    jerk_mps3: float,
    motion: MotionLimits,
) -> int:
    """Writes the way of least effort that is at v0 by ``end_s`` on ``intercept_m``.

    Over T seconds from speed u, with ``e`` the way that the mean of both speeds leaves,

        accel(t) = (v0 - u) / T + 6 e / T^2 (1 - 2 t / T),

    which minimises the integral of its square (``motion.least_effort``); it is held over equal
    periods, whose line is steeper by 1 / (1 - 1 / n^2). Returns its length, 0 where it would
    accelerate or brake harder than ``motion`` allows, change its acceleration by more than
    ``jerk_mps3`` within 1 s, be above v0, or stand.
    """
    duration_s = end_s - time_s
    periods = min(MOST_PERIODS, int(duration_s / SHORTEST_HOLD_S))
    if periods < 2:
        return 0
    hold_s = duration_s / periods
    way_m = intercept_m + v0_mps * end_s - station_m
    excess_m = way_m - 0.5 * (speed_mps + v0_mps) * duration_s
    mean_mps2 = (v0_mps - speed_mps) / duration_s
    steepness = 6.0 * excess_m / (duration_s * duration_s) / (1.0 - 1.0 / (periods * periods))
    changes_mps2 = 2.0 * abs(steepness) * min(1.0, 1.0 / duration_s)
    first = mean_mps2 + steepness * (1.0 - 1.0 / periods)
    last = mean_mps2 - steepness * (1.0 - 1.0 / periods)
    if max(abs(first), abs(last), changes_mps2) > jerk_mps3:
        return 0
    if min(first, last) < -motion.slow_down_mps2 or max(first, last) > motion.speed_up_mps2:
        return 0
    n = begin(out, time_s, station_m, speed_mps)
    for k in range(periods):
        n = drive(out, n, mean_mps2 + steepness * (1.0 - (2.0 * k + 1.0) / periods), hold_s)
        if not 0.0 < out[n - 1, SPEED] <= max(v0_mps, speed_mps) + SAME_MPS:
            return 0
    out[n - 1, STATION], out[n - 1, SPEED] = intercept_m + v0_mps * out[n - 1, TIME], v0_mps
    return n
