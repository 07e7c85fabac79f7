"""Several lanes: who is around whom, and whether a lane change further in is safe.

A vehicle of the ramp is beside the mainline's outermost lane, one of a mainline lane beside the
next lane further in. On each lane all keep the same law.
"""

from typing import NamedTuple

import numpy as np

from coramp._kernel import BoolArray, FloatArray, IntArray, kernel
from coramp.mixed.laws import OnBoardLaws
from coramp.mixed.on_board import (
    Ahead,
    Neighbours,
    asks_for_room,
    driven_and_changes,
    driven_mps2,
    may_be_between,
)
from coramp.mixed.users import NOBODY, RoadUsers

RAMP_LANE, OUTERMOST = -1, 0
"""Numbers of lanes: the ramp's with its acceleration lane, and the mainline's next to it."""
ENDLESS_M = 1e6
"""A lane of the mainline does not end: nobody may be nearer there than he keeps."""
HELD_MPS2 = -0.2
"""Who is told to slow down by so much, or more, for a vehicle that merges may make way instead."""
GAIN_MPS2 = 0.2
"""By so much at least it must be able to drive with more in the other lane."""


class Lanes(NamedTuple):
    """The lane of each vehicle, and whether it can change to the next one further in.

    ``number`` is ``RAMP_LANE``, or that of the mainline from the outermost, 0, on. ``tail`` is
    whose rear is still before the nose, on the ramp, though the vehicle has changed lanes.
    """

    number: IntArray
    beside: BoolArray
    tail: BoolArray


@kernel
def neighbours_in_lanes(users: RoadUsers, lanes: Lanes) -> Neighbours:
    """Returns the leader of each vehicle in its lane, and who is before and behind it further in.

    Who has changed lanes at the nose, with its rear on the ramp, leads who comes along the ramp.
    """
    lane, count = lanes.number, len(lanes.number)
    leader, front, rear = np.full(count, NOBODY), np.full(count, NOBODY), np.full(count, NOBODY)
    order = np.argsort(-users.station_m, kind="mergesort")
    last = np.full(lane.max() + 3 if count > 0 else 0, NOBODY)
    for own in order:  # front first: who came last on a lane is the next ahead
        leader[own], front[own] = last[lane[own] + 1], last[lane[own] + 2]
        last[lane[own] + 1] = own
        if lanes.tail[own]:
            last[RAMP_LANE + 1] = own
    last[:] = NOBODY
    for own in order[::-1]:
        rear[own] = last[lane[own] + 2]
        last[lane[own] + 1] = own
    return Neighbours(leader, front, rear)


def on_endless_lanes(laws: OnBoardLaws) -> OnBoardLaws:
    """Returns the laws for changes between lanes that do not end."""
    return laws._replace(safety=laws.safety._replace(lane_end_m=ENDLESS_M))


@kernel
def decided_in_lanes(
    users: RoadUsers,
    lanes: Lanes,
    ahead: Ahead,
    told_mps2: FloatArray,
    wishes: BoolArray,
    laws: OnBoardLaws,
    endless: OnBoardLaws,
) -> tuple[FloatArray, FloatArray, BoolArray, BoolArray]:
    """Returns what each vehicle obeys, its acceleration (m/s2), who changes lanes, and who asks.

    ``told_mps2`` is the most that each is told to speed up, ``wishes`` who on the acceleration lane
    wishes to merge; ``endless`` are the laws ``on_endless_lanes``. Who makes way obeys nothing any
    more, since what it was told is for the lane that it leaves. Who asks is as in
    ``asks_for_room``.
    """
    around = neighbours_in_lanes(users, lanes)
    changes = driven_and_changes(users, around, ahead, told_mps2, wishes, laws)[1]
    held = users.automated & (lanes.number == OUTERMOST) & lanes.beside
    held &= users.station_m < laws.safety.lane_end_m
    for own in range(len(changes)):
        if changes[own] and around.rear[own] >= 0:
            held[around.rear[own]] = False  # one thing at a time: its new leader comes in now
    obeys_mps2 = told_mps2.copy()
    for own in making_way(users, around, ahead, held, told_mps2, endless):
        changes[own], obeys_mps2[own] = True, np.inf
    accel_mps2 = driven_mps2(users, around, ahead, obeys_mps2, changes, laws)
    return obeys_mps2, accel_mps2, changes, asks_for_room(users, around.front)


@kernel
def making_way(
    users: RoadUsers,
    around: Neighbours,
    ahead: Ahead,
    held: BoolArray,
    told_mps2: FloatArray,
    endless: OnBoardLaws,
) -> IntArray:
    """Returns which of those ``held`` back change to the lane further in, front first.

    Each is told to slow down for a vehicle that merges (``told_mps2``), and gains by what it can
    drive with further in. The change is safe on both lanes: it stays where it is until it is over,
    keeps its distance in both, and leaves who is before and behind it there what they need, however
    much it slows down meanwhile. Two do not change into one gap at once.
    """
    count = len(users.number)
    wants = held & (told_mps2 <= HELD_MPS2)
    found, places = np.empty(count, np.int64), 0
    if not wants.any():
        return found[:0]
    inner_mps2 = inner_accelerations_mps2(users, around, ahead, endless)
    both_mps2 = driven_mps2(users, around, ahead, told_mps2, wants, endless)
    taken = np.zeros(count + 1, np.bool_)  # a gap is known by who is before it
    for own in np.argsort(-users.station_m, kind="mergesort"):
        gap = around.front[own] + 1
        if not wants[own] or taken[gap] or inner_mps2[own] < told_mps2[own] + GAIN_MPS2:
            continue
        slowest_mps = min(users.speed_mps[own], ahead.speed_mps[own])
        slowest_mps = max(0.0, slowest_mps + min(0.0, both_mps2[own]) * endless.period_s)
        if may_be_between(users, own, around, ahead, slowest_mps, endless.period_s, endless):
            found[places] = own
            places += 1
            taken[gap] = True
    return found[:places]


@kernel
def inner_accelerations_mps2(
    users: RoadUsers, around: Neighbours, ahead: Ahead, endless: OnBoardLaws
) -> FloatArray:
    """Returns with what each vehicle (m/s2) could drive behind who is ahead of it further in."""
    count = len(users.number)
    nobody, free = np.full(count, NOBODY), np.full(count, np.inf)
    there = Neighbours(around.front, nobody, nobody)
    return driven_mps2(users, there, ahead, free, np.zeros(count, np.bool_), endless)
