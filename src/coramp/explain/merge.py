"""The merge that a decision chose: its acceleration, and the gap that is made for it."""

import math

from coramp.equations.gap_creation import (
    acceleration_in_time_mps2,
    distance_driven_m,
    front_station_needed_m,
    half_distance_m,
    half_duration_s,
    merge_station_in_time_m,
    merge_time_from_front_s,
    merge_time_from_rear_s,
    missing_gap_m,
    shift_acceleration_mps2,
    shift_deceleration_mps2,
    speed_at_middle_mps,
    station_at_nose_time_m,
)
from coramp.equations.gaps import (
    acceleration_allowed,
    least_acceleration_mps2,
    merge_station_allowed,
)
from coramp.equations.ramp_acceleration import (
    acceleration_behind_front_mps2,
    acceleration_range_mps2,
    front_balance_m,
    front_station_at_merge_m,
    ramp_station_at_merge_m,
)
from coramp.explain.case import Merge
from coramp.explain.quantity import Quantity

ROUNDING_M, ROUNDING_MPS2 = 1e-6, 1e-9
"""What rounding may take from the bounds of Eq. 22."""


def least_effort(merge: Merge) -> list[Quantity]:
    """Returns the quantities of a merge whose way is planned as a whole, from the decision on."""
    return [
        Quantity("", "L", "gap between X and Y", merge.gap_m, "m"),
        Quantity("36", "dL", "way that X or Y is moved", merge.largest_shift_m, "m"),
        Quantity(
            "", "u", "largest acceleration on the way of least effort", merge.accel_mps2, "m/s2"
        ),
        Quantity("", "", "merge station", merge.merge_m, "m"),
        Quantity("", "", "merge time", merge.merge_s, "s"),
    ]


def acceleration(merge: Merge) -> list[Quantity]:
    """Returns the bounds of the acceleration, the one chosen, and where it leads."""
    v0, nose_mps, accel = merge.v0_mps, merge.nose_mps, merge.accel_mps2
    road, most = merge.rules.road, merge.rules.motion.ramp_acceleration_mps2
    last_m, lane_m = road.last_merge_station_m, road.acceleration_lane_m
    allowed = acceleration_allowed(accel, v0, nose_mps, last_m + ROUNDING_M, most + ROUNDING_MPS2)
    least = least_acceleration_mps2(v0, nose_mps, last_m)
    return [
        Quantity("21", "a_r", "least acceleration that reaches v0 in time", least, "m/s2"),
        Quantity("22", "a_r", "largest acceleration", most, "m/s2"),
        Quantity("", "L", "gap between X and Y", merge.gap_m, "m"),
        *_within_gap(merge),
        Quantity("31", "a_r'", "acceleration chosen", accel, "m/s2"),
        Quantity("32", "", "within Eq. 22", bool(allowed)),
        Quantity("26", "t_2'", "time on the acceleration lane", merge.t2_s, "s"),
        Quantity(
            "27",
            "S_X",
            "station of X at the merge had it kept v0",
            front_station_at_merge_m(merge.x_m, v0, merge.t1_s, merge.t2_s),
            "m",
        ),
        Quantity("28", "S_R'", "merge station", ramp_station_at_merge_m(v0, nose_mps, accel), "m"),
        Quantity(
            "29",
            "",
            "distance to X beyond the least planned, had it kept v0",
            front_balance_m(
                merge.x_m, merge.r_m, v0, nose_mps, merge.front_length_m, merge.clearance_m, accel
            ),
            "m",
        ),
        Quantity(
            "33",
            "",
            "merge within the acceleration lane",
            bool(merge_station_allowed(accel, v0, nose_mps, lane_m)),
        ),
        Quantity("", "t_1 + t_2'", "merge time", merge.merge_s, "s"),
    ]


def _within_gap(merge: Merge) -> list[Quantity]:
    """The accelerations that end within the gap as it was (Eq. 30); none where it was too small."""
    v0, nose_mps, own_m = merge.v0_mps, merge.nose_mps, merge.length_m
    front_length_m, clearance_m = merge.front_length_m, merge.clearance_m
    at_nose_x_m = station_at_nose_time_m(merge.x_m, v0, merge.r_m, nose_mps)
    at_nose_y_m = station_at_nose_time_m(merge.y_m, v0, merge.r_m, nose_mps)
    lowest_lag_m = -(at_nose_x_m - front_length_m - clearance_m)
    highest_lag_m = -(at_nose_y_m + own_m + clearance_m)
    low, high = acceleration_range_mps2(
        math.inf if math.isnan(highest_lag_m) else highest_lag_m,
        0.0 if math.isnan(lowest_lag_m) else lowest_lag_m,
        v0,
        nose_mps,
        merge.rules.road.last_merge_station_m,
        merge.rules.motion.ramp_acceleration_mps2,
    )
    lines = []
    if not merge.scenario:
        behind = acceleration_behind_front_mps2(
            merge.x_m, merge.r_m, v0, nose_mps, front_length_m, clearance_m
        )
        lines.append(
            Quantity("30", "a_r'", "acceleration that ends right behind X", behind, "m/s2")
        )
    if low <= high:
        lines += [
            Quantity("30", "a_r'", "least within the gap", low, "m/s2"),
            Quantity("30", "a_r'", "largest within the gap", high, "m/s2"),
        ]
    return lines


