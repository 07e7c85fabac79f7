"""Rios-Torres and Malikopoulos: u = a t + b, its ends, and that nothing else takes less effort."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from coramp.motion.least_effort import (
    coefficients,
    constrained_optimum,
    held_optimum,
    held_shift,
    speeds_mps,
)
from tests.mathematics import close

speeds = st.floats(0.0, 40.0)
durations = st.floats(0.5, 40.0)
distances = st.floats(1.0, 600.0)


def test_constants_by_hand():
    # 100 m in 10 s from 8 to 12 m/s is what an even acceleration does
    assert coefficients(100.0, 10.0, 8.0, 12.0) == close((0.0, 0.4))
    # 60 m in 6 s from a stand to a stand: u = 10 - 10 t / 3, 15 m/s at half time
    a, b = coefficients(60.0, 6.0, 0.0, 0.0)
    assert (a, b) == close((-10.0 / 3.0, 10.0))
    assert a * 3.0**2 / 2.0 + b * 3.0 == close(15.0)


def test_the_source_solves_four_equations_for_the_same_constants():
    s1_m, t1_s, v0, v1 = 400.0, 32.0, 13.4, 11.0
    t = t1_s
    rows = [[0, 0, 0, 1], [0, 0, 1, 0], [t**3 / 6, t**2 / 2, t, 1], [t**2 / 2, t, 1, 0]]
    a, b, c, d = np.linalg.solve(np.array(rows, float), [0.0, v0, s1_m, v1])
    assert (c, d) == (pytest.approx(v0), pytest.approx(0.0))
    assert coefficients(s1_m, t1_s, v0, v1) == (pytest.approx(a), pytest.approx(b))


def test_a_duration_must_be_positive():
    with pytest.raises(ValueError, match="positive"):
        coefficients(10.0, 0.0, 5.0, 5.0)


def ends(start_mps, accel_mps2, duration_s):
    """Distance and speed after holding accelerations over equal periods, piece by piece."""
    period_s = duration_s / len(accel_mps2)
    way_m, speed_mps = 0.0, start_mps
    for u in accel_mps2:
        way_m += speed_mps * period_s + u * period_s**2 / 2.0
        speed_mps += u * period_s
    return way_m, speed_mps


@given(distances, durations, speeds, speeds, st.integers(2, 40))
def test_held_accelerations_meet_both_ends(distance_m, duration_s, start_mps, end_mps, periods):
    accel = held_optimum(distance_m, duration_s, start_mps, end_mps, periods)
    way_m, speed_mps = ends(start_mps, accel, duration_s)
    assert way_m == pytest.approx(distance_m, abs=1e-6)
    assert speed_mps == pytest.approx(end_mps, abs=1e-7)


@given(distances, durations, speeds, speeds, st.integers(3, 20), st.integers(0, 2**31), st.data())
def test_any_other_way_to_the_same_ends_takes_more_effort(
    distance_m, duration_s, start_mps, end_mps, periods, seed, data
):
    accel = held_optimum(distance_m, duration_s, start_mps, end_mps, periods)
    period_s = duration_s / periods
    lever_s = duration_s - (np.arange(periods) + 0.5) * period_s
    kept = np.vstack([np.ones(periods), lever_s / duration_s])
    change = np.random.default_rng(seed).normal(size=periods)
    change -= np.linalg.lstsq(kept.T, change, rcond=None)[0] @ kept
    other = accel + data.draw(st.floats(0.01, 10.0)) * change
    assert ends(start_mps, other, duration_s)[0] == pytest.approx(distance_m, abs=1e-5)
    assert (other**2).sum() >= (accel**2).sum()


def test_many_periods_come_to_the_effort_of_the_continuous_optimum():
    a, b = coefficients(230.0, 14.0, 16.0, 20.0)
    t = np.linspace(0.0, 14.0, 200001)
    continuous = np.trapezoid((a * t + b) ** 2, t) / 2.0
    held = held_optimum(230.0, 14.0, 16.0, 20.0, 1000)
    assert (held**2).sum() / 2.0 * 14.0 / 1000 == pytest.approx(continuous, rel=1e-5)


def test_without_a_limit_that_binds_it_is_the_line():
    limits = np.full(20, 40.0)
    found = constrained_optimum(230.0, 14.0, 16.0, 20.0, 3.0, limits)
    assert found == pytest.approx(held_optimum(230.0, 14.0, 16.0, 20.0, 20))


def test_where_the_speed_limit_binds_there_is_an_arc_at_it():
    # without the limit it would have to drive faster than 20 m/s in between
    free = held_optimum(190.0, 10.0, 16.0, 20.0, 40)
    assert speeds_mps(16.0, free, 0.25).max() > 20.05
    accel = constrained_optimum(190.0, 10.0, 16.0, 20.0, 3.0, np.full(40, 20.0))
    driven = speeds_mps(16.0, accel, 0.25)
    assert driven.max() <= 20.0 + 1e-9
    on_limit = driven > 20.0 - 1e-6
    assert on_limit.sum() > 5
    first = int(np.argmax(on_limit))
    assert on_limit[first:].all()
    assert np.abs(accel[first + 1 :]).max() < 1e-6
    assert np.diff(accel[:first], 2) == pytest.approx(0.0, abs=1e-6)  # a line up to the limit
    assert ends(16.0, accel, 10.0) == (pytest.approx(190.0), pytest.approx(20.0))


def test_where_the_acceleration_binds_it_starts_on_that_bound():
    # 160 m in 10 s from 20 to 20 m/s: the line begins with -2.4 m/s2
    free = held_optimum(160.0, 10.0, 20.0, 20.0, 40)
    assert free[0] < -2.2
    accel = constrained_optimum(160.0, 10.0, 20.0, 20.0, 2.0, np.full(40, 20.0))
    assert np.abs(accel).max() <= 2.0 + 1e-9
    assert accel[:3] == pytest.approx(-2.0)
    assert accel[-3:] == pytest.approx(2.0)
    assert ends(20.0, accel, 10.0) == (pytest.approx(160.0), pytest.approx(20.0))
    assert (accel**2).sum() > (free**2).sum()


def test_what_no_acceleration_within_the_bounds_reaches_is_none():
    assert constrained_optimum(300.0, 10.0, 16.0, 20.0, 3.0, np.full(20, 20.0)) is None


@given(st.floats(-30.0, 30.0), st.floats(2.0, 30.0), st.integers(1, 12), st.floats(0.5, 4.0))
def test_a_shift_moves_by_itself_and_keeps_the_speed(shift_m, duration_s, half, most_mps2):
    accel = held_shift(shift_m, duration_s, 2 * half, most_mps2)
    if accel is None:
        assert abs(shift_m) > 0.25 * most_mps2 * duration_s**2 * (1.0 - 1e-9)
        return
    way_m, speed_mps = ends(0.0, accel, duration_s)
    assert way_m == pytest.approx(shift_m, abs=1e-6)
    assert speed_mps == pytest.approx(0.0, abs=1e-9)
    assert np.abs(accel).max() <= most_mps2 + 1e-12


def test_a_shift_takes_a_quarter_less_effort_than_the_triangle():
    # 12 d^2 / T^3 against 16 d^2 / T^3, each times a half
    accel = held_shift(-4.0, 10.0, 400, 3.0)
    assert (accel**2).sum() * 10.0 / 400 == pytest.approx(12.0 * 16.0 / 1000.0, rel=1e-3)
