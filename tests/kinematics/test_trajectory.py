"""Pieces of constant acceleration: what is exact about them, against dense sampling."""

import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from coramp.kinematics.trajectory import (
    begin,
    build,
    clip_end,
    clip_start,
    cruise_intercept_m,
    drive,
    drive_to_speed,
    intercept_range_m,
    largest_acceleration_mps2,
    piece_at,
    piece_end_s,
    speed_range_mps,
    station_and_speed,
    superpose_shift,
    time_at_station,
    time_to_cover,
)
from tests.mathematics import close, pieces, random_pairs, sampled, trajectories

# 10 m/s for 3 s, up to 20 m/s in 5 s (75 m), down to 16 m/s in 2 s (36 m), from 1 s and -50 m on
WAY = np.array(
    [
        [1.0, -50.0, 10.0, 0.0],
        [4.0, -20.0, 10.0, 2.0],
        [9.0, 55.0, 20.0, -2.0],
        [11.0, 91.0, 16.0, 0.0],
    ]
)


@pytest.mark.parametrize(
    ("time_s", "piece"), [(0.0, 0), (1.0, 0), (3.999, 0), (4.0, 1), (10.0, 2), (11.0, 3), (99.0, 3)]
)
def test_piece_under_way_begins_at_its_own_time(time_s, piece):
    assert piece_at(WAY, time_s) == piece


@pytest.mark.parametrize(
    ("time_s", "station_m", "speed_mps"),
    [
        (0.0, -60.0, 10.0),  # run back
        (2.0, -40.0, 10.0),
        (6.0, 4.0, 14.0),  # -20 + 20 + 4
        (9.0, 55.0, 20.0),
        (10.0, 74.0, 18.0),  # 55 + 20 - 1
        (13.0, 123.0, 16.0),
    ],
)
def test_station_and_speed_by_hand(time_s, station_m, speed_mps):
    assert station_and_speed(WAY, time_s) == (close(station_m), close(speed_mps))


def test_a_piece_ends_where_the_next_begins_and_the_last_never():
    assert [piece_end_s(WAY, k) for k in range(4)] == [4.0, 9.0, 11.0, math.inf]


@settings(max_examples=100, deadline=None)
@given(way=trajectories(), after_s=st.floats(-2.0, 40.0))
def test_station_and_speed_agree_with_sampling(way, after_s):
    time_s = way[0, 0] + after_s
    stations_m, speeds_mps = sampled(way, np.array([time_s]))
    assert station_and_speed(way, time_s) == (close(stations_m[0]), close(speeds_mps[0]))


@pytest.mark.parametrize(
    ("distance_m", "speed_mps", "accel_mps2", "time_s"),
    [
        (0.0, 10.0, 1.0, 0.0),
        (-5.0, 10.0, 1.0, 0.0),
        (75.0, 10.0, 2.0, 5.0),
        (36.0, 20.0, -2.0, 2.0),
        (100.0, 20.0, -2.0, 10.0),  # to a stand
        (100.001, 20.0, -2.0, math.inf),
        (8.0, 0.0, 1.0, 4.0),
        (8.0, 0.0, 0.0, math.inf),
        (8.0, 0.0, -1.0, math.inf),
        (50.0, 10.0, 0.0, 5.0),
    ],
)
def test_time_to_cover_by_hand(distance_m, speed_mps, accel_mps2, time_s):
    assert time_to_cover(distance_m, speed_mps, accel_mps2) == close(time_s)


def test_time_to_cover_loses_no_digits_where_the_acceleration_is_tiny():
    assert time_to_cover(50.0, 10.0, 1e-14) == pytest.approx(5.0, rel=1e-12)


@settings(max_examples=100, deadline=None)
@given(way=trajectories(), share=st.floats(0.0, 1.0))
def test_time_at_station_is_the_first_time_there(way, share):
    end_m = way[-1, 1] + 20.0 * way[-1, 2]
    station_m = way[0, 1] + share * (end_m - way[0, 1])
    time_s = time_at_station(way, station_m)
    assert sampled(way, np.array([time_s]))[0][0] == pytest.approx(station_m, abs=1e-8)
    before_m, _ = sampled(way, np.linspace(way[0, 0], time_s, 200)[:-1])
    assert (before_m <= station_m + 1e-9).all()


def test_time_at_station_behind_the_start_and_beyond_a_stand():
    stopped = pieces(2.0, -30.0, 10.0, [(0.0, 4.0)])
    assert time_at_station(stopped, -40.0) == 2.0
    assert time_at_station(stopped, -10.0) == close(6.0)
    assert time_at_station(stopped, -9.999) == math.inf


def test_driving_builds_the_rows():
    out = np.full((6, 4), np.nan)
    n = begin(out, 1.0, -50.0, 10.0)
    n = drive(out, n, 0.0, 3.0)
    n = drive(out, n, 2.0, 5.0)
    n = drive_to_speed(out, n, -2.0, 16.0)
    assert n == 4
    assert out[:n] == close(WAY)
    assert np.isnan(out[n:]).all()


