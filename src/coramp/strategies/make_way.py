"""The rung make way: the vehicle in conflict changes to the next lane further in.

It counts on both lanes until it has changed, before the subject reaches the nose, and the subject
takes the gap that it leaves. If it can, it keeps its own way along the road and leaves as soon as
it can act. Else it goes back to its cruise, or moves to a gap further in before it changes.
"""

import math
from typing import NamedTuple

import numpy as np

from coramp._kernel import FloatArray, kernel
from coramp.kinematics.trajectory import (
    MAX_PIECES,
    begin,
    clip_start,
    drive_to_speed,
    intercept_range_m,
    largest_acceleration_mps2,
    speed_range_mps,
    station_and_speed,
    superpose_shift,
)
from coramp.motion.following import speed_up
from coramp.road.lanes import LANE_CHANGE_LASTS_S
from coramp.road.rules import Rules
from coramp.strategies.ladder import plan_about, station_at_decision_m
from coramp.strategies.proposals import largest_safe_distance_m
from coramp.strategies.rungs import Merge, merge_at, no_merge, reach_as
from coramp.strategies.situation import RUNG_MAKE_WAY, MergePlan, Situation, gap_bounds_m
from coramp.vehicles.fleet import (
    ROUNDING_M,
    Fleet,
    PairSafety,
    Proposal,
    committed,
    in_lane,
    leaves_lane_s,
    merge_margin_m,
    ordered_margin_m,
    pair_margin_m,
    with_change,
)
from coramp.vehicles.merge_state import BY_MAINLINE_S, is_on_mainline
from coramp.vehicles.trace import (
    CHANGE_TOO_LATE,
    CHOSEN,
    GAP_TOO_SMALL,
    HOLDS_UP_FURTHER_IN,
    LEAVES_LANE,
    NO_GAP_FURTHER_IN,
    NOT_ON_MAINLINE,
    SHIFT_TOO_FAR,
    accept,
    note_moved,
    open_attempt,
    refuse,
    refuse_as_too_near,
)
from coramp.vehicles.traits import BRAKING, cruise_mps, pair_safety

LEAST_WINDOW_S = 2.0
"""Nobody moves to a gap further in who has less time for it."""
SHIFTS_M = (4.0, -4.0, 8.0, -8.0, 12.0, -12.0, 16.0, -16.0, 20.0, -20.0, 25.0, -25.0, 30.0, -30.0)
"""By how much a vehicle moves to a gap further in (positive: ahead), the least first."""


class Asked(NamedTuple):
    """Who is asked to change lanes, -1 or a row before and behind it, from when on, until when.

    That is when the subject reaches the nose. ``known_m`` bounds the intercepts of those that are
    yet to enter further in, and ``clearance_m`` is what is left to them.
    """

    row: int
    front_row: int
    rear_row: int
    from_s: float
    nose_s: float
    known_m: float
    clearance_m: float


@kernel
def make_way(
    fleet: Fleet,
    proposal: Proposal,
    situation: Situation,
    conflict: int,
    free_alone: bool,
    rules: Rules,
) -> Merge:
    """Rung make way: ``order[conflict]`` changes lanes, and the subject takes the gap it leaves.

    With ``free_alone`` the subject keeps its free movement, else it reaches the gap as in the rung
    reach. The result's ``gap`` is one of ``without``.
    """
    row, gap = situation.order[conflict], conflict
    rest = without(situation, conflict)
    front = rest.order[gap - 1] if gap > 0 else -1
    rear = rest.order[gap] if gap < len(rest.order) else -1
    asked = Asked(
        row, front, rear, situation.from_s, situation.nose_s, situation.known_m, rest.clearance_m
    )
    way = np.empty((MAX_PIECES, 4))
    n, change_s, shift_m = way_further_in(fleet, proposal, asked, rules, way)
    if n == 0:
        return no_merge()
    leaving = with_change(fleet, row, change_s)
    if free_alone:
        low_m, high_m = gap_bounds_m(fleet, rest, gap)
        missing_m = max(low_m - rest.free_m, rest.free_m - high_m)
        if missing_m > 0.0:
            refuse(proposal.trace, GAP_TOO_SMALL, -1, missing_m)
            return no_merge()
        merge = merge_at(leaving, proposal, rest, gap, rest.free_m, False, rules)
    else:
        merge = reach_as(leaving, proposal, rest, gap, RUNG_MAKE_WAY, rules)
    if merge.gap < 0:
        return merge
    propose_change(fleet, proposal, row, way[:n], change_s)
    return Merge(gap, merge.accel_mps2, merge.merge_time_s, merge.merge_station_m, abs(shift_m))


