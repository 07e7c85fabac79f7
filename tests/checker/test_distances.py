"""The checker's own distances: by hand, against sampling, and against the planner's formulas."""

import math
from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st

from coramp.checker.distances import (
    Bounds,
    Envelope,
    Needs,
    envelope_of,
    following_distance_m,
    lane_change_distance_m,
    least_between_m,
    least_margin_m,
    margin_at_least_m,
    margin_at_m,
    next_knot_s,
    passes_s,
    state_at,
)
from coramp.vehicles.separation import smallest_margin_m
from tests.mathematics import (
    SAFETY,
    close,
    pieces,
    random_pairs,
    sampled,
    sampled_margins,
    trajectories,
)

BOUNDS = Bounds(
    zone_end_m=400.0,
    stop_station_m=-1.0,
    last_merge_station_m=197.5,
    mainline_speed_mps=20.0,
    ramp_limit_mps=17.0,
    cos_merge_angle=0.8660254037844386,
    friction=0.51,
    standstill_gap_m=0.0,
    allowance_m=0.1,
    comfort_mps2=2.94,
    ramp_acceleration_mps2=6.0,
    gap_speed_factor=1.1,
)


class Budget(NamedTuple):
    """The checker's bounds, with the errors and the time gap of vehicles that are alike."""

    bounds: Bounds = BOUNDS
    positioning_error_m: float = 0.02
    clock_error_s: float = 3e-9
    time_gap_s: float = 0.0

    def needs(self, front_length_m=0.0):
        clock_s = self.clock_error_s
        errors_m = 2.0 * self.positioning_error_m
        return Needs(front_length_m, errors_m, clock_s, clock_s, self.time_gap_s)


BUDGET = Budget()
# errors large enough to be seen, in the words of the checker and of the planners
ERRORS = {"positioning_error_m": 0.3, "clock_error_s": 0.05, "time_gap_s": 0.4}
WIDE_BUDGET = Budget(BOUNDS._replace(standstill_gap_m=1.5), **ERRORS)
WIDE_SAFETY = SAFETY._replace(**ERRORS, standstill_gap_m=1.5)


def following_m(front_mps, rear_mps, budget):
    return following_distance_m(front_mps, rear_mps, budget.needs(), budget.bounds)


def lane_change_m(merging_mps, other_mps, budget):
    errors_m = 2.0 * budget.positioning_error_m
    return lane_change_distance_m(merging_mps, other_mps, errors_m, budget.bounds)


def at_m(front, length_m, rear, time_s, budget):
    return margin_at_m(front, rear, time_s, budget.needs(length_m), budget.bounds)


def between_m(front, length_m, rear, start_s, end_s, budget):
    return least_between_m(front, rear, start_s, end_s, budget.needs(length_m), budget.bounds)


def least_m(front, length_m, rear, start_s, end_s, budget):
    return least_margin_m(front, rear, start_s, end_s, budget.needs(length_m), budget.bounds)


def at_least_m(front, length_m, rear, budget):
    return margin_at_least_m(front, rear, budget.needs(length_m), budget.bounds)


BUDGETS = st.sampled_from([(BUDGET, SAFETY), (WIDE_BUDGET, WIDE_SAFETY)])

# 10 m/s for 3 s, up to 20 m/s in 5 s (75 m), down to a stand in 10 s (100 m)
WAY = np.array(
    [
        [1.0, -50.0, 10.0, 0.0],
        [4.0, -20.0, 10.0, 2.0],
        [9.0, 55.0, 20.0, -2.0],
        [19.0, 155.0, 0.0, 0.0],
    ]
)


@pytest.mark.parametrize(
    ("time_s", "state"),
    [
        (0.0, (-60.0, 10.0, 0.0)),
        (3.0, (-30.0, 10.0, 0.0)),
        (4.0, (-20.0, 10.0, 2.0)),
        (6.0, (4.0, 14.0, 2.0)),
        (10.0, (74.0, 18.0, -2.0)),
        (25.0, (155.0, 0.0, 0.0)),
    ],
)
def test_state_by_hand(time_s, state):
    assert state_at(WAY, time_s) == tuple(close(value) for value in state)


@pytest.mark.parametrize(
    ("time_s", "knot_s"), [(0.0, 1.0), (1.0, 4.0), (8.9, 9.0), (9.0, 19.0), (19.0, math.inf)]
)
def test_next_knot_is_after_the_time(time_s, knot_s):
    assert next_knot_s(WAY, time_s) == knot_s


@pytest.mark.parametrize(
    ("station_m", "time_s"),
    [
        (-60.0, 1.0),  # behind the start
        (-50.0, 1.0),
        (-30.0, 3.0),
        (4.0, 6.0),
        (55.0, 9.0),
        (74.0, 10.0),
        (154.9, 18.683772233983162),  # 0.1 m before the stand
        (155.0, 19.0),
        (155.001, math.inf),
    ],
)
def test_passing_a_station_by_hand(station_m, time_s):
    assert passes_s(WAY, station_m) == close(time_s)


