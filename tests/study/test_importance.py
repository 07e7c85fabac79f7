"""Importance sampling: worked numbers, and rare probabilities that are known."""

import math

import numpy as np
import pytest

from coramp.studies.importance import effective_size, poisson_ratio, weighted_rate
from coramp.studies.statistics import rate_interval


def test_the_ratio_of_a_poisson_process_by_hand():
    """Of 0.01 expected and 1 drawn: e^0.99 = 2.691 without an event, a hundredth each with one."""
    assert poisson_ratio(0, 0.01, 1.0) == pytest.approx(math.exp(0.99))
    assert poisson_ratio(1, 0.01, 1.0) == pytest.approx(0.01 * math.exp(0.99))
    assert poisson_ratio(2, 0.01, 1.0) == pytest.approx(1e-4 * math.exp(0.99))
    assert poisson_ratio(3, 2.0, 2.0) == pytest.approx(1.0)


def test_ratios_have_the_mean_1_under_the_law_that_is_drawn():
    drawn = 1.3
    chance = [math.exp(-drawn) * drawn**k / math.factorial(k) for k in range(60)]
    ratios = [poisson_ratio(k, 0.2, drawn) for k in range(60)]
    assert math.fsum(p * w for p, w in zip(chance, ratios, strict=True)) == pytest.approx(1.0)


def test_the_effective_size_by_hand():
    """(1 + 1 + 2)^2 / (1 + 1 + 4) = 16 / 6; equal weights count all, nothing counts nothing."""
    assert effective_size([1.0, 1.0, 2.0]) == pytest.approx(16.0 / 6.0)
    assert effective_size([0.3] * 7) == pytest.approx(7.0)
    assert effective_size([5.0, 1e-9]) == pytest.approx(1.0)
    assert effective_size([]) == effective_size([0.0]) == 0.0


def test_the_rate_by_hand():
    """Weights 0.1 and 0.02, 3 events and 1, over 50 km: (0.3 + 0.02) / 50."""
    found = weighted_rate([0.1, 0.02, 0.1], [3, 1, 0], 50.0)
    assert found.rate == pytest.approx(0.32 / 50.0)
    assert found.effective == pytest.approx(0.32**2 / (0.09 + 0.0004))
    assert found.low < found.rate < found.high


@pytest.mark.parametrize("count", [1, 2, 10])
def test_with_equal_weights_the_interval_is_garwoods(count):
    weights, counts = [0.01] * 40, [1] * count + [0] * (40 - count)
    low, high = rate_interval(count, 500.0)
    found = weighted_rate(weights, counts, 500.0)
    assert (found.low, found.high) == (pytest.approx(0.01 * low), pytest.approx(0.01 * high))
    assert found.effective == pytest.approx(count)


def test_without_an_event_the_limit_is_the_rule_of_three_of_the_largest_weight():
    found = weighted_rate([0.01, 0.04], [0, 0], 500.0)
    assert (found.rate, found.low, found.effective) == (0.0, 0.0, 0.0)
    assert found.high == pytest.approx(-math.log(0.05) * 0.04 / 500.0)


def test_nothing_drawn_tells_nothing():
    assert math.isnan(weighted_rate([], [], 10.0).rate)
    assert math.isnan(weighted_rate([1.0], [1], 0.0).high)


def test_several_events_of_one_run_are_one_observation():
    """Ten events of one run are known less well than one each of ten runs."""
    one = weighted_rate([0.1] * 10, [10] + [0] * 9, 100.0)
    ten = weighted_rate([0.1] * 10, [1] * 10, 100.0)
    assert one.rate == pytest.approx(ten.rate)
    assert one.effective == pytest.approx(1.0)
    assert one.low < ten.low < ten.high < one.high


NOMINAL, DRAWN, FOLLOWS, RUNS = 0.002, 1.0, 0.05, 300
"""Brakings expected in a run, nominally and as drawn; each is followed by an event with 5 %."""
TRUTH = NOMINAL * FOLLOWS
"""Events a run, a Poisson process thinned: one in 10,000 runs."""


def estimates(repeats):
    """Returns rates and intervals of studies of 300 runs each."""
    random = np.random.default_rng(5)
    found = []
    for _ in range(repeats):
        brakings = random.poisson(DRAWN, RUNS)
        events = random.binomial(brakings, FOLLOWS)
        able = brakings > 0
        weights = [poisson_ratio(k, NOMINAL, DRAWN) for k in brakings[able].tolist()]
        found.append(weighted_rate(weights, events[able].tolist(), float(RUNS)))
    return found


def test_a_rare_rate_that_is_known_is_found_without_bias():
    """300 runs as they are would show an event in one study of 33."""
    found = np.array([own.rate for own in estimates(2000)])
    assert abs(found.mean() - TRUTH) < 4.0 * found.std() / math.sqrt(len(found))
    assert found.std() < 0.5 * TRUTH


def test_the_interval_holds_a_rate_that_is_known_as_often_as_it_says():
    found = estimates(1000)
    held = np.mean([own.low <= TRUTH <= own.high for own in found])
    assert held >= 0.95


def test_the_limit_without_an_event_holds():
    """Where an event follows so rarely that most studies see none."""
    random = np.random.default_rng(7)
    follows, none, held = 0.004, 0, 0
    for _ in range(2000):
        brakings = random.poisson(DRAWN, RUNS)
        events = random.binomial(brakings, follows)
        able = brakings > 0
        weights = [poisson_ratio(k, NOMINAL, DRAWN) for k in brakings[able].tolist()]
        found = weighted_rate(weights, events[able].tolist(), float(RUNS))
        none += found.rate == 0.0
        held += NOMINAL * follows <= found.high
    assert none > 600
    assert held / 2000 >= 0.95


def test_the_tail_of_a_normal_distribution():
    """P(z > 4) = 3.17e-5, drawn around 4: w = exp(8 - 4 z). As it is, 500 draws show nothing."""
    random = np.random.default_rng(11)
    truth = 0.5 * math.erfc(4.0 / math.sqrt(2.0))
    found = []
    for _ in range(400):
        z = 4.0 + random.standard_normal(500)
        weights = np.exp(8.0 - 4.0 * z)
        able = z > 4.0  # nothing else is an event: there the weight is at most exp(-8)
        found.append(weighted_rate(weights[able].tolist(), [1] * int(able.sum()), 500.0))
    rates = np.array([own.rate for own in found])
    assert abs(rates.mean() - truth) < 4.0 * rates.std() / 20.0
    assert np.mean([own.low <= truth <= own.high for own in found]) >= 0.95
    assert 20.0 < np.mean([own.effective for own in found]) < 250.0
