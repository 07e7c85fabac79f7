"""Means over seeds with their intervals, and the paper's improvement rates (Eq. 46, 47)."""

import math
from collections.abc import Sequence
from typing import NamedTuple

CONFIDENCE = 0.95


class Estimate(NamedTuple):
    """A mean and half the width of its 95 % interval; nan where there is none."""

    mean: float
    half_width: float
    values: int


def estimate(values: Sequence[float]) -> Estimate:
    """Returns the mean and its interval by Student's t; one value has no interval."""
    n = len(values)
    if n == 0:
        return Estimate(math.nan, math.nan, 0)
    mean = math.fsum(values) / n
    if n == 1:
        return Estimate(mean, math.nan, 1)
    variance = math.fsum((value - mean) ** 2 for value in values) / (n - 1)
    from scipy.special import stdtrit

    quantile = float(stdtrit(n - 1, 0.5 + CONFIDENCE / 2.0))
    return Estimate(mean, quantile * math.sqrt(variance / n), n)


def improvement_rate(controlled: float, uncontrolled: float) -> float:
    """Returns I = 1 - D / D_k as a share (Eq. 46 for mainline, Eq. 47 for ramp priority).

    Raises ValueError for a D_k of 0.
    """
    if uncontrolled == 0.0:
        raise ValueError("without a baseline delay there is no improvement rate")
    return 1.0 - controlled / uncontrolled


def ratio_of_sums(values: Sequence[float], over: Sequence[float]) -> Estimate:
    """Returns R = sum(x) / sum(y) of pairs, with its interval; nan where the y add up to 0.

    The interval is that of a ratio estimator: Student's t by the standard error of the mean of
    x - R y, over the mean of y. It keeps that x and y are of the same seed.
    """
    total = math.fsum(over)
    if total == 0.0:
        return Estimate(math.nan, math.nan, len(values))
    ratio = math.fsum(values) / total
    left = estimate([x - ratio * y for x, y in zip(values, over, strict=True)])
    return Estimate(ratio, left.half_width * len(values) / total, len(values))


def rate_interval(count: int, exposure: float) -> tuple[float, float]:
    """Returns the exact 95 % interval of a rate by its Poisson count (Garwood).

    Where nothing was counted it is 0 to the one-sided 95 % limit, -ln 0.05 / exposure, which is the
    rule of three. Nan without exposure.
    """
    from scipy.special import gammaincinv

    if exposure <= 0.0:
        return math.nan, math.nan
    if count == 0:
        return 0.0, -math.log(1.0 - CONFIDENCE) / exposure
    tail = 0.5 * (1.0 - CONFIDENCE)
    low, high = gammaincinv(count, tail), gammaincinv(count + 1, 1.0 - tail)
    return float(low) / exposure, float(high) / exposure