def test_passing_a_station_in_the_last_cruise_or_never():
    assert passes_s(pieces(2.0, 10.0, 16.0), 90.0) == close(7.0)
    assert passes_s(pieces(2.0, 10.0, 0.0), 90.0) == math.inf
    # after a stand it goes on
    going_on = pieces(0.0, 0.0, 10.0, [(0.0, 4.0), (0.0, 3.0), (5.0, 2.0)])
    assert passes_s(going_on, 24.0) == close(7.0 + 3.2**0.5)  # 4 m with 2.5 m/s2


@settings(max_examples=100, deadline=None)
@given(way=trajectories(), share=st.floats(0.01, 1.0))
def test_passing_time_is_the_first_at_the_station(way, share):
    end_m = way[-1, 1] + 20.0 * way[-1, 2]
    station_m = way[0, 1] + share * (end_m - way[0, 1])
    time_s = passes_s(way, station_m)
    assert sampled(way, np.array([time_s]))[0][0] == pytest.approx(station_m, abs=1e-7)
    before_m, _ = sampled(way, np.linspace(way[0, 0], time_s, 200)[:-1])
    assert (before_m <= station_m + 1e-9).all()


def test_following_distance_by_hand():
    # 0.04 + 3e-9 * 37, and 10.8^2 / 129.54 for the faster follower
    assert following_m(20.0, 17.0, BUDGET) == close(0.040000111)
    assert following_m(17.0, 20.0, BUDGET) == close(0.9404169706572487)
    # 0.36^2 / 129.54
    assert following_m(19.9, 20.0, BUDGET) == close(0.041000582877397)
    # 0.6 + 0.05 * 37 + 0.4 * 20 + 1.5, and the same
    assert following_m(17.0, 20.0, WIDE_BUDGET) == close(12.850416859657248)


def test_lane_change_distance_by_hand():
    assert lane_change_m(20.0, 20.0, BUDGET) == close(0.7583002436540073)
    assert lane_change_m(20.0, 18.0, BUDGET) == close(0.0861923128504408)
    # a slower one counts alike: 20 cos 30 less 14.6410.. either way
    assert lane_change_m(20.0, 14.641016151377545, BUDGET) == close(0.7583002436540073)
    assert lane_change_m(20.0, 20.0, WIDE_BUDGET) == close(1.3183002436540073)


def test_margin_at_a_moment_by_hand():
    front, rear = pieces(0.0, 30.0, 17.0), pieces(0.0, 0.0, 20.0)
    # at 2 s: 64 - 5 - 40 m
    assert at_m(front, 5.0, rear, 2.0, BUDGET) == close(19.0 - 0.9404169706572487)


def test_least_between_is_at_the_start_of_an_opening_and_at_the_end_of_a_closing_span():
    front, rear = pieces(0.0, 100.0, 20.0), pieces(0.0, 0.0, 16.0, [(24.0, 8.0)])
    # opening up to 4 s: 95 m at first
    assert between_m(front, 5.0, rear, 0.0, 4.0, BUDGET) == close(94.96 - 3e-9 * 36.0)
    # 95 m again at 8 s, less 14.4^2 / 129.54
    at_end = 95.0 - 0.04 - 3e-9 * 44.0 - 207.36 / 129.54
    assert between_m(front, 5.0, rear, 4.0, 8.0, BUDGET) == close(at_end)
    # closing ever less: by 8 m up to 4 s
    braking = pieces(0.0, 0.0, 24.0, [(20.0, 4.0)])
    assert between_m(front, 5.0, braking, 0.0, 4.0, BUDGET) == close(86.96 - 3e-9 * 40.0)


def test_vertex_inside_the_span_is_found():
    # the follower's time gap shrinks as it brakes: 100 - 4 t + t^2 / 2 + 2 t - (4 - t)^2 kappa
    front, rear = pieces(0.0, 105.0, 20.0), pieces(0.0, 0.0, 24.0, [(20.0, 4.0)])
    bounds = BUDGET._replace(time_gap_s=2.0, clock_error_s=0.0)
    kappa = 12.96 / 129.54
    t = (2.0 - 8.0 * kappa) / (1.0 - 2.0 * kappa)
    least = 100.0 - 4.0 * t + t * t / 2.0 - 2.0 * (24.0 - t) - 0.04 - kappa * (4.0 - t) ** 2
    assert 1.0 < t < 2.0
    assert between_m(front, 5.0, rear, 0.0, 4.0, bounds) == close(least)
    assert between_m(front, 5.0, rear, 1.0, 2.0, bounds) == close(least)


