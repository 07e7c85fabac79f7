"""One merge where vehicles differ: the subject's way, who is before and behind, who makes room.

Vehicles need not reach v0, so their order follows from where they are at the merge, and each may
have to adapt to a slower one ahead of it (``motion.following``).
"""

import math
from typing import NamedTuple

import numpy as np

from coramp._kernel import FloatArray, IntArray, kernel
from coramp.equations.safe_distance import merge_clearance_m
from coramp.kinematics.trajectory import (
    MAX_PIECES,
    SPEED,
    TIME,
    clip_start,
    station_and_speed,
    time_at_station,
)
from coramp.motion.clock import ON_GRID
from coramp.motion.following import Leader, follow_safely, speed_up
from coramp.motion.lane_change import lane_change_s
from coramp.road.rules import Rules
from coramp.strategies.delays import delay_followers
from coramp.strategies.proposals import find_unsafe_pair
from coramp.strategies.situation import ascending_order
from coramp.vehicles.fleet import (
    ROUNDING_M,
    Fleet,
    Proposal,
    committed,
    is_full,
    leaves_lane_s,
    pair_margin_m,
    proposed,
)
from coramp.vehicles.merge_state import has_place_on_mainline
from coramp.vehicles.trace import (
    BEFORE_THE_NOSE,
    CANNOT_FALL_BACK,
    CANNOT_FOLLOW,
    HOLDS_UP_NEWCOMER,
    LEAVES_LANE,
    NO_EASY_WAY,
    TOO_MANY_MOVE,
    note_gap,
    note_merge,
    refuse,
    refuse_as_too_near,
)
from coramp.vehicles.traits import LENGTH, cruise_mps, pair_safety

MOST_AIMS = 3
SLOWER_MPS = 0.1
"""A vehicle ahead that is slower than aimed at by more than this sets the speed of the merge."""


class UnequalMerge(NamedTuple):
    """A merge that was tried. Rows are -1 for none; ``done`` tells whether it can be proposed.

    ``moved`` counts the vehicles that make room, ``lost_s`` is what they lose together.
    """

    done: bool
    accel_mps2: float
    time_s: float
    station_m: float
    speed_mps: float
    front_row: int
    rear_row: int
    moved: int
    lost_s: float


@kernel
def no_unequal_merge() -> UnequalMerge:
    """Returns the outcome of a merge that cannot be."""
    nothing = math.nan
    return UnequalMerge(False, nothing, nothing, nothing, nothing, -1, -1, 0, 0.0)


@kernel
def rows_on_mainline(fleet: Fleet, subject: int, at_s: float) -> IntArray:
    """Returns the rows that are or will be on the mainline, front first, as they are at a time.

    Who has left its lane by then for one further in is not among them.
    """
    rows, behind_m = np.empty(len(fleet.live), np.int64), np.empty(len(fleet.live))
    n = 0
    for row in fleet.live:
        stays = leaves_lane_s(fleet, row) > at_s
        if row != subject and has_place_on_mainline(fleet.merge_time_s[row]) and stays:
            station_m, _ = station_and_speed(committed(fleet, row), at_s)
            rows[n], behind_m[n] = row, -station_m
            n += 1
    return rows[:n][ascending_order(behind_m[:n])]


@kernel
def place_in_order(fleet: Fleet, order: IntArray, station_m: float, at_s: float) -> int:
    """Returns how many of the vehicles in order are ahead of a station at a time."""
    place = 0
    while place < len(order):
        other_m, _ = station_and_speed(committed(fleet, order[place]), at_s)
        if other_m <= station_m:
            break
        place += 1
    return place


