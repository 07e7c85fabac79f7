"""Eq. 18-20, with the paper's 100 and 60 km/h (250/9 and 50/3 m/s) and 2 m/s2."""

import numpy as np
import pytest

from coramp.equations.conflict import (
    CONFLICT_ALLOWANCE_M,
    conflict_index,
    in_conflict,
    mainline_station_at_merge_m,
    merge_station_m,
)
from tests.mathematics import close


def test_eq_18_merge_station():
    # (v_0^2 - v_R0^2) / (2 a) = 40000 / 81 / 4 = 10000 / 81
    assert merge_station_m(50 / 3, 250 / 9, 2.0) == close(123.45679012345678)


def test_eq_19_mainline_station_at_the_merge_time():
    # from -100 m at 60 km/h: t_1 = 6 s, t_2 = 50/9 s; 250/9 * 104/9 - 350 = -2350/81
    assert mainline_station_at_merge_m(-350.0, 250 / 9, 104 / 9) == close(-29.012345679012345)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_eq_20_reaches_one_length_and_the_allowance_to_either_side(side):
    assert CONFLICT_ALLOWANCE_M == 0.04
    assert in_conflict(100.0, 100.0 + side * 5.0399, 5.0, 0.04)
    assert not in_conflict(100.0, 100.0 + side * 5.0401, 5.0, 0.04)


def test_eq_20_includes_its_bounds():
    assert in_conflict(0.0, 5.25, 5.0, 0.25)
    assert in_conflict(5.25, 0.0, 5.0, 0.25)


def test_of_two_conflicting_vehicles_the_one_further_ahead_is_chosen():
    ahead_last, ahead_first = np.array([40.0, 97.0, 103.0, 140.0]), np.array([103.0, 97.0])
    assert conflict_index(100.0, ahead_last, 5.0, 0.04) == 2
    assert conflict_index(100.0, ahead_first, 5.0, 0.04) == 0


def test_no_conflict_gives_minus_one():
    assert conflict_index(100.0, np.array([90.0, 110.0]), 5.0, 0.04) == -1
