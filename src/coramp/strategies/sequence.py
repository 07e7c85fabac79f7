"""What strategies share that only choose an order of merging: what they see, and who drives it.

Every vehicle counts by its crossing: the time at which one that cruises at v0 on its final place in
the lane passes the nose, ``-intercept / v0``. A sequence strategy says in which gap of the lane
order its subject goes; the trajectories are those of the ladder's rungs.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from coramp._kernel import FloatArray, IntArray, kernel
from coramp.equations.safe_distance import following_clearance_m, merge_clearance_m
from coramp.kinematics.trajectory import station_and_speed
from coramp.road.rules import Rules, unpacked
from coramp.strategies.attempts import joined
from coramp.strategies.base import Decision, Memory, View
from coramp.strategies.delays import come_late
from coramp.strategies.feedback import place_on_mainline
from coramp.strategies.ladder import decide_first, plan_of
from coramp.strategies.least_effort_planner import LeastEffort
from coramp.strategies.ramp_queue import next_behind_on_ramp
from coramp.strategies.rungs import create, no_merge, reach
from coramp.strategies.situation import (
    RUNG_CREATE,
    RUNG_DELAY,
    RUNG_FREE,
    RUNG_HOLD,
    RUNG_REACH,
    MergePlan,
    assess,
    conflict_position,
    lane_order,
    ramp_neighbours,
)
from coramp.vehicles.fleet import Fleet, Proposal, committed, empty_proposal

LEAST_EFFORT = LeastEffort()
MOST_GAPS = 24
"""So many gaps are tried at one decision; who fits in none of them is planned again later."""
LATER_FIRST = 0.25
"""Of two gaps as far from the chosen one, the later is tried first."""


@dataclass(frozen=True)
class Crossings:
    """Who is to be put in order at a decision, as times (s) at which they would cross the nose.

    ``mainline_s`` are those of the vehicles that are or will be in the lane, front first;
    ``ramp_s`` those of ramp vehicles without a merge, the subject first and then who is behind it,
    in free movement, but not before the one ahead. ``mainline_next_s`` and ``ramp_next_s`` say how
    much later the next vehicle in the lane may cross than each of them.
    """

    mainline_s: FloatArray
    ramp_s: FloatArray
    mainline_next_s: FloatArray
    ramp_next_s: FloatArray


Sequencer = Callable[[Crossings], int]
"""Returns the number of lane vehicles that cross before the subject."""


def crossings(fleet: Fleet, subject: int, from_s: float, rules: Rules) -> Crossings:
    """Returns what a sequencer sees at ``from_s``."""
    v0 = rules.road.mainline_speed_mps
    order, intercepts_m = lane_order(fleet, subject, v0)
    rows, ramp_s = ramp_crossings_s(fleet, subject, from_s, rules)
    clearance_m = max(
        merge_clearance_m(rules.road, rules.safety), following_clearance_m(rules.road, rules.safety)
    )
    return Crossings(
        -intercepts_m / v0,
        np.maximum.accumulate(ramp_s),
        (fleet.length_m[order] + clearance_m) / v0,
        (fleet.length_m[rows] + clearance_m) / v0,
    )


@kernel
def ramp_crossings_s(
    fleet: Fleet, subject: int, from_s: float, rules: Rules
) -> tuple[IntArray, FloatArray]:
    """Returns the subject and those behind it on the ramp, and their crossings (s)."""
    rows, crossing_s = np.empty(len(fleet.live), np.int64), np.empty(len(fleet.live))
    row, n = subject, 0
    while row >= 0:
        station_m, speed_mps = station_and_speed(committed(fleet, row), from_s)
        virtual_m, _ = place_on_mainline(station_m, speed_mps, rules)
        rows[n], crossing_s[n] = row, from_s - virtual_m / rules.road.mainline_speed_mps
        row, n = next_behind_on_ramp(fleet, row, from_s), n + 1
    return rows[:n], crossing_s[:n]


def decide_in_sequence(
    sequencer: Sequencer,
    view: View,
    memory: Memory,
    least_effort: LeastEffort = LEAST_EFFORT,
    *,
    later_only: bool = False,
) -> Decision:
    """Returns the decision for the first subject, in the gap that the sequencer chooses.

    In each gap the trajectories of least effort come first, then those of the ladder's rungs. If
    neither can be driven, the gaps around it are tried, nearest first, or only later ones, up to
    ``MOST_GAPS``.
    """

    def planner(
        fleet: Fleet, row: int, now_s: float, fastest_entry_mps: float, packed_rules: FloatArray
    ) -> tuple[MergePlan, Proposal, bool, int]:
        rules = view.rules
        situation = assess(fleet, row, now_s, fastest_entry_mps, rules)
        seen = crossings(fleet, row, situation.from_s, rules)
        chosen, count = sequencer(seen), len(seen.mainline_s) + 1
        gaps = np.arange(chosen, count) if later_only else gaps_around(chosen, count)
        earlier: list[FloatArray] = []
        for place in range(min(len(gaps), MOST_GAPS)):
            plan, proposal = least_effort.plan(fleet, situation, int(gaps[place]), rules)
            if plan is not None:
                told = with_earlier(proposal, earlier)
                return plan, told, *ramp_neighbours(fleet, row, situation.from_s)
            earlier.append(proposal.trace)
            one = gaps[place : place + 1]
            answer = plan_in_gaps(fleet, row, now_s, fastest_entry_mps, one, packed_rules)
            if answer[0].rung != RUNG_HOLD:
                return answer[0], with_earlier(answer[1], earlier), *answer[2:]
            earlier.append(answer[1].trace)
        none = gaps[:0]
        answer = plan_in_gaps(fleet, row, now_s, fastest_entry_mps, none, packed_rules)
        return answer[0], with_earlier(answer[1], earlier), *answer[2:]

    return decide_first(planner, view, memory)


def with_earlier(proposal: Proposal, earlier: list[FloatArray]) -> Proposal:
    """Returns the proposal with what was tried before it, in other gaps."""
    return proposal._replace(trace=joined(earlier, proposal.trace))


def gaps_around(chosen: int, count: int) -> IntArray:
    """Returns all gap numbers, the chosen one first, then by distance from it."""
    numbers = np.arange(count)
    return np.argsort(np.abs(numbers - chosen - LATER_FIRST), kind="stable")


@kernel
def plan_in_gaps(
    fleet: Fleet,
    subject: int,
    now_s: float,
    fastest_entry_mps: float,
    gaps: IntArray,
    packed_rules: FloatArray,
) -> tuple[MergePlan, Proposal, bool, int]:
    """Returns the plan for the first of ``gaps`` in which the subject can merge.

    In each it is tried to reach the gap as it is, to have who is behind it fall back, or both
    vehicles or the front one move, and to come to it late, if need be with who is behind it falling
    back. The rest is what ``ramp_neighbours`` tells.
    """
    rules = unpacked(packed_rules)
    proposal = empty_proposal()
    situation = assess(fleet, subject, now_s, fastest_entry_mps, rules)
    conflict = conflict_position(fleet, situation, rules)
    blocked, behind = ramp_neighbours(fleet, subject, now_s + rules.control.actuation_delay_s)
    for gap in gaps:
        rung, scenario, merge = RUNG_REACH, 0, reach(fleet, proposal, situation, gap, rules)
        if merge.gap >= 0 and merge.accel_mps2 == situation.free_accel_mps2:
            rung = RUNG_FREE
        for moves in (1, 2, 3):
            if merge.gap < 0:
                rung, scenario = RUNG_CREATE, moves
                merge = create(fleet, proposal, situation, gap, moves, rules)
        for room_m in (0.0, np.inf):
            if merge.gap < 0:
                rung, scenario = RUNG_DELAY, 2 if room_m > 0.0 else 0
                merge = come_late(fleet, proposal, situation, gap, room_m, rules)
        if merge.gap >= 0:
            plan = plan_of(fleet, proposal, situation, merge, rung, scenario, conflict, rules)
            return plan, proposal, blocked, behind
    proposal.size[0] = 0
    plan = plan_of(fleet, proposal, situation, no_merge(), RUNG_HOLD, 0, conflict, rules)
    return plan, proposal, blocked, behind
