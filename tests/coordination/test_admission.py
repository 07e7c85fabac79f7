"""Who may enter behind whom; every number is worked by hand."""

import math

import pytest

from coramp.coordination.admission import safe_to_enter
from tests.mathematics import RULES, fleet_of, pieces, sized

BUMPER_M = 5.0
CRUISE = 0.04 + 2 * 3e-9 * 16.0 + 0.1
"""Eq. 1 at equal speeds of 16 m/s, and the allowance."""
STREAM = -math.inf


def may_enter(leader, merge_s, gap_m):
    """Whether a ramp vehicle may enter at 16 m/s, so far behind a leader that starts at -390 m."""
    own = pieces(0.0, -390.0 - BUMPER_M - gap_m, 16.0)
    return safe_to_enter(fleet_of((leader, merge_s)), own, sized(), True, 0.0, RULES)


@pytest.mark.parametrize("merge_s", [30.0, math.inf])
@pytest.mark.parametrize(("more_m", "may"), [(-0.001, False), (0.001, True)])
def test_a_ramp_vehicle_keeps_its_distance_from_those_before_it_merging_or_not(
    merge_s, more_m, may
):
    assert may_enter(pieces(0.0, -390.0, 16.0), merge_s, CRUISE + more_m) is may


@pytest.mark.parametrize("merge_s", [STREAM, -1.0])
def test_who_is_on_the_mainline_is_not_in_the_way_on_the_ramp(merge_s):
    assert may_enter(pieces(0.0, -390.0, 16.0), merge_s, -3.0)


def test_a_vehicle_without_a_way_in_does_not_enter():
    own = pieces(0.0, -400.0, 16.0)[:0]
    fleet = fleet_of((pieces(0.0, 300.0, 20.0), STREAM))
    assert not safe_to_enter(fleet, own, sized(), True, 0.0, RULES)
