"""The loop for ramp vehicles that are asked, one at a time, for their slots in the lane.

It pauses whenever somebody has to be asked. Who answers is outside: a policy, or a person.
"""

import math
from functools import partial
from typing import NamedTuple

import numpy as np

from coramp._kernel import BoolArray, FloatArray, IntArray
from coramp.coordination.admission import undecided_in_lane_order
from coramp.coordination.book import ways_of
from coramp.coordination.coordinator import Coordinator
from coramp.coordination.gate import NEVER
from coramp.equations.ramp_acceleration import lag_m
from coramp.equations.safe_distance import merge_clearance_m
from coramp.messages.feed import RequestFeed
from coramp.motion.clock import first_step_from
from coramp.road.rules import Rules, packed
from coramp.strategies.asked_slot import plan_into_slot
from coramp.strategies.base import (
    Decision,
    DriveWithAcceleration,
    EntryPolicy,
    FollowTrajectory,
    Memory,
    View,
    steps_of_period,
)
from coramp.strategies.situation import lane_order
from coramp.strategies.slot_onto_lane import crossing_of_s
from coramp.strategies.slots import SLOWEST_ENTRY_SHARE, time_ahead_s
from coramp.vehicles.fleet import proposed
from coramp.vehicles.merge_state import is_planned

AT_ONCE_S = 1e-6
"""The fallback holds no acceleration: who stands and is told so anew would stand for ever."""


class Nobody:
    """The strategy underneath plans nobody. Merges may hold up who has yet to enter."""

    entry_policy = EntryPolicy(holds_newcomers=True, slowest_share=SLOWEST_ENTRY_SHARE)

    def decide(self, view: View, memory: Memory) -> Decision:  # noqa: ARG002 - the interface
        """Returns no command."""
        return Decision((), (), memory)


class Requested(NamedTuple):
    """Who asks to enter, one entry each: when (s), where, and travel time in free movement (s)."""

    scheduled_s: FloatArray
    on_ramp: BoolArray
    free_flow_s: FloatArray