def test_a_stretch_that_only_continues_the_one_before_becomes_part_of_it():
    out = np.empty((6, 4))
    n = drive(out, drive(out, begin(out, 0.0, 0.0, 10.0), 2.0, 2.0), 2.0, 3.0)
    assert out[:n] == close(np.array([[0.0, 0.0, 10.0, 2.0], [5.0, 75.0, 20.0, 0.0]]))


def test_a_stretch_of_no_duration_is_left_out():
    out = np.empty((6, 4))
    n = begin(out, 0.0, 0.0, 10.0)
    assert drive(out, n, 2.0, 1e-13) == 1
    assert out[0].tolist() == [0.0, 0.0, 10.0, 0.0]


def test_a_speed_that_rounding_leaves_near_a_stand_is_a_stand():
    out = np.empty((6, 4))
    n = drive(out, begin(out, 0.0, 0.0, 0.3), -0.1, 0.3 / 0.1 - 1e-12)
    assert out[n - 1, 2] == 0.0


@pytest.mark.parametrize(
    ("from_mps", "accel_mps2", "to_mps"), [(14.3, 1.5, 20.0), (13.3, -2.1, 5.3)]
)
def test_drive_to_speed_ends_at_exactly_that_speed(from_mps, accel_mps2, to_mps):
    out = np.empty((6, 4))
    n = drive_to_speed(out, begin(out, 0.3, 0.0, from_mps), accel_mps2, to_mps)
    assert n == 2
    assert out[1, 2] == to_mps
    assert out[1, 0] == close(0.3 + (to_mps - from_mps) / accel_mps2)
    assert out[1, 1] == close((to_mps**2 - from_mps**2) / (2.0 * accel_mps2))


def test_drive_to_speed_leaves_out_what_changes_nothing():
    out = np.empty((6, 4))
    n = begin(out, 0.0, 0.0, 16.0)
    assert drive_to_speed(out, n, 2.0, 16.0) == 1
    assert drive_to_speed(out, n, 0.0, 20.0) == 1


@settings(max_examples=60, deadline=None)
@given(way=trajectories(), after_s=st.floats(0.0, 30.0))
def test_clipping_the_start_changes_nothing_after_it(way, after_s):
    from_s = way[0, 0] + after_s
    out = np.full((10, 4), np.nan)
    n = clip_start(way, from_s, out)
    times_s = np.linspace(from_s, from_s + 40.0, 101)
    assert out[0, 0] == from_s
    assert np.array(sampled(out[:n], times_s)) == close(np.array(sampled(way, times_s)))


@settings(max_examples=60, deadline=None)
@given(way=trajectories(), after_s=st.floats(0.0, 30.0))
def test_clipping_the_end_changes_nothing_before_it_and_cruises_after(way, after_s):
    end_s = way[0, 0] + after_s
    out = np.full((10, 4), np.nan)
    out[: len(way)] = way
    n = clip_end(out, len(way), end_s)
    before_s = np.linspace(way[0, 0], end_s, 101)
    assert np.array(sampled(out[:n], before_s)) == close(np.array(sampled(way, before_s)))
    assert out[n - 1, 3] == 0.0
    end_m, end_mps = (value[0] for value in sampled(way, np.array([end_s])))
    later_m, later_mps = (value[0] for value in sampled(out[:n], np.array([end_s + 7.0])))
    assert later_mps == close(end_mps)
    assert later_m == close(end_m + 7.0 * end_mps)


def test_clipping_the_end_at_a_knot_leaves_no_empty_piece():
    out = WAY.copy()
    assert clip_end(out, 4, 9.0) == 3
    assert out[:3] == close(np.array([*WAY[:2], [9.0, 55.0, 20.0, 0.0]]))


def test_cruise_intercept_runs_the_last_piece_back_to_time_0():
    assert cruise_intercept_m(WAY, 16.0) == close(-85.0)  # 91 - 11 * 16
    assert cruise_intercept_m(WAY, 20.0) == close(-129.0)


def _assert_bounds_are_tight(way, from_s, cruise_mps):
    low_m, high_m = intercept_range_m(way, from_s, cruise_mps)
    last_s = max(from_s, way[-1, 0]) + 1.0
    knots_s = way[way[:, 0] >= from_s, 0]
    times_s = np.concatenate([np.linspace(from_s, last_s, 20001), knots_s])
    intercepts_m = sampled(way, times_s)[0] - cruise_mps * times_s
    # between samples an extremum lies at most a dt^2 / 8 beyond
    step_s = (last_s - from_s) / 20000.0
    slack_m = np.abs(way[:, 3]).max() * step_s**2 / 8.0 + 1e-9
    assert -1e-9 <= intercepts_m.min() - low_m <= slack_m
    assert -1e-9 <= high_m - intercepts_m.max() <= slack_m


