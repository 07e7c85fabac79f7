"""What a strategy is told of mixed traffic, and what it answers."""

from typing import NamedTuple, Protocol

from coramp._kernel import BoolArray, FloatArray
from coramp.mixed.on_board import Neighbours
from coramp.mixed.users import Gaps, MixedRoad, RoadUsers

Places = tuple[tuple[int, int], ...]
"""Pairs of a ramp vehicle's number and the number of whom it is to merge behind."""


class MixedSituation(NamedTuple):
    """Who is known to be on the road at ``time_s``; the next command comes ``period_s`` later."""

    time_s: float
    period_s: float
    users: RoadUsers
    around: Neighbours
    gaps: Gaps
    road: MixedRoad


class Steering(NamedTuple):
    """A strategy's answer, one entry a user: how much it may speed up, whether it may merge.

    ``most_mps2`` is signed, infinity for no bound. What is no automated vehicle's is ignored.
    """

    most_mps2: FloatArray
    may_merge: BoolArray
    places: Places


class MixedStrategy(Protocol):
    """A strategy for automated vehicles among drivers.

    ``steer`` is a pure function, as ``decide`` is.
    """

    @property
    def decision_s(self) -> float:
        """The time (s) between two decisions."""
        ...

    def steer(self, situation: MixedSituation, places: Places) -> Steering:
        """Returns bounds for all automated vehicles; ``places`` are those of its last answer."""
        ...
