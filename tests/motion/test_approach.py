"""How ramp vehicles slow down, stop and come late: by hand, and against sampling.

``MOTION`` speeds up by 1.5 m/s2, slows down by 2 m/s2; the ramp's speed is 16 m/s.
"""

import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from coramp.kinematics.trajectory import begin
from coramp.motion.approach import (
    append_stop,
    approach_without_stop,
    brake_and_go,
    change_speed,
    harmonise,
    late_approach,
    late_start,
    stop_of_m,
    stop_starts_s,
)
from tests.mathematics import MOTION, RULES, close, pieces, sampled, trajectories

ROAD = RULES.road
# 16 m/s from -160 m, braking by 2.5 m/s2 over 16^2 / 5 = 51.2 m to a stand at -10 m
STOPPING = np.array(
    [[0.0, -160.0, 16.0, 0.0], [6.175, -61.2, 16.0, -2.5], [12.575, -10.0, 0.0, 0.0]]
)


def _written(function, *arguments, rows=12):
    out = np.full((rows, 4), np.nan)
    return out[: function(*arguments, out)].copy()


def _harmonised(speed_mps, delay_s, brake_s, target_mps=16.0):
    out = np.full((12, 4), np.nan)
    n = harmonise(out, 0.0, -400.0, speed_mps, delay_s, brake_s, target_mps, MOTION)
    return out[:n].copy()


def test_change_of_speed_uses_the_rate_of_its_direction():
    out = np.empty((4, 4))
    n = change_speed(out, begin(out, 0.0, 0.0, 13.0), 16.0, MOTION)
    assert out[:n] == close(np.array([[0.0, 0.0, 13.0, 1.5], [2.0, 29.0, 16.0, 0.0]]))
    n = change_speed(out, begin(out, 0.0, 0.0, 18.0), 16.0, MOTION)
    assert out[:n] == close(np.array([[0.0, 0.0, 18.0, -2.0], [1.0, 17.0, 16.0, 0.0]]))
    assert change_speed(out, begin(out, 0.0, 0.0, 16.0), 16.0, MOTION) == 1


def test_harmonising_waits_brakes_and_goes_to_the_target():
    expected = [
        [0.0, -400.0, 17.0, 0.0],
        [1.0, -383.0, 17.0, -2.0],
        [3.0, -353.0, 13.0, 1.5],
        [5.0, -324.0, 16.0, 0.0],
    ]
    assert _harmonised(17.0, 1.0, 2.0) == close(np.array(expected))


def test_harmonising_stands_for_the_rest_of_a_long_brake():
    expected = [
        [0.0, -400.0, 4.0, -2.0],
        [2.0, -396.0, 0.0, 0.0],
        [5.0, -396.0, 0.0, 1.5],
        [5.0 + 16 / 1.5, -396.0 + 256 / 3.0, 16.0, 0.0],
    ]
    assert _harmonised(4.0, 0.0, 5.0) == close(np.array(expected))


@settings(max_examples=60, deadline=None)
@given(
    speed_mps=st.floats(0.0, 25.0),
    delay_s=st.floats(0.0, 5.0),
    brake_s=st.floats(0.0, 15.0),
    more_s=st.floats(0.0, 10.0),
)
def test_a_longer_brake_is_never_further_ahead_nor_faster(speed_mps, delay_s, brake_s, more_s):
    times_s = np.linspace(0.0, 60.0, 601)
    short_m, short_mps = sampled(_harmonised(speed_mps, delay_s, brake_s), times_s)
    long_m, long_mps = sampled(_harmonised(speed_mps, delay_s, brake_s + more_s), times_s)
    assert (long_m <= short_m + 1e-9).all()
    # one that still slows down to the target may be overtaken in speed by one that has reached it
    if speed_mps <= 16.0:
        assert (long_mps <= short_mps + 1e-9).all()


def test_stop_begins_as_late_as_its_braking_allows():
    out = np.full((6, 4), np.nan)
    n = append_stop(out, begin(out, 0.0, -160.0, 16.0), -10.0, 2.5)
    assert out[:n] == close(STOPPING)


@settings(max_examples=100, deadline=None)
@given(way=trajectories(start_s=0.0, station_m=-300.0), stop_m=st.floats(-299.0, 0.0))
def test_stop_is_at_its_station_or_refused(way, stop_m):
    assume(way[-1, 2] > 0.5)
    assume((way[:, 3] > -2.5).all())
    out = np.full((12, 4), np.nan)
    out[: len(way)] = way
    n = append_stop(out, len(way), stop_m, 2.5)
    if way[0, 2] ** 2 / 5.0 > stop_m + 300.0 + 1e-6:
        assert n == 0
        return
    assume(way[0, 2] ** 2 / 5.0 < stop_m + 300.0 - 1e-6)
    stopping = out[:n]
    assert stopping[-1, 1] == stop_m
    assert stopping[-1, 2] == stopping[-1, 3] == 0.0
    assert stopping[-2, 3] == -2.5
    brakes_s, brakes_mps = stopping[-2, 0], stopping[-2, 2]
    assert stopping[-1, 0] - brakes_s == close(brakes_mps / 2.5)
    assert stop_m - stopping[-2, 1] == pytest.approx(brakes_mps**2 / 5.0, abs=1e-7)
    times_s = np.linspace(0.0, brakes_s, 101)
    expected = np.array(sampled(way, times_s))
    assert np.array(sampled(stopping, times_s)) == pytest.approx(expected, abs=1e-8)


