"""What an automated vehicle does by itself: follows, keeps its distance, stops before a lane's end.

Whatever it is told, it keeps to every leader the distance that it needs if that leader brakes at
b: with v and v_l the two speeds,

    gap - margin + v_l^2 / (2 b)  >=  v^2 / (2 b).

Braking at b keeps both sides as they are, so that a vehicle that holds this now can hold it for
ever. The acceleration that it takes lets it hold this after its reaction time too.
"""

import math
from typing import NamedTuple

import numpy as np

from coramp._kernel import BoolArray, FloatArray, IntArray, kernel
from coramp.mixed.laws import OnBoardLaws, SafetyLaw
from coramp.mixed.users import NOBODY, RoadUsers, gap_m, in_order

TO_CRUISE_S = 1.0
CRUISE_BRAKING_MPS2 = 2.0
"""A vehicle goes to the speed that it wishes within a second, and slows for that no harder."""
STANDING_M, STANDING_S = 0.5, 0.1
"""Nobody changes lanes with less than this, s_0 + T v of who is behind, before or behind it."""
READY_M = 1.0
"""The first metres of the acceleration lane are no place to change."""
REAR_BRAKES_SHARE = 3.0
"""A lane change may ask of an automated vehicle behind for b divided by this before it reacts."""


class Ahead(NamedTuple):
    """Where each vehicle will be when a command given now begins to act, ``delay_s`` later.

    ``way_m`` is how far it goes until then, ``speed_mps`` its speed then.
    """

    way_m: FloatArray
    speed_mps: FloatArray
    delay_s: float


class Neighbours(NamedTuple):
    """Who is ahead in one's lane, and beside a vehicle on the acceleration lane: -1 for nobody."""

    leader: IntArray
    front: IntArray
    rear: IntArray


@kernel
def neighbours_of(users: RoadUsers) -> Neighbours:
    """Returns the leader of each vehicle, and the mainline's vehicles before and behind it."""
    count = len(users.number)
    leader, front, rear = np.full(count, NOBODY), np.full(count, NOBODY), np.full(count, NOBODY)
    mainline = in_order(users.station_m, users.on_mainline)
    ramp = in_order(users.station_m, ~users.on_mainline)
    for k in range(1, len(mainline)):
        leader[mainline[k]] = mainline[k - 1]
    k = 0
    for i in range(len(ramp)):
        own = ramp[i]
        if i > 0:
            leader[own] = ramp[i - 1]
        while k < len(mainline) and users.station_m[mainline[k]] >= users.station_m[own]:
            k += 1
        front[own] = mainline[k - 1] if k > 0 else NOBODY
        rear[own] = mainline[k] if k < len(mainline) else NOBODY
    return Neighbours(leader, front, rear)


@kernel
def distance_speed_mps(
    gap_m: float, speed_mps: float, leader_mps: float, braking_mps2: float, law: SafetyLaw
) -> float:
    """Returns the largest speed v' (m/s) after the reaction time t that keeps the distance.

    ``(v + v') t / 2 + v'^2 / (2 b) = gap - margin + v_l^2 / (2 b_l)``, with the leader's b_l and an
    own b that is no larger; 0 where none does.
    """
    reaction_s = law.reaction_s
    left_m = gap_m - law.margin_m + leader_mps**2 / (2.0 * law.braking_mps2)
    left_m -= 0.5 * speed_mps * reaction_s
    if left_m <= 0.0:
        return 0.0
    half_s = 0.5 * reaction_s
    root_s = math.sqrt(half_s * half_s + 2.0 * left_m / braking_mps2)
    return float(braking_mps2 * (root_s - half_s))


@kernel
def may_change_lane(
    users: RoadUsers,
    own: int,
    around: Neighbours,
    ahead: Ahead,
    slowest_mps: float,
    laws: OnBoardLaws,
) -> bool:
    """Returns whether a lane change of a vehicle on the acceleration lane keeps all distances.

    Its own to the vehicle in front; that of an automated vehicle behind, which may have to brake at
    a third of b; and, of a driver behind, what he would keep and braking in comfort takes:
    s_0 + T v_Y + (v_Y^2 - v^2) / (2 b), with v = ``slowest_mps``, to which it may slow down before
    it is there.
    """
    if users.on_mainline[own] or users.station_m[own] < READY_M:
        return False
    return may_be_between(users, own, around, ahead, slowest_mps, 0.0, laws)


@kernel
def may_be_between(
    users: RoadUsers,
    own: int,
    around: Neighbours,
    ahead: Ahead,
    slowest_mps: float,
    until_s: float,
    laws: OnBoardLaws,
) -> bool:
    """Returns whether all distances are kept once a vehicle is between those beside it.

    The same as for ``may_change_lane``, wherever the vehicle comes from. It is there ``until_s``
    from now: so long a driver behind goes on as he does, and comes nearer.
    """
    front, rear = around.front[own], around.rear[own]
    if front >= 0 and not _may_be_behind(users, own, front, own, ahead, laws):
        return False
    if rear < 0:
        return True
    if not users.automated[rear]:
        return _leaves_driver_room(users, own, rear, slowest_mps, until_s, laws)
    return _may_be_behind(users, rear, own, own, ahead, laws)