@kernel
def _speed_up_and_merge(
    out: FloatArray, n: int, aim_mps: float, accel_mps2: float, traits: FloatArray, rules: Rules
) -> tuple[int, float]:
    """Appends the way up to a speed; returns the length, 0 for none, and when it merges (s).

    That is at the first step at which it has the speed aimed at, and is on the acceleration lane,
    or at the last step before the last merge station, at the speed that it has there.
    """
    step_s, last_m = rules.control.step_s, rules.road.last_merge_station_m
    m = speed_up(out, n, aim_mps, accel_mps2, traits)
    if m == 0:
        return 0, math.nan
    merge_s = lane_change_s(max(out[m - 1, TIME], out[n - 1, TIME] + ON_GRID * step_s), step_s)
    if station_and_speed(out[:m], merge_s)[0] <= 0.0:
        merge_s += step_s
    if station_and_speed(out[:m], merge_s)[0] > last_m + ROUNDING_M:
        merge_s = lane_change_s(time_at_station(out[:m], last_m), step_s) - step_s
    return m, merge_s


@kernel
def try_merge(
    fleet: Fleet,
    proposal: Proposal,
    subject: int,
    approach: FloatArray,
    accel_mps2: float,
    make_room: bool,
    known_m: float,
    rules: Rules,
) -> UnequalMerge:
    """Proposes that the subject comes by ``approach``, speeds up by ``accel_mps2`` and merges.

    It takes the speed of a slower vehicle ahead of it. With ``make_room`` the vehicles behind it
    adapt, each to the one ahead of it. ``known_m`` is the foremost intercept of a vehicle that has
    not entered, minus infinity where that does not matter.
    """
    from_s, traits = approach[0, TIME], fleet.traits[subject]
    base = np.empty((MAX_PIECES, 4))
    m, merge_s, order, place = way_to_merge(fleet, subject, approach, accel_mps2, rules, base)
    if m == 0:
        refuse(proposal.trace, NO_EASY_WAY, -1, math.nan)
        return no_unequal_merge()
    merge_m, merge_mps = station_and_speed(base[:m], merge_s)
    nose = approach[len(approach) - 1]
    note_merge(proposal.trace, math.nan, accel_mps2, merge_s, merge_m, nose[TIME], nose[SPEED])
    front = order[place - 1] if place > 0 else -1
    rear = order[place] if place < len(order) else -1
    note_gap(proposal.trace, front, rear)
    room_m = merge_clearance_m(rules.road, pair_safety(traits, traits, rules.safety))
    rear_m = merge_m - traits[LENGTH] - room_m
    if merge_m <= 0.0:
        refuse(proposal.trace, BEFORE_THE_NOSE, -1, -merge_m)
        return no_unequal_merge()
    held_up_m = known_m - (rear_m - rules.road.mainline_speed_mps * merge_s)
    if held_up_m > 0.0:
        refuse(proposal.trace, HOLDS_UP_NEWCOMER, -1, held_up_m)
        return no_unequal_merge()
    count = m
    proposal.pieces[0, :m] = base[:m]
    if front >= 0:
        count = follow_safely(
            base[:m],
            merge_s,
            merge_s,
            Leader(committed(fleet, front), fleet.traits[front], fleet.merge_time_s[front]),
            traits,
            0.0,
            rules,
            proposal.pieces[0],
        )
        if count == 0:
            refuse(proposal.trace, CANNOT_FOLLOW, front, math.nan)
            return no_unequal_merge()
    proposal.size[0], proposal.rows[0] = 1, subject
    proposal.piece_count[0], proposal.merge_time_s[0] = count, merge_s
    lost_s = give_way(fleet, proposal, order, place, from_s, make_room, rules)
    moved = proposal.size[0] - 1
    if math.isinf(lost_s) or not delay_followers(fleet, proposal, subject, from_s, rules):
        return no_unequal_merge()
    unsafe, _ = find_unsafe_pair(fleet, proposal, from_s, rules)
    if unsafe >= 0:
        return no_unequal_merge()
    return UnequalMerge(True, accel_mps2, merge_s, merge_m, merge_mps, front, rear, moved, lost_s)


