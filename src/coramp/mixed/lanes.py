"""Several lanes: who is around whom, and whether a lane change further in is safe.

A vehicle of the ramp is beside the mainline's outermost lane, one of a mainline lane beside the
next lane further in. On each lane all keep the same law.
"""

import numpy as np

from coramp._kernel import BoolArray, FloatArray, IntArray, kernel
from coramp.mixed.laws import OnBoardLaws
from coramp.mixed.on_board import Ahead, Neighbours, driven_mps2, may_be_between
from coramp.mixed.users import NOBODY, RoadUsers

RAMP_LANE, OUTERMOST = -1, 0
"""Numbers of lanes: the ramp's with its acceleration lane, and the mainline's next to it."""
ENDLESS_M = 1e6
"""A lane of the mainline does not end: nobody may be nearer there than he keeps."""
HELD_MPS2 = -0.2
"""Who is told to slow down by so much, or more, for a vehicle that merges may make way instead."""
GAIN_MPS2 = 0.2
"""By so much at least it must be able to drive with more in the other lane."""


@kernel
def neighbours_in_lanes(users: RoadUsers, lane: IntArray) -> Neighbours:
    """Returns the leader of each vehicle in its lane, and who is before and behind it further in.

    ``lane`` is each vehicle's: ``RAMP_LANE``, or that of the mainline from the outermost, 0, on.
    """
    count = len(lane)
    leader, front, rear = np.full(count, NOBODY), np.full(count, NOBODY), np.full(count, NOBODY)
    order = np.argsort(-users.station_m, kind="mergesort")
    last = np.full(lane.max() + 3 if count > 0 else 0, NOBODY)
    for own in order:  # front first: who came last on a lane is the next ahead
        leader[own], front[own] = last[lane[own] + 1], last[lane[own] + 2]
        last[lane[own] + 1] = own
    last[:] = NOBODY
    for own in order[::-1]:
        rear[own] = last[lane[own] + 2]
        last[lane[own] + 1] = own
    return Neighbours(leader, front, rear)


def on_endless_lanes(laws: OnBoardLaws) -> OnBoardLaws:
    """Returns the laws for changes between lanes that do not end."""
    return laws._replace(safety=laws.safety._replace(lane_end_m=ENDLESS_M))


def making_way(
    users: RoadUsers,
    around: Neighbours,
    ahead: Ahead,
    held: BoolArray,
    told_mps2: FloatArray,
    inner_mps2: FloatArray,
    laws: OnBoardLaws,
) -> IntArray:
    """Returns which of those ``held`` back change to the lane further in, front first.

    Each is told to slow down for a vehicle that merges (``told_mps2``), and could drive with
    ``inner_mps2`` further in: it must gain by it. The change is safe on both lanes: it stays where
    it is until it is over, and leaves who is before and behind it there what they need. Two do not
    change into one gap at once.
    """
    found: list[int] = []
    taken: set[tuple[int, int]] = set()
    endless = on_endless_lanes(laws)
    wants = held & (told_mps2 <= HELD_MPS2) & (inner_mps2 >= told_mps2 + GAIN_MPS2)
    own_places = np.flatnonzero(wants)
    for own in own_places[np.argsort(-users.station_m[own_places], kind="stable")].tolist():
        gap = int(around.front[own]), int(around.rear[own])
        slowest_mps = min(users.speed_mps[own], ahead.speed_mps[own])
        slowest_mps += min(0.0, float(told_mps2[own])) * laws.period_s
        if gap not in taken and may_be_between(
            users, own, around, ahead, max(0.0, slowest_mps), endless
        ):
            found.append(own)
            taken.add(gap)
    return np.array(found, np.int64)


def inner_accelerations_mps2(
    users: RoadUsers, around: Neighbours, ahead: Ahead, laws: OnBoardLaws
) -> FloatArray:
    """Returns with what each vehicle (m/s2) could drive behind who is ahead of it further in."""
    nobody = np.full(len(users.number), NOBODY)
    there = Neighbours(around.front, nobody, nobody)
    free, none = np.full(len(nobody), np.inf), np.zeros(len(nobody), np.bool_)
    return np.asarray(driven_mps2(users, there, ahead, free, none, on_endless_lanes(laws)))
