"""What the planning strategies share: from a rung's merge to a plan, from a plan to a decision."""

import math
from collections.abc import Callable

from coramp._kernel import FloatArray, kernel
from coramp.equations.conflict_risk import conflict_severity_m2ps4
from coramp.equations.safe_distance import merging_speed_along_mps
from coramp.kinematics.trajectory import station_and_speed
from coramp.road.rules import Rules
from coramp.strategies.attempts import tried_of
from coramp.strategies.base import Decision, Explanation, FollowTrajectory, Memory, View
from coramp.strategies.rungs import Merge
from coramp.strategies.situation import (
    RUNG_HOLD,
    RUNG_MAKE_WAY,
    RUNGS,
    MergePlan,
    Situation,
    gap_size_m,
)
from coramp.vehicles.fleet import Fleet, Proposal, committed, trajectory_under
from coramp.vehicles.trace import LEADER_WAITS, note_choice, note_subject, refuse

Planner = Callable[[Fleet, int, float, float, FloatArray], tuple[MergePlan, Proposal, bool, int]]


@kernel
def severity_at_merge(
    merge_m: float,
    own_length_m: float,
    other: FloatArray,
    other_length_m: float,
    merge_s: float,
    rules: Rules,
) -> tuple[float, float]:
    """Returns J (m2/s4) between a vehicle that merges and another, as printed and relative."""
    other_m, other_mps = station_and_speed(other, merge_s)
    along_mps = merging_speed_along_mps(rules.road.mainline_speed_mps, rules.road.merge_angle_rad)
    distance_m = max(other_m - other_length_m - merge_m, merge_m - own_length_m - other_m)
    return conflict_severity_m2ps4(along_mps, other_mps, distance_m)


@kernel
def plan_of(
    fleet: Fleet,
    proposal: Proposal,
    situation: Situation,
    merge: Merge,
    rung: int,
    scenario: int,
    conflict: int,
    rules: Rules,
) -> MergePlan:
    """Returns the plan that a rung's merge amounts to; ``gap`` is -1 for a hold.

    ``conflict`` is the place of the conflict vehicle in the lane order, -1 for none.
    """
    conflict_row = situation.order[conflict] if conflict >= 0 else -1
    conflict_m = station_at_decision_m(situation, conflict, rules)
    return plan_about(
        fleet, proposal, situation, merge, rung, scenario, conflict_row, conflict_m, rules
    )


@kernel
def plan_about(
    fleet: Fleet,
    proposal: Proposal,
    situation: Situation,
    merge: Merge,
    rung: int,
    scenario: int,
    conflict_row: int,
    conflict_m: float,
    rules: Rules,
) -> MergePlan:
    """Returns the plan of ``plan_of`` about a conflict vehicle, -1 for none, and its station (m).

    One that makes way is on another lane at the merge, and so in no conflict any more.
    """
    order, gap = situation.order, merge.gap
    own_length_m = fleet.length_m[situation.subject]
    note_subject(proposal.trace, situation.free_accel_mps2, own_length_m, situation.clearance_m)
    if gap >= 0:
        front_length_m = fleet.length_m[order[gap - 1]] if gap > 0 else math.nan
        note_choice(proposal.trace, rung, scenario, front_length_m)
    before = after = (math.nan, math.nan)
    if conflict_row >= 0:
        other_length_m = fleet.length_m[conflict_row]
        free_s = (
            situation.nose_s
            + (rules.road.mainline_speed_mps - situation.nose_speed_mps) / situation.free_accel_mps2
        )
        before = severity_at_merge(
            situation.free_m + rules.road.mainline_speed_mps * free_s,
            own_length_m,
            committed(fleet, conflict_row),
            other_length_m,
            free_s,
            rules,
        )
        if gap >= 0 and rung != RUNG_MAKE_WAY:
            after = severity_at_merge(
                merge.merge_station_m,
                own_length_m,
                trajectory_under(fleet, proposal, conflict_row),
                other_length_m,
                merge.merge_time_s,
                rules,
            )
    return MergePlan(
        rung,
        scenario,
        conflict_row,
        order[gap - 1] if gap > 0 else -1,
        order[gap] if 0 <= gap < len(order) else -1,
        gap_size_m(fleet, situation, gap),
        own_length_m + 2.0 * situation.clearance_m,
        merge.accel_mps2,
        merge.merge_time_s,
        merge.merge_station_m,
        merge.largest_shift_m,
        before[0],
        after[0],
        before[1],
        after[1],
        situation.nose_s,
        situation.nose_speed_mps,
        conflict_m,
        station_at_decision_m(situation, gap - 1, rules),
        station_at_decision_m(situation, gap if gap >= 0 else len(order), rules),
    )


