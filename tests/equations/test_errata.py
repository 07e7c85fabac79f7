"""Where the paper's equations are misprinted, incomplete or open, and how they are read here.

Printed forms are written out from the paper; km/h where it has km/h. The root of 3 comes from
v_Rx = v_0 cos 30 degrees.
"""

import math

import numpy as np
import pytest

from coramp.equations.conflict import CONFLICT_ALLOWANCE_M, in_conflict
from coramp.equations.conflict_risk import SEVERITY_THRESHOLD_M2PS4, conflict_severity_m2ps4
from coramp.equations.free_movement import ramp_station_m, ramp_trajectory
from coramp.equations.gap_creation import (
    acceleration_in_time_mps2,
    front_station_needed_m,
    merge_station_in_time_m,
    merge_time_from_front_s,
    merge_time_from_rear_s,
    missing_gap_m,
    shift_acceleration_mps2,
    station_at_nose_time_m,
)
from coramp.equations.gaps import gap_m, least_acceleration_mps2
from coramp.equations.ramp_acceleration import (
    acceleration_behind_front_mps2,
    acceleration_range_mps2,
    front_balance_m,
    lag_m,
)
from coramp.equations.safe_distance import (
    merge_distance_m,
    merging_speed_along_mps,
    minimum_merge_gap_m,
    safe_distance_m,
)
from coramp.kinematics.fuel import fuel_rate_mlps
from tests.mathematics import SAFETY, close, sampled

ALONG_20 = 17.320508075688772
L_RX_20 = 0.7583002436540073


def test_eq_48_has_the_coefficients_of_table_3_not_its_own():
    v = 20.0
    printed = 0.1596 + 0.0245 * v - 7.145e-4 * v**2 + 5.975e-5 * v**3
    assert printed == close(0.8418)
    assert fuel_rate_mlps(v, 0.0) == close(0.8283)


def test_merging_vehicle_s_longitudinal_part_of_speed_is_compared():
    along_mps = merging_speed_along_mps(20.0, math.pi / 6.0)
    assert along_mps == close(ALONG_20)  # the lateral part would be 10 m/s


@pytest.mark.parametrize(
    ("front_mps", "merging_mps", "needed_m"),
    [
        (18.0, 20.0, 0.0861923128504408),
        (20.0, 20.0, L_RX_20),
        (250 / 9, 250 / 9, 1.4256100379128228),
    ],
)
def test_eq_15_asks_more_of_a_merge_behind_a_leader_that_pulls_away(
    front_mps, merging_mps, needed_m
):
    along_mps = merging_speed_along_mps(merging_mps, math.pi / 6.0)
    assert along_mps < front_mps
    assert merge_distance_m(along_mps, front_mps, SAFETY) == close(needed_m)
    # Eq. 3 asks nothing for a slower follower: 4 cm and the clock error are left
    assert safe_distance_m(front_mps, along_mps, SAFETY) < 0.0400002


def test_eq_15_lacks_only_the_clock_error_of_eq_1():
    # at the same closing speed the two differ by L_2 = 3e-9 (18 + 20)
    by_eq_1_m = safe_distance_m(18.0, 20.0, SAFETY)
    assert by_eq_1_m - merge_distance_m(20.0, 18.0, SAFETY) == pytest.approx(1.14e-7, rel=1e-6)


def test_eq_2_and_3_are_read_by_roles_so_that_the_faster_follower_needs_more():
    faster_follower_m = safe_distance_m(17.0, 20.0, SAFETY)
    slower_follower_m = safe_distance_m(20.0, 17.0, SAFETY)
    # Eq. 3 in km/h, Eq. 2 in m/s
    assert faster_follower_m - slower_follower_m == close((72.0 - 61.2) ** 2 / (254 * 0.51))


def test_merge_without_conflict_by_eq_20_can_break_eq_15():
    # the ramp vehicle 5.1 m behind X: 0.1 m between bumpers, where Eq. 15 asks for 0.758 m
    assert not in_conflict(100.0, 105.1, 5.0, CONFLICT_ALLOWANCE_M)
    assert merge_distance_m(ALONG_20, 20.0, SAFETY) > 0.75
    assert in_conflict(100.0, 105.1, 5.0, merge_distance_m(ALONG_20, 20.0, SAFETY))


