"""What a run leaves behind in memory: who passed, how they drove, what was decided."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from coramp._kernel import BoolArray, FloatArray, IntArray
from coramp.coordination.decision_log import DecisionRecord, Refusal
from coramp.messages.log import Told
from coramp.records.lanes import LaneHistory
from coramp.vehicles.traits import CAR, Traits


@dataclass(frozen=True)
class Passages:
    """One entry a vehicle, in the order of scheduled times; nan where something never happened.

    ``merge_s`` is when a ramp vehicle changed to the mainline, ``BY_MAINLINE_S`` of
    ``vehicles.merge_state`` for mainline vehicles. ``entry_speed_mps`` is the scheduled one.
    ``plan_error_m`` is the largest distance seen between plan and simulator, nan without a plan.
    ``automated`` tells, where drivers and automated vehicles mix, which are automated. ``lane`` is
    that of the mainline by which each enters, 0 next to the ramp.
    ``traits`` are None for vehicles that only the common limits bind; types and traits may be left
    out where that is so for all.
    """

    vehicle_id: tuple[str, ...]
    on_ramp: BoolArray
    length_m: FloatArray
    scheduled_s: FloatArray
    entry_speed_mps: FloatArray
    entry_s: FloatArray
    merge_s: FloatArray
    exit_s: FloatArray
    plan_error_m: FloatArray
    vehicle_type: tuple[str, ...] = ()
    traits: tuple[Traits | None, ...] = ()
    automated: BoolArray | None = None
    lane: IntArray = field(default_factory=lambda: np.empty(0, np.int64))

    def __len__(self) -> int:
        return len(self.vehicle_id)

    def types(self) -> tuple[str, ...]:
        """Returns the name of each vehicle's type: a car's where types were left out."""
        return self.vehicle_type or (CAR,) * len(self)


@dataclass(frozen=True)
class Pieces:
    """How all vehicles drive: pieces of shape (n, 4) as in ``kinematics.trajectory``.

    ``first`` has one entry a vehicle of the passages and one more: vehicle i's rows are first[i]
    to first[i + 1].
    """

    first: IntArray
    rows: FloatArray


@dataclass(frozen=True)
class Outcome:
    """Everything that an engine hands to the metrics.

    ``pieces`` are what was planned, with a code for each one's ``lane``, and ``driven`` what the
    simulator made of it; for its own drivers both are its steps. ``lanes`` is who was on which lane
    when, as driven. ``end_s`` is when the run ended or was cut off. Decisions name vehicles by rows
    of the ledger; ``vehicle_of_row`` gives their places in ``passages``. ``told`` are the messages,
    where they were to be kept. ``drivers`` names their population; ``collided`` are those whom the
    simulator saw collide: time (s), places of rear and front vehicle. ``messages_of_air``
    counts messages and fallbacks; ``world_events`` are what happened by itself: time (s), what, and
    the vehicle's place. ``heard`` and ``on_board`` are columns by name, None where they were not to
    be kept: what the coordinator knew, and what vehicles did and why. All six are for mixed
    traffic.
    """

    cooperative: bool
    passages: Passages
    pieces: Pieces
    lane: IntArray
    driven: Pieces
    lanes: LaneHistory
    end_s: float
    collisions: int
    decisions: tuple[DecisionRecord, ...] = ()
    refusals: tuple[Refusal, ...] = ()
    interventions: int = 0
    vehicle_of_row: IntArray = field(default_factory=lambda: np.empty(0, np.int64))
    told: Told | None = None
    drivers: str = ""
    collided: tuple[tuple[float, int, int], ...] = ()
    messages_of_air: Mapping[str, int] = field(default_factory=dict)
    world_events: tuple[tuple[float, str, int], ...] = ()
    heard: Mapping[str, FloatArray] | None = None
    on_board: Mapping[str, FloatArray] | None = None

    @property
    def until_s(self) -> FloatArray:
        """When each vehicle left, or the run ended without it."""
        return until_s(self.passages.exit_s, self.end_s)


def until_s(exit_s: FloatArray, end_s: float) -> FloatArray:
    """Returns when each vehicle leaves (nan: never), or the run ends without it."""
    return np.where(np.isnan(exit_s), end_s, exit_s)
