"""Ways that lose a given distance to v0: by hand, and what they promise for any numbers."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from coramp.kinematics.trajectory import MAX_PIECES, station_and_speed
from coramp.motion.slow_phase import least_effort_way, slow_phase, slow_speed_mps
from tests.mathematics import RULES, close

MOTION = RULES.motion


def test_slowing_down_by_hand():
    # from 20 m/s: 2 s of braking with 2 to 16 (36 m), 10 s at 16 (160 m), 8/3 s of speeding up
    # with 1.5 to 20 (48 m): 244 m in 14 2/3 s
    assert slow_speed_mps(244.0, 44.0 / 3.0, 20.0, 20.0, 2.0, 1.5) == close((16.0, 10.0))


def test_rising_to_a_slower_speed_by_hand():
    # from 15 m/s: 4/3 s to 17 (64/3 m), 6 s at 17 (102 m), 2 s to 20 (37 m)
    way_m = 64.0 / 3.0 + 102.0 + 37.0
    assert slow_speed_mps(way_m, 28.0 / 3.0, 15.0, 20.0, 2.0, 1.5) == close((17.0, 6.0))


@pytest.mark.parametrize("way_m", [30.0, 310.0])
def test_no_speed_loses_that_much_or_so_little(way_m):
    # at 20 m/s for 15 s: 300 m at most, and a stand and a start take more than 30 m
    assert np.isnan(slow_speed_mps(way_m, 15.0, 20.0, 20.0, 2.0, 1.5)[0])


speeds = st.floats(5.0, 25.0)
ends = st.floats(8.0, 40.0)
lags = st.floats(0.0, 80.0)


@given(speeds, ends, lags)
def test_it_ends_on_its_intercept_at_v0_in_time(speed_mps, end_s, lag_m):
    out = np.empty((MAX_PIECES, 4))
    n = slow_phase(out, 0.0, 0.0, speed_mps, end_s, -lag_m, 20.0, 2.0, 1.5)
    assume(n > 0)
    assert out[n - 1, 0] == pytest.approx(end_s)
    assert out[n - 1, 1] == pytest.approx(20.0 * end_s - lag_m, abs=1e-6)
    assert out[n - 1, 2] == 20.0
    assert out[:n, 2].min() > 0.0
    assert out[:n, 2].max() <= max(20.0, speed_mps) + 1e-9
    for k in range(1, n):
        station_m, mps = station_and_speed(out[:k], out[k, 0])
        assert (station_m, mps) == (pytest.approx(out[k, 1]), pytest.approx(out[k, 2]))


@given(speeds, ends, lags, st.floats(0.1, 3.0))
def test_a_way_of_least_effort_keeps_its_jerk_and_takes_no_more_than_a_cruise(
    speed_mps, end_s, lag_m, jerk_mps3
):
    out = np.empty((MAX_PIECES, 4))
    n = least_effort_way(out, 0.0, 0.0, speed_mps, end_s, -lag_m, 20.0, jerk_mps3, MOTION)
    assume(n > 0)
    assert out[n - 1, 1:3] == close((20.0 * end_s - lag_m, 20.0))
    at_s = np.linspace(0.0, end_s, 200)
    mps = np.array([station_and_speed(out[:n], t)[1] for t in [-1.0, *at_s, end_s + 1.0]][1:-1])
    later = np.array([station_and_speed(out[:n], min(t + 1.0, end_s))[1] for t in at_s])
    assert mps.max() <= max(20.0, speed_mps) + 1e-6
    assert later.min() > 0.0
    accel = np.concatenate([[0.0], out[:n, 3]])
    hold_s = np.diff(out[:n, 0])
    within_1_s = max(1, round(1.0 / hold_s.min()))
    for k in range(within_1_s, len(accel)):
        assert abs(accel[k] - accel[k - within_1_s]) <= jerk_mps3 + 1e-9
    effort = float((out[: n - 1, 3] ** 2 * hold_s).sum())
    cruise = np.empty((MAX_PIECES, 4))
    m = slow_phase(cruise, 0.0, 0.0, speed_mps, end_s, -lag_m, 20.0, 2.0, 1.5)
    if m > 1:
        other = float((cruise[: m - 1, 3] ** 2 * np.diff(cruise[:m, 0])).sum())
        # held over periods it is the best of those, not of all
        assert effort <= other * 1.05 + 1e-6