@settings(max_examples=60, deadline=None)
@given(way=trajectories(end_speed_mps=20.0), after_s=st.floats(0.0, 20.0))
def test_intercept_range_bounds_what_is_driven_and_is_tight(way, after_s):
    _assert_bounds_are_tight(way, way[0, 0] + after_s, 20.0)


def test_intercept_range_of_busy_ways_bounds_what_is_driven_and_is_tight():
    for one, other, from_s, _ in random_pairs(5, 100):
        for way in (one, other):
            _assert_bounds_are_tight(way, from_s, way[-1, 2])


def test_intercept_range_counts_the_knot_at_which_the_cruise_begins():
    slowing, speeding = pieces(0.0, 0.0, 24.0, [(20.0, 2.0)]), pieces(0.0, 0.0, 16.0, [(20.0, 2.0)])
    assert intercept_range_m(slowing, 0.0, 20.0) == (0.0, close(4.0))
    assert intercept_range_m(speeding, 0.0, 20.0) == (close(-4.0), 0.0)


def test_intercept_range_is_open_to_the_side_where_the_end_leaves_it():
    # station - 20 t: -70 at 1 s, -100 at 4 s, -125 at 9 s, where speed touches 20 m/s
    assert intercept_range_m(WAY, 1.0, 20.0) == (-math.inf, close(-70.0))
    # station - 10 t: -60 up to 4 s, rises ever after
    assert intercept_range_m(WAY, 1.0, 10.0) == (close(-60.0), math.inf)
    # station - 16 t: falls to -84 - 9 = -93 at 7 s, where speed is 16 m/s
    assert intercept_range_m(WAY, 2.0, 16.0) == (close(-93.0), close(-72.0))


@settings(max_examples=100, deadline=None)
@given(
    way=trajectories(),
    after_s=st.integers(0, 100).map(lambda n: n / 10.0),
    wait_s=st.integers(0, 60).map(lambda n: n / 10.0),
    lasts_s=st.integers(5, 120).map(lambda n: n / 10.0),
    shift_m=st.floats(-5.0, 5.0),
)
def test_superposed_shift_adds_a_triangle_of_speed(way, after_s, wait_s, lasts_s, shift_m):
    from_s = way[0, 0] + after_s
    start_s = from_s + wait_s
    out = np.full((12, 4), np.nan)
    n = superpose_shift(way, from_s, start_s, start_s + lasts_s, shift_m, out)
    assert 0 < n <= len(way) + 4
    assert out[0, 0] == from_s
    times_s = np.linspace(from_s, start_s + lasts_s + 5.0, 301)
    u = np.clip((times_s - start_s) / lasts_s, 0.0, 1.0)
    done = np.where(u < 0.5, 2.0 * u**2, 1.0 - 2.0 * (1.0 - u) ** 2)
    faster = np.where(u < 0.5, 4.0 * u, 4.0 * (1.0 - u)) / lasts_s
    old_m, old_mps = sampled(way, times_s)
    new_m, new_mps = sampled(out[:n], times_s)
    assert new_m == pytest.approx(old_m + shift_m * done, abs=1e-8)
    assert new_mps == pytest.approx(old_mps + shift_m * faster, abs=1e-8)
    assert out[n - 1, 2] == way[-1, 2]  # the cruise is as fast as before, to the last digit
    ends_m = out[1:n, 1], sampled(out[: n - 1], out[1:n, 0])[0]
    assert ends_m[0] == pytest.approx(ends_m[1], abs=1e-8)


def test_superposed_shift_that_does_not_fit_is_refused():
    assert superpose_shift(WAY, 1.0, 2.0, 6.0, 1.0, np.empty((7, 4))) == 0
    assert superpose_shift(WAY, 1.0, 2.0, 6.0, 1.0, np.empty((8, 4))) > 0


@settings(max_examples=60, deadline=None)
@given(way=trajectories(), after_s=st.integers(0, 200).map(lambda n: n / 10.0))
def test_speed_range_is_that_of_the_samples(way, after_s):
    from_s = way[0, 0] + after_s
    assume(way[-1, 3] == 0.0)
    later_s = way[way[:, 0] >= from_s, 0]
    _, speeds_mps = sampled(way, np.array([from_s, *later_s]))
    lowest_mps, highest_mps = speed_range_mps(way, from_s)
    assert (lowest_mps, highest_mps) == (close(speeds_mps.min()), close(speeds_mps.max()))


def test_largest_acceleration_is_of_pieces_not_yet_over():
    way = pieces(0.0, 0.0, 10.0, [(22.0, 4.0), (20.0, 2.0), (20.5, 1.0)])  # 3, -1, 0.5
    assert largest_acceleration_mps2(way, 3.9) == close(3.0)
    assert largest_acceleration_mps2(way, 4.0) == close(1.0)
    assert largest_acceleration_mps2(way, 6.0) == close(0.5)
    assert largest_acceleration_mps2(way, 7.0) == 0.0


def test_build_makes_a_trajectory_of_its_own():
    assert build(1.0, -50.0, 10.0, [(0.0, 3.0), (2.0, 5.0), (-2.0, 2.0)]) == close(WAY)
