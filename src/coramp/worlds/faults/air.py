"""What the coordinator hears of vehicles, and what vehicles hear of it.

In a perfect world both is all that there is, at once. Otherwise reports and commands go over links,
positions and clocks are wrong, and what was heard last is carried on from its time.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial

import numpy as np

from coramp._kernel import BoolArray, FloatArray, IntArray
from coramp.demand.generators import generator
from coramp.mixed.situation import Steering
from coramp.mixed.users import RoadUsers, onwards
from coramp.scenarios.model import Scenario
from coramp.worlds.faults.link import ROUNDING_S, LossyLink
from coramp.worlds.faults.newest import newest
from coramp.worlds.faults.positions import WrongClocks, WrongPositions

NUMBER, STAMP, STATION, SPEED, ON_MAINLINE, ACCEL = range(6)
"""Columns of a report."""
GIVEN, MOST, MERGE = 1, 2, 3
"""Columns of a command, after the number of its vehicle."""
BEYOND_M = 20.0
MAKES_ROOM_MPS2, HOLDS_S = 0.5, 2.0
"""So long after its command has expired a vehicle that was to speed up by less keeps its room."""


@dataclass
class Air:
    """Both links of a run. ``reporting`` is which arrivals tell where they are.

    ``is_perfect`` is whether everything arrives at once and is right.
    ``vehicles_seed`` is that of what vehicles are, their clocks and manners, where several
    coordinators with links of their own know the same vehicles; else it is ``seed``.
    """

    scenario: Scenario
    reporting: BoolArray
    automated: BoolArray
    seed: int
    fallbacks: int = 0
    vehicles_seed: int | None = None
    is_perfect: bool = field(init=False)
    _all_report: bool = field(init=False)
    _reports: LossyLink = field(init=False)
    _commands: LossyLink = field(init=False)
    _positions: WrongPositions = field(init=False)
    _clocks: WrongClocks = field(init=False)
    _known: FloatArray = field(init=False)
    _command: FloatArray = field(init=False)
    _reported_s: FloatArray = field(init=False)
    _silent_from_s: FloatArray = field(init=False)
    _lie_m: FloatArray = field(init=False)
    _disobeys: BoolArray = field(init=False)
    _overdue: BoolArray = field(init=False)

    def __post_init__(self) -> None:
        """Each fault draws from random numbers of its own; in a perfect world there is none."""
        scenario, count = self.scenario, len(self.reporting)
        self._command, self._overdue = np.full((count, 4), np.nan), np.zeros(count, np.bool_)
        tables = (scenario.positioning, scenario.clock, scenario.reports, scenario.commands)
        self.is_perfect = scenario.behaviour.is_perfect and all(t.is_perfect for t in tables)
        self._all_report = bool(self.reporting.all())
        if self.is_perfect:  # nothing of a vehicle but its last command is kept
            count = 0
        self._reports = LossyLink(scenario.reports, count, self._random_of("reports"))
        self._commands = LossyLink(scenario.commands, count, self._random_of("commands"))
        positioning = self._random_of("positioning")
        self._positions = WrongPositions(scenario.positioning, count, positioning)
        self._clocks = WrongClocks(scenario.clock, count, self._of_vehicles("clock"))
        self._known, self._reported_s = np.full((count, 6), np.nan), np.full(count, -np.inf)
        self._draw_characters(self.automated[:count])

    def _random_of(self, table: str) -> Callable[[str], np.random.Generator]:
        return partial(_random_of, self.seed, table)

    def _of_vehicles(self, table: str) -> Callable[[str], np.random.Generator]:
        seed = self.seed if self.vehicles_seed is None else self.vehicles_seed
        return partial(_random_of, seed, table)

    def _draw_characters(self, automated: BoolArray) -> None:
        """Who falls silent when, who lies, who disobeys: automated vehicles alone."""
        count = len(automated)
        behaviour, horizon_s = self.scenario.behaviour, self.scenario.simulation.horizon_s
        random_of = self._of_vehicles("behaviour")
        (silent, since), lies, disobeys = (
            random_of("silent").random((2, count)),
            random_of("lies").random(count),
            random_of("disobeys").random(count),
        )
        chosen = automated & (silent < behaviour.silent_share)
        self._silent_from_s = np.where(chosen, since * horizon_s, np.inf)
        lies_m = np.where(lies < behaviour.lies_share, behaviour.lie_m, 0.0)
        self._lie_m = np.where(automated, lies_m, 0.0)
        self._disobeys = automated & (disobeys < behaviour.disobeys_share)

    def heard(self, now_s: float, users: RoadUsers) -> RoadUsers:
        """Returns what the coordinator knows of who is on the road now."""
        if self.is_perfect:
            return self._reporting_of(users)
        self._report(now_s, users)
        self._known = newest(self._known, self._reports.received(now_s), STAMP)
        return self._carried_on(now_s, users)

    def _reporting_of(self, users: RoadUsers) -> RoadUsers:
        if self._all_report:
            return users
        known = self.reporting[users.number]
        return users if known.all() else RoadUsers._make(column[known] for column in users)

    def _report(self, now_s: float, users: RoadUsers) -> None:
        """Sends reports of those whose time has come, with the errors of the moment."""
        period_s = self.scenario.reports.period_s or 0.0
        number = users.number
        due = self.reporting[number] & (now_s < self._silent_from_s[number])
        due &= now_s - self._reported_s[number] >= period_s - ROUNDING_S
        own = number[due]
        self._reported_s[own] = now_s
        error_m = self._positions.error_m(own, now_s) + self._lie_m[own]
        rows = np.column_stack(
            [
                own.astype(np.float64),
                now_s + self._clocks.error_s(own, now_s),
                users.station_m[due] + error_m,
                np.maximum(0.0, users.speed_mps[due] + self._positions.speed_error_mps(own)),
                users.on_mainline[due].astype(np.float64),
                users.accel_mps2[due],
            ]
        )
        self._reports.send(now_s, rows)

    def _carried_on(self, now_s: float, users: RoadUsers) -> RoadUsers:
        """The last reports, carried on from their stamps; those that are stale are forgotten."""
        order = np.argsort(users.number)  # who has left says so to the road's own detectors
        number, end_m = users.number[order], self.scenario.mainline.end_m
        known = self._known[number]
        age_s = np.clip(now_s - known[:, STAMP], 0.0, None)
        way_m, speed_mps = onwards(known[:, SPEED], known[:, ACCEL], age_s)
        station_m = known[:, STATION] + way_m
        fresh = (age_s <= self.scenario.reports.stale_s) & (station_m < end_m + BEYOND_M)
        there = order[fresh]
        return users._replace(
            number=number[fresh],
            station_m=station_m[fresh],
            speed_mps=speed_mps[fresh],
            accel_mps2=known[fresh, ACCEL],
            length_m=users.length_m[there],
            on_mainline=known[fresh, ON_MAINLINE] > 0.5,
            automated=users.automated[there],
            cruise_mps=users.cruise_mps[there],
            acceleration_mps2=users.acceleration_mps2[there],
            power_wpkg=users.power_wpkg[there],
            braking_mps2=users.braking_mps2[there],
        )

    def tell(self, now_s: float, seen: RoadUsers, steering: Steering) -> None:
        """Sends to each automated vehicle how much it may speed up and whether it may merge."""
        own = seen.automated
        if self.is_perfect:
            number = seen.number[own]
            self._commands.sent += len(number)
            self._command[number, GIVEN] = now_s
            self._command[number, MOST] = steering.most_mps2[own]
            self._command[number, MERGE] = steering.may_merge[own]
            return
        rows = np.column_stack(
            [
                seen.number[own].astype(np.float64),
                np.full(int(own.sum()), now_s),
                steering.most_mps2[own],
                steering.may_merge[own].astype(np.float64),
            ]
        )
        self._commands.send(now_s, rows)

    def told(self, now_s: float, users: RoadUsers) -> tuple[FloatArray, BoolArray]:
        """Returns the bound (m/s2) that each vehicle on the road has, and who may merge.

        What is older than what a vehicle has changes nothing, and one that is silent hears nothing.
        A vehicle whose last command is overdue goes by itself: it keeps its distances, and merges
        where it sees that all distances are kept. Who waited for leave would hold up the ramp. One
        that was to make room on the mainline does not speed up for another ``HOLDS_S``.
        """
        if self.is_perfect:
            command = self._command[users.number]
            most_mps2 = np.where(users.automated, command[:, MOST], np.inf)
            return most_mps2, users.automated & (command[:, MERGE] > 0.5)
        received = self._commands.received(now_s)
        if len(received):
            hears = now_s < self._silent_from_s[received[:, NUMBER].astype(np.int64)]
            self._command = newest(self._command, received[hears], GIVEN)
        command = self._command[users.number]
        expired_s = now_s - command[:, GIVEN] - self.scenario.commands.valid_s
        valid = expired_s <= ROUNDING_S
        self._count_fallbacks(users, valid, command)
        obeys = valid & ~self._disobeys[users.number] & users.automated
        holds = users.on_mainline & (expired_s <= HOLDS_S) & (command[:, MOST] < MAKES_ROOM_MPS2)
        holds &= ~valid & users.automated & ~self._disobeys[users.number]
        most_mps2 = np.where(obeys, command[:, MOST], np.where(holds, 0.0, np.inf))
        alone = users.automated & ~obeys
        return most_mps2, alone | obeys & (command[:, MERGE] > 0.5)

    def _count_fallbacks(self, users: RoadUsers, valid: BoolArray, command: FloatArray) -> None:
        """Counts each time that the last command of a vehicle runs out."""
        overdue = users.automated & ~valid & ~np.isnan(command[:, GIVEN])
        self.fallbacks += int((overdue & ~self._overdue[users.number]).sum())
        self._overdue[users.number] = overdue

    def age_s(self, now_s: float, number: IntArray) -> FloatArray:
        """Returns how old by its stamp (s) the last report of each vehicle is, nan without one.

        It is 0 where all is perfect.
        """
        if self.is_perfect:
            return np.zeros(len(number))
        return np.asarray(np.maximum(now_s - self._known[number, STAMP], 0.0))

    def given_s(self, number: IntArray) -> FloatArray:
        """Returns when the last command that each vehicle has was given, nan without one."""
        return np.asarray(self._command[number, GIVEN])

    def falls_back(self, number: IntArray) -> BoolArray:
        """Returns whose last command has expired."""
        return np.asarray(self._overdue[number])

    def lost_at(self, now_s: float) -> tuple[IntArray, IntArray]:
        """Returns whose reports, and to whom commands, of this time are lost."""
        return self._reports.lost_at(now_s), self._commands.lost_at(now_s)

    def faults(self, entry_s: FloatArray, until_s: FloatArray) -> list[tuple[float, str, int]]:
        """Returns which vehicles failed while they were on the road: time (s), what, number."""
        if self.is_perfect:
            return []
        silent_s = np.maximum(self._silent_from_s, entry_s)
        found = [(now_s, "positioning fails", n) for now_s, n in self._positions.outages]
        for what, from_s, chosen in (
            ("vehicle falls silent", silent_s, silent_s < until_s),
            ("vehicle disobeys", entry_s, self._disobeys & ~np.isnan(entry_s)),
            ("vehicle lies", entry_s, (self._lie_m != 0.0) & ~np.isnan(entry_s)),
        ):
            found += [(float(from_s[n]), what, n) for n in np.flatnonzero(chosen).tolist()]
        return found

    @property
    def counts(self) -> dict[str, int]:
        """How many messages there were, how many were lost, how often vehicles went alone."""
        return {
            "reports_sent": self._reports.sent,
            "reports_lost": self._reports.lost,
            "commands_sent": self._commands.sent,
            "commands_lost": self._commands.lost,
            "fallbacks": self.fallbacks,
        }


def _random_of(seed: int, table: str, fault: str) -> np.random.Generator:
    """Random numbers of one fault of a table, whatever else is switched on."""
    return generator(seed, f"faults/{table}/{fault}")
