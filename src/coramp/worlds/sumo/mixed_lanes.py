"""Automated vehicles among drivers on several lanes: their lanes, and how they make way."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple, Protocol

import numpy as np

from coramp._kernel import BoolArray, FloatArray, IntArray
from coramp.mixed.lanes import OUTERMOST, RAMP_LANE, Lanes, decided_in_lanes, on_endless_lanes
from coramp.mixed.laws import OnBoardLaws
from coramp.mixed.on_board import Ahead
from coramp.mixed.users import RoadUsers
from coramp.networks.limits import SLOWS_MPS2, Limits
from coramp.worlds.sumo.lanes import LanedRoad
from coramp.worlds.sumo.mixed import Control, Driven, Moment
from coramp.worlds.sumo.mixed_plant import Foresees, MixedPlant
from coramp.worlds.sumo.network import LaneSpan

NO_SITE = -1
"""Of who has not come by a ramp; sites are counted from 0."""
TO_LANE_END_M = 1.0
"""Nobody is told to change lanes who would come so near to his lane's end within a period."""
REFUSED_S = 1.0
"""So long SUMO may refuse a merge of a vehicle that stands, and that the law on board allows."""


@dataclass
class LanedPlant(MixedPlant):
    """The vehicles of a session on a road of several lanes.

    ``lane`` is the number of each user's lane at the last look, from the outermost of the mainline
    on, or ``RAMP_LANE``; ``beside`` is who can change from it to the next one further in, and stays
    beside that for another period; ``tail`` is whose rear is still on the ramp. Each cruises no
    faster than the limits where it is, and ahead, let it.
    """

    road: LanedRoad | None = None
    lane: IntArray = field(default_factory=lambda: np.empty(0, np.int64))
    beside: BoolArray = field(default_factory=lambda: np.empty(0, np.bool_))
    tail: BoolArray = field(default_factory=lambda: np.empty(0, np.bool_))
    _came_by: IntArray = field(init=False)
    _table: "_Table | None" = None
    _refused: dict[int, int] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Nobody has been seen on a ramp yet."""
        super().__post_init__()
        self._came_by = np.full(len(self.able.automated), NO_SITE)

    def is_on(self, road: LanedRoad) -> None:
        """Is told its road."""
        self.road, self._table = road, _Table.of(road.lanes)

    def users(self) -> tuple[list[str], BoolArray, RoadUsers]:
        """Returns names, who may leave the acceleration lane, and all that is on the road."""
        assert self._table is not None
        names, lanes, position_m, sumo_mps = self.session.everyone()
        able, number_of, table = self.able, self.able.number, self._table
        place_of = table.places
        number = np.array([number_of[name] for name in names], np.int64)
        place = np.array([place_of[lane] for lane in lanes], np.int64)
        station_m = table.start_m[place] + np.array(position_m) * table.per_m[place]
        speed_mps, accel_mps2 = self._measured(number, station_m, sumo_mps)
        self.lane = table.lane[place]
        users = RoadUsers(
            number,
            station_m,
            speed_mps,
            accel_mps2,
            able.length_m[number],
            self.lane > RAMP_LANE,
            able.automated[number],
            np.minimum(able.cruise_mps[number], self._allowed_mps(station_m)),
            able.acceleration_mps2[number],
            able.power_wpkg[number],
            able.braking_mps2[number],
        )
        may_leave = table.changes[place] & (self.lane == RAMP_LANE)
        # a lane's number is another one beyond its end, so that nobody is told of it near there
        stays = station_m + speed_mps * self.period_s + TO_LANE_END_M < table.end_m[place]
        self.beside = table.changes[place] & stays
        self.tail = self._tails(users, self.lane)
        return names, may_leave, users

    def _tails(self, users: RoadUsers, lane: IntArray, site: IntArray | None = None) -> BoolArray:
        """Returns whose rear is still on the ramp of its site, though it has left the ramp's lane.

        It is no more on the ramp for SUMO, but stands in the way of who comes along it. ``site`` is
        the site of each user; without it there is one.
        """
        site = np.zeros(len(lane), np.int64) if site is None else site
        on_ramp = lane == RAMP_LANE
        self._came_by[users.number[on_ramp]] = site[on_ramp]
        over_the_nose = (lane > RAMP_LANE) & (users.station_m < users.length_m)
        return np.asarray(over_the_nose & (self._came_by[users.number] == site))

    def _allowed_mps(self, station_m: FloatArray) -> FloatArray:
        """What the limits of each one's road let it drive."""
        assert self.road is not None
        mainline_mps = allowed_mps(self.road.mainline.limits, station_m)
        ramp_mps = allowed_mps(self.road.ramp.limits, station_m)
        return np.where(self.lane > RAMP_LANE, mainline_mps, ramp_mps)

    def _change_lane(self, name: str) -> None:
        """Has a vehicle change to the next lane further in, as SUMO allows.

        SUMO refuses gaps below the standstill gap of who is behind. Where both stand on less, which
        the law on board allows, neither would ever go on: then it changes without SUMO's check.
        """
        number = self.able.number[name]
        if self._from_ramp[number] and self._motion.sent_mps[number] == 0.0:
            tried = self._refused[number] = self._refused.get(number, 0) + 1
            if tried * self.period_s > REFUSED_S:
                self.session.change_lane_now(name, self.period_steps)
                return
        time_s = (self.period_steps - 1) * self.step_s
        self.session.change_lane_if_clear(name, max(time_s, self.step_s))

    def _forget_change(self, number: int) -> None:
        """Is told that a vehicle neither merges nor changes lanes any more."""
        super()._forget_change(number)
        self._refused.pop(number, None)


