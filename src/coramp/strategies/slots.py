"""Slots: one place in the merged lane for every vehicle, given once, one behind the other.

The lane behind the merge is a queue with one server: vehicles follow one another at a fixed time h.
Each vehicle of either stream gets the first free slot after its own earliest time, in the order of
these times. It is planned again only where a ramp vehicle that is known late goes before it.
"""

import math
from dataclasses import dataclass, replace
from typing import ClassVar

from coramp._kernel import FloatArray
from coramp.strategies.base import (
    Decision,
    Entered,
    EntryPolicy,
    FollowTrajectory,
    Memory,
    View,
)
from coramp.strategies.ladder import explanation, held
from coramp.strategies.parameters import choice, parameter
from coramp.strategies.situation import RUNG_HOLD
from coramp.strategies.slot_in_lane import Manner, plan_in_lane
from coramp.strategies.slot_onto_lane import crossing_of_s, plan_onto_lane
from coramp.vehicles.merge_state import (
    BY_MAINLINE_S,
    came_by_mainline,
    has_place_on_mainline,
    is_waiting,
)

ON_TIME_S = 1e-6
SHARED = ("first-come", "least-delay")
QUEUE_S = 5.0
"""Up to such a wait the lane is not beyond its limit: who could cross next has the slot."""
LONGEST_PUSH_S = 60.0
"""So long after its entry a ramp vehicle may have others fall back; then it takes any slot."""
SLOWEST_ENTRY_SHARE = 0.4
"""Of v0: below it a mainline vehicle waits outside. Higher shares lose capacity: who enters late
cannot make up for it."""


@dataclass(frozen=True)
class Claim:
    """A ramp vehicle that has no slot yet.

    ``crossing_s`` is when it would cross if nothing had held it up. ``late_known``: mainline
    vehicles that cross after that had entered before it. ``waits``: it was asked about in vain.
    """

    row: int
    entered_s: float
    crossing_s: float
    length_m: float
    late_known: bool
    waits: bool = False