def test_eq_9_as_printed_depends_on_the_observer():
    printed, relative = conflict_severity_m2ps4(20.0, 17.0, 10.0)
    assert printed / relative == close(37 / 3)  # 12.3 times
    printed_10_slower, relative_10_slower = conflict_severity_m2ps4(10.0, 7.0, 10.0)
    assert relative_10_slower == close(relative)
    assert printed_10_slower == close(printed * 17 / 37)


def test_severity_at_the_tight_gap_of_eq_15_is_far_beyond_its_threshold():
    printed, relative = conflict_severity_m2ps4(20.0, ALONG_20, L_RX_20)
    # a = 5 (20 - 10 root 3) / 2; 100 and (20 - 10 root 3)^2 over twice the distance
    assert printed == close(441.693766211851813)
    assert relative == close(31.712185621455411)
    assert SEVERITY_THRESHOLD_M2PS4 < 8.65


# 100 and 60 km/h from -100 m, t_1 = 6 s; a_r = 2 and a_r' = 1.5 m/s2
V0, V_R0, T1 = 250 / 9, 50 / 3, 6.0
T2, T2_PRIME = 50 / 9, 200 / 27


def test_eq_31_as_printed_jumps_and_with_t2_prime_does_not():
    merge_s = T1 + T2_PRIME
    second_stage_m = V_R0 * T2_PRIME + 0.75 * T2_PRIME**2
    printed_third_m = V_R0 * T2 + 0.75 * T2**2 + V0 * (merge_s - T1 - T2)
    jump_m = printed_third_m - second_stage_m
    assert jump_m == close(1875 / 729)  # 2.57 m
    before_m = ramp_station_m(-100.0, V_R0, V0, 1.5, merge_s - 1e-9)
    after_m = ramp_station_m(-100.0, V_R0, V0, 1.5, merge_s + 1e-9)
    assert before_m == pytest.approx(second_stage_m, abs=1e-6)
    assert after_m == pytest.approx(second_stage_m, abs=1e-6)


def test_trajectory_of_eq_31_is_continuous_in_station_and_speed():
    way = ramp_trajectory(0.0, -100.0, V_R0, V0, 1.5)
    just_before = np.nextafter(way[1:, 0], 0.0)
    assert np.array(sampled(way, just_before)) == close(way[1:, 1:3].T)
    assert way[2, 0] == close(T1 + T2_PRIME)


def test_eq_30_follows_from_eq_29_only_with_t2_prime():
    front_start_m = -170.0
    a = acceleration_behind_front_mps2(front_start_m, -100.0, V0, V_R0, 5.0, 1.4)
    # in km/h as printed: 40^2 / (25.92 * 9.7333..)
    assert a == close(40.0**2 / (25.92 * (170.0 - 100.0 * 100.0 / 60.0 + 6.4)))
    t2_prime_s = (V0 - V_R0) / a
    ramp_m = (V0**2 - V_R0**2) / (2.0 * a)
    with_t2_prime = front_start_m + V0 * (T1 + t2_prime_s) - 5.0 - 1.4 - ramp_m
    with_t2 = front_start_m + V0 * (T1 + T2) - 5.0 - 1.4 - ramp_m
    assert with_t2_prime == close(0.0)
    assert abs(with_t2) > 10.0
    assert front_balance_m(front_start_m, -100.0, V0, V_R0, 5.0, 1.4, a) == close(0.0)


@pytest.mark.parametrize(("x_m", "y_m"), [(-201.0, -210.5), (-205.0, -212.0), (-198.0, -206.0)])
def test_eq_39_to_41_give_one_time_whether_from_the_front_or_from_the_rear(x_m, y_m):
    needed_m = minimum_merge_gap_m(5.0, 0.5, 0.7)
    shift_m = missing_gap_m(needed_m, gap_m(x_m, y_m, 5.0))
    assert shift_m == close(6.2 - (x_m - y_m - 5.0))
    from_front_s = merge_time_from_front_s(x_m, 10.0, 20.0, 16.0, 5.0, 0.5, shift_m)
    from_rear_s = merge_time_from_rear_s(y_m, 10.0, 20.0, 16.0, 5.0, 0.7)
    assert from_front_s == close(from_rear_s)
    assert from_rear_s == close(-2.0 * (y_m + 200.0 + 5.0 + 0.7) / 4.0)  # X cancels


