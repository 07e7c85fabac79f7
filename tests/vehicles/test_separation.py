"""The smallest margin over Eq. 1, against dense sampling of the formula in the paper's km/h."""

import math

import numpy as np
import pytest
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st

from coramp.vehicles.separation import smallest_margin_m, smallest_of_quadratic
from tests.mathematics import SAFETY, close, pieces, random_pairs, sampled_margins, trajectories

# errors large enough to be seen
WIDE = SAFETY._replace(
    positioning_error_m=0.3, clock_error_s=0.05, time_gap_s=0.4, standstill_gap_m=1.5
)


@pytest.mark.parametrize(
    ("constant", "slope", "curvature", "duration", "least", "where"),
    [
        (5.0, -4.0, 1.0, 10.0, 1.0, 2.0),  # vertex
        (5.0, -4.0, 1.0, 1.0, 2.0, 1.0),  # vertex beyond the end
        (5.0, -4.0, 1.0, 1.5, 1.25, 1.5),
        (5.0, 4.0, 1.0, 3.0, 5.0, 0.0),
        (5.0, 1.0, -1.0, 3.0, -1.0, 3.0),
        (5.0, 1.0, -1.0, 0.5, 5.0, 0.0),
        (5.0, -2.0, 0.0, 2.0, 1.0, 2.0),
        (5.0, -4.0, 1.0, math.inf, 1.0, 2.0),
        (5.0, 0.0, 0.0, math.inf, 5.0, 0.0),
        (5.0, 1.0, 0.0, math.inf, 5.0, 0.0),
        (5.0, -1.0, 0.0, math.inf, -math.inf, math.inf),
        (5.0, 1.0, -1.0, math.inf, -math.inf, math.inf),
    ],
)
def test_smallest_of_a_quadratic(constant, slope, curvature, duration, least, where):
    found = smallest_of_quadratic(constant, slope, curvature, duration)
    assert found == (close(least), close(where))


def test_follower_that_slows_down_in_time_is_nearest_when_speeds_are_equal():
    front = pieces(0.0, 50.0, 16.0)
    rear = pieces(0.0, 0.0, 20.0, [(16.0, 4.0), (12.0, 4.0)])
    # distance 45 - 4 t + t^2 / 2 is least at 4 s: 37 m; Eq. 1 asks 0.04 + 3e-9 * 32 there
    margin_m, when_s = smallest_margin_m(front, 5.0, rear, 0.0, 8.0, SAFETY)
    assert margin_m == close(36.959999904)
    assert when_s == close(4.0)


def test_speed_term_can_make_the_start_the_nearest_moment():
    front = pieces(0.0, 10.5, 16.0)
    rear = pieces(0.0, 0.0, 20.0, [(16.0, 0.5)])
    # at 0 s: 5.5 - 0.04 - 3e-9 * 36 - 14.4^2 / 129.54; at 0.5 s: 5.5 - 1 - 0.04 - 1e-7
    margin_m, when_s = smallest_margin_m(front, 5.0, rear, 0.0, math.inf, SAFETY)
    assert margin_m == close(3.859258808164891)
    assert when_s == 0.0


def test_follower_that_is_faster_for_ever_comes_as_near_as_one_likes():
    front, rear = pieces(0.0, 500.0, 19.0), pieces(0.0, 0.0, 20.0)
    assert smallest_margin_m(front, 5.0, rear, 0.0, math.inf, SAFETY)[0] == -math.inf
    # after 100 s: 495 - 100 - 0.04 - 3e-9 * 39 - 3.6^2 / 129.54
    margin_m, when_s = smallest_margin_m(front, 5.0, rear, 0.0, 100.0, SAFETY)
    assert (margin_m, when_s) == (close(394.85995348721954), 100.0)


def test_empty_span_has_no_margin():
    front, rear = pieces(0.0, 50.0, 20.0), pieces(0.0, 0.0, 20.0)
    assert smallest_margin_m(front, 5.0, rear, 3.0, 2.0, SAFETY)[0] == math.inf
    assert smallest_margin_m(front, 5.0, rear, 3.0, 3.0, SAFETY) == (close(44.95999988), 3.0)