@dataclass(frozen=True)
class Slots:
    """Every vehicle gets the first free slot after its earliest time."""

    name: ClassVar[str] = "slots"
    summary: ClassVar[str] = "every vehicle of both streams gets one slot of the merged lane, once"
    cooperative: ClassVar[bool] = True
    entry_policy: ClassVar[EntryPolicy] = EntryPolicy(
        asked=True, holds_newcomers=True, slowest_share=SLOWEST_ENTRY_SHARE
    )

    order: str = choice(
        "first-come", "mainline-first", "ramp-first", "least-delay", meaning="order of slots"
    )
    ramp_share: float = parameter(
        0.5, 0.0, 1.0, meaning="the ramp's priority in queues: 0 mainline first, 1 ramp first"
    )
    longest_wait_s: float = parameter(
        300.0, 1.0, 3600.0, meaning="waits beyond this are served first come, first served"
    )
    clear_entrance: bool = parameter(
        True, meaning="mainline vehicles accelerate at the comfort limit on entry"
    )
    smooth: bool = parameter(False, meaning="lost time is driven with least effort, if possible")
    jerk_mps3: float = parameter(
        0.5, 0.05, 10.0, meaning="largest jerk of a smooth trajectory, over 1 s"
    )

    def problems(self) -> list[str]:
        """Returns what does not fit together, a line each."""
        if self.order in ("mainline-first", "ramp-first") and self.ramp_share != 0.5:
            problem = f"ramp_share: {self.ramp_share:g} says nothing where order is {self.order}"
            return [f"{problem}; allowed is 0.5, or another order"]
        return []

    def decide(self, view: View, memory: Memory) -> Decision:
        """Returns the slot of the first subject, or when it is to be asked again."""
        known: tuple[Claim, ...] = memory if isinstance(memory, tuple) else ()
        claims = (*known, *(claim_of(view, e) for e in view.entered if e.on_ramp))
        row = first_to_plan(view)
        rest = tuple((view.time_s, other) for other in view.subjects if other != row)
        merge_s = float(view.fleet.merge_time_s[row])
        if came_by_mainline(merge_s):
            decision = self._in_lane(view, row, claims)
        elif is_waiting(merge_s):
            decision = self._onto_lane(view, row, claims)
        else:
            decision = Decision((), (), claims)
        return replace(decision, wakes_s=(*rest, *decision.wakes_s)) if rest else decision

    def _in_lane(self, view: View, row: int, claims: tuple[Claim, ...]) -> Decision:
        """The slot of a mainline vehicle; then the first ramp vehicle that waits is asked about."""
        manner = Manner(self.clear_entrance, self._most_jerk)
        pieces = plan_in_lane(view.fleet, row, view.time_s, manner, view.packed_rules)
        commands = (FollowTrajectory(row, pieces, BY_MAINLINE_S),) if len(pieces) else ()
        head = tuple((view.time_s, claim.row) for claim in claims[:1] if claim.waits)
        return Decision(commands, head, claims)

    def _onto_lane(self, view: View, row: int, claims: tuple[Claim, ...]) -> Decision:
        """The slot of a ramp vehicle, once it is its turn."""
        claim = next(known for known in claims if known.row == row)
        due_s = self._due_s(view, claim)
        if due_s > view.time_s + ON_TIME_S:
            wakes = ((due_s, row),) if due_s < math.inf else ()
            return Decision((), wakes, claims)
        waiting = tuple(replace(c, waits=True) if c.row == row else c for c in claims)
        if row != claims[0].row:  # it is asked about again once those ahead have their slots
            return Decision((), (), waiting)
        again = ((view.time_s + view.rules.control.retry_s, row),)
        if not self._goes_now(view, claim):
            return Decision((), again, waiting)
        plan, proposal, _, _ = plan_onto_lane(
            view.fleet,
            row,
            view.time_s,
            claim.crossing_s,
            self._pushes(view, claim),
            self._most_jerk,
            view.packed_rules,
        )
        if plan.rung == RUNG_HOLD:
            story = () if claim.waits else (held(row, plan, proposal),)
            return Decision((), again, waiting, story)
        commands = tuple(
            FollowTrajectory(
                int(proposal.rows[k]),
                proposal.pieces[k, : proposal.piece_count[k]].copy(),
                float(proposal.merge_time_s[k]),
                makes_gap=bool(has_place_on_mainline(view.fleet.merge_time_s[proposal.rows[k]])),
            )
            for k in range(int(proposal.size[0]))
        )
        left = claims[1:]
        follow_up = tuple((view.time_s, next_one.row) for next_one in left[:1] if next_one.waits)
        return Decision(commands, follow_up, left, (explanation(row, plan, proposal),))

    @property
    def _most_jerk(self) -> float:
        """The largest jerk (m/s3) of a smooth way, 0 where ways need not be smooth."""
        return self.jerk_mps3 if self.smooth else 0.0

    def _due_s(self, view: View, claim: Claim) -> float:
        """When (s) a ramp vehicle is asked about.

        First come: before any mainline vehicle has entered that could cross after it. Mainline
        first: where it would be planned or begin its stop, of which the loop tells; until then,
        infinity. Ramp first: at once.
        """
        if self.order == "ramp-first" or claim.waits:
            return view.time_s
        if self.order == "mainline-first":
            return math.inf if view.time_s <= claim.entered_s else view.time_s
        return claim.crossing_s - time_ahead_s(view)

    def _pushes(self, view: View, claim: Claim) -> bool:
        """Whether mainline vehicles that cross after it fall back behind a ramp vehicle.

        Not once it is so late that there may never be room among them.
        """
        late_s = view.time_s + time_ahead_s(view) - claim.crossing_s
        known_late_s = claim.entered_s + time_ahead_s(view) - claim.crossing_s
        patient = late_s - known_late_s <= LONGEST_PUSH_S
        return claim.late_known and patient and self.order != "mainline-first"

    def _goes_now(self, view: View, claim: Claim) -> bool:
        """Whether a ramp vehicle gets its slot before the mainline vehicle that waits outside."""
        waiting = view.waiting
        outside = waiting.first(on_ramp=False)
        if outside < 0:
            return True
        waited_s = view.time_s - float(waiting.since_s[outside])
        late_s = view.time_s + time_ahead_s(view) - claim.crossing_s
        length_m = float(waiting.length_m[outside])
        if max(waited_s, late_s) > self.longest_wait_s:
            return late_s >= waited_s
        both_late = min(waited_s, late_s) > 0.0
        if self.order == "least-delay" and both_late and length_m != claim.length_m:
            return claim.length_m < length_m
        if self.order in SHARED and max(waited_s, late_s) <= QUEUE_S:
            return True
        share = {"mainline-first": 0.0, "ramp-first": 1.0}.get(self.order, self.ramp_share)
        if waiting.first(on_ramp=True) >= 0:
            share = max(share, 0.5)
        return share * late_s >= (1.0 - share) * waited_s


def first_to_plan(view: View) -> int:
    """Returns the subject that is planned first: who has just entered the mainline is ahead."""
    merge_time_s: FloatArray = view.fleet.merge_time_s
    return min(view.subjects, key=lambda row: float(merge_time_s[row]))


def time_ahead_s(view: View) -> float:
    """Returns how long (s) before its crossing a mainline vehicle enters at the latest."""
    v0, rules = view.rules.road.mainline_speed_mps, view.rules
    excess_mps = max(0.0, view.fastest_entry_mps - v0)
    delay_s = rules.control.actuation_delay_s + 0.5 * excess_mps / rules.motion.slow_down_mps2
    return -(rules.road.mainline_start_m + excess_mps * delay_s) / v0


def claim_of(view: View, entered: Entered) -> Claim:
    """Returns the claim of a ramp vehicle that has just entered.

    Its crossing is that of free movement, less the time for which it was held up outside.
    """
    row, held_up_s = entered.row, entered.time_s - entered.since_s
    crossing_s = crossing_of_s(view.fleet, row, view.time_s, view.packed_rules) - held_up_s
    return Claim(
        row,
        entered.time_s,
        crossing_s,
        float(view.fleet.length_m[row]),
        crossing_s < view.time_s + time_ahead_s(view) - 0.5 * view.rules.control.step_s,
    )