def test_stop_that_braking_at_once_overshoots_is_refused():
    out = np.empty((6, 4))
    assert append_stop(out, begin(out, 0.0, -61.1, 16.0), -10.0, 2.5) == 0
    assert append_stop(out, begin(out, 0.0, -61.2, 16.0), -10.0, 2.5) == 2


def test_start_and_station_of_the_final_stop():
    assert stop_starts_s(STOPPING) == 6.175
    assert stop_of_m(STOPPING) == -10.0
    assert stop_starts_s(STOPPING[:1]) == math.inf
    assert stop_starts_s(pieces(3.0, -10.0, 0.0)) == 3.0
    assert stop_starts_s(pieces(0.0, -10.0, 0.5)) == math.inf
    assert stop_starts_s(pieces(3.0, -10.0, 5.0, [(0.0, 2.0)])) == 3.0
    standing = np.array([[0.0, -10.0, 0.0, 0.0], [2.0, -10.0, 0.0, 0.0]])
    assert stop_starts_s(standing) == 2.0


def test_approach_leaves_out_a_stop_still_to_come():
    approach = _written(approach_without_stop, STOPPING, 2.0, ROAD, MOTION)
    assert approach == close(np.array([[2.0, -128.0, 16.0, 0.0], [10.0, 0.0, 16.0, 0.0]]))


def test_approach_speeds_up_again_from_within_a_stop():
    # at 8.175 s: 11 m/s and -61.2 + 32 - 5 = -34.2 m; 5 m/s more take 10/3 s and 45 m: too far
    nose_mps = math.sqrt(11.0**2 + 2.0 * 1.5 * 34.2)
    approach = _written(approach_without_stop, STOPPING, 8.175, ROAD, MOTION)
    expected = [[8.175, -34.2, 11.0, 1.5], [8.175 + (nose_mps - 11.0) / 1.5, 0.0, nose_mps, 0.0]]
    assert approach == close(np.array(expected))


def test_approach_of_a_vehicle_without_a_stop_goes_on_to_the_nose():
    way = pieces(0.0, -200.0, 13.0, [(16.0, 3.0)])
    approach = _written(approach_without_stop, way, 1.0, ROAD, MOTION)
    # 1 m/s2 is the commitment's own: 43.5 m up to -156.5 m at 3 s
    expected = [[1.0, -186.5, 14.0, 1.0], [3.0, -156.5, 16.0, 0.0], [12.78125, 0.0, 16.0, 0.0]]
    assert approach == close(np.array(expected))


def test_late_approach_by_hand():
    # down to 10 m/s in 3 s and 39 m, 5 s there, up again in 4 s and 52 m
    late = _written(late_approach, 0.0, -141.0, 16.0, 12.0, ROAD, MOTION)
    expected = [
        [0.0, -141.0, 16.0, -2.0],
        [3.0, -102.0, 10.0, 0.0],
        [8.0, -52.0, 10.0, 1.5],
        [12.0, 0.0, 16.0, 0.0],
    ]
    assert late == close(np.array(expected))


def test_late_approach_cannot_be_early_or_slower_than_the_slowest():
    # at 16 m/s all the way it takes 8.8125 s
    assert len(_written(late_approach, 0.0, -141.0, 16.0, 8.8, ROAD, MOTION)) == 0
    assert len(_written(late_approach, 0.0, -141.0, 16.0, 8.82, ROAD, MOTION)) == 4
    # by way of 2 m/s: 7 s and 63 m, 28/3 s and 84 m, which leaves nothing of 147 m
    latest_s = 7.0 + 28 / 3
    latest = _written(late_approach, 0.0, -147.0, 16.0, latest_s - 1e-3, ROAD, MOTION)
    assert latest[-1] == pytest.approx(np.array([latest_s - 1e-3, 0.0, 16.0, 0.0]), abs=1e-6)
    assert len(_written(late_approach, 0.0, -147.0, 16.0, latest_s + 1e-3, ROAD, MOTION)) == 0


def test_brake_and_go_by_hand():
    # at 16 m/s the nose is 10 s away; 2 s later is 32 m lost: (16 - u)^2 (1/4 + 1/3) = 32
    less_mps = math.sqrt(32.0 / (1.0 / 4.0 + 1.0 / 3.0))
    way = _written(brake_and_go, 0.0, -160.0, 16.0, 12.0, ROAD, MOTION)
    brake_s, regain_s = less_mps / 2.0, less_mps / 1.5
    braked_m = -160.0 + (16.0 - 0.5 * less_mps) * brake_s
    expected = [
        [0.0, -160.0, 16.0, -2.0],
        [brake_s, braked_m, 16.0 - less_mps, 1.5],
        [brake_s + regain_s, braked_m + (16.0 - 0.5 * less_mps) * regain_s, 16.0, 0.0],
        [12.0, 0.0, 16.0, 0.0],
    ]
    assert way == close(np.array(expected))


