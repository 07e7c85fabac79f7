"""Which mainline vehicle a ramp vehicle in free movement would conflict with (Eq. 18-20)."""

from coramp._kernel import FloatArray, kernel
from coramp.equations.free_movement import acceleration_time_s, mainline_station_m

CONFLICT_ALLOWANCE_M = 0.04
"""2 L_1 of the paper, the constant that Eq. 20 prints."""


@kernel
def merge_station_m(ramp_speed_mps: float, mainline_speed_mps: float, accel_mps2: float) -> float:
    """Returns S_R(t_1 + t_2) = v_R0 t_2 + a_r t_2^2 / 2 in m beyond the nose (Eq. 18)."""
    t2_s = acceleration_time_s(mainline_speed_mps, ramp_speed_mps, accel_mps2)
    return ramp_speed_mps * t2_s + 0.5 * accel_mps2 * t2_s * t2_s


@kernel
def mainline_station_at_merge_m(start_m: float, speed_mps: float, merge_time_s: float) -> float:
    """Returns S_main(t_1 + t_2) = x_0 + v_0 (t_1 + t_2) (Eq. 19)."""
    return mainline_station_m(start_m, speed_mps, merge_time_s)


@kernel
def in_conflict(
    ramp_station_m: float, mainline_station_m: float, vehicle_length_m: float, allowance_m: float
) -> bool:
    """Returns whether |S_R - S_main| <= L_v + allowance at the merge time (Eq. 20).

    The paper's allowance is 0.04 m. A merge outside it can still break Eq. 15 or 16, so every
    merge is asked for these as well.
    """
    return abs(ramp_station_m - mainline_station_m) <= vehicle_length_m + allowance_m


@kernel
def conflict_index(
    ramp_station_m: float,
    mainline_stations_m: FloatArray,
    vehicle_length_m: float,
    allowance_m: float,
) -> int:
    """Returns the index of the conflicting station, -1 if none conflicts (Eq. 20).

    Of two that conflict it is the one further ahead, as the paper has it.
    """
    chosen = -1
    for k in range(len(mainline_stations_m)):
        if in_conflict(ramp_station_m, mainline_stations_m[k], vehicle_length_m, allowance_m) and (
            chosen < 0 or mainline_stations_m[k] > mainline_stations_m[chosen]
        ):
            chosen = k
    return chosen