@kernel
def way_to_merge(
    fleet: Fleet,
    subject: int,
    approach: FloatArray,
    accel_mps2: float,
    rules: Rules,
    out: FloatArray,
) -> tuple[int, float, IntArray, int]:
    """Writes the subject's way by ``approach`` onto the mainline and up to its own cruise.

    It aims at that speed, or at that of a slower vehicle that will be ahead of it. Returns the
    length, 0 for none, the merge time (s), the rows on the mainline as they are then, and how many
    of them are ahead.
    """
    traits, n = fleet.traits[subject], len(approach)
    cruise = aim_mps = cruise_mps(traits, rules)
    out[:n] = approach
    m, merge_s, place = 0, math.nan, 0
    order = rows_on_mainline(fleet, subject, approach[0, TIME])
    for _ in range(MOST_AIMS):
        m, merge_s = _speed_up_and_merge(out, n, aim_mps, accel_mps2, traits, rules)
        if m == 0:
            return 0, merge_s, order, place
        order = rows_on_mainline(fleet, subject, merge_s)
        merge_m, merge_mps = station_and_speed(out[:m], merge_s)
        place = place_in_order(fleet, order, merge_m, merge_s)
        if place == 0:
            break
        _, front_mps = station_and_speed(committed(fleet, order[place - 1]), merge_s)
        if front_mps >= merge_mps - SLOWER_MPS:
            break
        aim_mps = max(front_mps, approach[n - 1, SPEED])
    m = speed_up(out, m, cruise, rules.motion.speed_up_mps2, traits)
    return m, merge_s, order, place


@kernel
def give_way(
    fleet: Fleet,
    proposal: Proposal,
    order: IntArray,
    place: int,
    from_s: float,
    make_room: bool,
    rules: Rules,
) -> float:
    """Adds the vehicles behind the subject that must adapt, front first; returns their loss (s).

    ``place`` is that of the first one behind it in ``order``. Returns infinity where one of them
    would have to adapt and cannot, or may not.
    """
    v0, lost_s = rules.road.mainline_speed_mps, 0.0
    most_dip_mps = rules.motion.slow_deviation * v0
    before = np.empty((MAX_PIECES, 4))
    ahead = proposal.rows[0]
    for k in range(place, len(order)):
        row, entry = order[k], proposal.size[0] - 1
        n = clip_start(committed(fleet, row), from_s, before)
        margin_m = pair_margin_m(
            before[:n],
            fleet.traits[row],
            fleet.merge_time_s[row],
            proposed(proposal, entry),
            fleet.traits[ahead],
            proposal.merge_time_s[entry],
            from_s,
            rules,
        )
        if margin_m >= rules.safety.execution_allowance_m - ROUNDING_M:
            return lost_s
        if not make_room:
            missing_m = rules.safety.execution_allowance_m - margin_m
            refuse_as_too_near(proposal.trace, -1, row, missing_m)
            return math.inf
        if is_full(proposal) or fleet.change_s[row] < math.inf:
            reason = TOO_MANY_MOVE if is_full(proposal) else LEAVES_LANE
            refuse(proposal.trace, reason, row, math.nan)
            return math.inf
        out = proposal.pieces[entry + 1]
        count = follow_safely(
            before[:n],
            fleet.merge_time_s[row],
            max(from_s, fleet.merge_time_s[row]),
            Leader(proposed(proposal, entry), fleet.traits[ahead], proposal.merge_time_s[entry]),
            fleet.traits[row],
            most_dip_mps,
            rules,
            out,
        )
        if count == 0:
            refuse(proposal.trace, CANNOT_FALL_BACK, row, math.nan)
            return math.inf
        proposal.rows[entry + 1], proposal.piece_count[entry + 1] = row, count
        proposal.merge_time_s[entry + 1] = fleet.merge_time_s[row]
        proposal.size[0] += 1
        end_m = rules.road.mainline_end_m
        lost_s += time_at_station(out[:count], end_m) - time_at_station(before[:n], end_m)
        ahead = row
    return lost_s