def test_closing_in_for_ever_has_no_least_margin():
    front, rear = pieces(0.0, 500.0, 19.0), pieces(0.0, 0.0, 20.0)
    assert least_m(front, 5.0, rear, 0.0, math.inf, BUDGET) == -math.inf
    # after 100 s: 495 - 100 - 0.04 - 3e-9 * 39 - 3.6^2 / 129.54
    assert least_m(front, 5.0, rear, 0.0, 100.0, BUDGET) == close(394.85995348721954)
    speeding_up = np.array([[0.0, 0.0, 20.0, 0.1]])
    cruising = pieces(0.0, 500.0, 20.0)
    assert least_m(cruising, 5.0, speeding_up, 0.0, math.inf, BUDGET) == -math.inf


def test_cruising_together_for_ever_keeps_the_distance():
    front, rear = pieces(0.0, 50.0, 20.0), pieces(0.0, 0.0, 20.0)
    assert least_m(front, 5.0, rear, 0.0, math.inf, BUDGET) == close(44.95999988)
    faster = pieces(0.0, 50.0, 21.0)
    # 45 - 0.04 - 3e-9 * 41
    assert least_m(faster, 5.0, rear, 0.0, math.inf, BUDGET) == close(44.959999877)


def test_empty_span_has_no_margin():
    front, rear = pieces(0.0, 50.0, 20.0), pieces(0.0, 0.0, 20.0)
    assert least_m(front, 5.0, rear, 3.0, 2.0, BUDGET) == math.inf
    assert least_m(front, 5.0, rear, 3.0, 3.0, BUDGET) == close(44.95999988)


@settings(max_examples=100, deadline=None)
@given(
    front=trajectories(station_m=30.0),
    rear=trajectories(station_m=0.0),
    after_s=st.floats(0.0, 10.0),
    lasts_s=st.floats(0.0, 25.0),
    budget=BUDGETS,
)
@example(
    pieces(0.0, 9.0, 10.0),
    pieces(0.0, 0.0, 10.0, [(0.0, 5.0)]),
    0.0,
    5.0,
    (WIDE_BUDGET, WIDE_SAFETY),
)
def test_least_margin_agrees_with_sampling_and_with_the_planners(
    front, rear, after_s, lasts_s, budget
):
    start_s = max(front[0, 0], rear[0, 0]) + after_s
    _assert_agreement(front, rear, start_s, start_s + lasts_s, budget)


@pytest.mark.parametrize(
    "budget", [(BUDGET, SAFETY), (WIDE_BUDGET, WIDE_SAFETY)], ids=["paper", "wide"]
)
def test_least_margin_of_busy_pairs_agrees_with_sampling_and_with_the_planners(budget):
    for front, rear, start_s, lasts_s in random_pairs(2, 200):
        _assert_agreement(front, rear, start_s, start_s + lasts_s, budget)


def _assert_agreement(front, rear, start_s, end_s, budget):
    checked, safety = budget
    found_m = least_m(front, 4.5, rear, start_s, end_s, checked)
    planned_m, when_s = smallest_margin_m(front, 4.5, rear, start_s, end_s, safety)
    assert found_m == pytest.approx(planned_m, abs=1e-7)
    knots_s = np.concatenate([front[:, 0], rear[:, 0], [when_s]])
    knots_s = knots_s[(knots_s >= start_s) & (knots_s <= end_s)]
    times_s = np.concatenate([np.linspace(start_s, end_s, 3001), knots_s])
    samples_m = sampled_margins(front, 4.5, rear, times_s, safety)
    assert found_m == pytest.approx(samples_m.min(), abs=1e-7)


@settings(max_examples=60, deadline=None)
@given(
    front=trajectories(station_m=30.0, end_speed_mps=20.0),
    rear=trajectories(station_m=0.0),
    budget=BUDGETS,
)
def test_least_margin_for_ever_agrees_with_the_planners(front, rear, budget):
    checked, safety = budget
    assume(rear[-1, 2] <= 20.0)
    start_s = max(front[0, 0], rear[0, 0])
    found_m = least_m(front, 4.5, rear, start_s, math.inf, checked)
    planned_m, _ = smallest_margin_m(front, 4.5, rear, start_s, math.inf, safety)
    assert found_m == pytest.approx(planned_m, abs=1e-7)
    assert math.isfinite(found_m)


# envelopes ----------------------------------------------------------------------------------


def test_envelope_by_hand():
    # station - 20 t: -70 at 1 s, -100 at 4 s, -125 at 9 s, then -225 at 19 s and ever less
    assert envelope_of(WAY, 1.0, 20.0) == (-math.inf, close(-70.0), 0.0, 20.0)
    ends_at_14 = pieces(1.0, -50.0, 10.0, [(10.0, 3.0), (20.0, 5.0), (14.0, 3.0)])
    # station - 14 t: -64 at 1 s, -76 at 4 s, -80 at 6 s (14 m/s), -71 at 9 s, -62 at 12 s
    assert envelope_of(ends_at_14, 1.0, 14.0) == (close(-80.0), close(-62.0), 10.0, 20.0)
    assert envelope_of(ends_at_14, 9.0, 14.0) == (close(-71.0), close(-62.0), 14.0, 20.0)


