"""The order in which mainline and ramp will pass: each ramp vehicle gets a place among the others.

Every vehicle on the ramp, automated or not, has a virtual station on the mainline: where a vehicle
at the lane's speed would be now if it is to be beside it once it has merged. Front first, each is
put behind its predecessor on the ramp where that costs least.
"""

import math
from typing import NamedTuple

import numpy as np

from coramp._kernel import BoolArray, FloatArray, IntArray, kernel
from coramp.mixed.laws import CourtesyLaws, FollowingLaw
from coramp.mixed.users import NOBODY, MixedRoad, RoadUsers, gap_for_m, gap_m, in_order

SLOWEST_LANE_MPS = 3.0
"""A lane that stands still has no virtual stations; they are those of a lane that crawls."""
CROSSED_M = 0.1
FAR_M = 120.0
"""A place this far ahead of its virtual station is no ramp vehicle's to take."""


class Sequence(NamedTuple):
    """The order of passing, front first, and each vehicle's virtual station there.

    ``place`` are entries of the users, ``station_m`` their stations, virtual ones where ``virtual``
    is True. ``lane_mps`` and ``merge_in_s`` have one entry a user: the speed of the lane beside a
    ramp vehicle, and how long it takes until it has merged at that speed.
    """

    place: IntArray
    station_m: FloatArray
    virtual: BoolArray
    lane_mps: FloatArray
    merge_in_s: FloatArray


@kernel
def sequence_of(
    users: RoadUsers,
    before: IntArray,
    laws: CourtesyLaws,
) -> tuple[Sequence, IntArray]:
    """Returns the order, and the number of whom each ramp vehicle is behind (-1: of nobody).

    ``before`` is that of the last decision, -2 for a vehicle that had no place yet.
    """
    mainline, ramp = (
        in_order(users.station_m, users.on_mainline),
        in_order(users.station_m, ~users.on_mainline),
    )
    count, last = len(mainline), -1
    size = count + len(ramp)
    place, station_m, virtual = (
        np.empty(size, np.int64),
        np.empty(size),
        np.zeros(size, np.bool_),
    )
    place[:count], station_m[:count] = mainline, users.station_m[mainline]
    lane_mps = np.full(len(users.number), laws.road.mainline_speed_mps)
    merge_in_s, behind = np.zeros(len(users.number)), np.full(len(users.number), NOBODY)
    for own in ramp:
        lane_mps[own] = _lane_speed_mps(users, mainline, users.station_m[own], laws)
        own_m, merge_in_s[own] = virtual_station(
            users.station_m[own], users.speed_mps[own], lane_mps[own], laws.following, laws.road
        )
        now = Sequence(place[:count], station_m[:count], virtual[:count], lane_mps, merge_in_s)
        last = _cheapest(users, now, own, own_m, last + 1, before[own], laws)
        behind[own] = users.number[place[last - 1]] if last > 0 else NOBODY
        for k in range(count, last, -1):
            place[k], station_m[k], virtual[k] = place[k - 1], station_m[k - 1], virtual[k - 1]
        place[last], station_m[last], virtual[last] = own, own_m, True
        count += 1
    return Sequence(place, station_m, virtual, lane_mps, merge_in_s), behind


@kernel
def _lane_speed_mps(users: RoadUsers, mainline: IntArray, at_m: float, laws: CourtesyLaws) -> float:
    """The mean speed of the mainline around a station, v0 where it is empty."""
    law, road = laws.sequence, laws.road
    total_mps, count = 0.0, 0
    for i in mainline:
        if at_m - law.behind_m < users.station_m[i] < at_m + law.ahead_m:
            total_mps += users.speed_mps[i]
            count += 1
    if count == 0:
        return road.mainline_speed_mps
    return min(road.mainline_speed_mps, max(SLOWEST_LANE_MPS, total_mps / count))


