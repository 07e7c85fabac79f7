"""Fuel of a truck: its road load by hand, and the closed form against numerical integration."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from scipy.integrate import quad

from coramp.kinematics.fuel import (
    FUEL_MODELS,
    HEAVY_DUTY,
    PASSENGER_CAR,
    heavy_duty_piece_fuel_l,
    heavy_duty_rate_mlps,
    trajectory_fuel_l,
)
from tests.mathematics import close, pieces, sampled, trajectories


def rate_mlps(mass_kg, speed_mps, accel_mps2):
    """f_0 + max(0, F v) / (eta H) from the numbers that docs/vehicles.md gives."""
    force_n = mass_kg * (accel_mps2 + 9.8 * 0.006) + 3.12 * speed_mps**2
    return 0.8 + max(0.0, force_n * speed_mps) / (0.40 * 35500.0)


@pytest.mark.parametrize(
    ("speed_mps", "accel_mps2", "expected_mlps"),
    [
        (0.0, 0.0, 0.8),
        (0.0, 1.0, 0.8),  # no power at rest
        # 2352 N and 1248 N over 14200 J/ml
        (20.0, 0.0, 0.8 + 3600.0 * 20.0 / 14200.0),
        (20.0, 0.25, 0.8 + 13600.0 * 20.0 / 14200.0),
        (20.0, -0.09, 0.8),  # 3600 - 3600 N
        (20.0, -2.0, 0.8),
    ],
)
def test_the_rate_by_hand(speed_mps, accel_mps2, expected_mlps):
    assert heavy_duty_rate_mlps(40000.0, speed_mps, accel_mps2) == close(expected_mlps)


def test_40_t_at_80_km_h_take_31_l_per_100_km():
    speed_mps = 80.0 / 3.6
    litres = heavy_duty_piece_fuel_l(40000.0, speed_mps, 0.0, 100e3 / speed_mps)
    # 2352 + 1540.7 N at 22.22 m/s: 6.892 ml/s for 4500 s
    assert litres == pytest.approx(31.01, abs=0.01)
    assert heavy_duty_piece_fuel_l(15000.0, speed_mps, 0.0, 100e3 / speed_mps) < 0.75 * litres


@given(
    mass_kg=st.floats(3500.0, 60000.0),
    speed_mps=st.floats(0.0, 30.0),
    accel_mps2=st.one_of(st.floats(-3.0, 1.5), st.floats(-0.15, 0.0)),
    lasts_s=st.floats(0.01, 40.0),
)
@example(40000.0, 25.0, -0.1, 40.0)  # the engine pulls at first, and no more from 22.98 m/s on
@example(40000.0, 10.0, -2.0, 5.0)
def test_a_piece_is_the_integral_of_the_rate(mass_kg, speed_mps, accel_mps2, lasts_s):
    if accel_mps2 < 0.0:
        lasts_s = min(lasts_s, speed_mps / -accel_mps2)
    turns_s = 0.0
    load_n = mass_kg * (accel_mps2 + 9.8 * 0.006)
    if load_n < 0.0:
        turns_s = min(lasts_s, max(0.0, (speed_mps - (-load_n / 3.12) ** 0.5) / -accel_mps2))
    expected_ml = sum(
        quad(lambda t: rate_mlps(mass_kg, speed_mps + accel_mps2 * t, accel_mps2), low, high)[0]
        for low, high in ((0.0, turns_s), (turns_s, lasts_s))
    )
    found_l = heavy_duty_piece_fuel_l(mass_kg, speed_mps, accel_mps2, lasts_s)
    assert found_l == pytest.approx(expected_ml / 1000.0, rel=1e-9, abs=1e-12)


def test_braking_halfway_through_a_piece_by_hand():
    # 25 m/s, -0.1 m/s2: 40 t pull 3.12 v^2 - 1648 N, until 22.983 m/s at 20.17 s; then it idles
    times_s = np.linspace(0.0, 40.0, 400001)
    rates = np.array([rate_mlps(40000.0, 25.0 - 0.1 * t, -0.1) for t in times_s])
    found_l = heavy_duty_piece_fuel_l(40000.0, 25.0, -0.1, 40.0)
    assert found_l == pytest.approx(np.trapezoid(rates, times_s) / 1000.0, rel=1e-8)
    assert found_l > 0.8 * 40.0 / 1000.0


@given(way=trajectories(), after_s=st.floats(0.0, 10.0), lasts_s=st.floats(0.1, 20.0))
def test_fuel_of_a_trucks_trajectory_agrees_with_sampling(way, after_s, lasts_s):
    from_s, to_s = way[0, 0] + after_s, way[0, 0] + after_s + lasts_s
    cuts = [from_s, *[t for t in way[:, 0] if from_s < t < to_s], to_s]
    expected_ml = 0.0
    for low, high in pairwise(cuts):
        middles_s = low + (high - low) * (np.arange(4000) + 0.5) / 4000
        _, speeds = sampled(way, middles_s)
        accel = way[max(0, np.searchsorted(way[:, 0], middles_s[0], side="right") - 1), 3]
        rates = np.array([rate_mlps(40000.0, v, accel) for v in speeds])
        expected_ml += rates.mean() * (high - low)
    found_l = trajectory_fuel_l(way, from_s, to_s, HEAVY_DUTY, 40000.0)
    assert found_l == pytest.approx(expected_ml / 1000.0, rel=1e-5)


def test_a_car_burns_by_eq_48_whatever_its_mass():
    way = pieces(0.0, 0.0, 16.0, [(20.0, 2.0)])
    usual_l = trajectory_fuel_l(way, 0.0, 10.0, PASSENGER_CAR, 1500.0)
    assert trajectory_fuel_l(way, 0.0, 10.0, PASSENGER_CAR, 40000.0) == usual_l
    assert trajectory_fuel_l(way, 0.0, 10.0, HEAVY_DUTY, 40000.0) > 5.0 * usual_l


def test_each_model_has_its_name_and_any_other_is_refused():
    assert FUEL_MODELS[PASSENGER_CAR] == "passenger-car"
    assert FUEL_MODELS[HEAVY_DUTY] == "heavy-duty"
    way = pieces(0.0, 0.0, 16.0, [(20.0, 2.0)])
    for model in (-1, len(FUEL_MODELS)):
        with pytest.raises(ValueError, match="no such model of fuel"):
            trajectory_fuel_l(way, 0.0, 10.0, model, 40000.0)