@kernel
def _may_be_behind(
    users: RoadUsers, rear: int, front: int, changes: int, ahead: Ahead, laws: OnBoardLaws
) -> bool:
    """Whether an automated vehicle keeps its distance behind another once one of them ``changes``.

    It follows gently then. One that does not change lanes itself may have to brake before it
    reacts.
    """
    safety = laws.safety
    free_m = users.station_m[front] - users.length_m[front] - users.station_m[rear]
    keeps_mps = _keeps_mps(users, rear, front, ahead, safety)
    spare_mps, touching_m = keeps_mps - ahead.speed_mps[rear], _touching_m(users, rear)
    brakes_mps2 = 0.0 if rear == changes else safety.braking_mps2 / REAR_BRAKES_SHARE
    if free_m < touching_m or spare_mps < -brakes_mps2 * safety.reaction_s:
        return False
    if keeps_mps == 0.0 and free_m - ahead.way_m[rear] < touching_m:
        return False  # it would only come to a stand beyond
    share = max(0.0, users.station_m[changes] / safety.lane_end_m)
    gentle_mps2 = safety.gentle_mps2 + safety.gentle_at_end_mps2 * share * share
    return bool(_follows_mps2(users, rear, front, ahead, laws) >= -gentle_mps2)


@kernel
def _leaves_driver_room(
    users: RoadUsers, own: int, rear: int, slowest_mps: float, until_s: float, laws: OnBoardLaws
) -> bool:
    """Whether a driver behind has what drivers keep, and what braking in comfort takes.

    His own time gap T cannot be seen. He yields until he has that, and no further: so the mean T of
    drivers is enough, and towards the lane's end the shortest. One who moves has s_0 at least,
    however fast the vehicle is that merges.
    """
    safety, gaps = laws.safety, laws.gaps
    rear_mps = users.speed_mps[rear] + max(0.0, users.accel_mps2[rear]) * until_s
    squares = rear_mps**2 - slowest_mps**2
    braking_m = max(squares / (2.0 * safety.driver_mps2), squares / (2.0 * safety.driver_dry_mps2))
    share = max(0.0, users.station_m[own] / safety.lane_end_m)
    relax_m = safety.relax_m + safety.relax_at_end_m * share * share
    shorter_s = (gaps.of_driver_s - gaps.least_of_driver_s) * share * share
    needs_m = gap_m(False, True, rear_mps, gaps) - shorter_s * rear_mps + braking_m - relax_m
    free_m = users.station_m[own] - users.length_m[own] - users.station_m[rear]
    free_m -= max(0.0, rear_mps - slowest_mps) * until_s
    near_m = min(gaps.of_driver_m, _touching_m(users, rear) + gaps.of_driver_s * rear_mps)
    return bool(free_m >= max(near_m, needs_m))


@kernel
def _touching_m(users: RoadUsers, rear: int) -> float:
    """The distance (m) that is too small whatever the speeds ahead."""
    return float(STANDING_M + STANDING_S * users.speed_mps[rear])


@kernel
def _keeps_mps(users: RoadUsers, own: int, front: int, ahead: Ahead, law: SafetyLaw) -> float:
    """The largest speed after the reaction time that keeps the distance to a vehicle in front.

    The way until a command acts is gone by then; the leader brakes from now on.
    """
    free_m = users.station_m[front] - users.length_m[front] - users.station_m[own]
    return distance_speed_mps(
        free_m - ahead.way_m[own],
        ahead.speed_mps[own],
        users.speed_mps[front],
        users.braking_mps2[own],
        law,
    )


@kernel
def _follows_mps2(users: RoadUsers, own: int, front: int, ahead: Ahead, laws: OnBoardLaws) -> float:
    """The linear law behind a vehicle in the same lane, or one that is about to be in it.

    It holds for when a command acts; a share of the leader's acceleration is taken over, and the
    leader is taken to go on with that until then.
    """
    speed_mps, front_mps = ahead.speed_mps[own], users.speed_mps[front]
    law, delay_s = laws.following, ahead.delay_s
    front_mps2 = law.feed_forward * users.accel_mps2[front]
    free_m = users.station_m[front] - users.length_m[front] - users.station_m[own]
    free_m += (front_mps + 0.5 * front_mps2 * delay_s) * delay_s - ahead.way_m[own]
    error_m = free_m - gap_m(True, users.automated[front], speed_mps, laws.gaps)
    faster_mps = max(0.0, front_mps + front_mps2 * delay_s) - speed_mps
    return float(law.gap_gain_ps2 * error_m + law.speed_gain_ps * faster_mps + front_mps2)


@kernel
def _behind_mps2(users: RoadUsers, own: int, front: int, ahead: Ahead, laws: OnBoardLaws) -> float:
    """The largest acceleration (m/s2) behind a vehicle: by the linear law, and never too near."""
    wanted_mps2 = _follows_mps2(users, own, front, ahead, laws)
    keeps_mps = _keeps_mps(users, own, front, ahead, laws.safety)
    safe_mps2 = (keeps_mps - ahead.speed_mps[own]) / laws.safety.reaction_s
    return float(min(max(-users.braking_mps2[own], wanted_mps2), safe_mps2))