@kernel
def without(situation: Situation, place: int) -> Situation:
    """Returns the situation without the vehicle at a place of the lane order."""
    order, intercepts_m = situation.order, situation.intercepts_m
    return Situation(
        situation.subject,
        situation.from_s,
        situation.approach,
        situation.nose_s,
        situation.nose_speed_mps,
        situation.free_accel_mps2,
        situation.lowest_m,
        situation.highest_m,
        situation.free_m,
        situation.known_m,
        situation.clearance_m,
        np.concatenate((order[:place], order[place + 1 :])),
        np.concatenate((intercepts_m[:place], intercepts_m[place + 1 :])),
    )


@kernel
def plan_of_way(
    fleet: Fleet,
    proposal: Proposal,
    situation: Situation,
    merge: Merge,
    conflict: int,
    rules: Rules,
) -> MergePlan:
    """Returns the plan that a merge of ``make_way`` amounts to."""
    return plan_about(
        fleet,
        proposal,
        without(situation, conflict),
        merge,
        RUNG_MAKE_WAY,
        0,
        situation.order[conflict],
        station_at_decision_m(situation, conflict, rules),
        rules,
    )


@kernel
def way_further_in(
    fleet: Fleet, proposal: Proposal, asked: Asked, rules: Rules, out: FloatArray
) -> tuple[int, float, float]:
    """Writes what a vehicle drives that changes lanes; its length is 0 where it cannot.

    With it come when it begins to change (s), and by how much it moves for that (m, positive
    ahead). It drives as it has committed to, which nobody behind it notices; where that is too slow
    or too fast for the next lane, it goes back to its own cruise at once. Where there is no gap
    beside it, it moves to one first, and changes as late as it can.
    """
    from_s, nothing = asked.from_s, (0, math.nan, 0.0)
    _open(proposal, asked)
    if not _can_leave_in_time(fleet, proposal, asked):
        return nothing
    n = clip_start(committed(fleet, asked.row), from_s, out)
    if has_room_further_in(fleet, proposal, asked, out[:n], from_s, rules):
        return n, from_s, 0.0
    if n > 1:
        _open(proposal, asked)
        n = _back_to_cruise(fleet, asked, rules, out)
        if n > 0 and _fits(fleet, proposal, asked, out[:n], from_s, rules):
            return n, from_s, 0.0
    change_s = asked.nose_s - LANE_CHANGE_LASTS_S
    if rules.traffic.differs or change_s < from_s + LEAST_WINDOW_S:
        return nothing
    _open(proposal, asked)
    for shift_m in SHIFTS_M:
        n = _moved(fleet, proposal, asked, change_s, shift_m, rules, out)
        if n > 0 and _fits(fleet, proposal, asked, out[:n], change_s, rules):
            accept(proposal.trace)
            return n, change_s, shift_m
    refuse(proposal.trace, NO_GAP_FURTHER_IN, asked.row, math.nan)
    return nothing


@kernel
def _open(proposal: Proposal, asked: Asked) -> None:
    open_attempt(proposal.trace, RUNG_MAKE_WAY, 0, asked.front_row, asked.rear_row)


@kernel
def _fits(
    fleet: Fleet, proposal: Proposal, asked: Asked, way: FloatArray, change_s: float, rules: Rules
) -> bool:
    """Returns whether a vehicle that leaves what it has committed to keeps all its distances."""
    room = has_room_further_in(fleet, proposal, asked, way, change_s, rules)
    return room and _stays_clear_until_gone(fleet, proposal, asked, way, change_s, rules)


@kernel
def _moved(
    fleet: Fleet,
    proposal: Proposal,
    asked: Asked,
    change_s: float,
    shift_m: float,
    rules: Rules,
    out: FloatArray,
) -> int:
    """Writes how a vehicle moves by ``shift_m`` until it changes lanes; 0 where it cannot.

    By the speed triangle and within the bounds of rung create.
    """
    before, motion, v0 = committed(fleet, asked.row), rules.motion, rules.road.mainline_speed_mps
    n = superpose_shift(before, asked.from_s, asked.from_s, change_s, shift_m, out)
    if n == 0:
        return 0
    lowest, highest = speed_range_mps(out[:n], asked.from_s)
    too_fast = highest > (1.0 + motion.speed_deviation) * v0
    too_slow = lowest < (1.0 - motion.slow_deviation) * v0
    too_hard = largest_acceleration_mps2(out[:n], asked.from_s) > motion.comfort_mps2
    if too_fast or too_slow or too_hard:
        refuse(proposal.trace, SHIFT_TOO_FAR, asked.row, math.nan)
        return 0
    return n


@kernel
def _can_leave_in_time(fleet: Fleet, proposal: Proposal, asked: Asked) -> bool:
    """Returns whether a vehicle is free to change lanes at once, and then gone in time."""
    row, reason = asked.row, CHOSEN
    if fleet.change_s[row] < math.inf:
        reason = LEAVES_LANE
    elif not is_on_mainline(fleet.merge_time_s[row], asked.from_s):
        reason = NOT_ON_MAINLINE
    elif asked.from_s + LANE_CHANGE_LASTS_S > asked.nose_s:
        reason = CHANGE_TOO_LATE
    if reason != CHOSEN:
        refuse(proposal.trace, reason, row, math.nan)
    return reason == CHOSEN