def test_eq_39_holds_for_the_station_of_x_at_t1_not_for_its_distance():
    x_m, y_m = -203.0, -210.7
    shift_m = missing_gap_m(6.2, gap_m(x_m, y_m, 5.0))
    t2_s = merge_time_from_front_s(x_m, 10.0, 20.0, 16.0, 5.0, 0.5, shift_m)
    merge_m = merge_station_in_time_m(20.0, 16.0, t2_s)
    station_m = station_at_nose_time_m(x_m, 20.0, -160.0, 16.0)
    assert front_station_needed_m(merge_m, 5.0, 0.5, 20.0, t2_s, shift_m) == close(station_m)
    # X, moved by the two halves of Eq. 41, is then just far enough ahead
    half_s, accel_mps2 = 0.5 * t2_s, shift_acceleration_mps2(shift_m, t2_s)
    middle_mps = 20.0 + accel_mps2 * half_s
    x_end_m = station_m + 2.0 * 0.5 * (20.0 + middle_mps) * half_s
    assert x_end_m - 5.0 - 0.5 == close(merge_m)
    assert acceleration_in_time_mps2(20.0, 16.0, t2_s) == close(4.0 / t2_s)


def test_reading_1_eq_29_reaches_only_a_window_of_15_and_a_half_metres():
    # with 20 and 17 m/s: X's station at t_1 is L_v + L_r-X less a lag of 9 / (2 a)
    t1_s, stations_m = 10.0, []
    for a in (least_acceleration_mps2(20.0, 17.0, 200.0), 6.0):
        x_m = 5.0 + L_RX_20 - 4.5 / a
        found_mps2 = acceleration_behind_front_mps2(
            x_m - 20.0 * t1_s, -17.0 * t1_s, 20.0, 17.0, 5.0, L_RX_20
        )
        assert found_mps2 == close(a)
        stations_m.append(x_m)
    assert stations_m == pytest.approx([-10.5, 5.0], abs=0.05)
    assert stations_m[1] - stations_m[0] == pytest.approx(15.5, abs=0.05)
    beyond = acceleration_behind_front_mps2(5.02 - 200.0, -170.0, 20.0, 17.0, 5.0, L_RX_20)
    behind = acceleration_behind_front_mps2(-10.5 - 200.0, -170.0, 20.0, 17.0, 5.0, L_RX_20)
    assert beyond > 6.0
    assert behind < 0.2775


def test_reading_1_a_long_gap_leaves_a_range_where_eq_29_has_a_point():
    # X 20 m and Y 20 m around the one who passes the nose at v_0: every acceleration is possible
    x_m, y_m = 20.0, -25.0
    highest_lag_m, lowest_lag_m = -(y_m + 5.0 + L_RX_20), -(x_m - 5.0 - L_RX_20)
    low, high = acceleration_range_mps2(highest_lag_m, lowest_lag_m, 20.0, 17.0, 200.0, 6.0)
    assert (low, high) == (close(0.2775), 6.0)
    assert acceleration_behind_front_mps2(-180.0, -170.0, 20.0, 17.0, 5.0, L_RX_20) == math.inf


def test_reading_2_a_ramp_vehicle_gains_little_and_can_fall_back_far():
    free_m = lag_m(20.0, 17.0, 2.0)
    assert free_m - lag_m(20.0, 17.0, 6.0) == close(1.5)
    slowest_m = lag_m(20.0, 17.0, least_acceleration_mps2(20.0, 17.0, 200.0))
    assert slowest_m - free_m == close(4.5 / 0.2775 - 2.25)
    assert slowest_m - free_m == pytest.approx(14.0, abs=0.05)
