"""Mainline priority (section IV of the paper): the ramp vehicle looks for its gap.

The ladder: free movement; an acceleration that reaches a large enough gap; of several lanes, the
place of a vehicle that makes way; a gap made on the mainline by X moving ahead, Y falling back, or
both; a later gap; a stop before the nose.
"""

from dataclasses import dataclass
from typing import ClassVar

from coramp._kernel import FloatArray, kernel
from coramp.road.rules import Rules, unpacked
from coramp.strategies.base import Decision, Memory, View
from coramp.strategies.delays import come_later
from coramp.strategies.ladder import decide_first, plan_of
from coramp.strategies.make_way import make_way, plan_of_way
from coramp.strategies.rungs import create, merge_freely, no_merge, reach
from coramp.strategies.situation import (
    RUNG_CREATE,
    RUNG_DELAY,
    RUNG_FREE,
    RUNG_HOLD,
    RUNG_REACH,
    MergePlan,
    assess,
    conflict_position,
    gaps_by_preference,
    ramp_neighbours,
)
from coramp.strategies.unequal_ladder import plan_unequal_mainline
from coramp.vehicles.fleet import Fleet, Proposal, empty_proposal


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
    gaps = gaps_by_preference(fleet, situation, conflict)
    for gap in gaps:
        merge = reach(fleet, proposal, situation, gap, rules)
        if merge.gap >= 0:
            return plan_of(
                fleet, proposal, situation, merge, RUNG_REACH, 0, conflict, rules
            ), proposal
    if rules.road.lanes > 1 and conflict >= 0:
        merge = make_way(fleet, proposal, situation, conflict, False, rules)
        if merge.gap >= 0:
            return plan_of_way(fleet, proposal, situation, merge, conflict, rules), proposal
    for scenario in (1, 2, 3):
        for gap in gaps:
            merge = create(fleet, proposal, situation, gap, scenario, rules)
            if merge.gap >= 0:
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
def plan_with_mainline_priority(
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
class MainlinePriority:
    """Ramp vehicles seek gaps; mainline vehicles move only where there is none."""

    name: ClassVar[str] = "mainline-priority"
    summary: ClassVar[str] = "the paper's method: the ramp vehicle picks, or is made, a gap"
    cooperative: ClassVar[bool] = True
    vehicles_may_differ: ClassVar[bool] = True
    makes_way: ClassVar[bool] = True

    def decide(self, view: View, memory: Memory) -> Decision:
        """Returns the ladder's answer for the first subject."""
        if view.rules.traffic.differs:
            return decide_first(plan_unequal_mainline, view, memory)
        return decide_first(plan_with_mainline_priority, view, memory)
