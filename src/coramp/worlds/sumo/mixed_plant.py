"""Automated vehicles among drivers in a SUMO session: where they are, and how they are driven."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Protocol

import numpy as np

from coramp._kernel import BoolArray, FloatArray, IntArray
from coramp.mixed.on_board import Ahead
from coramp.mixed.users import RoadUsers
from coramp.worlds.faults.actuators import SlowActuators
from coramp.worlds.sumo.lanes import LanedRoad
from coramp.worlds.sumo.mixed_motion import Motion, measured, sent_evenly
from coramp.worlds.sumo.mixed_setup import Able
from coramp.worlds.sumo.network import LaneSpan
from coramp.worlds.sumo.road_limits import NO_LIMITS, RoadLimits
from coramp.worlds.sumo.road_users import LaneTable, OnRoad, lane_table_of, on_road
from coramp.worlds.sumo.session import Session
from coramp.worlds.sumo.watch import Watch

NO_SITE = -1
"""Of who has not come by a ramp; sites are counted from 0."""
NO_GAP_M, NOT_ASSERTIVE = 200.0, 0.001
"""With these SUMO finds no gap for a vehicle that is to merge, but has drivers yield."""
ACTS_RARELY_MPS = 5.0
"""From this speed on a vehicle that acts once a second drives the same way bit for bit."""
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
    half a step's acceleration. ``spans`` are the lanes that are watched. ``min_gap_m`` is what SUMO
    has it keep once it is on the mainline.
    """

    session: Session
    spans: Mapping[str, LaneSpan]
    able: Able
    period_steps: int
    step_s: float
    min_gap_m: float
    actuators: SlowActuators
    _motion: Motion = field(init=False)
    _changing: BoolArray = field(init=False)
    _asking: BoolArray = field(init=False)
    _from_ramp: BoolArray = field(init=False)
    _came_by: IntArray = field(init=False)
    _acts_rarely: BoolArray = field(init=False)

    def __post_init__(self) -> None:
        """Nobody has been sent anywhere yet."""
        count = len(self.able.automated)
        self._motion = Motion(
            sent_m=np.full(count, np.nan),
            sent_mps=np.full(count, np.nan),
            was_mps=np.full(count, np.nan),
            accel_mps2=np.zeros(count),
            largest_error_m=np.where(self.able.automated, 0.0, np.nan),
        )
        self._changing, self._from_ramp = np.zeros(count, np.bool_), np.zeros(count, np.bool_)
        self._asking = np.zeros(count, np.bool_)
        self._came_by, self._acts_rarely = np.full(count, NO_SITE), np.zeros(count, np.bool_)

    @cached_property
    def watch(self) -> Watch:
        """Lets the session go on, and notes who is on its lanes."""
        return Watch(self.session, self.spans, self.able.number, self.step_s)

    @property
    def largest_error_m(self) -> FloatArray:
        """How far (m) each vehicle was from where it was sent at most, nan for drivers."""
        return self._motion.largest_error_m

    @property
    def period_s(self) -> float:
        """The time (s) between two commands."""
        return self.period_steps * self.step_s

    @cached_property
    def _lanes(self) -> LaneTable:
        return lane_table_of(self.watch.spans.values())

    def is_on(self, road: LanedRoad) -> None:
        """Is told its road where that has several lanes."""

    def users(self) -> tuple[list[str], BoolArray, RoadUsers]:
        """Returns names, who is on the acceleration lane, and all that is on the road."""
        names, seen = self._on_road(NO_LIMITS)
        return names, seen.may_leave, seen.users

    def _on_road(self, limits: RoadLimits) -> tuple[list[str], OnRoad]:
        """Names, and all that is on the road, each at most as fast as limits let it."""
        look, period_s = self.watch.look(), self.period_s
        seen = on_road(
            look.number,
            look.place,
            look.position_m,
            look.speed_mps,
            self._lanes,
            limits,
            self.able.columns,
            self._motion,
            self._came_by,
            period_s,
            min(1.0, period_s / SMOOTHED_OVER_S),
        )
        return look.names, seen

    def _measured(
        self, number: IntArray, station_m: FloatArray, sumo_mps: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Speeds (m/s) and accelerations (m/s2) of who is on the road now."""
        share = min(1.0, self.period_s / SMOOTHED_OVER_S)
        return measured(number, station_m, sumo_mps, self._motion, self.period_s, share)

    def ahead(self, users: RoadUsers) -> Ahead:
        """Returns where vehicles will be when a new command begins to act."""
        if not self.actuators.is_slow:
            return Ahead(np.zeros(len(users.number)), users.speed_mps, 0.0)
        way_m, speed_mps = self.actuators.predicted(users.number, users.speed_mps)
        return Ahead(way_m, speed_mps, self.actuators.delay_s)

    def command(
        self,
        names: Sequence[str],
        users: RoadUsers,
        accel_mps2: FloatArray,
        changes: BoolArray,
        asks: BoolArray,
    ) -> None:
        """Takes over who is new, and has vehicles ask for room and change lanes.

        Then all drive for a period.
        """
        own = np.flatnonzero(users.automated)
        number = users.number[own]
        for i in own[np.isnan(self._motion.sent_mps[number])].tolist():
            self._take_over(names[i], int(users.number[i]), bool(users.on_mainline[i]))
        self._settle(names, users, own, changes)
        self._ask(names, users, own, asks)
        if self._may_act_rarely:
            self._act(names, users, changes)
        for i in np.flatnonzero(changes).tolist():
            self.session.judge_gaps_by(names[i], self.min_gap_m, 1.0)
            self._change_lane(names[i])
            self._changing[users.number[i]] = True
        chosen = [names[i] for i in own.tolist()]
        self._motion.sent_m[number] = users.station_m[own]
        self._motion.sent_mps[number] = users.speed_mps[own]
        self._drive(chosen, number, accel_mps2[own])

    def _take_over(self, name: str, number: int, on_mainline: bool) -> None:
        """Takes over a vehicle; SUMO has drivers make room for one that is still to merge."""
        if on_mainline:
            self.session.take_over(name)
            return
        self._from_ramp[number] = self._asking[number] = True
        self.session.take_over_among_drivers(name)
        self.session.judge_gaps_by(name, NO_GAP_M, NOT_ASSERTIVE)

    def _settle(
        self, names: Sequence[str], users: RoadUsers, own: IntArray, changes: BoolArray
    ) -> None:
        """Has who came from the ramp or was to change drive as all do in the lane where it is.

        Where the mainline is empty far and wide SUMO changes lanes by itself, without a command:
        there gaps are judged as usual from then on, or nobody could change in before it. For one
        whose merge SUMO refused, and that merges no more, drivers make room again.
        """
        number, on_mainline = users.number[own], users.on_mainline[own]
        changing = self._changing[number]
        arrived = on_mainline & (changing | self._from_ramp[number])
        for i in own[arrived].tolist():
            if not self._changing[users.number[i]]:
                self.session.judge_gaps_by(names[i], self.min_gap_m, 1.0)
            self.session.take_over(names[i])
            self._forget_change(int(users.number[i]))
        for i in own[changing & ~on_mainline & ~changes[own]].tolist():
            self._changing[users.number[i]] = False
            self._take_over(names[i], int(users.number[i]), on_mainline=False)

    def _ask(self, names: Sequence[str], users: RoadUsers, own: IntArray, asks: BoolArray) -> None:
        """Has those on the ramp who are not told to merge ask drivers for room, or no longer."""
        number = users.number[own]
        waits = ~users.on_mainline[own] & ~self._changing[number]
        for i in own[waits & (asks[own] != self._asking[number])].tolist():
            self.session.ask_drivers(names[i], bool(asks[i]))
            self._asking[users.number[i]] = asks[i]

    @cached_property
    def _may_act_rarely(self) -> bool:
        """Whether nobody drives by himself whose random numbers SUMO draws together with others'.

        SUMO draws them for all that act on a lane.
        """
        return bool(self.able.automated.all())

    def _act(self, names: Sequence[str], users: RoadUsers, changes: BoolArray) -> None:
        """Has SUMO ask a vehicle that keeps its lane only rarely what it would do by itself.

        It does as commanded all the same, at each step: it drives the same way bit for bit.
        """
        number = users.number
        rarely = users.on_mainline & ~changes & (users.speed_mps >= ACTS_RARELY_MPS)
        other = rarely != self._acts_rarely[number]
        self._acts_rarely[number] = rarely
        for i in np.flatnonzero(other).tolist():
            if rarely[i]:
                self.session.act_now(names[i])
            else:
                self.session.act_each_step(names[i])

    def _forget_change(self, number: int) -> None:
        """Is told that a vehicle neither merges nor changes lanes any more."""
        self._changing[number] = self._from_ramp[number] = False

    def _change_lane(self, name: str) -> None:
        """Has a vehicle on the acceleration lane change to the mainline beside it."""
        self.session.change_lane_now(name, self.period_steps)

    def _drive(self, names: Sequence[str], number: IntArray, accel_mps2: FloatArray) -> None:
        """Drives a period: at once with these accelerations, or step by step as the lag has it."""
        if not self.actuators.is_slow:
            driven = self.actuators.driven(number, accel_mps2)
            self._drive_evenly(names, number, driven, self.period_steps)
            return
        for step in range(self.period_steps):
            if step > 0:
                self._step_on()
                here = self.session.still_here(names)
                names = [name for name, there in zip(names, here, strict=True) if there]
                number, accel_mps2 = number[here], accel_mps2[here]
            self._drive_evenly(names, number, self.actuators.driven(number, accel_mps2), 1)

    def _step_on(self) -> None:
        """Executes a step within a period."""
        self.watch.step_on()

    def _drive_evenly(
        self, names: Sequence[str], number: IntArray, accel_mps2: FloatArray, steps: int
    ) -> None:
        from_mps, to_mps = sent_evenly(number, accel_mps2, self._motion, steps, self.step_s)
        self.session.drive_evenly(names, from_mps, to_mps, steps)
