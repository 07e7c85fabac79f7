"""Which gaps a lane change of mixed traffic asks for: the least with which the law lets it happen.

The law itself is asked, with the other vehicle nearer and nearer.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from coramp.demand.arrivals import arrivals_of, automated_of, connected_of
from coramp.mixed.laws import OnBoardLaws
from coramp.mixed.on_board import Ahead, Neighbours, may_change_lane
from coramp.mixed.users import NOBODY, RoadUsers
from coramp.records.lapses import period_s
from coramp.records.run import RunRecords
from coramp.records.schemas import Row
from coramp.worlds.sumo.mixed_setup import Able, actuators_of, laws_of

FAR_M = 1000.0
WITHIN_M = 1e-3


@dataclass(frozen=True)
class Drove:
    """Who drove in a run of mixed traffic, and by which laws, as its specification has it."""

    run: RunRecords

    @cached_property
    def laws(self) -> OnBoardLaws:
        """The laws of automated vehicles."""
        scenario, told = self.run.scenario, self.run.on_board
        drivers = scenario.drivers[self.run.content["drivers"]]
        period = scenario.control.step_s if told is None else period_s(told)
        return laws_of(scenario, drivers, period, self.delay_s)

    @cached_property
    def delay_s(self) -> float:
        """The time (s) until a command acts."""
        return actuators_of(self.run.scenario, 1).delay_s

    @cached_property
    def able(self) -> Able:
        """What vehicles are and can do."""
        scenario, seed = self.run.scenario, self.run.content["seed"]
        arrivals = arrivals_of(scenario, seed)
        return Able.of(scenario, arrivals, automated_of(scenario, arrivals, seed))

    @cached_property
    def reporting(self) -> frozenset[str]:
        """Which vehicles report: automated ones, and drivers who are connected."""
        scenario, seed = self.run.scenario, self.run.content["seed"]
        arrivals = arrivals_of(scenario, seed)
        reports = self.able.automated | connected_of(scenario, arrivals, seed)
        return frozenset(a.vehicle_id for a, own in zip(arrivals, reports, strict=True) if own)

    @cached_property
    def rows(self) -> dict[tuple[float, str], Row]:
        """What was noted on board, by time and vehicle."""
        found = self.run.on_board
        rows = [] if found is None else found.rows(named=True)
        return {(row["time_s"], row["vehicle_id"]): row for row in rows}

    def is_automated(self, vehicle_id: str) -> bool:
        """Returns whether a vehicle is automated."""
        return bool(self.able.automated[self.able.number[vehicle_id]])

    def asked_m(self, row: Row, side: str) -> float:
        """Returns the gap (m) that changing lanes now asks for to the vehicle at a ``side``.

        ``row`` is what was noted of the vehicle on the acceleration lane; ``side`` is ``front`` or
        ``rear``. Infinity where no gap is enough.
        """
        low_m, high_m = 0.0, FAR_M
        if not self._may_change(row, side, high_m):
            return np.inf
        while high_m - low_m > WITHIN_M:
            middle_m = 0.5 * (low_m + high_m)
            if self._may_change(row, side, middle_m):
                high_m = middle_m
            else:
                low_m = middle_m
        return high_m

    def _may_change(self, row: Row, side: str, gap_m: float) -> bool:
        """Whether it may change lanes with only the vehicle at that side, ``gap_m`` away."""
        able, station_m = self.able, row["station_m"]
        numbers = np.array([able.number[row["vehicle_id"]], able.number[row[f"{side}_vehicle_id"]]])
        own, other = numbers
        other_m = station_m + gap_m + able.length_m[other]
        if side == "rear":
            other_m = station_m - able.length_m[own] - gap_m
        other_mps = row[f"{side}_speed_mps"]
        users = RoadUsers(
            numbers,
            np.array([station_m, other_m]),
            np.array([row["speed_mps"], other_mps]),
            np.array([row["measured_mps2"], row[f"{side}_accel_mps2"]]),
            able.length_m[numbers],
            np.array([False, True]),
            able.automated[numbers],
            able.cruise_mps[numbers],
            able.acceleration_mps2[numbers],
            able.power_wpkg[numbers],
            able.braking_mps2[numbers],
        )
        there = np.array([NOBODY, NOBODY])
        beside = np.array([1, NOBODY])
        around = Neighbours(there, *((beside, there) if side == "front" else (there, beside)))
        noted = self.rows.get((row["time_s"], row[f"{side}_vehicle_id"]))
        ahead = Ahead(
            np.array([_or(row["ahead_m"], 0.0), _or(noted and noted["ahead_m"], 0.0)]),
            np.array(
                [
                    _or(row["ahead_mps"], row["speed_mps"]),
                    _or(noted and noted["ahead_mps"], other_mps),
                ]
            ),
            self.delay_s,
        )
        slower_mps = row["speed_mps"] + min(0.0, _or(row["accel_mps2"], 0.0)) * self.laws.period_s
        slowest_mps = min(slower_mps, ahead.speed_mps[0])
        return bool(may_change_lane(users, 0, around, ahead, slowest_mps, self.laws))


def _or(value: float | Row | None, otherwise: float) -> float:
    return otherwise if value is None or isinstance(value, dict) else float(value)
