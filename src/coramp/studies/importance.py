"""Importance sampling: rates of rare events from runs in which what causes them is frequent.

Runs are drawn by a law in which something rare happens often. Each counts with its likelihood ratio
w = p(run) / q(run) of the nominal law p to that law q, so that sums of w x over runs estimate what
sums of x would be under p, without bias.
"""

import math
from collections.abc import Iterable, Sequence
from typing import NamedTuple

from coramp.studies.statistics import CONFIDENCE


class WeightedRate(NamedTuple):
    """A rate with its 95 % interval, and how many runs with an event it rests on effectively."""

    rate: float
    low: float
    high: float
    effective: float


def poisson_ratio(count: int, nominal: float, drawn: float) -> float:
    """Returns p / q of a run in which ``count`` events of a Poisson process happened.

    ``(nominal / drawn)^count exp(drawn - nominal)``, with how many are expected in a run under
    either law. It holds for the whole process: where in time the events are has the same law.
    """
    return math.exp(count * math.log(nominal / drawn) + drawn - nominal)


def effective_size(weights: Iterable[float]) -> float:
    """Returns Kish's effective sample size, ``(sum w)^2 / sum w^2``; 0 where nothing weighs."""
    own = list(weights)
    squares = math.fsum(w * w for w in own)
    return math.fsum(own) ** 2 / squares if squares > 0.0 else 0.0


def weighted_rate(
    weights: Sequence[float], counts: Sequence[float], exposure: float
) -> WeightedRate:
    """Returns ``sum w x / exposure``, the rate of events of which runs have ``counts`` x.

    ``weights`` are those of all runs in which an event of this kind can happen; ``exposure`` is of
    all runs that were drawn. The interval is that of Fay and Feuer (1997, Statistics in Medicine
    16, 791-801) for weighted Poisson counts, with the run as the unit: with y = sum w x,
    v = sum (w x)^2 and m the largest weight (times the largest x), y and y + m are gamma
    distributed with the variances v and v + m^2. For equal weights and single events it is
    Garwood's exact one. Without an event it is 0 to the one-sided limit -m ln 0.05 / exposure, the
    rule of three for events of the largest weight. Nan without exposure or weights.
    """
    if exposure <= 0.0 or not weights:
        return WeightedRate(math.nan, math.nan, math.nan, 0.0)
    parts = [w * x for w, x in zip(weights, counts, strict=True)]
    total, largest = math.fsum(parts), max(weights) * max(1.0, *counts)
    if total == 0.0:
        limit = -math.log(1.0 - CONFIDENCE) * largest / exposure
        return WeightedRate(0.0, 0.0, limit, 0.0)
    squares, tail = math.fsum(part * part for part in parts), 0.5 * (1.0 - CONFIDENCE)
    low = _gamma_quantile(total, squares, tail)
    high = _gamma_quantile(total + largest, squares + largest**2, 1.0 - tail)
    return WeightedRate(total / exposure, low / exposure, high / exposure, effective_size(parts))


def _gamma_quantile(mean: float, variance: float, probability: float) -> float:
    """The quantile of the gamma distribution with a mean and a variance."""
    from scipy.special import gammaincinv

    return float(gammaincinv(mean**2 / variance, probability)) * variance / mean