def test_brake_and_go_may_stand_for_a_while():
    # 20 s late are 320 m; 256 (1/4 + 1/3) = 149.33 m are lost by stopping, the rest by standing
    way = _written(brake_and_go, 0.0, -160.0, 16.0, 30.0, ROAD, MOTION)
    expected = [
        [0.0, -160.0, 16.0, -2.0],
        [8.0, -96.0, 0.0, 0.0],
        [8.0 + 32.0 / 3.0, -96.0, 0.0, 1.5],
        [8.0 + 64.0 / 3.0, -96.0 + 256.0 / 3.0, 16.0, 0.0],
        [30.0, 0.0, 16.0, 0.0],
    ]
    assert way == close(np.array(expected))


@pytest.mark.parametrize("speed_mps", [0.0, 4.0, 16.0, 17.0])
@pytest.mark.parametrize("nose_s", [25.0, 40.0])
def test_brake_and_go_is_at_the_nose_in_time_from_any_speed(speed_mps, nose_s):
    way = _written(brake_and_go, 3.0, -200.0, speed_mps, nose_s, ROAD, MOTION)
    assert way[0, :3].tolist() == [3.0, -200.0, speed_mps]
    assert way[-1, :3] == close(np.array([nose_s, 0.0, 16.0]))


def test_brake_and_go_is_neither_early_nor_short_of_the_ramp_s_speed():
    assert len(_written(brake_and_go, 0.0, -160.0, 16.0, 9.9, ROAD, MOTION)) == 0
    assert len(_written(brake_and_go, 0.0, -160.0, 8.0, 10.1, ROAD, MOTION)) == 0
    assert len(_written(brake_and_go, 0.0, -80.0, 0.0, 30.0, ROAD, MOTION)) == 0  # 85.3 m
    assert len(_written(brake_and_go, 0.0, -86.0, 0.0, 30.0, ROAD, MOTION)) > 0


def test_late_start_by_hand():
    # 2 s after it has come to its stop, 10 m before the nose: 10 = 0.75 t^2
    way = _written(late_start, STOPPING, 1.0, 2.0, ROAD, MOTION)
    off_s = math.sqrt(10.0 / 0.75)
    expected = [
        [1.0, -144.0, 16.0, 0.0],
        [6.175, -61.2, 16.0, -2.5],
        [12.575, -10.0, 0.0, 0.0],
        [14.575, -10.0, 0.0, 1.5],
        [14.575 + off_s, 0.0, 1.5 * off_s, 0.0],
    ]
    assert way == close(np.array(expected))
    # one that stands already waits from now on
    way = _written(late_start, STOPPING, 20.0, 2.0, ROAD, MOTION)
    expected = [
        [20.0, -10.0, 0.0, 0.0],
        [22.0, -10.0, 0.0, 1.5],
        [22.0 + off_s, 0.0, 1.5 * off_s, 0.0],
    ]
    assert way == close(np.array(expected))


def test_late_start_needs_a_stop():
    assert len(_written(late_start, pieces(0.0, -160.0, 16.0), 1.0, 2.0, ROAD, MOTION)) == 0


def test_late_approach_needs_a_way_to_the_ramp_s_speed():
    assert len(_written(late_approach, 0.0, -1.0, 5.0, 0.2, ROAD, MOTION)) == 0
    # 10 m leave room to slow down to 15.455 m/s and up again, 0.6358 s in all
    assert len(_written(late_approach, 0.0, -10.0, 16.0, 0.635, ROAD, MOTION)) > 0
    assert len(_written(late_approach, 0.0, -10.0, 16.0, 0.637, ROAD, MOTION)) == 0
    # 15 m/s needs (256 - 225) / 3 m to reach 16
    assert len(_written(late_approach, 0.0, -10.0, 15.0, 0.65, ROAD, MOTION)) == 0


@settings(max_examples=100, deadline=None)
@given(
    station_m=st.floats(-390.0, -20.0),
    speed_mps=st.floats(4.0, 17.0),
    pace_mps=st.floats(2.0, 17.0),
)
def test_late_approach_passes_the_nose_in_time_and_within_its_bounds(
    station_m, speed_mps, pace_mps
):
    nose_s = 5.0 - station_m / pace_mps
    late = _written(late_approach, 5.0, station_m, speed_mps, nose_s, ROAD, MOTION)
    assume(len(late) > 0)
    assert late[0, :3] == close(np.array([5.0, station_m, speed_mps]))
    assert late[-1] == pytest.approx(np.array([nose_s, 0.0, 16.0, 0.0]), abs=1e-6)
    assert (late[:, 2] >= 2.0 - 1e-9).all()
    assert set(late[:, 3]) <= {0.0, -2.0, 1.5}
    x = np.diff(late[:, 0])
    joins_m = late[:-1, 1] + late[:-1, 2] * x + late[:-1, 3] * x * x / 2.0
    assert late[1:, 1] == pytest.approx(joins_m, abs=1e-6)
