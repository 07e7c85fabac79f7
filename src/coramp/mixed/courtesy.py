"""Room for who is to merge: how far an automated vehicle may speed up behind a virtual leader."""

import math

import numpy as np

from coramp._kernel import FloatArray, IntArray, kernel
from coramp.mixed.laws import CourtesyLaws, FollowingLaw, SequenceLaw
from coramp.mixed.on_board import STANDING_M
from coramp.mixed.sequence import Sequence, sequence_of
from coramp.mixed.users import Gaps, MixedRoad, RoadUsers, gap_for_m, gap_m

STANDS_MPS = 0.1
"""Who is slower than this stands."""


@kernel
def steered_mps2(
    users: RoadUsers, before: IntArray, leaders: IntArray, laws: CourtesyLaws
) -> tuple[FloatArray, IntArray]:
    """Returns the bounds of ``courtesy_mps2`` in the order of ``sequence_of``, and its numbers."""
    order, behind = sequence_of(users, before, laws)
    return courtesy_mps2(users, order, leaders, laws), behind


@kernel
def courtesy_mps2(
    users: RoadUsers,
    order: Sequence,
    leaders: IntArray,
    laws: CourtesyLaws,
) -> FloatArray:
    """Returns the largest acceleration (m/s2) of each vehicle that leaves room, infinity for most.

    Bound are automated vehicles behind one that is yet to merge, and those that are themselves to
    merge behind one on the mainline. ``leaders`` are those in their own lanes.
    """
    following, period_s = laws.following, laws.period_s
    most_mps2 = np.full(len(users.number), math.inf)
    for k in range(1, len(order.place)):
        own, front = order.place[k], order.place[k - 1]
        if not users.automated[own] or front == leaders[own]:
            continue
        if not (order.virtual[k] or order.virtual[k - 1]):
            continue
        if order.virtual[k - 1] and _is_beside(users, own, front, laws.sequence):
            continue
        wanted_mps2 = _wanted_mps2(users, order, k, laws.gaps, following)
        merge_in_s = order.merge_in_s[own if order.virtual[k] else front]
        share = following.early_share if merge_in_s > following.early_s else 1.0
        wanted_mps2 = max(wanted_mps2, -following.courtesy_mps2 * share)
        floor_mps = _floor_mps(users, order, k, laws.sequence, laws.road)
        speed_mps = users.speed_mps[own]
        if wanted_mps2 < 0.0 and speed_mps + wanted_mps2 * period_s < floor_mps:
            wanted_mps2 = min(0.0, max(wanted_mps2, (floor_mps - speed_mps) / period_s))
        most_mps2[own] = wanted_mps2
    return most_mps2


@kernel
def _is_beside(users: RoadUsers, own: int, front: int, law: SequenceLaw) -> bool:
    """Whether one that hardly moves is beside one that stands and is to merge ahead of it.

    It cannot drive backwards: the other can only merge once it has passed.
    """
    stand = users.speed_mps[front] < STANDS_MPS and users.speed_mps[own] < law.urgent_mps
    tail_m = users.station_m[front] - users.length_m[front]
    return bool(stand and tail_m - users.station_m[own] < STANDING_M)


@kernel
def _wanted_mps2(
    users: RoadUsers,
    order: Sequence,
    k: int,
    gaps: Gaps,
    law: FollowingLaw,
) -> float:
    """The linear law behind the vehicle ahead in the order, at virtual stations."""
    own, front = order.place[k], order.place[k - 1]
    tail_m = order.station_m[k - 1] - users.length_m[front]
    if order.virtual[k]:  # at the lane's speed, where it will have merged
        speed_mps = order.lane_mps[own]
        front_mps = speed_mps if order.virtual[k - 1] else users.speed_mps[front]
        own_m = order.station_m[k]
    else:
        speed_mps, own_m = users.speed_mps[own], users.station_m[own]
        front_mps = users.speed_mps[front]
        if users.station_m[front] <= 0.0:
            front_mps = order.lane_mps[front]
    if order.virtual[k - 1]:
        keeps_m = gap_for_m(True, users.automated[front], speed_mps, gaps)
    else:
        keeps_m = gap_m(True, users.automated[front], speed_mps, gaps)
    error_m = tail_m - own_m - keeps_m
    return float(
        law.courtesy_gap_gain_ps2 * error_m + law.courtesy_speed_gain_ps * (front_mps - speed_mps)
    )


@kernel
def _floor_mps(
    users: RoadUsers, order: Sequence, k: int, law: SequenceLaw, road: MixedRoad
) -> float:
    """The speed below which nobody slows for courtesy."""
    own, front = order.place[k], order.place[k - 1]
    if order.virtual[k]:
        return float(law.slowest_ramp_share * min(road.ramp_speed_mps, order.lane_mps[own]))
    station_m, speed_mps = users.station_m[front], users.speed_mps[front]
    slow = station_m > 0.0 and speed_mps < law.slowest_share * road.ramp_speed_mps
    if slow or station_m > law.urgent_m:
        return float(law.urgent_mps)
    return float(law.slowest_share * order.lane_mps[front])
