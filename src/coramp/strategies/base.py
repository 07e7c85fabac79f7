"""The one interface that every strategy has.

A strategy is asked when a cooperative vehicle reaches its decision station, whenever it has asked
to be woken and, if it has a ``period_s``, once in each such period, then without subjects. It
answers from the view and its own memory alone: ``decide`` is a pure function.
"""

import math
from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import ClassVar, NamedTuple, Protocol

import numpy as np

from coramp._kernel import BoolArray, FloatArray, IntArray
from coramp.road.rules import Rules
from coramp.strategies.attempts import Attempt
from coramp.vehicles.fleet import Fleet


@dataclass(frozen=True, slots=True)
class Reports:
    """What each live vehicle last told of itself, in the order of ``Fleet.live``.

    ``std_m`` is the standard deviation of the reported station.
    """

    time_s: FloatArray
    station_m: FloatArray
    speed_mps: FloatArray
    std_m: FloatArray


@dataclass(frozen=True, slots=True)
class Drivers:
    """Vehicles that report where they are and take no commands, one entry each.

    A driver's row is below -1 and stays its own. Commands to it are refused and counted.
    """

    rows: IntArray
    reports: Reports


NO_DRIVERS = Drivers(
    np.empty(0, np.int64), Reports(np.empty(0), np.empty(0), np.empty(0), np.empty(0))
)


@dataclass(frozen=True, slots=True)
class Detectors:
    """What the road's loop detectors tell of the time since they were last asked.

    Occupancies are shares of the time (0 to 1) in which a vehicle stood on the loop: on the
    mainline beside the acceleration lane, and at the upstream end of the ramp. ``passed_veh``
    counts the vehicles that passed the ramp's stop line.
    """

    mainline_occupancy: float
    queue_occupancy: float
    passed_veh: int


class Entered(NamedTuple):
    """A vehicle that has entered: its row, its stream, when, and since when it wanted to (s)."""

    row: int
    on_ramp: bool
    time_s: float
    since_s: float


@dataclass(frozen=True, slots=True)
class Waiting:
    """Who waits outside to enter, by stream and then by time; one entry a vehicle.

    ``vehicle`` is its number among all arrivals, ``since_s`` when it came.
    """

    vehicle: IntArray
    on_ramp: BoolArray
    since_s: FloatArray
    length_m: FloatArray

    def first(self, on_ramp: bool) -> int:
        """Returns the place of the vehicle of a stream that waits longest, -1 if none does."""
        if len(self.on_ramp) == 0:
            return -1
        if not on_ramp:
            return -1 if self.on_ramp[0] else 0
        return int(np.argmax(self.on_ramp)) if self.on_ramp[-1] else -1


NOBODY_WAITS = Waiting(np.empty(0, np.int64), np.empty(0, np.bool_), np.empty(0), np.empty(0))


@dataclass(frozen=True)
class View:
    """What the coordinator knows at ``time_s``: who has entered, and what they have committed to.

    Of several mainline lanes the outermost is the mainline; ``fleet.inner`` are on those further
    in, of whom nothing else tells.

    ``subjects`` are the rows that the strategy is asked about, in the order in which they reached
    their decision stations. ``acknowledged`` holds the commitments that vehicles have confirmed;
    in a world without delays it is ``fleet`` itself. ``fastest_entry_mps`` bounds the speed at
    which mainline vehicles enter. ``ask_reports`` fetches the live vehicles' last reports for
    ``reports``; ``ask_entered`` who has entered since the strategy was last asked, for ``entered``;
    ``ask_waiting`` who waits outside, for ``waiting``. ``packed_rules`` are the rules as kernels
    take them (``road.rules``).
    ``detectors`` is what the road's loops have just told, None where they told nothing.
    ``ask_drivers`` has the vehicles that take no commands report, for ``drivers``. A strategy must
    not write into any of the arrays.
    """

    time_s: float
    subjects: tuple[int, ...]
    fleet: Fleet
    acknowledged: Fleet
    ask_reports: Callable[[], Reports]
    fastest_entry_mps: float
    rules: Rules
    packed_rules: FloatArray
    detectors: Detectors | None = None
    ask_entered: Callable[[], tuple[Entered, ...]] = tuple
    ask_waiting: Callable[[], Waiting] = lambda: NOBODY_WAITS
    ask_drivers: Callable[[], Drivers] = lambda: NO_DRIVERS

    @cached_property
    def reports(self) -> Reports:
        """The last reports of all live vehicles."""
        return self.ask_reports()

    @property
    def entered(self) -> tuple[Entered, ...]:
        """Who has entered since the strategy was last asked, in order of entry."""
        return self.ask_entered()

    @cached_property
    def drivers(self) -> Drivers:
        """Who drives on the road and takes no commands, as last reported."""
        return self.ask_drivers()

    @cached_property
    def waiting(self) -> Waiting:
        """Who waits outside to enter."""
        return self.ask_waiting()


@dataclass(frozen=True, slots=True)
class FollowTrajectory:
    """Follow these pieces; merge at ``merge_time_s``.

    They take the place of all that is committed, from the earliest time at which a vehicle can act,
    ``time_s + actuation_delay_s``; their first time is that, their first station and speed what is
    committed for then. ``makes_gap`` tells that the vehicle moves aside for another:
    the checker then allows it more than v0, by ``motion.speed_deviation``, until the merge.
    ``lane_change_s`` is when it begins to change to the next lane further in, which takes
    ``road.lanes.LANE_CHANGE_LASTS_S``; infinity for a command that leaves its lane as it is.
    """

    row: int
    pieces: FloatArray
    merge_time_s: float
    makes_gap: bool = False
    lane_change_s: float = math.inf