@kernel
def virtual_station(
    station_m: float, speed_mps: float, lane_mps: float, law: FollowingLaw, road: MixedRoad
) -> tuple[float, float]:
    """Returns the virtual station (m) of a ramp vehicle, and how long it takes to merge there (s).

    It goes to v_R0 and to the nose, which takes t_n over the distance d, and from its speed v_n
    there to the lane's speed u: it loses u t_n - d and (u - v_n)^2 / (2 a) to the lane.
    """
    to_nose_m, now_mps = max(0.0, -station_m), max(speed_mps, 1.0)
    up_mps2, ramp_mps = law.speed_up_mps2, road.ramp_speed_mps
    up_s = max(0.0, (ramp_mps - now_mps) / up_mps2)
    up_m = 0.5 * (now_mps + ramp_mps) * up_s
    if to_nose_m <= 0.0:
        nose_s, nose_mps = 0.0, now_mps
    elif up_m < to_nose_m:
        nose_mps = max(ramp_mps, now_mps)
        nose_s = up_s + (to_nose_m - up_m) / nose_mps
    else:
        nose_mps = math.sqrt(now_mps * now_mps + 2.0 * up_mps2 * to_nose_m)
        nose_s = (nose_mps - now_mps) / up_mps2
    slower_mps = max(0.0, lane_mps - nose_mps)
    lost_m = max(0.0, lane_mps * nose_s - to_nose_m) + slower_mps**2 / (2.0 * law.merge_mps2)
    return station_m - lost_m, nose_s + slower_mps / law.merge_mps2


@kernel
def _cheapest(
    users: RoadUsers,
    now: Sequence,
    own: int,
    own_m: float,
    first: int,
    before: int,
    laws: CourtesyLaws,
) -> int:
    """The place in the order that costs least; the vehicle at it and those behind fall back."""
    gaps, law = laws.gaps, laws.sequence
    best, least = len(now.place), math.inf
    lane_mps, automated = now.lane_mps[own], users.automated[own]
    for k in range(first, len(now.place) + 1):
        there_m, leader = own_m, NOBODY
        if k > 0:
            front = now.place[k - 1]
            leader = users.number[front]
            keeps_m = gaps.for_driver_m + gaps.for_driver_s * lane_mps
            if automated:
                keeps_m = gap_m(True, users.automated[front], lane_mps, gaps)
            there_m = min(own_m, now.station_m[k - 1] - users.length_m[front] - keeps_m)
        cost = law.own_weight * (own_m - there_m)
        cost += _fall_back(users, now, own, there_m, k, laws)
        if leader == before:
            cost -= law.hysteresis_m
        if cost < least - 1e-9:
            best, least = k, cost
        if k > 0 and now.station_m[k - 1] < own_m - FAR_M:
            break
    return best


@kernel
def _fall_back(
    users: RoadUsers,
    now: Sequence,
    own: int,
    there_m: float,
    first: int,
    laws: CourtesyLaws,
) -> float:
    """What the vehicles behind fall back (weighted m) if one merges at ``there_m``."""
    if first >= len(now.place):
        return 0.0
    gaps, law = laws.gaps, laws.sequence
    speed_mps, rear = now.lane_mps[own], now.place[first]
    leaves_m = gap_for_m(users.automated[rear], users.automated[own], speed_mps, gaps)
    carry_m = now.station_m[first] - (there_m - users.length_m[own] - leaves_m)
    cost, k = 0.0, first
    while carry_m > CROSSED_M and k < min(len(now.place), first + int(law.deep)):
        rear = now.place[k]
        cost += carry_m * (1.0 if users.automated[rear] else law.driver_weight)
        if k + 1 < len(now.place):
            after = now.place[k + 1]
            keeps_m = gap_m(users.automated[after], users.automated[rear], speed_mps, gaps)
            tail_m = now.station_m[k] - users.length_m[rear]
            carry_m -= max(0.0, tail_m - now.station_m[k + 1] - keeps_m)
        k += 1
    return cost
