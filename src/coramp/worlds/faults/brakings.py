"""When drivers brake for nothing: a Poisson process that nothing on the road changes."""

import numpy as np

from coramp._kernel import FloatArray
from coramp.demand.generators import generator

SECONDS_AN_HOUR = 3600.0
MANY = 64
"""How many waits are drawn at a time; their number changes none of them."""


def due_s(rate_per_h: float, seed: int, until_s: float) -> FloatArray:
    """Returns the times (s) up to ``until_s`` at which a driver is to brake for nothing.

    Waits in between are exponential with mean 1 / rate, from random numbers of their own, so that
    the times are known without a run: they depend on rate and seed alone.
    """
    if rate_per_h == 0.0:
        return np.empty(0)
    random = generator(seed, "faults/careless/waits")
    times_s = np.empty(0)
    last_s = 0.0
    while last_s <= until_s:
        waits_s = random.exponential(SECONDS_AN_HOUR / rate_per_h, MANY)
        times_s = np.concatenate([times_s, last_s + np.cumsum(waits_s)])
        last_s = float(times_s[-1])
    return times_s[times_s <= until_s]
