"""Automated vehicles among drivers on several lanes: their lanes, and how they make way."""

from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from coramp._kernel import BoolArray, FloatArray, IntArray
from coramp.mixed.lanes import (
    OUTERMOST,
    RAMP_LANE,
    inner_accelerations_mps2,
    making_way,
    neighbours_in_lanes,
)
from coramp.mixed.on_board import Ahead, Neighbours, driven_mps2, may_change_lane
from coramp.mixed.users import RoadUsers
from coramp.networks.limits import Limits
from coramp.worlds.sumo.lanes import LanedRoad
from coramp.worlds.sumo.mixed import Control, Driven, Moment
from coramp.worlds.sumo.mixed_plant import Foresees, MixedPlant
from coramp.worlds.sumo.network import LaneSpan


@dataclass
class LanedPlant(MixedPlant):
    """The vehicles of a session on a road of several lanes.

    ``lane`` is the number of each user's lane at the last look, from the outermost of the mainline
    on, or ``RAMP_LANE``; ``beside`` is who can change from it to the next one further in. Each
    cruises no faster than the limits where it is, and ahead, let it.
    """

    road: LanedRoad | None = None
    lane: IntArray = field(default_factory=lambda: np.empty(0, np.int64))
    beside: BoolArray = field(default_factory=lambda: np.empty(0, np.bool_))
    _sumo_lane: dict[str, int] = field(default_factory=dict)

    def is_on(self, road: LanedRoad) -> None:
        """Is told its road."""
        self.road = road

    def users(self) -> tuple[list[str], BoolArray, RoadUsers]:
        """Returns names, who may leave the acceleration lane, and all that is on the road."""
        assert self.road is not None
        names, lanes, position_m, sumo_mps = self.session.everyone()
        spans = [self.road.lanes[lane] for lane in lanes]
        number = np.array([self.able.number[name] for name in names], np.int64)
        station_m = _stations_m(spans, position_m)
        speed_mps, accel_mps2 = self._measured(number, station_m, sumo_mps)
        self.lane = np.array([span.lane for span in spans], np.int64)
        self._sumo_lane = {
            name: int(lane.rpartition("_")[2]) for name, lane in zip(names, lanes, strict=True)
        }
        users = RoadUsers(
            number,
            station_m,
            speed_mps,
            accel_mps2,
            self.able.length_m[number],
            self.lane > RAMP_LANE,
            self.able.automated[number],
            np.minimum(self.able.cruise_mps[number], self._allowed_mps(station_m)),
            self.able.acceleration_mps2[number],
            self.able.power_wpkg[number],
            self.able.braking_mps2[number],
        )
        self.beside = np.array([span.changes for span in spans], np.bool_)
        return names, self.beside & (self.lane == RAMP_LANE), users

    def _allowed_mps(self, station_m: FloatArray) -> FloatArray:
        """What the limits of each one's road let it drive."""
        assert self.road is not None
        allowed = np.empty(len(station_m))
        for way, own in (
            (self.road.mainline, self.lane > RAMP_LANE),
            (self.road.ramp, self.lane == RAMP_LANE),
        ):
            allowed[own] = _allowed_mps(way.limits, station_m[own])
        return allowed

    def _change_lane(self, name: str) -> None:
        """Has a vehicle change to the next lane further in; SUMO refuses what would collide."""
        time_s = (self.period_steps - 1) * self.step_s
        self.session.change_lane_if_clear(name, self._sumo_lane[name] + 1, max(time_s, self.step_s))


def _stations_m(spans: list[LaneSpan], position_m: list[float]) -> FloatArray:
    start_m = np.array([span.start_m for span in spans], np.float64)
    per_m = np.array([span.per_m for span in spans], np.float64)
    return start_m + np.array(position_m, np.float64) * per_m


def _allowed_mps(limits: Limits, station_m: FloatArray) -> FloatArray:
    """``Limits.allowed_mps`` of many stations."""
    return np.array([limits.allowed_mps(at_m) for at_m in station_m.tolist()], np.float64)


class InLanes(Protocol):
    """What a control asks of the plant on several lanes: each user's lane, and who can change."""

    lane: IntArray
    beside: BoolArray


