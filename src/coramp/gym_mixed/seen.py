"""What agents of mixed traffic see: what the coordinator has heard of them and those around."""

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from coramp._kernel import FloatArray, IntArray
from coramp.mixed.laws import FollowingLaw, SequenceLaw
from coramp.mixed.sequence import virtual_station
from coramp.mixed.situation import Places
from coramp.mixed.users import MixedRoad, RoadUsers, in_order

EACH_SIDE = 2
"""So many vehicles before the agent's place in the order of passing are seen, and so many after."""
OWN_FEATURES, OTHER_FEATURES = 6, 4
FEATURES = OWN_FEATURES + OTHER_FEATURES * (1 + 2 * EACH_SIDE)
FAR_M, FASTER_MPS, OLD_S, QUEUE_VEH = 100.0, 10.0, 1.0, 10.0
"""What counts as 1 in an observation."""


class Heard(NamedTuple):
    """What the coordinator knows: who is where, how old that is (s), and each one's place."""

    users: RoadUsers
    age_s: FloatArray
    places: Places


class Stretch(NamedTuple):
    """What counts as 1 of a station: the ramp's length before the nose, the lane's behind it."""

    ramp_m: float
    lane_m: float


def agents_among(users: RoadUsers, slots: int, wanted: int | None) -> IntArray:
    """Returns which entries are agents: automated, and not yet on the mainline, front first.

    ``wanted`` is the number of the only one that may be, None for all up to ``slots``.
    """
    chosen = users.automated & ~users.on_mainline
    if wanted is not None:
        chosen &= users.number == wanted
    return in_order(users.station_m, chosen)[:slots]


def features_of(
    heard: Heard, agents: IntArray, slots: int, road: MixedRoad, stretch: Stretch
) -> FloatArray:
    """Returns a row of features an agent, zeros for slots without one, all from -1 to 1."""
    features = np.zeros((slots, FEATURES))
    if len(agents) == 0:
        return features
    users, ramp = heard.users, in_order(heard.users.station_m, ~heard.users.on_mainline)
    lane_mps = {i: lane_speed_mps(users, i, road) for i in ramp.tolist()}
    virtual_m = users.station_m.copy()
    for i in ramp.tolist():
        at_m, speed_mps = float(users.station_m[i]), float(users.speed_mps[i])
        virtual_m[i], _ = virtual_station(at_m, speed_mps, lane_mps[i], FollowingLaw(), road)
    order = order_of(users, ramp, heard.places)
    for row, own in enumerate(agents.tolist()):
        place = ramp.tolist().index(own)
        station_m = float(users.station_m[own])
        features[row, :OWN_FEATURES] = (
            1.0,
            station_m / (stretch.ramp_m if station_m < 0.0 else stretch.lane_m),
            users.speed_mps[own] / road.mainline_speed_mps,
            lane_mps[own] / road.mainline_speed_mps,
            heard.age_s[own] / OLD_S,
            (len(ramp) - 1 - place) / QUEUE_VEH,
        )
        leader = int(ramp[place - 1]) if place > 0 else -1
        others = [_other(heard, users.station_m, own, leader, 1.0)]
        at = order.index(own)
        for step in (*range(-EACH_SIDE, 0), *range(1, EACH_SIDE + 1)):
            other = order[at + step] if 0 <= at + step < len(order) else -1
            others.append(_other(heard, virtual_m, own, other, -math.copysign(1.0, step)))
        features[row, OWN_FEATURES:] = np.concatenate(others)
    return np.clip(features, -1.0, 1.0)


def lane_speed_mps(users: RoadUsers, own: int, road: MixedRoad) -> float:
    """Returns the mean speed of the mainline around a vehicle, v0 where it is empty."""
    law, ahead_m = SequenceLaw(), users.station_m - users.station_m[own]
    near = users.on_mainline & (ahead_m > -law.behind_m) & (ahead_m < law.ahead_m)
    return float(users.speed_mps[near].mean()) if near.any() else road.mainline_speed_mps


def order_of(users: RoadUsers, ramp: IntArray, places: Places) -> list[int]:
    """Returns all entries in the order in which they are to pass, the first first.

    Who has no place yet, or one behind a vehicle that is no longer known, is last.
    """
    order: list[int] = in_order(users.station_m, users.on_mainline).tolist()
    entry = {int(number): i for i, number in enumerate(users.number)}
    behind: Mapping[int, int] = dict(places)
    for own in ramp.tolist():
        leader = behind.get(int(users.number[own]), -2)
        if leader == -1:
            order.insert(0, own)
        elif entry.get(leader, own) in order:
            order.insert(order.index(entry[leader]) + 1, own)
        else:
            order.append(own)
    return order


def _other(
    heard: Heard, station_m: FloatArray, own: int, other: int, side: float
) -> tuple[float, float, float, float]:
    """The free distance to another vehicle, negative behind, its speed beyond the own, kind, age.

    ``side`` is 1 ahead and -1 behind; nobody counts as far away there, and as neither kind.
    """
    if other < 0:
        return side, 0.0, 0.0, 0.0
    users = heard.users
    front, rear = (other, own) if side > 0.0 else (own, other)
    free_m = float(station_m[front] - users.length_m[front] - station_m[rear])
    return (
        side * free_m / FAR_M,
        float(users.speed_mps[other] - users.speed_mps[own]) / FASTER_MPS,
        1.0 if users.automated[other] else -1.0,
        float(heard.age_s[other]) / OLD_S,
    )
