"""Eq. 26-31 for a ramp vehicle from -160 m at 16 m/s (t_1 = 10 s) and a mainline at 20 m/s."""

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from coramp.equations.ramp_acceleration import (
    acceleration_behind_front_mps2,
    acceleration_for_lag_mps2,
    acceleration_range_mps2,
    front_balance_m,
    front_station_at_merge_m,
    lag_m,
    ramp_station_at_merge_m,
)
from tests.mathematics import close


def test_lag_and_acceleration_are_inverse():
    assert lag_m(20.0, 16.0, 2.0) == close(4.0)  # 16 / 4
    assert acceleration_for_lag_mps2(20.0, 16.0, 4.0) == close(2.0)
    assert lag_m(20.0, 16.0, 0.5) == close(16.0)
    assert acceleration_for_lag_mps2(20.0, 16.0, 0.5) == close(16.0)


@pytest.mark.parametrize("lag", [0.0, -1.0])
def test_no_acceleration_reaches_a_lag_that_is_not_positive(lag):
    assert acceleration_for_lag_mps2(20.0, 16.0, lag) == math.inf


def test_eq_27_front_vehicle_at_the_merge_time():
    assert front_station_at_merge_m(-189.0, 20.0, 10.0, 8 / 3) == close(64.33333333333333)


def test_eq_28_ramp_vehicle_at_the_merge_time():
    assert ramp_station_at_merge_m(20.0, 16.0, 1.5) == close(48.0)  # 144 / 3


def test_eq_29_balance_at_the_merge_time():
    # 64.333.. - 5 - 0.5 - 48
    assert front_balance_m(-189.0, -160.0, 20.0, 16.0, 5.0, 0.5, 1.5) == close(10.833333333333334)


def test_eq_30_by_its_printed_form_in_km_h():
    # -(72 - 57.6)^2 / (25.92 (-198.5 + 72 * 160 / 57.6 - 5 - 0.5)) = 207.36 / (25.92 * 4)
    assert acceleration_behind_front_mps2(-198.5, -160.0, 20.0, 16.0, 5.0, 0.5) == close(2.0)


def test_eq_30_is_infinite_behind_a_vehicle_that_is_out_of_reach():
    assert acceleration_behind_front_mps2(-189.0, -160.0, 20.0, 16.0, 5.0, 0.5) == math.inf


@settings(max_examples=100, deadline=None)
@given(
    front_start_m=st.floats(-260.0, -195.0),
    ramp_speed_mps=st.floats(5.0, 19.0),
    front_length_m=st.floats(3.0, 20.0),
    front_distance_m=st.floats(0.0, 3.0),
)
def test_eq_30_solves_eq_29(front_start_m, ramp_speed_mps, front_length_m, front_distance_m):
    ramp_start_m = -10.0 * ramp_speed_mps
    accel_mps2 = acceleration_behind_front_mps2(
        front_start_m, ramp_start_m, 20.0, ramp_speed_mps, front_length_m, front_distance_m
    )
    if accel_mps2 == math.inf:
        assert front_start_m + 200.0 - front_length_m - front_distance_m >= -1e-9
        return
    balance_m = front_balance_m(
        front_start_m,
        ramp_start_m,
        20.0,
        ramp_speed_mps,
        front_length_m,
        front_distance_m,
        accel_mps2,
    )
    assert balance_m == pytest.approx(0.0, abs=1e-6 * (1.0 + 1.0 / accel_mps2))


def test_range_is_eq_22_cut_to_the_lags_of_the_gap():
    # lags 2 to 8 m are 16 / 16 = 1 and 16 / 4 = 4 m/s2
    assert acceleration_range_mps2(8.0, 2.0, 20.0, 16.0, 200.0, 6.0) == (close(1.0), close(4.0))


def test_range_keeps_to_eq_22_where_the_gap_is_longer():
    assert acceleration_range_mps2(80.0, 0.5, 20.0, 16.0, 200.0, 6.0) == (close(0.36), close(6.0))


def test_range_is_empty_for_a_gap_out_of_reach():
    low, high = acceleration_range_mps2(1.0, 0.5, 20.0, 16.0, 200.0, 6.0)
    assert low > high
    low, high = acceleration_range_mps2(-1.0, -2.0, 20.0, 16.0, 200.0, 6.0)
    assert low > high
    low, high = acceleration_range_mps2(30.0, 25.0, 20.0, 16.0, 200.0, 6.0)
    assert low > high


@pytest.mark.parametrize("function", [lag_m, ramp_station_at_merge_m])
def test_acceleration_must_be_positive(function):
    with pytest.raises(ValueError, match="acceleration must be positive"):
        function(20.0, 16.0, 0.0)
