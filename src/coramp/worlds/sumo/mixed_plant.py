"""Automated vehicles among drivers in a SUMO session: where they are, and how they are driven."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from coramp._kernel import BoolArray, FloatArray, IntArray
from coramp.mixed.on_board import Ahead
from coramp.mixed.users import RoadUsers
from coramp.worlds.faults.actuators import SlowActuators
from coramp.worlds.sumo.lanes import LanedRoad
from coramp.worlds.sumo.mixed_setup import Able
from coramp.worlds.sumo.network import RAMP_LANES
from coramp.worlds.sumo.session import Session

MERGE_LANE = "merge_0"
NO_GAP_M, NOT_ASSERTIVE = 200.0, 0.001
"""With these SUMO finds no gap for a vehicle that is to merge, but has drivers yield."""
SMOOTHED_OVER_S = 0.5
"""Drivers' accelerations are noisy, and measured through a filter of this time constant."""


class Foresees(Protocol):
    """What a control asks of the plant: its period, and where vehicles will be."""

    @property
    def period_s(self) -> float:
        """The time (s) between two commands."""
        ...

    def ahead(self, users: RoadUsers) -> Ahead:
        """Returns where vehicles will be when a new command begins to act."""
        ...


@dataclass
class MixedPlant:
    """The vehicles in a SUMO session: where they are, and what automated ones do.

    An automated vehicle's speed is that of its commands: under Euler steps SUMO's own is off by
    half a step's acceleration. ``min_gap_m`` is what SUMO has it keep once it is on the
    mainline. ``largest_error_m`` is how far each was from where it was sent, nan for drivers.
    """

    session: Session
    lane_starts_m: Mapping[str, float]
    able: Able
    period_steps: int
    step_s: float
    min_gap_m: float
    actuators: SlowActuators
    largest_error_m: FloatArray = field(init=False)
    _sent_mps: FloatArray = field(init=False)
    _sent_m: FloatArray = field(init=False)
    _was_mps: FloatArray = field(init=False)
    _accel_mps2: FloatArray = field(init=False)
    _changing: set[int] = field(default_factory=set)

    def __post_init__(self) -> None:
        """Nobody has been sent anywhere yet."""
        count = len(self.able.automated)
        self._sent_mps, self._sent_m = np.full(count, np.nan), np.full(count, np.nan)
        self.largest_error_m = np.where(self.able.automated, 0.0, np.nan)
        self._was_mps, self._accel_mps2 = np.full(count, np.nan), np.zeros(count)

    @property
    def period_s(self) -> float:
        """The time (s) between two commands."""
        return self.period_steps * self.step_s

    def is_on(self, road: LanedRoad) -> None:
        """Is told its road where that has several lanes."""

    def users(self) -> tuple[list[str], BoolArray, RoadUsers]:
        """Returns names, who is on the acceleration lane, and all that is on the road."""
        names, lanes, position_m, sumo_mps = self.session.everyone()
        number = np.array([self.able.number[name] for name in names], np.int64)
        start_m = np.array([self.lane_starts_m[lane] for lane in lanes])
        station_m = start_m + np.array(position_m)
        speed_mps = self._known_speeds(number, station_m, np.array(sumo_mps))
        users = RoadUsers(
            number,
            station_m,
            speed_mps,
            self._measured_mps2(number, speed_mps),
            self.able.length_m[number],
            np.array([lane not in RAMP_LANES for lane in lanes], np.bool_),
            self.able.automated[number],
            self.able.cruise_mps[number],
            self.able.acceleration_mps2[number],
            self.able.power_wpkg[number],
            self.able.braking_mps2[number],
        )
        return names, np.array([lane == MERGE_LANE for lane in lanes], np.bool_), users

    def _known_speeds(
        self, number: IntArray, station_m: FloatArray, speed_mps: FloatArray
    ) -> FloatArray:
        """SUMO's speeds for drivers, those of commands for automated vehicles; notes errors."""
        sent_mps = self._sent_mps[number]
        sent = ~np.isnan(sent_mps)
        error_m = np.abs(station_m[sent] - self._sent_m[number[sent]])
        there = number[sent]
        self.largest_error_m[there] = np.maximum(self.largest_error_m[there], error_m)
        return np.where(sent, sent_mps, speed_mps)

    def _measured_mps2(self, number: IntArray, speed_mps: FloatArray) -> FloatArray:
        """Smoothed accelerations (m/s2) since the last command, 0 of who is new."""
        was_mps = self._was_mps[number]
        since_mps = np.where(np.isnan(was_mps), 0.0, speed_mps - was_mps)
        share = min(1.0, self.period_s / SMOOTHED_OVER_S)
        self._accel_mps2[number] += share * (since_mps / self.period_s - self._accel_mps2[number])
        self._was_mps[number] = speed_mps
        return np.asarray(self._accel_mps2[number])

    def ahead(self, users: RoadUsers) -> Ahead:
        """Returns where vehicles will be when a new command begins to act."""
        if not self.actuators.is_slow:
            return Ahead(np.zeros(len(users.number)), users.speed_mps, 0.0)
        way_m, speed_mps = self.actuators.predicted(users.number, users.speed_mps)
        return Ahead(way_m, speed_mps, self.actuators.delay_s)

    def command(
        self, names: Sequence[str], users: RoadUsers, accel_mps2: FloatArray, changes: BoolArray
    ) -> None:
        """Takes over who is new, and has vehicles change lanes; then all drive for a period."""
        own = np.flatnonzero(users.automated)
        number = users.number[own]
        new = np.isnan(self._sent_mps[number])
        for i in own[new].tolist():
            if users.on_mainline[i]:
                self.session.take_over(names[i])
                continue
            self.session.take_over_among_drivers(names[i])
            self.session.judge_gaps_by(names[i], NO_GAP_M, NOT_ASSERTIVE)
        for i in own[users.on_mainline[own]].tolist():
            if int(users.number[i]) in self._changing:
                self.session.take_over(names[i])
                self._changing.discard(int(users.number[i]))
        for i in np.flatnonzero(changes).tolist():
            self.session.judge_gaps_by(names[i], self.min_gap_m, 1.0)
            self._change_lane(names[i])
            self._changing.add(int(users.number[i]))
        chosen = [names[i] for i in own.tolist()]
        self._sent_m[number], self._sent_mps[number] = users.station_m[own], users.speed_mps[own]
        self._drive(chosen, number, accel_mps2[own])

    def _change_lane(self, name: str) -> None:
        """Has a vehicle on the acceleration lane change to the mainline beside it."""
        self.session.change_lane_now(name, 1, self.period_steps)

    def _drive(self, names: Sequence[str], number: IntArray, accel_mps2: FloatArray) -> None:
        """Drives a period: at once with these accelerations, or step by step as the lag has it."""
        if not self.actuators.is_slow:
            driven = self.actuators.driven(number, accel_mps2)
            self._drive_evenly(names, number, driven, self.period_steps)
            return
        for step in range(self.period_steps):
            if step > 0:
                self.session.step_on()
                here = self.session.still_here(names)
                names = [name for name, there in zip(names, here, strict=True) if there]
                number, accel_mps2 = number[here], accel_mps2[here]
            self._drive_evenly(names, number, self.actuators.driven(number, accel_mps2), 1)

    def _drive_evenly(
        self, names: Sequence[str], number: IntArray, accel_mps2: FloatArray, steps: int
    ) -> None:
        time_s, half_s = steps * self.step_s, 0.5 * self.step_s
        before_mps = self._sent_mps[number]
        after_mps = np.maximum(0.0, before_mps + accel_mps2 * time_s)
        accel = (after_mps - before_mps) / time_s
        self._sent_mps[number] = after_mps
        self._sent_m[number] += 0.5 * (before_mps + after_mps) * time_s
        from_mps = (before_mps - accel * half_s).tolist()
        to_mps = np.maximum(0.0, after_mps - accel * half_s).tolist()
        for name, start, end in zip(names, from_mps, to_mps, strict=True):
            self.session.drive_evenly(name, start, end, steps)
