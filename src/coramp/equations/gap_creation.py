"""Making a gap: how far and how fast vehicles move aside (Eq. 34-45).

Vehicle X speeds up for the first half of a time T and slows down by as much in the second, so that
it ends at its old speed, ``shift`` further on. The same holds for Y with a negative shift.
"""

from coramp._kernel import kernel
from coramp.equations.free_movement import mainline_station_m, nose_time_s
from coramp.equations.ramp_acceleration import ramp_station_at_merge_m


@kernel
def station_at_nose_time_m(
    start_m: float, mainline_speed_mps: float, ramp_start_m: float, ramp_speed_mps: float
) -> float:
    """Returns S(t_1) = x + v_0 |r| / v_R0 in m, of X (Eq. 34) or of Y (Eq. 35)."""
    return mainline_station_m(
        start_m, mainline_speed_mps, nose_time_s(ramp_start_m, ramp_speed_mps)
    )


@kernel
def missing_gap_m(needed_m: float, gap_m: float) -> float:
    """Returns dL_X = L_min s - L in m, by how far the gap is too short (Eq. 36)."""
    return needed_m - gap_m


@kernel
def acceleration_in_time_mps2(
    mainline_speed_mps: float, ramp_speed_mps: float, t2_s: float
) -> float:
    """Returns a_r' = (v_0 - v_R0) / t_2' in m/s2 (Eq. 37).

    Raises ValueError for a time that is not positive.
    """
    if t2_s <= 0.0:
        raise ValueError("time must be positive")
    return (mainline_speed_mps - ramp_speed_mps) / t2_s


@kernel
def merge_station_in_time_m(mainline_speed_mps: float, ramp_speed_mps: float, t2_s: float) -> float:
    """Returns S_mr' = (v_0 + v_R0) t_2' / 2 in m (Eq. 38)."""
    return ramp_station_at_merge_m(
        mainline_speed_mps,
        ramp_speed_mps,
        acceleration_in_time_mps2(mainline_speed_mps, ramp_speed_mps, t2_s),
    )


@kernel
def front_station_needed_m(
    merge_station_m: float,
    front_length_m: float,
    front_distance_m: float,
    mainline_speed_mps: float,
    t2_s: float,
    shift_m: float,
) -> float:
    """Returns X's station at t_1, S_mr' + L_v + L_r-X - (v_0 t_2' + dL_X) in m (Eq. 39)."""
    return (
        merge_station_m
        + front_length_m
        + front_distance_m
        - distance_driven_m(mainline_speed_mps, t2_s, shift_m)
    )


@kernel
def merge_time_from_front_s(
    front_start_m: float,
    nose_s: float,
    mainline_speed_mps: float,
    ramp_speed_mps: float,
    front_length_m: float,
    front_distance_m: float,
    shift_m: float,
) -> float:
    """Returns t_2' = 2 (L_v + L_r-X - dL_X - x - v_0 t_1) / (v_0 - v_R0) in s.

    Eq. 34, 38 and 39 solved for t_2', which the paper leaves out. Negative or zero where the ramp
    vehicle cannot come as far forward. Raises ValueError unless v_0 > v_R0.
    """
    if mainline_speed_mps <= ramp_speed_mps:
        raise ValueError("mainline speed must exceed ramp speed")
    behind_m = (
        front_length_m
        + front_distance_m
        - shift_m
        - mainline_station_m(front_start_m, mainline_speed_mps, nose_s)
    )
    return 2.0 * behind_m / (mainline_speed_mps - ramp_speed_mps)


@kernel
def merge_time_from_rear_s(
    rear_start_m: float,
    nose_s: float,
    mainline_speed_mps: float,
    ramp_speed_mps: float,
    vehicle_length_m: float,
    rear_distance_m: float,
) -> float:
    """Returns t_2' = -2 (y + v_0 t_1 + L_v + L_r-Y) / (v_0 - v_R0) in s.

    The same as ``merge_time_from_front_s`` once dL_X of Eq. 36 is put in: X cancels. Raises
    ValueError unless v_0 > v_R0.
    """
    if mainline_speed_mps <= ramp_speed_mps:
        raise ValueError("mainline speed must exceed ramp speed")
    ahead_m = (
        mainline_station_m(rear_start_m, mainline_speed_mps, nose_s)
        + vehicle_length_m
        + rear_distance_m
    )
    return -2.0 * ahead_m / (mainline_speed_mps - ramp_speed_mps)


