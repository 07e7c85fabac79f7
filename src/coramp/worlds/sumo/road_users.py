"""Where SUMO's vehicles are on a road, as the laws of mixed traffic read it."""

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from coramp._kernel import BoolArray, FloatArray, IntArray, kernel
from coramp.mixed.users import RoadUsers
from coramp.worlds.sumo.mixed_motion import Motion, measured
from coramp.worlds.sumo.network import RAMP_LANE, LaneSpan
from coramp.worlds.sumo.road_limits import MAINLINE_WAY, RAMP_WAY, RoadLimits, allowed_mps

TO_LANE_END_M = 1.0
"""Nobody is told to change lanes who would come so near to his lane's end within a period."""


class LaneTable(NamedTuple):
    """SUMO's lanes as arrays, one entry a lane, as in ``LaneSpan``."""

    start_m: FloatArray
    end_m: FloatArray
    per_m: FloatArray
    lane: IntArray
    changes: BoolArray


class Abilities(NamedTuple):
    """What vehicles are and can do, one entry an arrival, as in ``RoadUsers``."""

    automated: BoolArray
    length_m: FloatArray
    cruise_mps: FloatArray
    acceleration_mps2: FloatArray
    power_wpkg: FloatArray
    braking_mps2: FloatArray


class OnRoad(NamedTuple):
    """All on the road, one entry each: ``lane`` is as in ``LaneSpan``.

    ``may_leave`` is who is on the acceleration lane and can change from it; ``beside`` is who can
    change to the next lane further in, and stays beside that for another period; ``tail`` is whose
    rear is still on the ramp.
    """

    users: RoadUsers
    lane: IntArray
    may_leave: BoolArray
    beside: BoolArray
    tail: BoolArray


def lane_table_of(spans: Iterable[LaneSpan]) -> LaneTable:
    """Returns lanes as arrays."""
    lanes = list(spans)
    return LaneTable(
        np.array([span.start_m for span in lanes], np.float64),
        np.array([span.end_m for span in lanes], np.float64),
        np.array([span.per_m for span in lanes], np.float64),
        np.array([span.lane for span in lanes], np.int64),
        np.array([span.changes for span in lanes], np.bool_),
    )


@kernel
def on_road(
    number: IntArray,
    place: IntArray,
    position_m: FloatArray,
    sumo_mps: FloatArray,
    lanes: LaneTable,
    limits: RoadLimits,
    able: Abilities,
    motion: Motion,
    came_by: IntArray,
    period_s: float,
    share: float,
) -> OnRoad:
    """Returns all that is on the road at a look at SUMO, each at most as fast as limits let it.

    ``share`` is as in ``measured``, which notes speeds in ``motion``; ``came_by`` as in ``tails``.
    """
    count = len(number)
    station_m = np.empty(count)
    for k in range(count):
        station_m[k] = lanes.start_m[place[k]] + position_m[k] * lanes.per_m[place[k]]
    speed_mps, accel_mps2 = measured(number, station_m, sumo_mps, motion, period_s, share)
    lane, cruise_mps = np.empty(count, np.int64), np.empty(count)
    may_leave, beside = np.empty(count, np.bool_), np.empty(count, np.bool_)
    for k in range(count):
        lane[k] = lanes.lane[place[k]]
        way = MAINLINE_WAY if lane[k] > RAMP_LANE else RAMP_WAY
        cruise_mps[k] = min(able.cruise_mps[number[k]], allowed_mps(limits, 0, way, station_m[k]))
        changes = lanes.changes[place[k]]
        may_leave[k] = changes and lane[k] == RAMP_LANE
        # a lane's number is another one beyond its end, so that nobody is told of it near there
        then_m = station_m[k] + speed_mps[k] * period_s + TO_LANE_END_M
        beside[k] = changes and then_m < lanes.end_m[place[k]]
    one_site = np.zeros(count, np.int64)
    users = RoadUsers(
        number,
        station_m,
        speed_mps,
        accel_mps2,
        able.length_m[number],
        lane > RAMP_LANE,
        able.automated[number],
        cruise_mps,
        able.acceleration_mps2[number],
        able.power_wpkg[number],
        able.braking_mps2[number],
    )
    return OnRoad(users, lane, may_leave, beside, tails(users, lane, one_site, came_by))


@kernel
def tails(users: RoadUsers, lane: IntArray, site: IntArray, came_by: IntArray) -> BoolArray:
    """Returns whose rear is still on the ramp of its site, though it has left the ramp's lane.

    It is no more on the ramp for SUMO, but stands in the way of who comes along it. ``site`` is
    the site of each user. ``came_by`` has one entry a vehicle of the run: the site on whose ramp it
    was last, which is noted.
    """
    for k in range(len(lane)):
        if lane[k] == RAMP_LANE:
            came_by[users.number[k]] = site[k]
    tail = np.zeros(len(lane), np.bool_)
    for k in range(len(lane)):
        over_the_nose = lane[k] > RAMP_LANE and users.station_m[k] < users.length_m[k]
        tail[k] = over_the_nose and came_by[users.number[k]] == site[k]
    return tail
