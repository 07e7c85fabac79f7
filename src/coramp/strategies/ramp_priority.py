"""Ramp priority (section V.B of the paper): the mainline opens a gap where the ramp vehicle merges.

The ramp vehicle keeps its free movement. X moves ahead, Y back or both, whichever adjusts the
fewest vehicles and then the least. Of several lanes, the vehicle in conflict makes way instead, if
it can. Where no bound allows that: a later free movement, or a stop.
"""

import math
from dataclasses import dataclass
from typing import ClassVar

from coramp._kernel import FloatArray, kernel
from coramp.kinematics.trajectory import cruise_intercept_m
from coramp.road.rules import Rules, unpacked
from coramp.strategies.base import Decision, Memory, View
from coramp.strategies.delays import come_later
from coramp.strategies.ladder import decide_first, plan_of
from coramp.strategies.make_way import make_way, plan_of_way
from coramp.strategies.rungs import (
    Merge,
    merge_at,
    merge_freely,
    no_merge,
    unknown_bound_m,
)
from coramp.strategies.situation import (
    RUNG_CREATE,
    RUNG_DELAY,
    RUNG_FREE,
    RUNG_HOLD,
    MergePlan,
    Situation,
    assess,
    conflict_position,
    gap_bounds_m,
    gap_of_free_movement,
    ramp_neighbours,
)
from coramp.strategies.unequal_ladder import plan_unequal_ramp
from coramp.vehicles.fleet import Fleet, Proposal, committed, empty_proposal, proposed
from coramp.vehicles.trace import (
    CURRENT,
    HOLDS_UP_NEWCOMER,
    MOVES_MORE,
    give_preference,
    open_in_gap,
    refuse,
)


@kernel
def scenario_of(fleet: Fleet, situation: Situation, gap: int) -> int:
    """Returns 1 where X must move for free movement to fit into the gap, 2 for Y, 3 for both."""
    low_m, high_m = gap_bounds_m(fleet, situation, gap)
    if situation.free_m <= high_m:
        return 2
    return 1 if situation.free_m >= low_m else 3


@kernel
def open_gap(fleet: Fleet, proposal: Proposal, situation: Situation, rules: Rules) -> Merge:
    """Rung create: opens the gap that free movement meets, or one of the two next to it.

    The one that adjusts fewest vehicles, then the one with the smallest sum of shifts.
    """
    here = gap_of_free_movement(situation)
    best, latest, best_attempt = no_merge(), -1, 0
    unknown_m = unknown_bound_m(fleet, situation)
    if situation.free_m < unknown_m:
        open_in_gap(proposal.trace, RUNG_CREATE, 0, situation.order, here)
        refuse(proposal.trace, HOLDS_UP_NEWCOMER, -1, unknown_m - situation.free_m)
        return best
    fewest, least_m = 0, math.inf
    for gap in (here, here - 1, here + 1):
        if gap < 0 or gap > len(situation.order):
            continue
        movers, shift_m = least_moved(fleet, situation, gap)
        scenario = scenario_of(fleet, situation, gap)
        open_in_gap(proposal.trace, RUNG_CREATE, scenario, situation.order, gap)
        if best.gap >= 0 and (movers, shift_m) >= (fewest, least_m):
            refuse(proposal.trace, MOVES_MORE, -1, math.nan)
            continue
        latest = gap
        merge = merge_at(fleet, proposal, situation, gap, situation.free_m, True, rules)
        if merge.gap < 0:
            continue
        moved, moved_m = proposal.size[0] - 1, total_shift_m(fleet, proposal, rules)
        if best.gap < 0 or (moved, moved_m) < (fewest, least_m):
            best, fewest, least_m = merge, moved, moved_m
            best_attempt = give_preference(proposal.trace, best_attempt)
        else:
            refuse(proposal.trace, MOVES_MORE, -1, math.nan)
    if best.gap >= 0:
        proposal.trace[0, CURRENT] = best_attempt
    if best.gap >= 0 and best.gap != latest:
        return merge_at(fleet, proposal, situation, best.gap, situation.free_m, True, rules)
    return best


