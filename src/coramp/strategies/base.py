"""The one interface that every strategy has.

A strategy is asked when a cooperative vehicle reaches its decision station and whenever it has
asked to be woken. It answers from the view and its own memory alone: ``decide`` is a pure function.
"""

from collections.abc import Callable, Hashable
from dataclasses import dataclass, field
from functools import cached_property
from typing import ClassVar, NamedTuple, Protocol

from coramp._kernel import FloatArray
from coramp.core.fleet import Fleet
from coramp.core.rules import Rules


@dataclass(frozen=True, slots=True)
class Reports:
    """What each live vehicle last told of itself, in the order of ``Fleet.live``.

    ``std_m`` is the standard deviation of the reported station.
    """

    time_s: FloatArray
    station_m: FloatArray
    speed_mps: FloatArray
    std_m: FloatArray


@dataclass(frozen=True)
class View:
    """What the coordinator knows at ``time_s``: who has entered, and what they have committed to.

    ``subjects`` are the rows that the strategy is asked about, in the order in which they reached
    their decision stations. ``acknowledged`` holds the commitments that vehicles have confirmed;
    in a world without delays it is ``fleet`` itself. ``fastest_entry_mps`` bounds the speed at
    which mainline vehicles enter. ``ask_reports`` fetches the live vehicles' last reports for
    ``reports``. ``packed_rules`` are the rules as kernels take them (``core.rules``). A strategy
    must not write into any of the arrays.
    """

    time_s: float
    subjects: tuple[int, ...]
    fleet: Fleet
    acknowledged: Fleet
    ask_reports: Callable[[], Reports]
    fastest_entry_mps: float
    rules: Rules
    packed_rules: FloatArray

    @cached_property
    def reports(self) -> Reports:
        """The last reports of all live vehicles."""
        return self.ask_reports()


@dataclass(frozen=True, slots=True)
class FollowTrajectory:
    """Follow these pieces from their first time on; merge at ``merge_time_s``.

    ``makes_gap`` tells that the vehicle moves aside for another.
    """

    row: int
    pieces: FloatArray
    merge_time_s: float
    makes_gap: bool = False


@dataclass(frozen=True, slots=True)
class ReleaseToDriver:
    """Leave the vehicle to its driver, or in SUMO to its driver model."""

    row: int


Command = FollowTrajectory | ReleaseToDriver


class Explanation(NamedTuple):
    """Why a vehicle got its plan; rows are -1 and numbers nan where there is none.

    Severities are in m2/s4. The last three are stations at the decision of vehicles that cruise at
    v0, or will: run back from there.
    """

    row: int
    rung: str
    scenario: int
    conflict_row: int
    front_row: int
    rear_row: int
    gap_m: float
    required_gap_m: float
    accel_mps2: float
    merge_time_s: float
    merge_station_m: float
    largest_shift_m: float
    severity_before: float
    severity_after: float
    relative_severity_before: float
    relative_severity_after: float
    nose_time_s: float
    nose_speed_mps: float
    conflict_station_m: float
    front_station_m: float
    rear_station_m: float


Memory = Hashable


@dataclass(frozen=True, slots=True)
class Decision:
    """A strategy's answer: commands that stand or fall together, wake-up calls, its memory.

    A wake is a pair of time (s) and row.
    """

    commands: tuple[Command, ...] = ()
    wakes_s: tuple[tuple[float, int], ...] = ()
    memory: Memory = None
    explanations: tuple[Explanation, ...] = field(default=())


class Strategy(Protocol):
    """Who yields to whom."""

    name: ClassVar[str]
    summary: ClassVar[str]
    cooperative: ClassVar[bool]

    def decide(self, view: View, memory: Memory) -> Decision:
        """Returns the decision for ``view.subjects``; must not change the view."""
        ...
