"""Eq. 48 with Table 3, by hand, and its integral against a quadrature."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad

from coramp.kinematics.fuel import (
    PASSENGER_CAR,
    fuel_rate_mlps,
    piece_fuel_l,
    trajectory_fuel_l,
)
from tests.mathematics import close, pieces, sampled, trajectories


@pytest.mark.parametrize(
    ("speed_mps", "accel_mps2", "rate_mlps"),
    [
        (0.0, 0.0, 0.1569),
        (20.0, 0.0, 0.8283),  # 0.1569 + 0.49 - 0.2966 + 0.478
        (20.0, 1.0, 3.26674),  # and 0.07224 + 1.9362 + 0.43
        (15.0, 2.0, 4.09174875),  # 0.55921875 + 2 * 1.766265
        (10.0, -3.0, 0.3875),  # 0.1569 + 0.245 - 0.07415 + 0.05975
    ],
)
def test_eq_48_with_the_coefficients_of_table_3(speed_mps, accel_mps2, rate_mlps):
    assert fuel_rate_mlps(speed_mps, accel_mps2) == close(rate_mlps)


def test_fuel_of_a_piece_is_the_integral_over_speed():
    # integrals of f dv / a, in exact fractions: 16 to 20 m/s in 2 s, 20 to 10 m/s in 5 s
    assert piece_fuel_l(16.0, 2.0, 2.0) == pytest.approx(0.010077072, rel=1e-12)
    assert piece_fuel_l(20.0, -2.0, 5.0) == pytest.approx(0.0028772291666666667, rel=1e-12)


def test_fuel_of_a_trajectory_counts_only_the_span():
    way = pieces(0.0, 0.0, 16.0, [(16.0, 10.0), (20.0, 2.0)])
    # 5 s at 16 m/s (0.1569 + 0.392 - 0.189824 + 0.244736), the 2 s above, 3 s at 20 m/s
    expected_l = 5 * 0.603812e-3 + 0.010077072 + 3 * 0.8283e-3
    for from_s, to_s, fuel_l in [(5.0, 15.0, expected_l), (15.0, 15.0, 0.0), (15.0, 5.0, 0.0)]:
        found_l = trajectory_fuel_l(way, from_s, to_s, PASSENGER_CAR, 1500.0)
        assert found_l == pytest.approx(fuel_l, rel=1e-9)


def _rate_mlps(way, time_s):
    _, speeds = sampled(way, np.array([time_s]))
    accel = way[max(0, np.searchsorted(way[:, 0], time_s, side="right") - 1), 3]
    v = speeds[0]
    cruise = 0.1569 + 0.0245 * v - 0.0007415 * v**2 + 0.00005975 * v**3
    return cruise + max(0.0, accel) * (0.07224 + 0.09681 * v + 0.001075 * v**2)


@settings(max_examples=30, deadline=None)
@given(way=trajectories(), after_s=st.floats(0.0, 10.0), lasts_s=st.floats(0.1, 20.0))
def test_fuel_of_a_trajectory_agrees_with_a_quadrature(way, after_s, lasts_s):
    from_s, to_s = way[0, 0] + after_s, way[0, 0] + after_s + lasts_s
    cuts = [from_s, *[t for t in way[:, 0] if from_s < t < to_s], to_s]
    expected_ml = sum(
        quad(lambda t: _rate_mlps(way, t), low, high)[0] for low, high in pairwise(cuts)
    )
    found_l = trajectory_fuel_l(way, from_s, to_s, PASSENGER_CAR, 1500.0)
    assert found_l == pytest.approx(expected_ml / 1000.0, rel=1e-9)