def creation(merge: Merge) -> list[Quantity]:
    """Returns the gap that is made and how X or Y moves for it; of both, how X does."""
    v0, nose_mps, t2_s = merge.v0_mps, merge.nose_mps, merge.t2_s
    moves_m = merge.ahead_m if merge.ahead_m > 0.0 else -merge.back_m
    merge_m = merge_station_in_time_m(v0, nose_mps, t2_s)
    missing_m = missing_gap_m(merge.required_gap_m, merge.gap_m)
    lines = [
        Quantity("34", "S_X(t_1)", "station of X at t_1", _at_nose(merge, merge.x_m), "m"),
        Quantity("35", "S_Y(t_1)", "station of Y at t_1", _at_nose(merge, merge.y_m), "m"),
        Quantity("36", "dL", "missing gap", missing_m, "m"),
    ]
    if merge.ahead_m > 0.0:
        lines.append(Quantity("", "dL_X", "way that X moves ahead", merge.ahead_m, "m"))
    if merge.back_m > 0.0:
        lines.append(Quantity("", "dL_Y", "way that Y falls back", merge.back_m, "m"))
    if merge.scenario == 1:
        lines += _front_moves(merge, moves_m, merge_m)
    lines += [
        Quantity(
            "37",
            "a_r'",
            "acceleration of the ramp vehicle",
            acceleration_in_time_mps2(v0, nose_mps, t2_s),
            "m/s2",
        ),
        Quantity("38", "S_mr'", "merge station", merge_m, "m"),
    ]
    return [*lines, *_shift(v0, merge.window_s, moves_m)] if moves_m else lines


def _front_moves(merge: Merge, shift_m: float, merge_m: float) -> list[Quantity]:
    """When X alone moves: the time that Eq. 34, 38 and 39 give, and where X has to be (Eq. 39)."""
    v0, nose_mps, clearance_m = merge.v0_mps, merge.nose_mps, merge.clearance_m
    from_front_s = merge_time_from_front_s(
        merge.x_m, merge.t1_s, v0, nose_mps, merge.front_length_m, clearance_m, shift_m
    )
    from_rear_s = merge_time_from_rear_s(
        merge.y_m, merge.t1_s, v0, nose_mps, merge.length_m, clearance_m
    )
    needed_m = front_station_needed_m(
        merge_m, merge.front_length_m, clearance_m, v0, merge.t2_s, shift_m
    )
    meaning = "station that X needs at t_1 to make the gap from there"
    return [
        Quantity("34, 38, 39", "t_2'", "right behind X once it has moved", from_front_s, "s"),
        Quantity("34, 38, 39", "t_2'", "right before Y", from_rear_s, "s"),
        Quantity("39", "S_X", meaning, needed_m, "m"),
    ]


def _shift(v0_mps: float, window_s: float, shift_m: float) -> list[Quantity]:
    """How a vehicle moves by a shift (m, positive ahead) within a window."""
    accel = shift_acceleration_mps2(shift_m, window_s)
    way_m = distance_driven_m(v0_mps, window_s, shift_m)
    dec = shift_deceleration_mps2(shift_m, window_s)
    middle_mps = speed_at_middle_mps(v0_mps, shift_m, window_s)
    half_m = half_distance_m(v0_mps, window_s, accel)
    return [
        Quantity("", "T", "time for the shift", window_s, "s"),
        Quantity("40", "S_X", "way driven in that time", way_m, "m"),
        Quantity("41", "S_X / 2", "half of it", half_m, "m"),
        Quantity("42", "a_acc", "first half", accel, "m/s2"),
        Quantity("43", "a_dec", "second half", dec, "m/s2"),
        Quantity("44", "t_acc", "half of the time", half_duration_s(window_s), "s"),
        Quantity("45", "v_t", "speed half-way", middle_mps, "m/s"),
    ]


def _at_nose(merge: Merge, station_m: float) -> float:
    return station_at_nose_time_m(station_m, merge.v0_mps, merge.r_m, merge.nose_mps)
