"""Slots that somebody else asks for: what a ramp vehicle sees of the lane, and the way to a slot.

A slot is a crossing time c, as in ``slots``: a vehicle that cruises at v0 on intercept ``-v0 c``.
"""

import math

import numpy as np

from coramp._kernel import FloatArray, kernel
from coramp.road.rules import unpacked
from coramp.strategies.situation import assess, bounds_between_m
from coramp.strategies.slot_onto_lane import ROOM, Place, merge_in_slot
from coramp.vehicles.fleet import Fleet, Proposal, empty_proposal

TRIED_EVERY_S = 0.1
"""How far apart the slots are that are tried."""


@kernel
def crossings_around(
    fleet: Fleet, row: int, now_s: float, each_side: int, packed_rules: FloatArray
) -> tuple[float, FloatArray]:
    """Returns when (s) a ramp vehicle crosses in free movement, and who crosses around that.

    The latter are the crossing times (s) of so many vehicles with a place on the mainline that
    cross before it, the latest of them first, and of as many that cross after it, the earliest
    first; then that of the last of all. Where there is none the time is minus infinity before,
    and for the last of all, and infinity after it.
    """
    rules = unpacked(packed_rules)
    v0 = rules.road.mainline_speed_mps
    situation = assess(fleet, row, now_s, 0.0, rules)
    intercepts_m = situation.intercepts_m
    first_behind = 0
    while first_behind < len(intercepts_m) and intercepts_m[first_behind] >= situation.free_m:
        first_behind += 1
    around_s = np.empty(2 * each_side + 1)
    around_s[:each_side], around_s[each_side:] = -math.inf, math.inf
    around_s[2 * each_side] = -intercepts_m[-1] / v0 if len(intercepts_m) else -math.inf
    for k in range(each_side):
        if first_behind - 1 - k >= 0:
            around_s[k] = -intercepts_m[first_behind - 1 - k] / v0
        if first_behind + k < len(intercepts_m):
            around_s[each_side + k] = -intercepts_m[first_behind + k] / v0
    return -situation.free_m / v0, around_s


@kernel
def plan_into_slot(
    fleet: Fleet,
    row: int,
    now_s: float,
    shift_s: float,
    tolerance_s: float,
    packed_rules: FloatArray,
) -> Proposal:
    """Returns a ramp vehicle's way into a slot ``shift_s`` after that of its free movement.

    It is the first that is safe of those up to ``tolerance_s`` later, ``TRIED_EVERY_S`` apart.
    Nobody on the mainline moves for it; those behind it on the ramp brake where they must. The
    proposal is empty where none is safe.
    """
    rules = unpacked(packed_rules)
    proposal = empty_proposal(ROOM)
    situation = assess(fleet, row, now_s, 0.0, rules)
    order, intercepts_m = situation.order, situation.intercepts_m
    own_m, clearance_m = fleet.length_m[row] + situation.clearance_m, situation.clearance_m
    for k in range(int(tolerance_s / TRIED_EVERY_S + 1e-9) + 1):
        slot_m = situation.free_m - rules.road.mainline_speed_mps * (shift_s + k * TRIED_EVERY_S)
        gap = 0
        while gap < len(order) and intercepts_m[gap] >= slot_m:
            gap += 1
        low_m, high_m = bounds_between_m(
            order, intercepts_m, fleet.length_m, gap, -math.inf, own_m, clearance_m
        )
        if not low_m <= slot_m <= high_m:
            continue
        place = Place(gap, slot_m, len(order), 0.0)
        if merge_in_slot(fleet, proposal, situation, place, rules).gap >= 0:
            return proposal
    proposal.size[0] = 0
    return proposal
