"""What meters of several ramps are told and answer, once a control period."""

from collections.abc import Sequence
from typing import Any, NamedTuple, Protocol

from coramp.strategies.base import Detectors

ALONE, MASTER, SLAVE = "alone", "master", "slave"


class RampSeen(NamedTuple):
    """What the detectors of one ramp told of the time since they were last asked.

    ``arrived_veh`` came onto the ramp; ``queue_veh`` are on it before the stop line, where it holds
    ``room_veh``.
    """

    detectors: Detectors
    arrived_veh: int
    queue_veh: int
    room_veh: float


class Update(NamedTuple):
    """One update of a meter: what it rests on, its rate until the next, and its part in a cluster.

    ``ramp`` is its place among those metered, ``master`` that of its cluster's master, or its own.
    ``let_go`` says that the queue override holds.
    """

    ramp: int
    occupancy_percent: float
    queue_percent: float
    arrivals_veh_h: float
    queue_veh: int
    room_veh: float
    rate_veh_h: float
    master: int
    role: str = ALONE
    let_go: bool = False


class Metered(NamedTuple):
    """What several meters answer: which signals are green, what is remembered, and updates."""

    green: tuple[bool, ...]
    memory: Any
    updates: tuple[Update, ...]


class MetersRamps(Protocol):
    """A strategy that meters the ramps of a corridor; ``period_s`` is its control period (s)."""

    @property
    def period_s(self) -> float:
        """Control period (s)."""
        ...

    def meter(
        self, now_s: float, seen: Sequence[RampSeen], roads: Sequence[Sequence[int]], memory: Any
    ) -> Metered:
        """Returns the signals of all ramps.

        ``roads`` has the places of each road's ramps among those ``seen``, in driving order.
        ``memory`` is None at first.
        """
        ...