def test_allowance_is_no_part_of_the_margin():
    front, rear = pieces(0.0, 50.0, 20.0), pieces(0.0, 0.0, 20.0)
    generous = SAFETY._replace(execution_allowance_m=9.0)
    assert smallest_margin_m(front, 5.0, rear, 0.0, math.inf, generous)[0] == close(44.95999988)


def test_follower_that_speeds_up_from_equal_speeds_is_nearest_at_the_end():
    front, rear = pieces(0.0, 50.0, 10.0), pieces(0.0, 0.0, 10.0, [(14.0, 4.0)])
    # at 4 s: 45 - 8 - 0.04 - 3e-9 * 24 - 14.4^2 / 129.54
    margin_m, when_s = smallest_margin_m(front, 5.0, rear, 0.0, 4.0, SAFETY)
    assert (margin_m, when_s) == (close(35.359258844164891), 4.0)


def test_pair_that_parts_and_closes_within_one_piece_is_nearest_at_the_end():
    front, rear = pieces(0.0, 30.0, 20.0, [(10.0, 10.0)]), pieces(0.0, 0.0, 15.0)
    # at 10 s as far apart as at first, 25 m, less 0.04 + 3e-9 * 25 + 18^2 / 129.54
    margin_m, when_s = smallest_margin_m(front, 5.0, rear, 0.0, 10.0, SAFETY)
    assert (margin_m, when_s) == (close(22.458841981507642), 10.0)


def _assert_below_every_sample_and_attained(front, rear, start_s, end_s, safety):
    margin_m, when_s = smallest_margin_m(front, 4.5, rear, start_s, end_s, safety)
    knots_s = np.concatenate([front[:, 0], rear[:, 0]])
    knots_s = knots_s[(knots_s >= start_s) & (knots_s <= end_s)]
    times_s = np.concatenate([np.linspace(start_s, end_s, 3001), knots_s])
    assert margin_m <= sampled_margins(front, 4.5, rear, times_s, safety).min() + 1e-9
    assert start_s <= when_s <= end_s
    there_m = sampled_margins(front, 4.5, rear, np.array([when_s]), safety)[0]
    assert there_m == pytest.approx(margin_m, abs=1e-9)


@pytest.mark.parametrize("safety", [SAFETY, WIDE], ids=["paper", "wide"])
def test_smallest_margin_of_busy_pairs_is_below_every_sample_and_attained(safety):
    for front, rear, start_s, lasts_s in random_pairs(1, 200):
        _assert_below_every_sample_and_attained(front, rear, start_s, start_s + lasts_s, safety)


@settings(max_examples=100, deadline=None)
@given(
    front=trajectories(station_m=30.0),
    rear=trajectories(station_m=0.0),
    after_s=st.floats(0.0, 10.0),
    lasts_s=st.floats(0.0, 25.0),
    safety=st.sampled_from([SAFETY, WIDE]),
)
@example(pieces(0.0, 9.0, 10.0), pieces(0.0, 0.0, 10.0, [(0.0, 5.0)]), 0.0, 5.0, WIDE)
@example(
    pieces(0.0, 30.0, 10.0, [(15.0, 2.0)]), pieces(0.0, 0.0, 10.0, [(14.0, 2.0)]), 0.0, 2.0, WIDE
)
def test_smallest_margin_is_below_every_sample_and_attained(front, rear, after_s, lasts_s, safety):
    start_s = max(front[0, 0], rear[0, 0]) + after_s
    _assert_below_every_sample_and_attained(front, rear, start_s, start_s + lasts_s, safety)


@settings(max_examples=50, deadline=None)
@given(
    front=trajectories(station_m=30.0),
    rear=trajectories(station_m=0.0),
    safety=st.sampled_from([SAFETY, WIDE]),
)
def test_for_ever_is_as_long_as_something_still_changes(front, rear, safety):
    assume(front[-1, 2] >= rear[-1, 2])
    start_s = max(front[0, 0], rear[0, 0])
    settled_s = max(front[-1, 0], rear[-1, 0]) + 1.0
    finite = smallest_margin_m(front, 4.5, rear, start_s, settled_s, safety)
    assert smallest_margin_m(front, 4.5, rear, start_s, math.inf, safety) == finite
