"""Free movement: what vehicles do when nobody coordinates them (Eq. 10-14).

Mainline vehicles cruise at v0. A ramp vehicle cruises at v_R0 to the nose (station 0), accelerates
with a_r to v0 on the acceleration lane and merges at once. Times start at 0; stations are in m.
"""

import numpy as np

from coramp._kernel import FloatArray, kernel
from coramp.kinematics.trajectory import begin, drive, drive_to_speed


@kernel
def mainline_station_m(start_m: float, speed_mps: float, time_s: float) -> float:
    """Returns S_main = x_0 + v_0 t (Eq. 10)."""
    return start_m + speed_mps * time_s


@kernel
def nose_time_s(start_m: float, ramp_speed_mps: float) -> float:
    """Returns t_1 = |r| / v_R0, the time to the nose from ``start_m`` <= 0 (Eq. 24).

    Raises ValueError for a ramp speed that is not positive.
    """
    if ramp_speed_mps <= 0.0:
        raise ValueError("ramp speed must be positive")
    return abs(start_m) / ramp_speed_mps


@kernel
def acceleration_time_s(
    mainline_speed_mps: float, ramp_speed_mps: float, accel_mps2: float
) -> float:
    """Returns t_2 = (v_0 - v_R0) / a_r, the time on the acceleration lane (Eq. 25, 26).

    Raises ValueError for an acceleration that is not positive.
    """
    if accel_mps2 <= 0.0:
        raise ValueError("acceleration must be positive")
    return (mainline_speed_mps - ramp_speed_mps) / accel_mps2


@kernel
def ramp_stage_1_m(start_m: float, ramp_speed_mps: float, time_s: float) -> float:
    """Returns S_1(t) = r + v_R0 t, before the nose (Eq. 11)."""
    return start_m + ramp_speed_mps * time_s


@kernel
def ramp_stage_2_m(
    start_m: float, ramp_speed_mps: float, accel_mps2: float, time_s: float
) -> float:
    """Returns S_2(t) = S_1(t_1) + v_R0 (t - t_1) + a_r (t - t_1)^2 / 2, from t_1 on (Eq. 12)."""
    nose_s = nose_time_s(start_m, ramp_speed_mps)
    since_nose_s = time_s - nose_s
    return (
        ramp_stage_1_m(start_m, ramp_speed_mps, nose_s)
        + ramp_speed_mps * since_nose_s
        + 0.5 * accel_mps2 * since_nose_s * since_nose_s
    )


@kernel
def ramp_stage_3_m(
    start_m: float,
    ramp_speed_mps: float,
    mainline_speed_mps: float,
    accel_mps2: float,
    time_s: float,
) -> float:
    """Returns S_3(t) = S_2(t_1 + t_2) + v_0 (t - t_1 - t_2), on the mainline (Eq. 13)."""
    merge_s = nose_time_s(start_m, ramp_speed_mps) + acceleration_time_s(
        mainline_speed_mps, ramp_speed_mps, accel_mps2
    )
    return ramp_stage_2_m(start_m, ramp_speed_mps, accel_mps2, merge_s) + mainline_speed_mps * (
        time_s - merge_s
    )


@kernel
def ramp_station_m(
    start_m: float,
    ramp_speed_mps: float,
    mainline_speed_mps: float,
    accel_mps2: float,
    time_s: float,
) -> float:
    """Returns S_ramp(t), the stage that holds at ``time_s`` (Eq. 14; with a_r' it is Eq. 31)."""
    nose_s = nose_time_s(start_m, ramp_speed_mps)
    merge_s = nose_s + acceleration_time_s(mainline_speed_mps, ramp_speed_mps, accel_mps2)
    if time_s < nose_s:
        return ramp_stage_1_m(start_m, ramp_speed_mps, time_s)
    if time_s <= merge_s:
        return ramp_stage_2_m(start_m, ramp_speed_mps, accel_mps2, time_s)
    return ramp_stage_3_m(start_m, ramp_speed_mps, mainline_speed_mps, accel_mps2, time_s)


@kernel
def ramp_trajectory(
    start_s: float,
    start_m: float,
    ramp_speed_mps: float,
    mainline_speed_mps: float,
    accel_mps2: float,
) -> FloatArray:
    """Returns Eq. 14 (or Eq. 31) as a trajectory from ``start_s`` on, of 3 pieces or less."""
    out = np.empty((3, 4))
    n = begin(out, start_s, start_m, ramp_speed_mps)
    n = drive(out, n, 0.0, nose_time_s(start_m, ramp_speed_mps))
    n = drive_to_speed(out, n, accel_mps2, mainline_speed_mps)
    return out[:n]