class _Table(NamedTuple):
    """SUMO's lanes as arrays, with the place of each in them."""

    places: Mapping[str, int]
    start_m: FloatArray
    end_m: FloatArray
    per_m: FloatArray
    lane: IntArray
    changes: BoolArray

    @classmethod
    def of(cls, lanes: Mapping[str, LaneSpan]) -> "_Table":
        spans = list(lanes.values())
        return cls(
            {name: place for place, name in enumerate(lanes)},
            np.array([span.start_m for span in spans], np.float64),
            np.array([span.end_m for span in spans], np.float64),
            np.array([span.per_m for span in spans], np.float64),
            np.array([span.lane for span in spans], np.int64),
            np.array([span.changes for span in spans], np.bool_),
        )


def allowed_mps(limits: Limits, station_m: FloatArray) -> FloatArray:
    """Returns ``Limits.allowed_mps`` (m/s) of many stations, to the last bit."""
    here = np.searchsorted(limits.from_m, station_m, side="right") - 1
    allowed = np.array(limits.limit_mps)[np.maximum(here, 0)]
    for k in range(1, len(limits.from_m)):
        ahead_m = limits.from_m[k] - station_m
        slows_mps = np.sqrt(limits.limit_mps[k] ** 2 + 2.0 * SLOWS_MPS2 * np.maximum(ahead_m, 0.0))
        allowed = np.where(k > here, np.minimum(allowed, slows_mps), allowed)
    return allowed


class InLanes(Protocol):
    """What a control asks of the plant on several lanes, as ``LanedPlant`` has it."""

    lane: IntArray
    beside: BoolArray
    tail: BoolArray


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
        return moment._replace(users=users, around=None, outer=outer)

    @cached_property
    def _endless(self) -> OnBoardLaws:
        return on_endless_lanes(self.laws)

    @property
    def _lane(self) -> IntArray:
        assert self.plant is not None
        return self.plant.lane

    @property
    def _lanes(self) -> Lanes:
        assert self.plant is not None
        return Lanes(self.plant.lane, self.plant.beside, self.plant.tail)

    def driven(self, moment: Moment, plant: Foresees) -> Driven:
        """Returns what vehicles are told, as far as it arrives, and what they do on board."""
        users, laws, endless = moment.users, self.laws, self._endless
        most_mps2, may_merge = self._told(moment, self._lane)
        lanes = self._lanes
        wishes = may_merge & moment.able & users.automated & (lanes.number == RAMP_LANE)
        obeys_mps2, accel_mps2, changes, asks = decided_in_lanes(
            users, lanes, plant.ahead(users), most_mps2, wishes, laws, endless
        )
        return Driven(obeys_mps2, wishes, accel_mps2, changes, asks)

    def _told(self, moment: Moment, lane: IntArray) -> tuple[FloatArray, BoolArray]:
        """What those of the outer lanes were told; others are told nothing."""
        users, outer = moment.users, lane <= OUTERMOST
        if moment.steering is not None:
            self.air.tell(moment.now_s, moment.seen, moment.steering)
        most_mps2, may_merge = np.full(len(lane), np.inf), np.zeros(len(lane), np.bool_)
        own = _chosen(users, outer) if moment.outer is None else moment.outer
        most_mps2[outer], may_merge[outer] = self.air.told(moment.now_s, own)
        if self.notes is not None:
            self.notes.told(moment.now_s, own, moment.seen, most_mps2, self.air)
        return most_mps2, may_merge

    def note(
        self, moment: Moment, ahead: Ahead, accel_mps2: FloatArray, changes: BoolArray
    ) -> None:
        """Notes what those of all lanes do, if anything is noted."""
        self._note(moment, ahead, (accel_mps2, changes), self._lanes)


def _chosen(users: RoadUsers, chosen: BoolArray) -> RoadUsers:
    if chosen.all():
        return users
    return RoadUsers._make(column[chosen] for column in users)
