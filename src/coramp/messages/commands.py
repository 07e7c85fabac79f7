"""What the coordinator tells the world."""

import math
from dataclasses import dataclass

from coramp._kernel import FloatArray


@dataclass(frozen=True, slots=True)
class Enter:
    """Enter at ``step`` and follow these pieces (``kinematics.trajectory``) from there."""

    vehicle_id: str
    step: int
    pieces: FloatArray
    merge_time_s: float


@dataclass(frozen=True, slots=True)
class Follow:
    """Follow these pieces from their first time on; commanded at ``step``.

    ``merge_time_s`` is as ``vehicles.merge_state`` reads it. ``lane_change_s`` is when to begin to
    change to the next lane further in, infinity to stay on one's lane, or as commanded before.
    """

    vehicle_id: str
    step: int
    pieces: FloatArray
    merge_time_s: float
    lane_change_s: float = math.inf


@dataclass(frozen=True, slots=True)
class SetSignal:
    """Show green, or red, at the ramp's stop line."""

    step: int
    green: bool


WorldCommand = Enter | Follow | SetSignal
