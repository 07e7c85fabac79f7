"""Gaps on the mainline and the accelerations that a ramp vehicle may use (Eq. 21-23, 32, 33)."""

from coramp._kernel import kernel
from coramp.equations.conflict import merge_station_m


@kernel
def gap_m(front_station_m: float, rear_station_m: float, front_length_m: float) -> float:
    """Returns L = x - y - L_v, bumper to bumper; L_v of the front vehicle (after Eq. 36)."""
    return front_station_m - rear_station_m - front_length_m


@kernel
def least_acceleration_mps2(
    mainline_speed_mps: float, ramp_speed_mps: float, lane_length_m: float
) -> float:
    """Returns (v_0^2 - v_R0^2) / (2 S_a), the least that reaches v_0 on the lane (Eq. 21).

    Raises ValueError for a lane length that is not positive.
    """
    if lane_length_m <= 0.0:
        raise ValueError("acceleration lane must be longer than 0")
    return (mainline_speed_mps * mainline_speed_mps - ramp_speed_mps * ramp_speed_mps) / (
        2.0 * lane_length_m
    )


@kernel
def acceleration_allowed(
    accel_mps2: float,
    mainline_speed_mps: float,
    ramp_speed_mps: float,
    lane_length_m: float,
    most_mps2: float,
) -> bool:
    """Returns whether (v_0^2 - v_R0^2) / (2 S_a) <= a <= ``most_mps2`` (Eq. 22; 32 for a_r')."""
    least = least_acceleration_mps2(mainline_speed_mps, ramp_speed_mps, lane_length_m)
    return least <= accel_mps2 <= most_mps2


@kernel
def merge_station_allowed(
    accel_mps2: float, mainline_speed_mps: float, ramp_speed_mps: float, lane_length_m: float
) -> bool:
    """Returns whether 0 < S_R(t_1 + t_2) < ``lane_length_m`` (Eq. 23; Eq. 33 for t_2', a_r')."""
    station_m = merge_station_m(ramp_speed_mps, mainline_speed_mps, accel_mps2)
    return 0.0 < station_m < lane_length_m
