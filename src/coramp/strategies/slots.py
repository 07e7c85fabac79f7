"""Slots: one place in the merged lane for every vehicle, given once, one behind the other.

The lane behind the merge is a queue with one server: vehicles follow one another at a fixed time h.
Each vehicle of either stream gets the first free slot after its own earliest time, in the order of
these times, and is never planned again.
"""

import math
from dataclasses import dataclass
from typing import ClassVar

from coramp.core.fleet import Fleet
from coramp.core.rules import Rules
from coramp.strategies.base import (
    Decision,
    EntryPolicy,
    FollowTrajectory,
    Memory,
    View,
)
from coramp.strategies.ladder import explanation, held
from coramp.strategies.parameters import choice, parameter
from coramp.strategies.situation import RUNG_HOLD, assess, foremost_unknown_m
from coramp.strategies.slot_plans import plan_in_lane, plan_onto_lane

Claims = tuple[tuple[int, float, bool], ...]
"""Ramp vehicles without a slot: row, the crossing time (s) that they claim, whether they wait."""
SLOWEST_SHARE = 0.6


@dataclass(frozen=True)
class Slots:
    """Every vehicle gets the first free slot after its earliest time."""

    name: ClassVar[str] = "slots"
    summary: ClassVar[str] = "every vehicle of both streams gets one slot of the merged lane, once"
    cooperative: ClassVar[bool] = True
    entry_policy: ClassVar[EntryPolicy] = EntryPolicy(True, True, SLOWEST_SHARE)

    order: str = choice(
        "first-come", "mainline-first", "ramp-first", "least-delay", meaning="who gets a slot first"
    )
    ramp_share: float = parameter(0.5, 0.0, 1.0, meaning="the ramp's claim beyond the lane's limit")
    longest_wait_s: float = parameter(
        300.0, 1.0, 3600.0, meaning="after so long a wait, first come, first served"
    )

    clear_entrance: bool = parameter(
        True, meaning="mainline vehicles speed up as hard as is comfortable as they enter"
    )

    def decide(self, view: View, memory: Memory) -> Decision:
        """Returns the slot of the first subject, or when it is to be asked again."""
        claims: Claims = memory if isinstance(memory, tuple) else ()
        row = first_to_plan(view)
        rest = tuple((view.time_s, other) for other in view.subjects if other != row)
        merge_s = float(view.fleet.merge_time_s[row])
        if merge_s == -math.inf:
            return self._in_lane(view, row, rest, claims)
        if merge_s < math.inf:
            return Decision((), rest, claims)
        return self._onto_lane(view, row, rest, claims)

    def _in_lane(
        self, view: View, row: int, rest: tuple[tuple[float, int], ...], claims: Claims
    ) -> Decision:
        pieces, _ = plan_in_lane(
            view.fleet, row, view.time_s, self.clear_entrance, view.packed_rules
        )
        commands = (FollowTrajectory(row, pieces, -math.inf),) if len(pieces) else ()
        head = tuple((view.time_s, other) for other, _, waits in claims[:1] if waits)
        return Decision(commands, (*rest, *head), claims)

    def _onto_lane(
        self, view: View, row: int, rest: tuple[tuple[float, int], ...], claims: Claims
    ) -> Decision:
        if row not in [other for other, _, _ in claims]:
            claim_s = claim_of(view, row)
            claims = (*claims, (row, claim_s, False))
        claim_s = next(s for other, s, _ in claims if other == row)
        ahead_s = time_ahead_s(view)
        if self.order == "first-come" and claim_s > view.time_s + ahead_s + 1e-6:
            return Decision((), (*rest, (claim_s - ahead_s, row)), claims)
        waits = tuple((other, s, w or other == row) for other, s, w in claims)
        if not self._goes_now(view, claim_s, ahead_s):
            return Decision((), (*rest, (view.time_s + view.rules.control.retry_s, row)), waits)
        plan, proposal, blocked, behind = plan_onto_lane(
            view.fleet, row, view.time_s, claim_s, view.packed_rules
        )
        if blocked or plan.rung == RUNG_HOLD:
            again = () if blocked else ((view.time_s + view.rules.control.retry_s, row),)
            told = any(other == row and w for other, _, w in claims)
            return Decision((), (*rest, *again), waits, () if told else (held(row, plan),))
        commands = tuple(
            FollowTrajectory(
                int(proposal.rows[k]),
                proposal.pieces[k, : proposal.piece_count[k]].copy(),
                float(proposal.merge_time_s[k]),
            )
            for k in range(int(proposal.size[0]))
        )
        left = tuple(claim for claim in claims if claim[0] != row)
        follow_up = tuple((view.time_s, other) for other, _, w in left if other == behind and w)
        return Decision(commands, (*rest, *follow_up), left, (explanation(row, plan),))

    def _goes_now(self, view: View, claim_s: float, ahead_s: float) -> bool:
        """Whether a ramp vehicle gets its slot before the mainline vehicle that waits longest."""
        since_s = view.waiting.first_since_s(False)
        if since_s == math.inf:
            return True
        waited_s, late_s = view.time_s - since_s, view.time_s + ahead_s - claim_s
        share = self.ramp_share
        if max(waited_s, late_s) > self.longest_wait_s:
            share = 0.5
        if view.waiting.first_since_s(True) < math.inf:
            share = max(share, 0.5)
        return share * late_s >= (1.0 - share) * waited_s


def first_to_plan(view: View) -> int:
    """Returns the subject that is planned first: who has just entered the mainline is ahead."""
    merge_time_s = view.fleet.merge_time_s
    return min(view.subjects, key=lambda row: float(merge_time_s[row]))


def time_ahead_s(view: View) -> float:
    """Returns how long (s) before its crossing a mainline vehicle enters at the latest."""
    foremost_m = foremost_unknown_m(view.time_s, view.fastest_entry_mps, view.rules)
    return -foremost_m / view.rules.road.mainline_speed_mps - view.time_s


def claim_of(view: View, row: int) -> float:
    """Returns the crossing time (s) of a ramp vehicle that had not been held up outside."""
    late_s = sum(e.time_s - e.since_s for e in view.entered if e.row == row)
    return free_crossing_s(view.fleet, row, view.time_s, view.rules) - late_s


def free_crossing_s(fleet: Fleet, row: int, now_s: float, rules: Rules) -> float:
    """Returns when (s) a ramp vehicle in free movement crosses the nose as if it were at v0."""
    return -float(assess(fleet, row, now_s, 0.0, rules).free_m) / rules.road.mainline_speed_mps
