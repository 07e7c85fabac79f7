"""What the loop needs of a world that carries vehicles: a simulator, the exact engine, a road."""

from typing import NamedTuple, Protocol

from coramp._kernel import FloatArray

STREAMS = ("mainline", "ramp")
"""Names of the streams; a stream's place is also whether it comes by the ramp."""


class Arrival(NamedTuple):
    """A vehicle on its way to the zone: when it would enter (a step number) and how fast."""

    vehicle_id: str
    on_ramp: bool
    step: int
    speed_mps: float
    length_m: float


class Plant(Protocol):
    """Carries vehicles. Steps count the control clock; step k is at ``k * step_s``."""

    def advance(self, step: int) -> None:
        """Lets time pass up to ``step``; what is commanded next takes effect from there."""
        ...

    def enter(self, row: int, arrival: Arrival, step: int) -> None:
        """Puts a vehicle with its front at the start of its zone, at its entry speed."""
        ...

    def follow(self, row: int, pieces: FloatArray, merge_time_s: float) -> None:
        """Makes a vehicle follow the pieces from their first time on; merge at that time."""
        ...
