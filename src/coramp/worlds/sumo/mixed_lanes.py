"""Automated vehicles among drivers on several lanes: their lanes, and how they make way."""

from dataclasses import dataclass, field
from functools import cached_property
from typing import Protocol

import numpy as np

from coramp._kernel import BoolArray, FloatArray, IntArray
from coramp.mixed.lanes import OUTERMOST, RAMP_LANE, Lanes, decided_in_lanes, on_endless_lanes
from coramp.mixed.laws import OnBoardLaws
from coramp.mixed.on_board import Ahead
from coramp.mixed.users import RoadUsers
from coramp.worlds.sumo.lanes import LanedRoad
from coramp.worlds.sumo.mixed import Control, Driven, Moment
from coramp.worlds.sumo.mixed_plant import Foresees, MixedPlant
from coramp.worlds.sumo.road_limits import NO_LIMITS, RoadLimits, road_limits_of

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

    lane: IntArray = field(default_factory=lambda: np.empty(0, np.int64))
    beside: BoolArray = field(default_factory=lambda: np.empty(0, np.bool_))
    tail: BoolArray = field(default_factory=lambda: np.empty(0, np.bool_))
    _limits: RoadLimits = NO_LIMITS
    _refused: dict[int, int] = field(default_factory=dict)

    def is_on(self, road: LanedRoad) -> None:
        """Is told its road."""
        self._limits = road_limits_of([[road.mainline.limits, road.ramp.limits]])

    def users(self) -> tuple[list[str], BoolArray, RoadUsers]:
        """Returns names, who may leave the acceleration lane, and all that is on the road."""
        names, seen = self._on_road(self._limits)
        self.lane, self.beside, self.tail = seen.lane, seen.beside, seen.tail
        return names, seen.may_leave, seen.users

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