def test_envelope_is_open_where_the_end_leaves_it():
    assert envelope_of(pieces(0.0, 0.0, 21.0), 2.0, 20.0) == (close(2.0), math.inf, 21.0, math.inf)
    assert envelope_of(pieces(0.0, 0.0, 19.0), 2.0, 20.0) == (-math.inf, close(-2.0), 19.0, 19.0)
    assert envelope_of(pieces(0.0, 0.0, 20.0), 2.0, 20.0) == (0.0, 0.0, 20.0, 20.0)
    speeding_up, slowing_down = (np.array([[0.0, 0.0, 20.0, rate]]) for rate in (0.1, -0.1))
    assert envelope_of(speeding_up, 0.0, 20.0)[1:] == (math.inf, 20.0, math.inf)
    assert envelope_of(slowing_down, 0.0, 20.0)[0] == -math.inf


def test_envelope_of_busy_ways_bounds_what_is_driven_and_is_tight():
    for one, other, from_s, _ in random_pairs(6, 100):
        for way in (one, other):
            v0_mps = way[-1, 2]
            envelope = envelope_of(way, from_s, v0_mps)
            last_s = max(from_s, way[-1, 0]) + 1.0
            knots_s = way[way[:, 0] >= from_s, 0]
            times_s = np.concatenate([np.linspace(from_s, last_s, 20001), knots_s])
            stations_m, speeds_mps = sampled(way, times_s)
            intercepts_m = stations_m - v0_mps * times_s
            slack_m = np.abs(way[:, 3]).max() * ((last_s - from_s) / 20000.0) ** 2 / 8.0 + 1e-9
            assert -1e-9 <= intercepts_m.min() - envelope.lowest_m <= slack_m
            assert -1e-9 <= envelope.highest_m - intercepts_m.max() <= slack_m
            assert (envelope.slowest_mps, envelope.fastest_mps) == (
                close(speeds_mps.min()),
                close(speeds_mps.max()),
            )


def test_margin_at_least_by_hand():
    front, rear = Envelope(100.0, 110.0, 18.0, 21.0), Envelope(60.0, 70.0, 19.0, 22.0)
    # the lane change at 18 m/s beside 22 m/s: (3.6 (22 - 18 cos 30))^2 / 129.54 and 0.04
    needed_m = 0.04 + (3.6 * (22.0 - 15.588457268119896)) ** 2 / 129.54
    assert at_least_m(front, 5.0, rear, BUDGET) == close(25.0 - needed_m)
    # with both gaps Eq. 1: 0.6 + 0.05 (18 + 22 + 3) + 14.4^2 / 129.54 + 0.4 * 22 + 1.5
    needed = 0.6 + 2.15 + 207.36 / 129.54 + 8.8 + 1.5
    assert at_least_m(front, 5.0, rear, WIDE_BUDGET) == close(25.0 - needed)
    # slow in front and fast behind, or the other way round, asks the same of a lane change
    front, rear = Envelope(100.0, 110.0, 19.0, 22.0), Envelope(60.0, 70.0, 18.0, 21.0)
    assert at_least_m(front, 5.0, rear, BUDGET) == close(25.0 - needed_m)


@pytest.mark.parametrize("bounds", [BUDGET, WIDE_BUDGET], ids=["paper", "wide"])
def test_no_margin_falls_below_that_of_the_envelopes(bounds):
    for front, rear, from_s, lasts_s in random_pairs(7, 100):
        front[:, 1] += 200.0
        times_s = np.linspace(from_s, from_s + lasts_s, 501)
        envelopes = []
        for way in (front, rear):  # envelopes of what is driven in the span
            stations_m, speeds_mps = sampled(way, times_s)
            moving_m = stations_m - 20.0 * times_s
            envelopes.append(
                Envelope(moving_m.min(), moving_m.max(), speeds_mps.min(), speeds_mps.max())
            )
        bound_m = at_least_m(envelopes[0], 4.5, envelopes[1], bounds)
        for time_s in times_s[::50]:
            assert bound_m <= at_m(front, 4.5, rear, time_s, bounds) + 1e-9
            front_m, front_mps, _ = state_at(front, time_s)
            rear_m, rear_mps, _ = state_at(rear, time_s)
            for merging_mps, other_mps in ((front_mps, rear_mps), (rear_mps, front_mps)):
                asked_m = lane_change_m(merging_mps, other_mps, bounds)
                assert bound_m <= front_m - 4.5 - rear_m - asked_m + 1e-9
