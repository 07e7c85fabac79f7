"""The rung make way: the vehicle in conflict changes to the next lane further in.

It keeps its own way along the road, or goes back to its cruise at once. It leaves as soon as it can
act, and counts on both lanes until it has changed. The subject then takes the gap that it leaves.
"""

import math
from typing import NamedTuple

import numpy as np

from coramp._kernel import FloatArray, kernel
from coramp.kinematics.trajectory import (
    MAX_PIECES,
    STATION,
    TIME,
    begin,
    clip_start,
    drive_to_speed,
    intercept_range_m,
    station_and_speed,
)
from coramp.motion.following import speed_up
from coramp.road.lanes import LANE_CHANGE_LASTS_S
from coramp.road.rules import Rules
from coramp.strategies.ladder import plan_about, station_at_decision_m
from coramp.strategies.proposals import largest_safe_distance_m
from coramp.strategies.rungs import Merge, merge_at, no_merge, reach_as, refuse_gap
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
    HOLDS_UP_FURTHER_IN,
    LEAVES_LANE,
    NOT_ON_MAINLINE,
    note_moved,
    open_attempt,
    refuse,
    refuse_as_too_near,
)
from coramp.vehicles.traits import BRAKING, cruise_mps, pair_safety


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
    n = way_further_in(fleet, proposal, asked, rules, way)
    if n == 0:
        return no_merge()
    leaving = with_change(fleet, row, situation.from_s)
    if free_alone:
        low_m, high_m = gap_bounds_m(fleet, rest, gap)
        if not low_m <= rest.free_m <= high_m:
            refuse_gap(fleet, proposal, rest, gap)
            return no_merge()
        merge = merge_at(leaving, proposal, rest, gap, rest.free_m, False, rules)
    else:
        merge = reach_as(leaving, proposal, rest, gap, RUNG_MAKE_WAY, rules)
    if merge.gap >= 0:
        propose_change(fleet, proposal, row, way[:n])
    return merge


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
) -> int:
    """Writes what a vehicle drives from when it changes lanes; returns 0 where it cannot.

    That is what it has committed to, which nobody behind it notices. Where that is too slow or too
    fast for the next lane, it goes back to its own cruise at once.
    """
    open_attempt(proposal.trace, RUNG_MAKE_WAY, 0, asked.front_row, asked.rear_row)
    if not _can_leave_in_time(fleet, proposal, asked):
        return 0
    n = clip_start(committed(fleet, asked.row), asked.from_s, out)
    if has_room_further_in(fleet, proposal, asked, out[:n], rules):
        return n
    if n == 1:
        return 0
    open_attempt(proposal.trace, RUNG_MAKE_WAY, 0, asked.front_row, asked.rear_row)
    n = _back_to_cruise(fleet, asked, rules, out)
    if n == 0 or not has_room_further_in(fleet, proposal, asked, out[:n], rules):
        return 0
    return n if _stays_clear_until_gone(fleet, proposal, asked, out[:n], rules) else 0


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
    fleet: Fleet, proposal: Proposal, asked: Asked, way: FloatArray, rules: Rules
) -> bool:
    """Returns whether a vehicle keeps its distance on the next lane from its change on, for ever.

    Nor may it hold up a vehicle that is yet to enter there, whose foremost intercept is
    ``known_m``: to that it leaves ``clearance_m``; one slower than v0, when it changes lanes.
    """
    row, from_s, v0 = asked.row, asked.from_s, rules.road.mainline_speed_mps
    far_m = largest_safe_distance_m(rules)
    lowest_m, highest_m = intercept_range_m(way, from_s, v0)
    rear_m = lowest_m
    if math.isinf(rear_m):
        rear_m = way[0, STATION] - v0 * from_s
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
            from_s,
            rules,
        )
        missing_m = rules.safety.execution_allowance_m - margin_m
        if missing_m > ROUNDING_M:
            refuse_as_too_near(proposal.trace, row, other, missing_m)
            return False
    return True


@kernel
def _stays_clear_until_gone(
    fleet: Fleet, proposal: Proposal, asked: Asked, way: FloatArray, rules: Rules
) -> bool:
    """Returns whether a vehicle keeps its distance on the lane that it leaves until it has."""
    row = asked.row
    gone_s = asked.from_s + LANE_CHANGE_LASTS_S
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
def propose_change(fleet: Fleet, proposal: Proposal, row: int, way: FloatArray) -> None:
    """Adds a vehicle that changes lanes as its way begins."""
    entry = proposal.size[0]
    proposal.rows[entry], proposal.piece_count[entry] = row, len(way)
    proposal.pieces[entry, : len(way)] = way
    proposal.merge_time_s[entry] = fleet.merge_time_s[row]
    proposal.lane_change_s[entry] = way[0, TIME]
    proposal.size[0] = entry + 1
    note_moved(proposal.trace, row)
