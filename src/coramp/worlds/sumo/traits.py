"""What tells one driver of a population from another: time gap and speed factor."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from statistics import NormalDist

import numpy as np

from coramp._kernel import FloatArray
from coramp.coordination.plant import Arrival
from coramp.demand.generators import generator
from coramp.road.streams import STREAMS
from coramp.scenarios.sections import DriverPopulation, SpeedFactor
from coramp.scenarios.world_sections import Behaviour


@dataclass(frozen=True)
class DriverTraits:
    """One driver: the time gap that it keeps, and its wish over the common speed, None for 1.

    One who ``never_yields`` makes no room for others. ``looks_each_s`` is how often an inattentive
    one looks around, None for each step.
    """

    tau_s: float
    speed_factor: float | None
    never_yields: bool = False
    looks_each_s: float | None = None


def traits_of(
    drivers: DriverPopulation, arrivals: Sequence[Arrival], seed: int
) -> list[DriverTraits]:
    """Returns the traits of each arrival's driver.

    Each stream and each trait has random numbers of its own, one a vehicle in the order of
    arrival: a vehicle keeps its draw whatever else changes.
    """
    traits: list[DriverTraits | None] = [None] * len(arrivals)
    for on_ramp, stream in enumerate(STREAMS):
        places = [k for k, arrival in enumerate(arrivals) if arrival.on_ramp == bool(on_ramp)]
        draws = [
            generator(seed, f"drivers/{trait}/{stream}").random(len(places))
            for trait in ("time gap", "speed factor")
        ]
        taus_s = np.array(drivers.taus_s)[(draws[0] * len(drivers.taus_s)).astype(np.int64)]
        factors = _speed_factors(drivers.speed_factor, draws[1])
        for place, tau_s, factor in zip(places, taus_s.tolist(), factors, strict=True):
            traits[place] = DriverTraits(tau_s, factor)
    return [found for found in traits if found is not None]


def _speed_factors(asked: SpeedFactor | None, draws: FloatArray) -> list[float | None]:
    """The quantiles of the cut-off normal distribution at draws from 0 to 1."""
    if asked is None:
        return [None] * len(draws)
    normal = NormalDist(asked.mean, asked.deviation)
    low, high = normal.cdf(asked.low), normal.cdf(asked.high)
    shares = low + (high - low) * draws
    return [min(asked.high, max(asked.low, normal.inv_cdf(share))) for share in shares.tolist()]


def with_careless(
    traits: Sequence[DriverTraits], behaviour: Behaviour, seed: int
) -> list[DriverTraits]:
    """Returns the drivers, some of whom never yield or are inattentive.

    Random numbers do not depend on the shares: who is careless at one share is so at a higher one.
    """
    never, late = generator(seed, "faults/manners").random((2, len(traits)))
    return [
        replace(
            own,
            never_yields=bool(never[k] < behaviour.never_yields_share),
            looks_each_s=behaviour.inattentive_s if late[k] < behaviour.inattentive_share else None,
        )
        for k, own in enumerate(traits)
    ]
