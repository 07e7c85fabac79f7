"""The loop: arrivals enter, strategies decide, the checker examines, commitments are made.

Driven by the control clock alone. It knows no simulator: a plant carries the vehicles.
"""

import heapq
import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from coramp._kernel import FloatArray
from coramp.audit.checker import ACCEPTED, REASONS
from coramp.coordination.admission import (
    decision_due_s,
    plan_entry,
    plan_moving_up,
    undecided_in_lane_order,
)
from coramp.coordination.examination import Examiner, bounds_of
from coramp.coordination.ledger import Ledger
from coramp.coordination.plant import Arrival, Plant
from coramp.core.fleet import proposed
from coramp.core.rules import Rules
from coramp.core.trajectory import station_and_speed
from coramp.strategies.base import (
    Decision,
    Explanation,
    FollowTrajectory,
    Memory,
    Strategy,
    View,
)

ENTRY, WAKE = 0, 1
NOBODY = -1


@dataclass(frozen=True, slots=True)
class DecisionRecord:
    """One explained decision, with what the checker measured of it."""

    time_s: float
    explanation: Explanation
    adjusted_rows: tuple[int, ...]
    min_margin_m: float


@dataclass(frozen=True, slots=True)
class Refusal:
    """A plan that the checker did not let pass; the vehicles kept their commitments."""

    time_s: float
    row: int
    reason: str


@dataclass(frozen=True, slots=True)
class Entry:
    """At which step a row entered, and which arrival it is."""

    arrival: int
    step: int


