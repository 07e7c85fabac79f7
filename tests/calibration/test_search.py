"""The search finds known parameters of a noisy function in few runs."""

import numpy as np
import pytest

from coramp.calibration.calibrate import ROUNDS as ROUNDS_OF_CALIBRATION
from coramp.calibration.search import (
    USUAL_WITHIN,
    Axis,
    Round,
    Runs,
    Wanted,
    costs,
    rounds_of,
    search,
    surrogate_of,
    terms,
)

ROUNDS = (Round(40, 0.5, 0.3), Round(20, 0.25, 0.2), Round(20, 0.12, 0.1))
AXES = (Axis("a", 0.0, 2.0), Axis("b", 1.0, 3.0), Axis("c", 0.0, 1.0, usual=0.8))


def test_terms_are_all_products_of_two():
    assert terms(np.array([[2.0, 3.0]])).tolist() == [[1.0, 2.0, 3.0, 4.0, 6.0, 9.0]]


def test_a_quadratic_is_learnt_as_it_is():
    random = np.random.default_rng(1)
    places = random.random((60, 2))
    values = 3.0 + 2.0 * places[:, :1] - places[:, 1:] * places[:, :1]
    surrogate = surrogate_of(Runs(places, values), np.array([0.4, 0.6]), 2.0, np.array([1e-9]))
    assert surrogate.means(np.array([[0.4, 0.6]])).item() == pytest.approx(3.56, abs=0.01)
    assert surrogate.noise.item() < 0.02


@pytest.mark.parametrize("truth", [(0.3, 0.6), (0.7, 0.25)])
def test_known_parameters_are_found_through_noise(truth):
    random = np.random.default_rng(7)

    def means(places):
        a, b = places[:, 0], places[:, 1]
        return np.column_stack([np.exp(a), a * b + 0.2 * b, np.full(len(a), np.nan)])

    def simulate(places):
        return means(places) + random.normal(0.0, 0.02, (len(places), 3))

    measured = means(np.array([truth]))[0]
    place, surrogate, runs = search(AXES, ROUNDS, simulate, Wanted(measured), np.full(3, 1e-3))
    assert np.abs(place[:2] - truth).max() < 0.02
    assert place[2] == pytest.approx(0.8, abs=0.01)  # it shows nowhere and stays as is usual
    assert len(runs.places) == 80
    assert surrogate.noise[0] == pytest.approx(0.02, rel=0.5)
    assert np.isinf(surrogate.noise[2])


def test_what_was_measured_more_often_counts_more_than_what_is_usual():
    runs = Runs(np.linspace(0.0, 1.0, 11)[:, None], np.linspace(0.0, 1.0, 11)[:, None])
    surrogate = surrogate_of(runs, np.array([0.5]), 9.0, np.array([0.1]))
    places, usual = np.array([[0.3], [0.5]]), np.array([0.5])
    once, often = (costs(surrogate, Wanted(np.array([0.3]), n), usual, places) for n in (1, 4))
    aside = (0.2 / USUAL_WITHIN) ** 2
    assert once == pytest.approx([aside, 4.0], abs=0.02)
    assert often == pytest.approx([aside, 16.0], abs=0.08)


def test_rounds_share_all_runs():
    rounds = rounds_of(10, [(0.37, 0.5, 0.3), (0.33, 0.2, 0.2), (0.3, 0.1, 0.1)])
    assert rounds == [Round(4, 0.5, 0.3), Round(3, 0.2, 0.2), Round(3, 0.1, 0.1)]
    assert sum(one.runs for one in rounds_of(97, ROUNDS_OF_CALIBRATION)) == 97


def test_values_have_three_digits():
    assert AXES[1].value(1.0 / 3.0) == 1.667
    assert AXES[2].usual_share == pytest.approx(0.8)