@dataclass(frozen=True, slots=True)
class DriveWithAcceleration:
    """Drive with this acceleration (m/s2, signed) for ``hold_s``, then go on as is safe.

    For feedback laws, which command anew before ``hold_s`` has passed. The speed stays between 0
    and the lane's limit. ``merge`` lets a ramp vehicle come onto the mainline as soon as that is
    safe; without it, it is to stop before the nose. Commands of this kind stand or fall one by one:
    the supervisor (``coordination.supervisor``) replaces one that is not safe.
    """

    row: int
    accel_mps2: float
    hold_s: float
    merge: bool = True


@dataclass(frozen=True, slots=True)
class SetRampSignal:
    """Set the signal at the ramp's stop line, upstream of the nose, to green or red."""

    green: bool


@dataclass(frozen=True, slots=True)
class ReleaseToDriver:
    """Leave the vehicle to its driver, or in SUMO to its driver model."""

    row: int


Command = FollowTrajectory | DriveWithAcceleration | SetRampSignal | ReleaseToDriver


class Explanation(NamedTuple):
    """Why a vehicle got its plan; rows are -1 and numbers nan where there is none.

    Severities are in m2/s4. The last three are where conflict, front and rear vehicle would be at
    the decision if they had always cruised at v0 as they will in the end; that need not be where
    they are. ``tried`` is every attempt in order, with the reason why it was refused.
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
    tried: Sequence[Attempt] = ()


Memory = Hashable


@dataclass(frozen=True, slots=True)
class Decision:
    """A strategy's answer: commands, wake-up calls, its memory.

    Trajectories of one decision stand or fall together. What nobody can carry out is refused and
    counted: a command to a driver, a release of a vehicle that has no driver, a colour where there
    is no signal.

    A wake is a pair of time (s) and row.
    """

    commands: tuple[Command, ...] = ()
    wakes_s: tuple[tuple[float, int], ...] = ()
    memory: Memory = None
    explanations: tuple[Explanation, ...] = field(default=())


class Decider(Protocol):
    """Whatever answers like a strategy."""

    def decide(self, view: View, memory: Memory) -> Decision:
        """Returns the decision for ``view.subjects``; must not change the view."""
        ...


@dataclass(frozen=True, slots=True)
class EntryPolicy:
    """What a strategy asks of the entries of vehicles.

    ``asked``: it is asked about every vehicle as that enters, with the vehicle as the subject.
    ``holds_newcomers``: its merges may stand in the way of mainline vehicles that are yet to enter;
    these brake as they enter, or wait outside until they can enter safely. Without it a merge that
    would hold one of them up is refused. ``slowest_share``: no mainline vehicle brakes below this
    share of v0 as it enters; it waits outside instead.
    """

    asked: bool = False
    holds_newcomers: bool = False
    slowest_share: float = 0.0


class Strategy(Decider, Protocol):
    """Who yields to whom.

    A frozen dataclass whose fields are its parameters (``strategies.parameters``). One that steers
    by feedback, or sets a signal, also has ``period_s`` (s): see ``period_of``. ``metered`` is True
    for one that needs a signal and detectors on the ramp, in SUMO; ``coordinates_meters`` for one
    that is for several ramps (``strategies.metering``). ``vehicles_may_differ`` is True
    for one that plans with vehicles' own limits; others are refused where vehicles differ.
    ``makes_way`` is True for one that plans on a mainline of several lanes (``View``); others are
    refused there.
    ``entry_policy`` is what it
    asks of entries, if anything: see ``entry_policy_of``. One whose parameters must fit
    together has a method ``problems()``, which returns lines ``parameter: what is wrong; what is
    allowed``.
    """

    name: ClassVar[str]
    summary: ClassVar[str]
    cooperative: ClassVar[bool]


def period_of(strategy: Decider) -> float | None:
    """Returns in which period (s) a strategy is woken besides, None for one that only plans."""
    return getattr(strategy, "period_s", None)


def entry_policy_of(strategy: Decider) -> EntryPolicy:
    """Returns what a strategy asks of the entries of vehicles."""
    policy = getattr(strategy, "entry_policy", None)
    return policy if isinstance(policy, EntryPolicy) else EntryPolicy()


def steps_of_period(period_s: float, step_s: float) -> int:
    """Returns how many steps of the control clock a period takes, to the nearest, at least 1."""
    return max(1, round(period_s / step_s))


def held_period_s(period_s: float, rules: Rules) -> float:
    """Returns the time (s) between two decisions of a strategy with this period."""
    return steps_of_period(period_s, rules.control.step_s) * rules.control.step_s


def vehicles_may_differ(strategy: Decider | type[Strategy]) -> bool:
    """Returns whether a strategy looks at each vehicle's own limits, not at its length alone."""
    return bool(getattr(strategy, "vehicles_may_differ", False))


def makes_way(strategy: Decider | type[Strategy]) -> bool:
    """Returns whether a strategy plans on a mainline of several lanes."""
    return bool(getattr(strategy, "makes_way", False))


def is_metered(strategy: Decider | type[Strategy]) -> bool:
    """Returns whether a strategy needs a signal and detectors at the ramp."""
    return bool(getattr(strategy, "metered", False))


def coordinates_meters(strategy: type[Strategy]) -> bool:
    """Returns whether a strategy coordinates the meters of several ramps."""
    return bool(getattr(strategy, "coordinates_meters", False))