@kernel
def station_at_decision_m(situation: Situation, position: int, rules: Rules) -> float:
    """Returns a vehicle's station (m) at the decision had it cruised, nan for none.

    ``position`` is its place in the lane order; outside that there is none.
    """
    if position < 0 or position >= len(situation.order):
        return math.nan
    v0 = rules.road.mainline_speed_mps
    decision_s = situation.from_s - rules.control.actuation_delay_s
    return float(situation.intercepts_m[position] + v0 * decision_s)


def decide_first(planner: Planner, view: View, memory: Memory) -> Decision:
    """Returns the decision for the first of ``view.subjects``; the others are woken at once.

    One at a time, since each plan rests on those before it. A vehicle that no rung helps keeps its
    stop and is woken again after ``retry_s``. One whose leader on the ramp still waits is woken
    when that gets its merge. The memory is the set of rows that wait, so that a wait is explained
    once.
    """
    row = view.subjects[0]
    waiting = memory if isinstance(memory, frozenset) else frozenset()
    rest = tuple((view.time_s, other) for other in view.subjects[1:])
    plan, proposal, blocked, behind = planner(
        view.fleet, row, view.time_s, view.fastest_entry_mps, view.packed_rules
    )
    if blocked or plan.rung == RUNG_HOLD:
        again = () if blocked else ((view.time_s + view.rules.control.retry_s, row),)
        reasons = () if row in waiting else (held(row, plan, proposal),)
        return Decision((), (*rest, *again), waiting | {row}, reasons)
    commands = tuple(
        FollowTrajectory(
            int(proposal.rows[k]),
            proposal.pieces[k, : proposal.piece_count[k]].copy(),
            float(proposal.merge_time_s[k]),
            makes_gap=k > 0,
            lane_change_s=float(proposal.lane_change_s[k]),
        )
        for k in range(int(proposal.size[0]))
    )
    follow_up = ((view.time_s, behind),) if behind in waiting else ()
    return Decision(
        commands, (*rest, *follow_up), waiting - {row}, (explanation(row, plan, proposal),)
    )


def explanation(row: int, plan: MergePlan, proposal: Proposal) -> Explanation:
    """Returns the record of a plan, with what was tried for it."""
    return Explanation(row, RUNGS[plan.rung], *plan[1:], tried=tried_of(proposal))


def held(row: int, plan: MergePlan, proposal: Proposal) -> Explanation:
    """Returns the record of a vehicle that keeps its stop, whatever plan there would be for it.

    A plan that there would be is one that has to wait for a vehicle ahead on the ramp.
    """
    nothing = math.nan
    if plan.rung != RUNG_HOLD:
        refuse(proposal.trace, LEADER_WAITS, -1, nothing)
    return explanation(
        row,
        plan._replace(
            rung=RUNG_HOLD,
            scenario=0,
            front_row=-1,
            rear_row=-1,
            gap_m=nothing,
            accel_mps2=nothing,
            merge_time_s=nothing,
            merge_station_m=nothing,
            largest_shift_m=nothing,
            severity_after=nothing,
            relative_severity_after=nothing,
            front_station_m=nothing,
            rear_station_m=nothing,
        ),
        proposal,
    )
