"""The rung make way: the vehicle in conflict changes to the next lane further in.

It keeps its own way along the road, so that nobody behind it notices. It leaves as soon as it can
act, and counts on both lanes until it has changed. The subject then takes the gap that it leaves.
"""

import math

import numpy as np

from coramp._kernel import kernel
from coramp.kinematics.trajectory import clip_start, station_and_speed
from coramp.road.lanes import LANE_CHANGE_LASTS_S
from coramp.road.rules import Rules
from coramp.strategies.ladder import plan_about, station_at_decision_m
from coramp.strategies.proposals import largest_safe_distance_m
from coramp.strategies.rungs import Merge, merge_at, no_merge, reach_as, refuse_gap
from coramp.strategies.situation import RUNG_MAKE_WAY, MergePlan, Situation, gap_bounds_m
from coramp.vehicles.fleet import (
    ROUNDING_M,
    Fleet,
    Proposal,
    committed,
    in_lane,
    pair_margin_m,
    with_change,
)
from coramp.vehicles.merge_state import BY_MAINLINE_S, is_on_mainline
from coramp.vehicles.trace import (
    CHANGE_TOO_LATE,
    HOLDS_UP_FURTHER_IN,
    LEAVES_LANE,
    NOT_ON_MAINLINE,
    note_moved,
    open_in_gap,
    refuse,
    refuse_as_too_near,
)


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
    open_in_gap(proposal.trace, RUNG_MAKE_WAY, 0, rest.order, gap)
    in_time = can_leave_in_time(fleet, proposal, row, situation.from_s, situation.nose_s)
    if not in_time or not has_room_further_in(
        fleet, proposal, row, situation.from_s, situation.known_m, situation.clearance_m, rules
    ):
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
        propose_change(fleet, proposal, row, situation.from_s)
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
def can_leave_in_time(
    fleet: Fleet, proposal: Proposal, row: int, from_s: float, nose_s: float
) -> bool:
    """Returns whether a vehicle is free to change lanes at once, and then gone in time."""
    if fleet.change_s[row] < math.inf:
        refuse(proposal.trace, LEAVES_LANE, row, math.nan)
        return False
    if not is_on_mainline(fleet.merge_time_s[row], from_s):
        refuse(proposal.trace, NOT_ON_MAINLINE, row, math.nan)
        return False
    if from_s + LANE_CHANGE_LASTS_S > nose_s:
        refuse(proposal.trace, CHANGE_TOO_LATE, row, math.nan)
        return False
    return True


@kernel
def has_room_further_in(
    fleet: Fleet,
    proposal: Proposal,
    row: int,
    from_s: float,
    known_m: float,
    clearance_m: float,
    rules: Rules,
) -> bool:
    """Returns whether a vehicle keeps its distance on the next lane from ``from_s`` on, for ever.

    Nor may it hold up a vehicle that is yet to enter there, whose foremost intercept is
    ``known_m``: to that it leaves ``clearance_m``; one slower than v0, when it changes lanes.
    """
    far_m = largest_safe_distance_m(rules)
    lowest_m, highest_m = fleet.intercepts_m[row]
    rear_m = lowest_m
    if math.isinf(rear_m):
        rear_m = station_and_speed(committed(fleet, row), from_s)[0]
        rear_m -= rules.road.mainline_speed_mps * from_s
    missing_m = known_m - (rear_m - fleet.length_m[row] - clearance_m)
    if missing_m > 0.0:
        refuse(proposal.trace, HOLDS_UP_FURTHER_IN, row, missing_m)
        return False
    for other in in_lane(fleet, fleet.lane[row] + 1).live:
        ahead_m = fleet.intercepts_m[other, 0] - fleet.length_m[other] - highest_m
        behind_m = lowest_m - fleet.length_m[row] - fleet.intercepts_m[other, 1]
        if max(ahead_m, behind_m) > far_m:
            continue
        margin_m = pair_margin_m(
            committed(fleet, row),
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
def propose_change(fleet: Fleet, proposal: Proposal, row: int, from_s: float) -> None:
    """Adds a vehicle that changes lanes from ``from_s`` on, and drives on as committed."""
    entry = proposal.size[0]
    proposal.rows[entry] = row
    proposal.piece_count[entry] = clip_start(committed(fleet, row), from_s, proposal.pieces[entry])
    proposal.merge_time_s[entry] = fleet.merge_time_s[row]
    proposal.lane_change_s[entry] = from_s
    proposal.size[0] = entry + 1
    note_moved(proposal.trace, row)
