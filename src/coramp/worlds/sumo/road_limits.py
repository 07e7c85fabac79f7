"""Speed limits along the ways of merge sites as arrays, for kernels."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from coramp._kernel import FloatArray, IntArray, kernel
from coramp.networks.limits import SLOWS_MPS2, Limits

MAINLINE_WAY, RAMP_WAY = 0, 1
"""The ways of a site, of each of which limits are kept."""


class RoadLimits(NamedTuple):
    """Speed limits as arrays [site, way, place along it]; ``known`` is how many each way has."""

    known: IntArray
    from_m: FloatArray
    limit_mps: FloatArray
    squared: FloatArray


def road_limits_of(ways: Sequence[Sequence[Limits]]) -> RoadLimits:
    """Returns the limits of sites, of each those along its mainline and its ramp."""
    most = max((len(limits.from_m) for way in ways for limits in way), default=0)

    def padded(values: Sequence[float]) -> list[float]:
        return [*values, *[np.inf] * (most - len(values))]

    def squares(limits: Limits) -> list[float]:
        return [limit**2 for limit in limits.limit_mps]

    return RoadLimits(
        np.array([[len(limits.from_m) for limits in way] for way in ways], np.int64),
        np.array([[padded(limits.from_m) for limits in way] for way in ways], np.float64),
        np.array([[padded(limits.limit_mps) for limits in way] for way in ways], np.float64),
        np.array([[padded(squares(limits)) for limits in way] for way in ways], np.float64),
    )


NO_LIMITS = road_limits_of([[Limits((), ()), Limits((), ())]])
"""Of one site whose vehicles know how fast they may be."""


@kernel
def allowed_mps(limits: RoadLimits, site: int, way: int, station_m: float) -> float:
    """Returns ``Limits.allowed_mps`` (m/s) of a way to the last bit, infinity without limits."""
    count = limits.known[site, way]
    if count == 0:
        return np.inf
    here = 0
    while here + 1 < count and limits.from_m[site, way, here + 1] <= station_m:
        here += 1
    allowed = limits.limit_mps[site, way, here]
    for k in range(here + 1, count):
        ahead_m = limits.from_m[site, way, k] - station_m
        slows_mps = np.sqrt(limits.squared[site, way, k] + 2.0 * SLOWS_MPS2 * ahead_m)
        allowed = min(allowed, slows_mps)
    return float(allowed)
