"""The acceleration that puts a ramp vehicle into a gap between cruising vehicles (Eq. 24-31).

Stations at time 0: x of the gap's front vehicle X, y of its rear vehicle Y, r <= 0 of the ramp
vehicle. Seen from a vehicle that passes the nose together with the ramp vehicle at v_0, the ramp
vehicle falls back by ``lag = (v_0 - v_R0)^2 / (2 a)`` until it has reached v_0.
"""

import math

from coramp._kernel import kernel
from coramp.equations.free_movement import acceleration_time_s, mainline_station_m, nose_time_s
from coramp.equations.gaps import least_acceleration_mps2


@kernel
def lag_m(mainline_speed_mps: float, nose_speed_mps: float, accel_mps2: float) -> float:
    """Returns (v_0 - v)^2 / (2 a) in m, what a vehicle at v at the nose loses to one at v_0.

    Raises ValueError for an acceleration that is not positive.
    """
    if accel_mps2 <= 0.0:
        raise ValueError("acceleration must be positive")
    difference_mps = mainline_speed_mps - nose_speed_mps
    return difference_mps * difference_mps / (2.0 * accel_mps2)


@kernel
def acceleration_for_lag_mps2(
    mainline_speed_mps: float, nose_speed_mps: float, lag_m: float
) -> float:
    """Returns a = (v_0 - v)^2 / (2 lag), infinity for a lag <= 0, which none can reach."""
    if lag_m <= 0.0:
        return math.inf
    difference_mps = mainline_speed_mps - nose_speed_mps
    return difference_mps * difference_mps / (2.0 * lag_m)


@kernel
def front_station_at_merge_m(
    front_start_m: float, mainline_speed_mps: float, nose_s: float, t2_s: float
) -> float:
    """Returns S_X(t_1 + t_2') = x + v_0 (t_1 + t_2') (Eq. 27, with t_2' for its printed t_2)."""
    return mainline_station_m(front_start_m, mainline_speed_mps, nose_s + t2_s)


@kernel
def ramp_station_at_merge_m(
    mainline_speed_mps: float, ramp_speed_mps: float, accel_mps2: float
) -> float:
    """Returns S_R'(t_1 + t_2') = (v_0^2 - v_R0^2) / (2 a_r') (Eq. 28, with t_2' and a_r').

    Raises ValueError for an acceleration that is not positive.
    """
    if accel_mps2 <= 0.0:
        raise ValueError("acceleration must be positive")
    return (mainline_speed_mps * mainline_speed_mps - ramp_speed_mps * ramp_speed_mps) / (
        2.0 * accel_mps2
    )


@kernel
def front_balance_m(
    front_start_m: float,
    ramp_start_m: float,
    mainline_speed_mps: float,
    ramp_speed_mps: float,
    front_length_m: float,
    front_distance_m: float,
    accel_mps2: float,
) -> float:
    """Returns S_X - L_v - L_r-X - S_R' at the merge time t_1 + t_2', in m (Eq. 29).

    Zero where Eq. 29 holds, positive where the ramp vehicle keeps more than L_r-X from X.
    """
    nose_s = nose_time_s(ramp_start_m, ramp_speed_mps)
    t2_s = acceleration_time_s(mainline_speed_mps, ramp_speed_mps, accel_mps2)
    return (
        front_station_at_merge_m(front_start_m, mainline_speed_mps, nose_s, t2_s)
        - front_length_m
        - front_distance_m
        - ramp_station_at_merge_m(mainline_speed_mps, ramp_speed_mps, accel_mps2)
    )


@kernel
def acceleration_behind_front_mps2(
    front_start_m: float,
    ramp_start_m: float,
    mainline_speed_mps: float,
    ramp_speed_mps: float,
    front_length_m: float,
    front_distance_m: float,
) -> float:
    """Returns a_r' = -(v_0 - v_R0)^2 / (2 (x + v_0 |r| / v_R0 - L_v - L_r-X)) in m/s2 (Eq. 30).

    It puts the ramp vehicle ``front_distance_m`` behind X. Infinity where X is so far ahead that
    no acceleration reaches it.
    """
    nose_s = nose_time_s(ramp_start_m, ramp_speed_mps)
    behind_m = -(
        mainline_station_m(front_start_m, mainline_speed_mps, nose_s)
        - front_length_m
        - front_distance_m
    )
    return acceleration_for_lag_mps2(mainline_speed_mps, ramp_speed_mps, behind_m)


@kernel
def acceleration_range_mps2(
    highest_lag_m: float,
    lowest_lag_m: float,
    mainline_speed_mps: float,
    nose_speed_mps: float,
    lane_length_m: float,
    most_mps2: float,
) -> tuple[float, float]:
    """Returns the accelerations whose lag lies within bounds and that Eq. 22 allows, in m/s2.

    This is Eq. 30 read as an interval: with X and Y cruising,
    y + L_v + L_r-Y <= -v_0 t_1 - (v_0 - v_R0)^2 / (2 a') <= x - L_v - L_r-X.
    The range is empty where its first value exceeds its second.
    """
    least = least_acceleration_mps2(mainline_speed_mps, nose_speed_mps, lane_length_m)
    low = max(least, acceleration_for_lag_mps2(mainline_speed_mps, nose_speed_mps, highest_lag_m))
    high = min(
        most_mps2, acceleration_for_lag_mps2(mainline_speed_mps, nose_speed_mps, lowest_lag_m)
    )
    return low, high