@kernel
def least_moved(fleet: Fleet, situation: Situation, gap: int) -> tuple[int, float]:
    """Returns how many must move at least for free movement to fit into a gap, and how far (m)."""
    low_m, high_m = gap_bounds_m(fleet, situation, gap)
    ahead_m, back_m = max(0.0, situation.free_m - high_m), max(0.0, low_m - situation.free_m)
    return int(ahead_m > 0.0) + int(back_m > 0.0), ahead_m + back_m


@kernel
def total_shift_m(fleet: Fleet, proposal: Proposal, rules: Rules) -> float:
    """Returns the sum of the shifts (m, each positive) of all vehicles but the subject."""
    v0 = rules.road.mainline_speed_mps
    total_m = 0.0
    for entry in range(1, proposal.size[0]):
        after_m = cruise_intercept_m(proposed(proposal, entry), v0)
        before_m = cruise_intercept_m(committed(fleet, proposal.rows[entry]), v0)
        total_m += abs(after_m - before_m)
    return total_m


@kernel
def first_that_helps(
    fleet: Fleet,
    subject: int,
    now_s: float,
    fastest_entry_mps: float,
    rules: Rules,
) -> tuple[MergePlan, Proposal]:
    """Returns the plan of the first rung that helps, and the trajectories that it proposes."""
    proposal = empty_proposal()
    situation = assess(fleet, subject, now_s, fastest_entry_mps, rules)
    merge = merge_freely(fleet, proposal, situation, rules)
    if merge.gap >= 0:
        return plan_of(fleet, proposal, situation, merge, RUNG_FREE, 0, -1, rules), proposal
    conflict = conflict_position(fleet, situation, rules)
    if rules.road.lanes > 1 and conflict >= 0:
        merge = make_way(fleet, proposal, situation, conflict, True, rules)
        if merge.gap >= 0:
            return plan_of_way(fleet, proposal, situation, merge, conflict, rules), proposal
    merge = open_gap(fleet, proposal, situation, rules)
    if merge.gap >= 0:
        scenario = scenario_of(fleet, situation, merge.gap)
        return plan_of(
            fleet, proposal, situation, merge, RUNG_CREATE, scenario, conflict, rules
        ), proposal
    merge, scenario = come_later(fleet, proposal, situation, rules)
    if merge.gap >= 0:
        return plan_of(
            fleet, proposal, situation, merge, RUNG_DELAY, scenario, conflict, rules
        ), proposal
    proposal.size[0] = 0
    return plan_of(fleet, proposal, situation, no_merge(), RUNG_HOLD, 0, conflict, rules), proposal


@kernel
def plan_with_ramp_priority(
    fleet: Fleet,
    subject: int,
    now_s: float,
    fastest_entry_mps: float,
    packed_rules: FloatArray,
) -> tuple[MergePlan, Proposal, bool, int]:
    """Returns the plan and its trajectories, and what ``ramp_neighbours`` tells."""
    rules = unpacked(packed_rules)
    plan, proposal = first_that_helps(fleet, subject, now_s, fastest_entry_mps, rules)
    blocked, behind = ramp_neighbours(fleet, subject, now_s + rules.control.actuation_delay_s)
    return plan, proposal, blocked, behind


@dataclass(frozen=True)
class RampPriority:
    """Ramp vehicles keep their free movement; mainline vehicles make room for them."""

    name: ClassVar[str] = "ramp-priority"
    summary: ClassVar[str] = "the paper's second method: the mainline opens a gap at the merge"
    cooperative: ClassVar[bool] = True
    vehicles_may_differ: ClassVar[bool] = True
    makes_way: ClassVar[bool] = True

    def decide(self, view: View, memory: Memory) -> Decision:
        """Returns the answer for the first subject."""
        if view.rules.traffic.differs:
            return decide_first(plan_unequal_ramp, view, memory)
        return decide_first(plan_with_ramp_priority, view, memory)
