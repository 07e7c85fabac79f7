"""Eq. 21-23, 32, 33, with 20 and 16 m/s: (400 - 256) / 400 = 0.36 m/s2 on 200 m."""

import pytest

from coramp.equations.gaps import (
    acceleration_allowed,
    gap_m,
    least_acceleration_mps2,
    merge_station_allowed,
)
from tests.mathematics import close


def test_gap_is_bumper_to_bumper_behind_the_front_vehicle():
    assert gap_m(51.0, 23.0, 7.0) == close(21.0)


def test_eq_21_least_acceleration():
    assert least_acceleration_mps2(20.0, 16.0, 200.0) == close(0.36)
    assert least_acceleration_mps2(20.0, 17.0, 200.0) == close(0.2775)
    assert least_acceleration_mps2(2.0, 1.0, 0.5) == close(3.0)
    # 100 and 60 km/h: 40000 / 81 / 400
    assert least_acceleration_mps2(250 / 9, 50 / 3, 200.0) == close(1.2345679012345678)


@pytest.mark.parametrize(
    ("accel_mps2", "allowed"),
    [(0.359, False), (0.361, True), (3.0, True), (6.0, True), (6.001, False)],
)
def test_eq_22_and_32_bound_the_acceleration_from_both_sides(accel_mps2, allowed):
    assert acceleration_allowed(accel_mps2, 20.0, 16.0, 200.0, 6.0) is allowed


def test_eq_22_and_32_include_the_lower_bound():
    # (400 - 144) / 256 is 1 exactly
    assert acceleration_allowed(1.0, 20.0, 12.0, 128.0, 6.0)


@pytest.mark.parametrize(
    ("accel_mps2", "allowed"),
    [(0.35, False), (0.37, True), (2.0, True), (144.0, True)],  # 205.7, 194.6, 36, 0.5 m
)
def test_eq_23_and_33_want_the_merge_on_the_lane(accel_mps2, allowed):
    assert merge_station_allowed(accel_mps2, 20.0, 16.0, 200.0) is allowed


def test_eq_23_and_33_exclude_both_ends_of_the_lane():
    assert not merge_station_allowed(1.0, 20.0, 12.0, 128.0)  # merges at 128 m
    assert not merge_station_allowed(1.0, 20.0, 20.0, 128.0)  # merges at 0 m


def test_acceleration_lane_must_have_a_length():
    with pytest.raises(ValueError, match="acceleration lane must be longer than 0"):
        least_acceleration_mps2(20.0, 16.0, 0.0)