@kernel
def driven_mps2(
    users: RoadUsers,
    around: Neighbours,
    ahead: Ahead,
    told_mps2: FloatArray,
    changes: BoolArray,
    laws: OnBoardLaws,
) -> FloatArray:
    """Returns the acceleration (m/s2) of each automated vehicle for one period, 0 of others.

    ``told_mps2`` is the most that it is told to speed up. A vehicle that ``changes`` lanes keeps
    its distance in both lanes, and the one behind it on the mainline does so already.
    """
    accel_mps2 = np.zeros(len(users.number))
    for own in range(len(users.number)):
        if not users.automated[own]:
            continue
        accel = min(told_mps2[own], _alone_mps2(users, own, ahead, laws))
        if around.leader[own] >= 0:
            leader = around.leader[own]
            accel = min(accel, _behind_mps2(users, own, leader, ahead, laws))
        if changes[own] and around.front[own] >= 0:
            front = around.front[own]
            accel = min(accel, _behind_mps2(users, own, front, ahead, laws))
        accel_mps2[own] = accel
    for own in range(len(users.number)):
        rear = around.rear[own]
        if changes[own] and rear >= 0 and users.automated[rear]:
            behind_mps2 = _behind_mps2(users, rear, own, ahead, laws)
            accel_mps2[rear] = min(accel_mps2[rear], behind_mps2)
    for own in range(len(users.number)):
        accel = max(-laws.safety.hardest_mps2, accel_mps2[own])
        stops_mps2 = -ahead.speed_mps[own] / laws.period_s
        accel_mps2[own] = max(stops_mps2, accel) if users.automated[own] else 0.0
    return accel_mps2


@kernel
def driven_and_changes(
    users: RoadUsers,
    around: Neighbours,
    ahead: Ahead,
    told_mps2: FloatArray,
    wishes: BoolArray,
    laws: OnBoardLaws,
) -> tuple[FloatArray, BoolArray]:
    """Returns the accelerations of ``driven_mps2``, and who changes lanes of those who wish to.

    Whether a lane change keeps all distances is asked of the speed to which a vehicle slows down
    if it prepares for one.
    """
    accel_mps2 = driven_mps2(users, around, ahead, told_mps2, wishes, laws)
    changes = np.zeros(len(users.number), np.bool_)
    if not wishes.any():
        return accel_mps2, changes
    for own in range(len(users.number)):
        if wishes[own]:
            slower_mps = users.speed_mps[own] + min(0.0, accel_mps2[own]) * laws.period_s
            slowest_mps = min(slower_mps, ahead.speed_mps[own])
            changes[own] = may_change_lane(users, own, around, ahead, slowest_mps, laws)
    return driven_mps2(users, around, ahead, told_mps2, changes, laws), changes


@kernel
def asks_for_room(users: RoadUsers, front: IntArray) -> BoolArray:
    """Returns which automated vehicles on the ramp ask drivers on the mainline to make room.

    ``front`` is who is before each on the mainline. One that is faster than a driver before it asks
    nobody: SUMO would take it for one that overtakes him, and keep him from speeding up.
    """
    asks = users.automated & ~users.on_mainline
    for own in range(len(asks)):
        ahead = front[own]
        if asks[own] and ahead >= 0 and not users.automated[ahead]:
            asks[own] = users.speed_mps[own] <= users.speed_mps[ahead]
    return asks


@kernel
def _alone_mps2(users: RoadUsers, own: int, ahead: Ahead, laws: OnBoardLaws) -> float:
    """Towards the speed that it wishes, and to a stop before the acceleration lane ends."""
    following, safety, road, period_s = laws.following, laws.safety, laws.road, laws.period_s
    station_m, speed_mps = users.station_m[own] + ahead.way_m[own], ahead.speed_mps[own]
    able_mps2 = min(users.acceleration_mps2[own], users.power_wpkg[own] / max(speed_mps, 0.1))
    if users.on_mainline[own]:
        wish_mps, up_mps2 = users.cruise_mps[own], min(able_mps2, following.speed_up_mps2)
    elif station_m >= 0.0:
        wish_mps, up_mps2 = users.cruise_mps[own], min(able_mps2, following.merge_mps2)
    else:
        wish_mps = min(users.cruise_mps[own], road.ramp_speed_mps)
        up_mps2 = min(able_mps2, following.speed_up_mps2)
    accel = min(up_mps2, max(-CRUISE_BRAKING_MPS2, (wish_mps - speed_mps) / TO_CRUISE_S))
    accel = min(accel, (users.cruise_mps[own] - speed_mps) / period_s)
    if not users.on_mainline[own]:
        left_m = max(0.0, safety.lane_end_m - station_m)
        stops_mps = math.sqrt(2.0 * safety.stop_mps2 * left_m)
        accel = min(accel, (stops_mps - speed_mps) / period_s)
        if station_m < 0.0:
            accel = min(accel, (road.ramp_limit_mps - speed_mps) / period_s)
    return float(accel)
