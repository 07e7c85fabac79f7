"""Fitted pieces: few, through samples, never further than the tolerance from the others."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from coramp.metrics.fitting import TOLERANCE_M, fitted_pieces
from coramp.metrics.motion import pieces_of_samples

STEP_S = 0.1


def driven(speeds_mps, start_s=3.0):
    """Samples of one vehicle that drives so, Euler's way, as SUMO's do."""
    times_s = start_s + STEP_S * np.arange(len(speeds_mps))
    stations_m = -400.0 + np.concatenate([[0.0], np.cumsum(STEP_S * np.array(speeds_mps[1:]))])
    return times_s, stations_m


def fitted_of(speeds_mps, lane):
    times_s, stations_m = driven(speeds_mps)
    first, rows = pieces_of_samples(
        np.zeros(len(times_s), np.int64), times_s, stations_m, np.array(speeds_mps), 1
    )
    return times_s, stations_m, *fitted_pieces(first, rows, lane)


def station_by_hand_m(rows, time_s):
    for start_s, station_m, speed_mps, accel_mps2 in reversed(rows):
        if time_s >= start_s - 1e-9:
            x = time_s - start_s
            return station_m + speed_mps * x + accel_mps2 * x * x / 2
    raise AssertionError("before the first piece")


def starts_of_lane(times_s, lane):
    return [times_s[k] for k in range(1, len(lane)) if lane[k] != lane[k - 1]]


@settings(deadline=None, max_examples=60)
@given(
    st.lists(st.floats(-4.0, 3.0), min_size=2, max_size=300),
    st.integers(0, 300),
)
def test_every_sample_is_met_within_the_tolerance(accels_mps2, merge_at):
    speeds_mps = np.clip(18.0 + STEP_S * np.cumsum(accels_mps2), 0.0, 30.0).tolist()
    lane = np.where(np.arange(len(speeds_mps)) < merge_at, 0, 2)
    times_s, stations_m, first, rows, lanes = fitted_of(speeds_mps, lane)
    assert first.tolist() == [0, len(rows)]
    for time_s, station_m in zip(times_s, stations_m, strict=True):
        assert abs(station_by_hand_m(rows, time_s) - station_m) <= TOLERANCE_M + 1e-9
    assert starts_of_lane(rows[:, 0], lanes) == starts_of_lane(times_s, lane)


def test_a_cruise_is_few_pieces_and_exact():
    times_s, stations_m, _, rows, _ = fitted_of([20.0] * 201, np.full(201, 2))
    assert len(rows) == 3
    assert np.abs(rows[:, 3]).max() < 1e-12
    assert abs(station_by_hand_m(rows, times_s[-1]) - stations_m[-1]) < 1e-9


def test_a_jump_of_speed_is_not_smoothed_away():
    speeds_mps = [20.0] * 50 + [0.0] * 50
    times_s, stations_m, _, rows, _ = fitted_of(speeds_mps, np.full(100, 2))
    assert abs(station_by_hand_m(rows, times_s[60]) - stations_m[60]) <= TOLERANCE_M
    assert rows[-1, 1] == stations_m[-1]
