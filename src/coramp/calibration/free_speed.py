"""How fast drivers wish to drive, from detectors where they are left to it."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from coramp._kernel import BoolArray, FloatArray
from coramp.calibration.series import Series

LEAST_INTERVALS = 6
"""With fewer intervals the spread is off by a third."""


@dataclass(frozen=True)
class FreeSpeed:
    """Mean of drivers' speeds and its standard deviation among them (m/s), None where not told.

    ``vehicles`` and ``intervals`` are how many it rests on.
    """

    mean_mps: float
    deviation_mps: float | None
    vehicles: int
    intervals: int


def free_speed(series: Series, detectors: Sequence[str], when: BoolArray) -> FreeSpeed:
    """Returns mean and spread of speeds in some intervals; nan for a mean of nobody.

    An interval k in which n_k vehicles pass tells their mean v_k. The mean over all vehicles is
    v = sum n_k v_k / sum n_k. If speeds have a variance s^2 among drivers, v_k has s^2 / n_k, and
    s^2 = sum n_k (v_k - v)^2 / (K - 1) from K intervals. Both are means over the detectors.
    """
    found = [_at(series.vehicles[name][when], series.speed_mps[name][when]) for name in detectors]
    means, variances, vehicles, intervals = zip(*found, strict=True)
    spread = None
    if min(intervals) >= LEAST_INTERVALS:
        spread = float(np.sqrt(np.mean(variances)))
    return FreeSpeed(float(np.mean(means)), spread, int(min(vehicles)), int(min(intervals)))


def _at(counts: FloatArray, speeds_mps: FloatArray) -> tuple[float, float, float, int]:
    """Mean (m/s) and variance of speeds at one detector, vehicles and intervals."""
    known = (counts > 0) & ~np.isnan(speeds_mps)
    counts, speeds_mps = counts[known], speeds_mps[known]
    if not len(counts):
        return float("nan"), float("nan"), 0.0, 0
    mean = float(np.average(speeds_mps, weights=counts))
    squares = float((counts * (speeds_mps - mean) ** 2).sum())
    return mean, squares / max(1, len(counts) - 1), float(counts.sum()), len(counts)
