"""Eq. 1-4 and 15-17 against numbers worked out by hand; 254 (0.4 + 0.11) is 129.54."""

import math

import numpy as np
import pytest

from coramp.equations.safe_distance import (
    braking_distance_m,
    clock_distance_m,
    following_clearance_m,
    merge_clearance_m,
    merge_distance_m,
    merging_speed_along_mps,
    minimum_gap_m,
    minimum_merge_gap_m,
    safe_distance_m,
    speed_difference_distance_m,
    standing_clearance_m,
)
from tests.mathematics import RULES, SAFETY, close

ALONG_20 = 17.320508075688772  # 20 cos 30 degrees, 10 times the root of 3


def test_eq_2_clock_error_times_both_speeds():
    assert clock_distance_m(20.0, 17.0, 3e-9) == pytest.approx(1.11e-7, rel=1e-9)


def test_eq_3_speed_term_of_3_mps():
    # 3 m/s are 10.8 km/h: 116.64 / 129.54
    assert braking_distance_m(3.0, 0.4, 0.11) == close(0.9004168596572487)
    assert speed_difference_distance_m(17.0, 20.0, 0.4, 0.11) == close(0.9004168596572487)


def test_eq_3_adhesion_and_resistance_add_up():
    # 10 m/s are 36 km/h: 1296 / (254 * 0.75)
    assert braking_distance_m(10.0, 0.7, 0.05) == close(6.803149606299213)


def test_eq_1_adds_twice_the_positioning_error():
    # 0.04 + 3e-9 * 37 + 116.64 / 129.54
    assert safe_distance_m(17.0, 20.0, SAFETY) == close(0.9404169706572487)
    assert safe_distance_m(20.0, 17.0, SAFETY) == close(0.040000111)


def test_eq_1_with_a_time_gap_adds_the_follower_s_travel():
    # 0.04 + 3e-9 * 37 + 0.5 * 17
    assert safe_distance_m(20.0, 17.0, SAFETY._replace(time_gap_s=0.5)) == close(8.540000111)


def test_eq_1_with_a_standstill_gap_adds_it_at_every_speed():
    # 0.04 + 3e-9 * 37 + 116.64 / 129.54 + 2.5, and 0.04 + 2.5 at a stand
    gap = SAFETY._replace(standstill_gap_m=2.5)
    assert safe_distance_m(17.0, 20.0, gap) == close(3.4404169706572487)
    assert safe_distance_m(0.0, 0.0, gap) == close(2.54)


def test_eq_4_one_length_and_two_safe_distances():
    assert minimum_gap_m(5.0, 0.75) == close(6.5)


def test_merging_speed_along_the_mainline_is_the_cosine_part():
    assert merging_speed_along_mps(20.0, math.radians(30.0)) == close(ALONG_20)


def test_eq_15_and_16_at_20_and_18_mps():
    # 3.6 (20 cos 30 - 20) km/h squared over 129.54, plus 0.04; and for 18 m/s
    assert merge_distance_m(ALONG_20, 20.0, SAFETY) == close(0.7583002436540073)
    assert merge_distance_m(ALONG_20, 18.0, SAFETY) == close(0.0861923128504408)


def test_eq_15_and_16_count_the_speed_difference_either_way():
    # 2 m/s are 7.2 km/h: 0.04 + 51.84 / 129.54
    assert merge_distance_m(22.0, 20.0, SAFETY) == close(0.4401852709587772)
    assert merge_distance_m(18.0, 20.0, SAFETY) == close(0.4401852709587772)


def test_eq_17_ramp_vehicle_and_both_distances():
    assert minimum_merge_gap_m(5.0, 0.7583002436540073, 0.0861923128504408) == close(
        5.8444925565044481
    )


def test_merge_clearance_is_eq_15_with_the_allowance():
    assert merge_clearance_m(RULES.road, SAFETY) == close(0.8583002436540073)


def test_merge_clearance_is_eq_1_where_a_time_gap_makes_it_larger():
    # 0.04 + 3e-9 * 40 + 0.5 * 20 + 0.1
    assert merge_clearance_m(RULES.road, SAFETY._replace(time_gap_s=0.5)) == close(10.14000012)


def test_merge_clearance_is_eq_1_where_a_standstill_gap_makes_it_larger():
    # 0.04 + 3e-9 * 40 + 2.5 + 0.1; 0.5 m leave Eq. 15 the larger, and Eq. 15 has no such gap
    assert merge_clearance_m(RULES.road, SAFETY._replace(standstill_gap_m=2.5)) == close(2.64000012)
    half = SAFETY._replace(standstill_gap_m=0.5)
    assert merge_clearance_m(RULES.road, half) == merge_clearance_m(RULES.road, SAFETY)
    assert merge_distance_m(ALONG_20, 20.0, half) == merge_distance_m(ALONG_20, 20.0, SAFETY)


def test_following_clearance_is_eq_1_at_v0_with_the_allowance():
    assert following_clearance_m(RULES.road, SAFETY) == close(0.14000012)
    gap = SAFETY._replace(time_gap_s=1.0, standstill_gap_m=2.5)
    assert following_clearance_m(RULES.road, gap) == close(22.64000012)


@pytest.mark.parametrize(
    ("time_gap_s", "clock_error_s", "stop_mps2"),
    [
        (0.0, 0.0, 2.94),
        (0.3, 0.0, 2.94),
        (0.3, 0.1, 2.94),
        (1.0, 0.0, 2.94),
        (3.0, 0.0, 2.94),
        (0.0, 0.0, 6.0),
        (0.5, 0.0, 6.0),
    ],
)
def test_standing_clearance_covers_the_whole_braking_and_no_more(
    time_gap_s, clock_error_s, stop_mps2
):
    safety = SAFETY._replace(time_gap_s=time_gap_s, clock_error_s=clock_error_s)
    speeds = np.linspace(0.0, 17.0, 20001)
    # what is asked for behind a standing vehicle, or one as fast, less the way still to brake
    asked = (
        (time_gap_s + 2.0 * clock_error_s) * speeds
        + (3.6 * speeds) ** 2 / 129.54
        - speeds**2 / (2.0 * stop_mps2)
    )
    clearance_m = standing_clearance_m(RULES.road, safety, stop_mps2)
    assert clearance_m == pytest.approx(0.14 + asked.max(), abs=1e-7)
    with_gap = safety._replace(standstill_gap_m=2.5)
    assert standing_clearance_m(RULES.road, with_gap, stop_mps2) == close(clearance_m + 2.5)