@kernel
def distance_driven_m(mainline_speed_mps: float, duration_s: float, shift_m: float) -> float:
    """Returns S_X = v_0 t_2' + dL_X in m, what X drives while it makes the gap (Eq. 40)."""
    return mainline_speed_mps * duration_s + shift_m


@kernel
def half_distance_m(mainline_speed_mps: float, duration_s: float, accel_mps2: float) -> float:
    """Returns S_X / 2 = v_0 t_2' / 2 + a_Xacc (t_2' / 2)^2 / 2 in m (Eq. 41).

    Slowing down to v0 in the second half covers just as much as speeding up in the first.
    """
    half_s = 0.5 * duration_s
    return mainline_speed_mps * half_s + 0.5 * accel_mps2 * half_s * half_s


@kernel
def shift_acceleration_mps2(shift_m: float, duration_s: float) -> float:
    """Returns a_Xacc = 4 dL_X / t_2'^2 in m/s2, signed like the shift (Eq. 42).

    Raises ValueError for a duration that is not positive.
    """
    if duration_s <= 0.0:
        raise ValueError("duration must be positive")
    return 4.0 * shift_m / (duration_s * duration_s)


@kernel
def shift_deceleration_mps2(shift_m: float, duration_s: float) -> float:
    """Returns a_Xdec = -4 dL_X / t_2'^2 in m/s2 (Eq. 43)."""
    return -shift_acceleration_mps2(shift_m, duration_s)


@kernel
def half_duration_s(duration_s: float) -> float:
    """Returns t_Xacc = t_Xdec = t_2' / 2 (Eq. 44)."""
    return 0.5 * duration_s


@kernel
def speed_at_middle_mps(mainline_speed_mps: float, shift_m: float, duration_s: float) -> float:
    """Returns v_t = v_0 + a_Xacc t_Xacc in m/s, the speed furthest from v_0 (Eq. 45)."""
    return mainline_speed_mps + shift_acceleration_mps2(shift_m, duration_s) * half_duration_s(
        duration_s
    )


@kernel
def largest_shift_m(
    mainline_speed_mps: float, duration_s: float, most_mps2: float, speed_deviation: float
) -> float:
    """Returns the largest |shift| (m) in a time, from Eq. 42 and 45 and the bounds on both.

    |a| <= ``most_mps2`` and |v_t - v_0| <= ``speed_deviation`` v_0, the deviation in the direction
    of the shift.
    """
    if duration_s <= 0.0:
        return 0.0
    by_acceleration_m = 0.25 * most_mps2 * duration_s * duration_s
    by_speed_m = 0.5 * speed_deviation * mainline_speed_mps * duration_s
    return min(by_acceleration_m, by_speed_m)


@kernel
def cascade_shift_m(shift_m: float, spare_m: float, time_gap_s: float, duration_s: float) -> float:
    """Returns by how far (m, >= 0) the next vehicle must move with one that moves ``shift_m`` >= 0.

    ``spare_m`` is the distance between them beyond the planned clearance. Both move by triangles
    over the same time, so their distance changes by the difference of the shifts and is smallest
    at the end: the next vehicle moves by ``shift - spare``. A time gap asks for ``time_gap`` times
    the speed that the follower has more in between, ``2 shift / T`` at most, half-way, where half
    of the difference is made up.
    """
    needed_m = shift_m - spare_m
    if time_gap_s > 0.0 and duration_s > 0.0:
        at_middle_m = 2.0 * (time_gap_s * 2.0 * shift_m / duration_s - spare_m) + shift_m
        needed_m = max(needed_m, at_middle_m)
    return max(0.0, needed_m)