class AskingLoop:
    """A coordinator that stops where a ramp vehicle is to be asked for its slot.

    Asked is the foremost ramp vehicle without a merge. The first time is so long before it crosses
    in free movement as the mainline takes from its start to the nose (``slots.time_ahead_s``), the
    next ones follow every ``period_steps``. ``row`` is that vehicle, -1 where nobody will be asked
    any more. ``refused`` counts wishes for which no slot was safe, ``own_refused`` those of the
    vehicle that is asked.

    From the first question on, the vehicle merges by itself in each step in which that is safe and
    holds nobody up who has yet to enter; until then it goes on to its stop, and so do those behind.
    """

    def __init__(
        self, rules: Rules, feed: RequestFeed, fastest_entry_mps: float, period_steps: int
    ) -> None:
        self.coordinator = Coordinator(Nobody(), rules, feed, fastest_entry_mps)
        self.coordinator.expect_arrivals()
        self.row, self.step, self.refused, self.own_refused = -1, 0, 0, 0
        self.packed_rules = packed(rules)
        self._rules, self._period = rules, period_steps
        self._step_s = rules.control.step_s
        self._moving_up = steps_of_period(rules.control.retry_s, self._step_s)
        self._asked, self._again = -1, 0
        self._clearance_m = merge_clearance_m(rules.road, rules.safety)
        self._ahead_s = time_ahead_s(self.coordinator.view((), 0))
        self.requested = requested(feed, rules)

    @property
    def time_s(self) -> float:
        """The present."""
        return self.step * self._step_s

    def waiting(self) -> IntArray:
        """Returns the ramp rows whose merge is not committed, front first."""
        return undecided_in_lane_order(ways_of(self.coordinator.ledger.book), self.time_s)

    def crossing_s(self, row: int) -> float:
        """Returns when (s) a ramp vehicle without a merge would cross in free movement from now."""
        fleet = self.coordinator.ledger.fleet
        return float(crossing_of_s(fleet, row, self.time_s, self.packed_rules))

    def ask_for(self, shift_s: float, tolerance_s: float) -> bool:
        """Commits who is asked to a slot after free movement's; False where none is safe.

        It is the first safe one from ``shift_s`` to ``shift_s + tolerance_s`` later.
        """
        ledger = self.coordinator.ledger
        proposal = plan_into_slot(
            ledger.fleet, self.row, self.time_s, shift_s, tolerance_s, self.packed_rules
        )
        commands = tuple(
            FollowTrajectory(
                int(proposal.rows[k]), proposed(proposal, k).copy(), float(proposal.merge_time_s[k])
            )
            for k in range(int(proposal.size[0]))
        )
        if commands:
            self.coordinator.carry_out(Decision(commands), (self.row,), self.step)
        if is_planned(ledger.merge_time_s(self.row)):
            return True
        self.refused += 1
        self.own_refused += 1
        return False

    def go_on(self, last_step: int) -> None:
        """Lets time pass until somebody is asked, nobody will be, or a step is over."""
        self.row = -1
        while self.step < last_step:
            waiting = self.waiting()
            due = self._due_step(waiting)
            if due <= self.step:
                self._ask(int(waiting[0]))
                return
            if len(waiting) == 0 and self._everybody_is_in():
                return
            until = min(due, self.step + self._moving_up, last_step)
            if len(waiting) and waiting[0] == self._asked:
                self._fall_back(waiting, until)
            self.coordinator.run(until)
            self.step = until

    def delay_s(self) -> float:
        """Returns the delay (s) that all vehicles together are known to have by now.

        Whose place on the mainline is committed leaves the zone as committed. Other ramp vehicles
        count as if they took the next slots behind all of these, in their order, and who waits
        outside has waited so far.
        """
        ledger, (arrival, _) = self.coordinator.ledger, self.coordinator.entered()
        asked, now_s = self.requested, self.time_s
        exit_s = ledger.book.exit_s[: len(ledger)].copy()
        v0, end_m = self._rules.road.mainline_speed_mps, self._rules.road.mainline_end_m
        last_s = self._last_crossing_s()
        for row in self.waiting().tolist():
            headway_s = (ledger.length_m(row) + self._clearance_m) / v0
            last_s = max(self.crossing_s(row), last_s + headway_s)
            exit_s[row] = last_s + end_m / v0
        inside_s = exit_s - (asked.scheduled_s + asked.free_flow_s)[arrival]
        outside = asked.scheduled_s <= now_s
        outside[arrival] = False
        return float(inside_s.sum() + (now_s - asked.scheduled_s[outside]).sum())

    def late_s(self, row: int) -> float:
        """Returns how late (s) a ramp vehicle without a merge would be in free movement."""
        k = self.coordinator.entered()[0][row]
        v0, end_m = self._rules.road.mainline_speed_mps, self._rules.road.mainline_end_m
        asked = self.requested
        exit_s = self.crossing_s(row) + end_m / v0
        return float(exit_s - asked.scheduled_s[k] - asked.free_flow_s[k])

    def _last_crossing_s(self) -> float:
        """Returns when (s) the last vehicle with a place on the mainline crosses."""
        fleet, v0 = self.coordinator.ledger.fleet, self._rules.road.mainline_speed_mps
        _, intercepts_m = lane_order(fleet, -1, v0)
        return float(-intercepts_m[-1] / v0) if len(intercepts_m) else -math.inf

    def _everybody_is_in(self) -> bool:
        return len(self.coordinator.ledger) == len(self.requested.scheduled_s)

    def _due_step(self, waiting: IntArray) -> int:
        """Returns when the foremost ramp vehicle is to be asked."""
        if len(waiting) == 0:
            return NEVER
        row = int(waiting[0])
        if row == self._asked:
            return self._again
        return int(first_step_from(self.crossing_s(row) - self._ahead_s, self._step_s))

    def _ask(self, row: int) -> None:
        if row != self._asked:
            self.own_refused = 0
        self.row = self._asked = row
        self._again = self.step + self._period

    def _fall_back(self, waiting: IntArray, until: int) -> None:
        """Has the foremost merge by itself in each step before that one; others move up once."""
        drive = partial(DriveWithAcceleration, accel_mps2=0.0, hold_s=AT_ONCE_S)
        rows = waiting.tolist()
        self.coordinator.drive([drive(row) for row in rows], self.step)
        for step in range(self.step + 1, until):
            if is_planned(self.coordinator.ledger.merge_time_s(rows[0])):
                return
            self.coordinator.run(step)
            self.coordinator.drive([drive(rows[0])], step)


def requested(feed: RequestFeed, rules: Rules) -> Requested:
    """Returns the requests of a feed with their travel times in free movement."""
    road, v0 = rules.road, rules.road.mainline_speed_mps
    on_ramp = np.array([feed[k].on_ramp for k in range(len(feed))], np.bool_)
    scheduled_s = np.array([feed[k].step for k in range(len(feed))], np.float64)
    merging_m = lag_m(v0, road.ramp_speed_mps, rules.motion.free_acceleration_mps2)
    on_ramp_s = -road.ramp_start_m / road.ramp_speed_mps + (road.mainline_end_m + merging_m) / v0
    on_mainline_s = (road.mainline_end_m - road.mainline_start_m) / v0
    return Requested(
        scheduled_s * rules.control.step_s,
        on_ramp,
        np.where(on_ramp, on_ramp_s, on_mainline_s),
    )