@dataclass
class LanedControl(Control):
    """The strategy for the ramp and the lane beside it, and what each vehicle does on board.

    The strategy is shown the vehicles of the ramp and of the mainline's outermost lane. Those of
    the lanes further in keep their lane and the law on board. Who is told to slow down for a
    vehicle that merges changes to the lane further in where that is safe.
    """

    plant: InLanes | None = None

    def drives(self, plant: MixedPlant) -> None:
        """Is told whom it drives."""
        assert isinstance(plant, LanedPlant)
        self.plant = plant

    def decided(self, now_s: float, names: list[str], able: BoolArray, users: RoadUsers) -> Moment:
        """Returns what the strategy answers to what it has heard of the outer lanes."""
        outer = _chosen(users, self._lane <= OUTERMOST)
        moment = super().decided(now_s, names, able, outer)
        return moment._replace(users=users, around=None)

    @property
    def _lane(self) -> IntArray:
        assert self.plant is not None
        return self.plant.lane

    @property
    def _beside(self) -> BoolArray:
        assert self.plant is not None
        return self.plant.beside

    def driven(self, moment: Moment, plant: Foresees) -> Driven:
        """Returns what vehicles are told, as far as it arrives, and what they do on board."""
        users, lane, laws = moment.users, self._lane, self.laws
        most_mps2, may_merge = self._told(moment, lane)
        around, ahead = neighbours_in_lanes(users, lane), plant.ahead(users)
        wishes = may_merge & moment.able & users.automated & (lane == RAMP_LANE)
        changes = self._merging(users, around, ahead, most_mps2, wishes)
        for own in self._making_way(moment, around, ahead, most_mps2, changes):
            changes[own] = True
            most_mps2[own] = np.inf  # what it was told is for the lane that it leaves
        accel_mps2 = driven_mps2(users, around, ahead, most_mps2, changes, laws)
        return Driven(most_mps2, wishes, accel_mps2, changes)

    def _told(self, moment: Moment, lane: IntArray) -> tuple[FloatArray, BoolArray]:
        """What those of the outer lanes were told; others are told nothing."""
        users, outer = moment.users, lane <= OUTERMOST
        if moment.steering is not None:
            self.air.tell(moment.now_s, moment.seen, moment.steering)
        most_mps2, may_merge = np.full(len(lane), np.inf), np.zeros(len(lane), np.bool_)
        own = _chosen(users, outer)
        most_mps2[outer], may_merge[outer] = self.air.told(moment.now_s, own)
        if self.notes is not None:
            self.notes.told(moment.now_s, own, moment.seen, most_mps2[outer], self.air)
        return most_mps2, may_merge

    def _merging(
        self,
        users: RoadUsers,
        around: Neighbours,
        ahead: Ahead,
        most_mps2: FloatArray,
        wishes: BoolArray,
    ) -> BoolArray:
        """Which of those on the acceleration lane that wish to merge may."""
        changes = np.zeros(len(wishes), np.bool_)
        if not wishes.any():
            return changes
        accel_mps2 = driven_mps2(users, around, ahead, most_mps2, wishes, self.laws)
        slower_mps = users.speed_mps + np.minimum(0.0, accel_mps2) * self.laws.period_s
        slowest_mps = np.minimum(slower_mps, ahead.speed_mps)
        for own in np.flatnonzero(wishes).tolist():
            slowest = slowest_mps[own]
            changes[own] = may_change_lane(users, own, around, ahead, slowest, self.laws)
        return changes

    def _making_way(
        self,
        moment: Moment,
        around: Neighbours,
        ahead: Ahead,
        most_mps2: FloatArray,
        merging: BoolArray,
    ) -> list[int]:
        """Which vehicles of the outermost lane change to the lane further in."""
        users, lane = moment.users, self._lane
        held = users.automated & (lane == OUTERMOST) & self._beside & np.isfinite(most_mps2)
        held &= users.station_m < self.laws.safety.lane_end_m
        beside = around.rear[merging]
        held[beside[beside >= 0]] = False  # one thing at a time: its new leader comes in now
        if not (held & (most_mps2 < 0.0)).any():
            return []
        inner_mps2 = inner_accelerations_mps2(users, around, ahead, self.laws)
        chosen = making_way(users, around, ahead, held, most_mps2, inner_mps2, self.laws)
        return [int(own) for own in chosen]

    def note(
        self, moment: Moment, ahead: Ahead, accel_mps2: FloatArray, changes: BoolArray
    ) -> None:
        """Notes what those of the outer lanes do, if anything is noted."""
        if self.notes is None:
            return
        outer = self._lane <= OUTERMOST
        own = moment._replace(users=_chosen(moment.users, outer))
        there = Ahead(ahead.way_m[outer], ahead.speed_mps[outer], ahead.delay_s)
        super().note(own, there, accel_mps2[outer], changes[outer])


def _chosen(users: RoadUsers, chosen: BoolArray) -> RoadUsers:
    if chosen.all():
        return users
    return RoadUsers._make(column[chosen] for column in users)