@kernel
def _back_to_cruise(fleet: Fleet, asked: Asked, rules: Rules, out: FloatArray) -> int:
    """Writes how a vehicle goes back to its own cruise at once; returns the number of pieces."""
    traits = fleet.traits[asked.row]
    cruise = cruise_mps(traits, rules)
    station_m, speed_mps = station_and_speed(committed(fleet, asked.row), asked.from_s)
    n = begin(out, asked.from_s, station_m, speed_mps)
    if speed_mps > cruise:
        return drive_to_speed(out, n, -min(rules.motion.slow_down_mps2, traits[BRAKING]), cruise)
    return speed_up(out, n, cruise, rules.motion.speed_up_mps2, traits)


@kernel
def has_room_further_in(
    fleet: Fleet, proposal: Proposal, asked: Asked, way: FloatArray, change_s: float, rules: Rules
) -> bool:
    """Returns whether a vehicle keeps its distance on the next lane from its change on, for ever.

    Nor may it hold up a vehicle that is yet to enter there, whose foremost intercept is
    ``known_m``: to that it leaves ``clearance_m``; one slower than v0, when it changes lanes.
    """
    row, v0 = asked.row, rules.road.mainline_speed_mps
    far_m = largest_safe_distance_m(rules)
    lowest_m, highest_m = intercept_range_m(way, change_s, v0)
    rear_m = lowest_m
    if math.isinf(rear_m):
        rear_m = station_and_speed(way, change_s)[0] - v0 * change_s
    held_up_m = asked.known_m - (rear_m - fleet.length_m[row] - asked.clearance_m)
    if held_up_m > 0.0:
        refuse(proposal.trace, HOLDS_UP_FURTHER_IN, row, held_up_m)
        return False
    for other in in_lane(fleet, fleet.lane[row] + 1).live:
        ahead_m = fleet.intercepts_m[other, 0] - fleet.length_m[other] - highest_m
        behind_m = lowest_m - fleet.length_m[row] - fleet.intercepts_m[other, 1]
        if max(ahead_m, behind_m) > far_m:
            continue
        margin_m = pair_margin_m(
            way,
            fleet.traits[row],
            BY_MAINLINE_S,
            committed(fleet, other),
            fleet.traits[other],
            BY_MAINLINE_S,
            change_s,
            rules,
        )
        missing_m = rules.safety.execution_allowance_m - margin_m
        if missing_m > ROUNDING_M:
            refuse_as_too_near(proposal.trace, row, other, missing_m)
            return False
    return True


@kernel
def _stays_clear_until_gone(
    fleet: Fleet, proposal: Proposal, asked: Asked, way: FloatArray, change_s: float, rules: Rules
) -> bool:
    """Returns whether a vehicle keeps its distance on the lane that it leaves until it has."""
    row = asked.row
    gone_s = change_s + LANE_CHANGE_LASTS_S
    for other in fleet.live:
        merge_s = fleet.merge_time_s[other]
        start_s, end_s = max(asked.from_s, merge_s), min(gone_s, leaves_lane_s(fleet, other))
        if other == row or not start_s < end_s:
            continue
        theirs, own_m, other_m = committed(fleet, other), fleet.length_m[row], fleet.length_m[other]
        safety = PairSafety(
            pair_safety(fleet.traits[row], fleet.traits[other], rules.safety),
            pair_safety(fleet.traits[other], fleet.traits[row], rules.safety),
        )
        margin_m = ordered_margin_m(way, own_m, theirs, other_m, start_s, end_s, rules.road, safety)
        if merge_s >= asked.from_s:
            at_merge_m = merge_margin_m(
                theirs, other_m, way, own_m, merge_s, rules.road, safety.one_leads
            )
            margin_m = min(margin_m, at_merge_m)
        missing_m = rules.safety.execution_allowance_m - margin_m
        if missing_m > ROUNDING_M:
            refuse_as_too_near(proposal.trace, row, other, missing_m)
            return False
    return True


@kernel
def propose_change(
    fleet: Fleet, proposal: Proposal, row: int, way: FloatArray, change_s: float
) -> None:
    """Adds a vehicle that begins to change lanes then (s)."""
    entry = proposal.size[0]
    proposal.rows[entry], proposal.piece_count[entry] = row, len(way)
    proposal.pieces[entry, : len(way)] = way
    proposal.merge_time_s[entry] = fleet.merge_time_s[row]
    proposal.lane_change_s[entry] = change_s
    proposal.size[0] = entry + 1
    note_moved(proposal.trace, row)
