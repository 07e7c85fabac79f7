"""The unit in which speeds are shown; inside they are m/s."""

from typing import NamedTuple

from coramp.scenarios.speeds_kmh import KMH_PER_MPS


class SpeedUnit(NamedTuple):
    """A unit's name, and how many of it are 1 m/s."""

    name: str
    per_mps: float

    def of(self, speed_mps: float | None) -> float | None:
        """Returns a speed in this unit, None for none."""
        return None if speed_mps is None else speed_mps * self.per_mps


MPS = SpeedUnit("m/s", 1.0)
KMH = SpeedUnit("km/h", KMH_PER_MPS)
