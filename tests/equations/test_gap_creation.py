"""Eq. 34-45 for 20 and 16 m/s, t_1 = 10 s, t_2' = 2.5 s and a gap that lacks 2.3 m."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from coramp.equations.gap_creation import (
    acceleration_in_time_mps2,
    cascade_shift_m,
    distance_driven_m,
    front_station_needed_m,
    half_distance_m,
    half_duration_s,
    largest_shift_m,
    merge_station_in_time_m,
    merge_time_from_front_s,
    merge_time_from_rear_s,
    missing_gap_m,
    shift_acceleration_mps2,
    shift_deceleration_mps2,
    speed_at_middle_mps,
    station_at_nose_time_m,
)
from tests.mathematics import close


def test_eq_34_and_35_stations_when_the_ramp_vehicle_passes_the_nose():
    assert station_at_nose_time_m(-189.0, 20.0, -160.0, 16.0) == close(11.0)
    assert station_at_nose_time_m(-217.0, 20.0, -160.0, 16.0) == close(-17.0)


def test_eq_36_missing_gap():
    assert missing_gap_m(6.5, 4.2) == close(2.3)


def test_eq_37_acceleration_in_the_time():
    assert acceleration_in_time_mps2(20.0, 16.0, 2.5) == close(1.6)
    assert acceleration_in_time_mps2(20.0, 16.0, 0.8) == close(5.0)


def test_eq_38_merge_station_in_the_time():
    assert merge_station_in_time_m(20.0, 16.0, 2.5) == close(45.0)  # 36 * 2.5 / 2


def test_eq_39_station_of_the_front_vehicle_at_the_nose_time():
    # 45 + 5 + 0.5 m, less 52.3 m
    assert front_station_needed_m(45.0, 5.0, 0.5, 20.0, 2.5, 2.3) == close(-1.8)


def test_eq_40_distance_driven():
    assert distance_driven_m(20.0, 2.5, 2.3) == close(52.3)


def test_eq_41_half_the_distance():
    # 20 * 1.25 + 1.472 * 1.25^2 / 2, half of 52.3
    assert half_distance_m(20.0, 2.5, 1.472) == close(26.15)


def test_eq_42_and_43_speeding_up_and_slowing_down():
    assert shift_acceleration_mps2(2.3, 2.5) == close(1.472)  # 9.2 / 6.25
    assert shift_deceleration_mps2(2.3, 2.5) == close(-1.472)
    assert shift_acceleration_mps2(-2.3, 2.5) == close(-1.472)
    assert shift_acceleration_mps2(0.1, 0.5) == close(1.6)


def test_eq_44_half_of_the_time():
    assert half_duration_s(2.5) == close(1.25)


def test_eq_45_speed_at_the_middle():
    assert speed_at_middle_mps(20.0, 2.3, 2.5) == close(21.84)  # 20 + 1.472 * 1.25
    assert speed_at_middle_mps(20.0, -2.3, 2.5) == close(18.16)


def test_time_from_the_front_vehicle_undoes_eq_39():
    # X at -1.8 m when the ramp vehicle passes the nose, as in the test of Eq. 39
    assert merge_time_from_front_s(-201.8, 10.0, 20.0, 16.0, 5.0, 0.5, 2.3) == close(2.5)


def test_time_from_the_rear_vehicle():
    # Y is at -10.5 m at the nose time: twice 5 m over 4 m/s
    assert merge_time_from_rear_s(-210.5, 10.0, 20.0, 16.0, 5.0, 0.5) == close(2.5)


@pytest.mark.parametrize(
    ("duration_s", "shift_m"),
    [
        (1.0, 0.735),  # by acceleration 2.94 * 1 / 4, by speed 0.1 * 20 * 1 / 2
        (2.0, 2.0),  # 2.94 and 2
        (10.0, 10.0),
        (0.0, 0.0),
        (-1.0, 0.0),
    ],
)
def test_largest_shift_keeps_both_bounds(duration_s, shift_m):
    assert largest_shift_m(20.0, duration_s, 2.94, 0.1) == close(shift_m)


@settings(max_examples=50, deadline=None)
@given(duration_s=st.floats(0.1, 20.0))
def test_largest_shift_reaches_one_of_its_bounds(duration_s):
    shift_m = largest_shift_m(20.0, duration_s, 2.94, 0.1)
    share_of_acceleration = 4.0 * shift_m / duration_s**2 / 2.94
    share_of_speed = 2.0 * shift_m / duration_s / 2.0
    assert max(share_of_acceleration, share_of_speed) == close(1.0)


def test_cascade_passes_on_what_the_spare_does_not_take():
    assert cascade_shift_m(3.0, 1.25, 0.0, 6.0) == close(1.75)
    assert cascade_shift_m(3.0, 4.0, 0.0, 6.0) == 0.0
    # where they are too near already, by no more than what is missing
    assert cascade_shift_m(3.0, -0.1, 0.0, 6.0) == close(3.1)
    assert cascade_shift_m(3.0, 1.25, 1.5, 0.0) == close(1.75)


def test_cascade_with_a_time_gap_looks_at_the_middle_too():
    # at the middle: 2 (1.5 * 2 * 3 / 6 - 1.25) + 3
    assert cascade_shift_m(3.0, 1.25, 1.5, 6.0) == close(3.5)
    # 2 (0.8 * 2 * 3 / 6 - 0.25) + 3, and 2 (0.5 * 2 * 0.3 / 0.5 - 0.1) + 0.3
    assert cascade_shift_m(3.0, 0.25, 0.8, 6.0) == close(4.1)
    assert cascade_shift_m(0.3, 0.1, 0.5, 0.5) == close(1.3)
    # at the end: 3 - 0.25, against 2 (0.1 * 2 * 3 / 6 - 0.25) + 3 = 2.7
    assert cascade_shift_m(3.0, 0.25, 0.1, 6.0) == close(2.75)


@settings(max_examples=100, deadline=None)
@given(shift_m=st.floats(0.1, 5.0), spare_m=st.floats(0.0, 5.0), duration_s=st.floats(2.0, 10.0))
def test_cascade_without_a_time_gap_is_enough_and_no_more(shift_m, spare_m, duration_s):
    leader_m = cascade_shift_m(shift_m, spare_m, 0.0, duration_s)
    u = np.linspace(0.0, 1.0, 201)
    done = np.where(u < 0.5, 2.0 * u**2, 1.0 - 2.0 * (1.0 - u) ** 2)
    least_m = (spare_m + (leader_m - shift_m) * done).min()
    assert least_m >= -1e-9
    assert leader_m == 0.0 or least_m == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("function", [merge_time_from_front_s, merge_time_from_rear_s])
def test_mainline_must_be_faster_than_the_ramp(function):
    distances = (5.0, 0.5, 2.3) if function is merge_time_from_front_s else (5.0, 0.5)
    with pytest.raises(ValueError, match="mainline speed must exceed ramp speed"):
        function(-201.8, 10.0, 16.0, 16.0, *distances)


def test_times_must_be_positive():
    with pytest.raises(ValueError, match="time must be positive"):
        acceleration_in_time_mps2(20.0, 16.0, 0.0)
    with pytest.raises(ValueError, match="duration must be positive"):
        shift_acceleration_mps2(2.3, 0.0)