class Coordinator:
    """Runs one strategy over given arrivals."""

    def __init__(
        self,
        strategy: Strategy,
        rules: Rules,
        arrivals: Sequence[Arrival],
        fastest_entry_mps: float,
        plant: Plant,
    ) -> None:
        self.ledger = Ledger(rules.road.mainline_speed_mps, rules.road.mainline_end_m)
        self.entries: list[Entry] = []
        self.decisions: list[DecisionRecord] = []
        self.refusals: list[Refusal] = []
        self._strategy = strategy
        self._rules = rules
        self._examiner = Examiner(bounds_of(rules))
        self._arrivals = arrivals
        self._fastest_entry_mps = fastest_entry_mps
        self._plant = plant
        self._memory: Memory = None
        self._step_s = rules.control.step_s
        self._queues: tuple[deque[int], deque[int]] = (deque(), deque())
        self._due_step: dict[int, int] = {}
        self._events: list[tuple[int, int, int]] = []

    def expect_arrivals(self) -> None:
        """Lets every arrival come at its step."""
        self._events += [(arrival.step, ENTRY, k) for k, arrival in enumerate(self._arrivals)]
        heapq.heapify(self._events)

    def run(self, last_step: int) -> None:
        """Handles every event up to and including ``last_step``."""
        while self._events and self._events[0][0] <= last_step:
            step = self._events[0][0]
            self._plant.advance(step)
            self.ledger.forget_exited(step * self._step_s)
            self._handle(step)

    def decide_now(self, step: int) -> None:
        """Has every ramp vehicle on the road planned at ``step``, wherever it is, front first."""
        rows = undecided_in_lane_order(self.ledger.fleet, step * self._step_s)
        for row in rows.tolist():
            self._due_step.pop(row, None)
            self._decide((row,), step)

    def waiting(self) -> list[int]:
        """Returns the arrivals (by number) that wait outside."""
        return sorted([*self._queues[False], *self._queues[True]])

    def _handle(self, step: int) -> None:
        while self._next_is(step, ENTRY):
            _, _, number = heapq.heappop(self._events)
            if number != NOBODY:
                self._queues[self._arrivals[number].on_ramp].append(number)
        self._admit(False, step)
        self._admit(True, step)
        while subjects := self._woken(step):
            ready = tuple(row for row in subjects if not self._goes_on_to_station(row, step))
            if ready:
                self._decide(ready, step)

    def _next_is(self, step: int, kind: int) -> bool:
        return bool(self._events) and self._events[0][:2] == (step, kind)

    def _woken(self, step: int) -> tuple[int, ...]:
        rows: dict[int, None] = {}
        while self._next_is(step, WAKE):
            _, _, row = heapq.heappop(self._events)
            if self._due_step.get(row, step) == step:
                self._due_step.pop(row, None)
                rows[row] = None
        return tuple(rows)

    def _wake(self, step: int, row: int) -> None:
        heapq.heappush(self._events, (step, WAKE, row))

    def _first_step_from(self, time_s: float) -> int:
        return math.ceil(time_s / self._step_s - 1e-6)

    def _admit(self, on_ramp: bool, step: int) -> None:
        queue = self._queues[on_ramp]
        while queue:
            if not self._enter(queue[0], step):
                heapq.heappush(self._events, (step + 1, ENTRY, NOBODY))
                return
            queue.popleft()

    def place(self, number: int, station_m: float, step: int) -> bool:
        """Puts an arrival on the road, harmonised from there; False where that is not safe."""
        arrival = self._arrivals[number]
        time_s = step * self._step_s
        row = self.ledger.add(arrival.length_m, arrival.on_ramp)
        pieces = plan_entry(
            self.ledger.fleet,
            arrival.length_m,
            arrival.on_ramp,
            time_s,
            station_m,
            arrival.speed_mps,
            self._rules,
        )
        if len(pieces) == 0:
            self.ledger.withdraw(row)
            return False
        state = np.array([time_s, station_m, arrival.speed_mps])
        verdict = self._examiner.entry(self.ledger, row, pieces, state)
        if verdict.code != ACCEPTED:
            self.ledger.withdraw(row)
            self.refusals.append(Refusal(time_s, row, REASONS[verdict.code]))
            return False
        self.entries.append(Entry(number, step))
        self._plant.enter(row, arrival, step)
        self._commit(row, pieces, self.ledger.merge_time_s(row), step)
        if arrival.on_ramp:
            self._plan_when_due(row, pieces, step)
        return True

    def _enter(self, number: int, step: int) -> bool:
        road = self._rules.road
        on_ramp = self._arrivals[number].on_ramp
        return self.place(number, road.ramp_start_m if on_ramp else road.mainline_start_m, step)

    def _commit(self, row: int, pieces: FloatArray, merge_time_s: float, step: int) -> None:
        self.ledger.commit(row, pieces, merge_time_s)
        self._plant.follow(row, pieces, merge_time_s)
        if row in self._due_step:
            self._plan_when_due(row, pieces, step)

    def _plan_when_due(self, row: int, pieces: FloatArray, step: int) -> None:
        due_s = decision_due_s(pieces, self._rules.road.decision_station_m)
        self._due_step[row] = max(step, self._first_step_from(due_s))
        self._wake(self._due_step[row], row)

    def _goes_on_to_station(self, row: int, step: int) -> bool:
        """Whether a vehicle whose stop lay before its decision station can now go on towards it."""
        station_m, _ = station_and_speed(self.ledger.trajectory(row), step * self._step_s)
        if station_m >= self._rules.road.decision_station_m or not self._moves_up(row, step):
            return False
        self._plan_when_due(row, self.ledger.trajectory(row), step + 1)
        return True

    def _moves_up(self, row: int, step: int) -> bool:
        """Whether a vehicle without a merge can go on to a stop further ahead, and now does."""
        time_s = step * self._step_s
        if self.ledger.merge_time_s(row) < math.inf:
            return False
        from_s = time_s + self._rules.control.actuation_delay_s
        proposal = plan_moving_up(self.ledger.fleet, from_s, self._rules)
        moves = [
            FollowTrajectory(
                int(proposal.rows[k]), proposed(proposal, k), float(proposal.merge_time_s[k])
            )
            for k in range(int(proposal.size[0]))
        ]
        if row not in [move.row for move in moves]:
            return False
        verdict = self._examiner.change(self.ledger, moves, from_s)
        if verdict.code != ACCEPTED:
            self.refusals.append(Refusal(time_s, row, REASONS[verdict.code]))
            return False
        for move in moves:
            self._commit(move.row, move.pieces, move.merge_time_s, step)
        return True

    def _decide(self, subjects: tuple[int, ...], step: int) -> None:
        time_s = step * self._step_s
        view = View(
            time_s,
            subjects,
            self.ledger.fleet,
            self.ledger.fleet,
            self.ledger.reports(time_s),
            self._fastest_entry_mps,
            self._rules,
        )
        decision = self._strategy.decide(view, self._memory)
        trajectories = [c for c in decision.commands if isinstance(c, FollowTrajectory)]
        margin_m = math.nan
        if trajectories:
            earliest_s = time_s + self._rules.control.actuation_delay_s
            verdict = self._examiner.change(self.ledger, trajectories, earliest_s)
            if verdict.code != ACCEPTED:
                self._refuse(subjects, step, REASONS[verdict.code])
                return
            margin_m = verdict.least_margin_m
            for command in trajectories:
                self._commit(command.row, command.pieces, command.merge_time_s, step)
        self._memory = decision.memory
        self._record(decision, trajectories, time_s, margin_m)
        for wake_s, row in decision.wakes_s:
            wake_step = self._first_step_from(wake_s)
            self._wake(wake_step, row)
            if wake_step > step:
                self._moves_up(row, step)

    def _refuse(self, subjects: tuple[int, ...], step: int, reason: str) -> None:
        retry_step = self._first_step_from(step * self._step_s + self._rules.control.retry_s)
        for row in subjects:
            self.refusals.append(Refusal(step * self._step_s, row, reason))
            self._wake(retry_step, row)

    def _record(
        self,
        decision: Decision,
        trajectories: Sequence[FollowTrajectory],
        time_s: float,
        margin_m: float,
    ) -> None:
        for explanation in decision.explanations:
            adjusted = tuple(c.row for c in trajectories if c.row != explanation.row)
            self.decisions.append(DecisionRecord(time_s, explanation, adjusted, margin_m))
