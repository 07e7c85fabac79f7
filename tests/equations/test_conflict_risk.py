"""Eq. 5-9 against numbers worked out by hand."""

import math

import pytest

from coramp.equations.conflict_risk import (
    SEVERITY_THRESHOLD_M2PS4,
    collision_acceleration_from_masses_mps2,
    collision_acceleration_mps2,
    collision_acceleration_of_log_ratio_mps2,
    conflict_severity_m2ps4,
    relative_urgent_acceleration_mps2,
    severity_m2ps4,
    severity_of_masses_m2ps4,
    urgent_acceleration_mps2,
)
from tests.mathematics import close


def test_eq_5_is_a_product():
    assert severity_m2ps4(7.5, 1.2) == close(9.0)


def test_eq_6_from_masses():
    # 1000 kg at 20 m/s into 1500 kg, 0.2 s: 20000 / (2500 * 0.2)
    assert collision_acceleration_from_masses_mps2(1500.0, 1000.0, 20.0, 0.2) == close(40.0)
    assert collision_acceleration_from_masses_mps2(1500.0, 1000.0, -20.0, 0.2) == close(40.0)
    # small masses are masses too: 2.5 / (0.75 * 0.2)
    assert collision_acceleration_from_masses_mps2(0.25, 0.5, 5.0, 0.2) == close(16.666666666666668)


def test_eq_7_from_the_ratio_of_masses():
    # 20 m/s over 2.5 times 0.25 s
    assert collision_acceleration_mps2(20.0, 1.5, 0.25) == close(32.0)
    assert collision_acceleration_mps2(-20.0, 1.5, 0.25) == close(32.0)
    assert collision_acceleration_mps2(10.0, 0.25, 0.5) == close(16.0)


def test_eq_8_from_the_logarithm_of_the_ratio():
    # 5 * 2 / (1 + 10^p) for p = 0, 1, -1
    assert collision_acceleration_of_log_ratio_mps2(2.0, 0.0) == close(5.0)
    assert collision_acceleration_of_log_ratio_mps2(-2.0, 1.0) == close(0.9090909090909091)
    assert collision_acceleration_of_log_ratio_mps2(2.0, -1.0) == close(9.090909090909091)


def test_eq_9_as_printed_and_in_the_relative_form():
    # 111 and 9 over twice 10 m
    assert urgent_acceleration_mps2(20.0, 17.0, 10.0) == close(5.55)
    assert relative_urgent_acceleration_mps2(20.0, 17.0, 10.0) == close(0.45)
    assert urgent_acceleration_mps2(20.0, 17.0, 0.5) == close(111.0)
    assert relative_urgent_acceleration_mps2(20.0, 17.0, 0.5) == close(9.0)


@pytest.mark.parametrize("distance_m", [0.0, -1.0])
def test_eq_9_is_infinite_without_a_distance(distance_m):
    assert urgent_acceleration_mps2(20.0, 17.0, distance_m) == math.inf
    assert relative_urgent_acceleration_mps2(20.0, 17.0, distance_m) == math.inf


def test_severity_of_equal_masses_in_both_forms_whichever_is_faster():
    # a = 5 * 3 / 2 = 7.5; times 5.55 and 0.45
    expected = (close(41.625), close(3.375))
    assert conflict_severity_m2ps4(20.0, 17.0, 10.0) == expected
    assert conflict_severity_m2ps4(17.0, 20.0, 10.0) == expected


def test_severity_is_nothing_at_equal_speeds_and_infinite_for_an_overlap():
    assert conflict_severity_m2ps4(20.0, 20.0, -1.0) == (0.0, 0.0)
    assert conflict_severity_m2ps4(20.0, 17.0, -1.0) == (math.inf, math.inf)


def test_severity_of_unequal_masses_is_that_of_the_lighter_vehicle():
    # 1500 kg against 40 t: k = 10^p = 0.0375; a = 3 / (1.0375 * 0.2), times 5.55 and 0.45
    accel_mps2 = 3.0 / (1.0375 * 0.2)
    expected = (close(accel_mps2 * 5.55), close(accel_mps2 * 0.45))
    for masses in ((1500.0, 40000.0), (40000.0, 1500.0)):
        assert severity_of_masses_m2ps4(20.0, 17.0, 10.0, *masses) == expected
        assert severity_of_masses_m2ps4(17.0, 20.0, 10.0, *masses) == expected
    # it is Eq. 6 for the lighter one, and more than that of the heavier one
    assert accel_mps2 == close(collision_acceleration_from_masses_mps2(1500.0, 40000.0, 3.0, 0.2))
    assert accel_mps2 > collision_acceleration_from_masses_mps2(40000.0, 1500.0, 3.0, 0.2)


def test_severity_of_equal_masses_is_that_of_equal_vehicles():
    for mass_kg in (1.0, 1500.0, 40000.0):
        same = severity_of_masses_m2ps4(20.0, 17.0, 10.0, mass_kg, mass_kg)
        assert same == conflict_severity_m2ps4(20.0, 17.0, 10.0)


def test_threshold_is_the_square_of_three_tenths_of_g():
    assert close(8.6436) == SEVERITY_THRESHOLD_M2PS4  # 2.94^2


@pytest.mark.parametrize(
    ("own_kg", "other_kg", "duration_s"), [(0.0, 1.0, 1.0), (1.0, 0.0, 1.0), (1.0, 1.0, 0.0)]
)
def test_masses_and_duration_must_be_positive(own_kg, other_kg, duration_s):
    with pytest.raises(ValueError, match="masses and duration must be positive"):
        collision_acceleration_from_masses_mps2(own_kg, other_kg, 5.0, duration_s)


@pytest.mark.parametrize(("ratio", "duration_s"), [(0.0, 1.0), (1.0, 0.0)])
def test_ratio_and_duration_must_be_positive(ratio, duration_s):
    with pytest.raises(ValueError, match="mass ratio and duration must be positive"):
        collision_acceleration_mps2(5.0, ratio, duration_s)
