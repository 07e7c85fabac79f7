"""The loop: arrivals enter, strategies decide, the checker examines, commitments are made.

Driven by the control clock alone. It knows no simulator: a plant carries the vehicles.
"""

import math
from collections.abc import Sequence
from functools import partial

from coramp._kernel import FloatArray, IntArray
from coramp.checker.checker import Verdict
from coramp.checker.reasons import (
    ACCEPTED,
    HOLDS_NEWCOMERS,
)
from coramp.coordination.admission import (
    decision_due_s,
    plan_moving_up,
    undecided_in_lane_order,
)
from coramp.coordination.book import ways_of
from coramp.coordination.commitments import Commitments
from coramp.coordination.decision_log import DecisionLog
from coramp.coordination.drivers import DriverRoad, sorted_by_taker
from coramp.coordination.entrance import Entrance, Listeners
from coramp.coordination.examination import Examiner, bounds_of
from coramp.coordination.ledger import Ledger
from coramp.coordination.newcomers import Newcomers
from coramp.coordination.plant import Plant
from coramp.coordination.supervisor import drive_safely
from coramp.coordination.wakes import PERIOD, Wakes
from coramp.kinematics.trajectory import station_and_speed
from coramp.messages.events import DetectorReading
from coramp.messages.feed import RequestFeed
from coramp.motion.approach import stop_starts_s
from coramp.motion.clock import first_step_from
from coramp.road.rules import Rules, packed
from coramp.strategies.base import (
    Command,
    Decider,
    Decision,
    Detectors,
    DriveWithAcceleration,
    FollowTrajectory,
    Memory,
    View,
    entry_policy_of,
    is_metered,
    period_of,
    steps_of_period,
)
from coramp.vehicles.fleet import proposed
from coramp.vehicles.merge_state import has_place_on_mainline


class Coordinator:
    """Runs one strategy over the requests to enter that a world feeds.

    The feed is the world's; a request is read when its step has come, and may be there earlier.
    Without a plant nobody carries the vehicles: the commitments are all there is. ``drivers`` is
    what it hears of vehicles that take no commands, if there are any.
    ``interventions`` counts what the strategy commanded and was refused.
    """

    def __init__(
        self,
        strategy: Decider,
        rules: Rules,
        feed: RequestFeed,
        fastest_entry_mps: float,
        plant: Plant | None = None,
        drivers: DriverRoad | None = None,
    ) -> None:
        road = rules.road
        self.ledger = Ledger(len(feed))
        self._log = DecisionLog(rules.safety.execution_allowance_m)
        self.decisions, self.refusals = self._log.decisions, self._log.refusals
        self.interventions = 0
        self._strategy = strategy
        self._rules = rules
        self._packed = packed(rules)
        examiner = Examiner(bounds_of(rules), len(feed))
        self._commitments = Commitments(self.ledger, examiner, road)
        policy = entry_policy_of(strategy)
        self._asks_at_entry, self._holds_newcomers = policy.asked, policy.holds_newcomers
        self._wakes = Wakes()
        listeners = Listeners(self._wakes, self._log, plant)
        self._entrance = Entrance(feed, policy, rules, self._commitments, listeners)
        self._fastest_entry_mps = fastest_entry_mps
        self._newcomers = Newcomers(fastest_entry_mps, rules)
        self._plant = plant
        self._drivers = DriverRoad() if drivers is None else drivers
        self._detectors: Detectors | None = None
        self._memory: Memory = None
        self._step_s = rules.control.step_s
        self._told_of_entries = 0
        period_s = period_of(strategy)
        self._period_steps = 0 if period_s is None else steps_of_period(period_s, self._step_s)

    def expect_arrivals(self) -> None:
        """Lets every request be heard at its step, and starts the strategy's own clock, if any.

        The clock of a strategy that meters are the readings of the loops.
        """
        self._entrance.open()
        if self._period_steps and not is_metered(self._strategy):
            self._wakes.ask(self._period_steps, PERIOD)

    def run(self, last_step: int) -> None:
        """Handles every event up to and including ``last_step``."""
        while True:
            self._entrance.admit(min(last_step, self._wakes.next_step))
            step = self._wakes.next_step
            if step > last_step:
                if self._entrance.next_step > last_step:
                    return
                continue
            if self._plant is not None:
                self._plant.advance(step)
            self._handle_wakes(step)

    def read(self, reading: DetectorReading) -> None:
        """Asks the strategy at the step of a reading of the road's loops, after all else of it."""
        step = round(reading.time_s / self._step_s)
        self.run(step)
        self._detectors = Detectors(
            mainline_occupancy=reading.mainline_occupancy,
            queue_occupancy=reading.queue_occupancy,
            passed_veh=reading.passed_veh,
        )
        self._decide((), step)
        self._detectors = None

    def entered(self) -> tuple[IntArray, IntArray]:
        """Returns, a row each, which arrival it is and at which step it entered."""
        return self._entrance.entered()

    def waiting(self) -> list[int]:
        """Returns the requests (by number) that have been heard and have not entered."""
        return self._entrance.waiting()

    def place(self, number: int, station_m: float, step: int) -> bool:
        """Puts who asks to enter on the road, from that station; False where that is not safe."""
        return self._entrance.place(number, station_m, step)

    def decide_now(self, step: int) -> None:
        """Has every ramp vehicle on the road planned at ``step``, wherever it is, front first."""
        rows = undecided_in_lane_order(ways_of(self.ledger.book), step * self._step_s)
        for row in rows.tolist():
            self._wakes.planned(row)
            self._decide((row,), step)

    def _handle_wakes(self, step: int) -> None:
        if self._wakes.tick(step, self._period_steps) and self._has_traffic():
            self._decide((), step)
        while subjects := self._wakes.woken(step):
            ready = self._ready(subjects, step)
            if ready:
                self._decide(ready, step)

    def _has_traffic(self) -> bool:
        return bool(len(self.ledger.fleet.live) or len(self._drivers.seen().rows))

    def _ready(self, subjects: tuple[int, ...], step: int) -> tuple[int, ...]:
        """Who is to be planned now: all, but for those who can go on to their station first.

        A strategy that is asked at entries plans vehicles before that, and so is asked about all.
        """
        if not self._asks_at_entry:
            return tuple(row for row in subjects if not self._goes_on_to_station(row, step))
        for row in subjects:
            self._moves_up_in_time(row, step, step)
        return subjects

    def _moves_up_in_time(self, row: int, step: int, before_step: int) -> None:
        """Moves a vehicle up whose stop would begin before a step, if it can."""
        if has_place_on_mainline(self.ledger.merge_time_s(row)):
            return
        if stop_starts_s(self.ledger.trajectory(row)) <= before_step * self._step_s:
            self._moves_up(row, step)

    def _commit(self, command: FollowTrajectory, step: int) -> None:
        row, merge_time_s = command.row, command.merge_time_s
        now_s, lane_change_s = step * self._step_s, command.lane_change_s
        self._commitments.change(row, command.pieces, merge_time_s, now_s, lane_change_s)
        if has_place_on_mainline(merge_time_s):
            self._wakes.planned(row)  # nothing is due any more at its decision station
        self._announce(row, step, lane_change_s)

    def _plan_when_due(self, row: int, pieces: FloatArray, step: int) -> None:
        due_s = decision_due_s(pieces, self._rules.road.decision_station_m)
        self._wakes.due(max(step, first_step_from(due_s, self._step_s)), row)

    def _goes_on_to_station(self, row: int, step: int) -> bool:
        """Whether a vehicle whose stop lay before its decision station can now go on towards it."""
        station_m, _ = station_and_speed(self.ledger.way(row), step * self._step_s)
        if station_m >= self._rules.road.decision_station_m or not self._moves_up(row, step):
            return False
        self._plan_when_due(row, self.ledger.trajectory(row), step + 1)
        return True

    def _moves_up(self, row: int, step: int) -> bool:
        """Whether a vehicle without a merge can go on to a stop further ahead, and now does."""
        time_s = step * self._step_s
        if has_place_on_mainline(self.ledger.merge_time_s(row)):
            return False
        from_s = time_s + self._rules.control.actuation_delay_s
        proposal = plan_moving_up(self.ledger.fleet, from_s, self._rules)
        moves = [
            FollowTrajectory(
                int(proposal.rows[k]), proposed(proposal, k), float(proposal.merge_time_s[k])
            )
            for k in range(int(proposal.size[0]))
        ]
        if not moves or not (self._asks_at_entry or row in [move.row for move in moves]):
            return False
        verdict = self._commitments.examiner.change(moves, time_s, from_s)
        if verdict.code != ACCEPTED:
            self._log.note_refused_entry(row, verdict.code, time_s)
            return False
        for move in moves:
            self._commit(move, step)
        return True

    def view(self, subjects: tuple[int, ...], step: int) -> View:
        """Returns what is known at a step."""
        time_s = step * self._step_s
        fleet = self.ledger.fleet
        return View(
            time_s,
            subjects,
            fleet,
            fleet,
            partial(self.ledger.reports, time_s),
            self._fastest_entry_mps,
            self._rules,
            self._packed,
            self._detectors,
            self._entrance.entries_since(self._told_of_entries),
            self._entrance.waiting_at(step),
            self._drivers.seen,
        )

    def _decide(self, subjects: tuple[int, ...], step: int) -> None:
        decision = self._strategy.decide(self.view(subjects, step), self._memory)
        self.carry_out(decision, subjects, step)

    def carry_out(self, decision: Decision, subjects: tuple[int, ...], step: int) -> None:
        """Commits what a decision commands, or what is safe instead, and notes its wakes."""
        time_s = step * self._step_s
        trajectories = [c for c in decision.commands if isinstance(c, FollowTrajectory)]
        if len(trajectories) < len(decision.commands):
            self._carry_out_others(decision.commands, step)
        margin_m = math.nan
        if trajectories:
            verdict = self._verdict_on(trajectories, time_s)
            if verdict.code != ACCEPTED:
                self.interventions += 1
                self._refuse(decision, subjects, step, verdict)
                return
            margin_m = verdict.least_margin_m
            for command in trajectories:
                self._commit(command, step)
        self._memory = decision.memory
        self._told_of_entries = len(self.ledger)
        self._log.note_decision(decision, trajectories, time_s, margin_m)
        for wake_s, row in decision.wakes_s:
            wake_step = first_step_from(wake_s, self._step_s)
            self._wakes.ask(wake_step, row)
            if self._asks_at_entry:
                self._moves_up_in_time(row, step, wake_step)
            elif wake_step > step:
                self._moves_up(row, step)

    def _carry_out_others(self, commands: Sequence[Command], step: int) -> None:
        given = sorted_by_taker(commands)
        without_signal = sum(not self._drivers.show(signal, step) for signal in given.signals)
        self.interventions += given.refused + without_signal
        if given.drives:
            self.drive(given.drives, step)

    def _verdict_on(self, trajectories: Sequence[FollowTrajectory], time_s: float) -> Verdict:
        earliest_s = time_s + self._rules.control.actuation_delay_s
        verdict = self._commitments.examiner.change(trajectories, time_s, earliest_s)
        if (
            verdict.code == ACCEPTED
            and not (self._holds_newcomers or self._rules.traffic.differs)
            and self._newcomers.are_held_up(self.ledger, trajectories, time_s)
        ):
            return verdict._replace(code=HOLDS_NEWCOMERS)
        return verdict

    def drive(self, commands: Sequence[DriveWithAcceleration], step: int) -> int:
        """Carries out what is safe of commanded accelerations; returns how many were refused."""
        carried_out = drive_safely(
            self._commitments,
            commands,
            step * self._step_s,
            self._fastest_entry_mps,
            self._packed,
        )
        for command, driven in zip(commands, carried_out, strict=True):
            if driven:
                self._announce(command.row, step)
        refused = len(commands) - sum(carried_out)
        self.interventions += refused
        return refused

    def _announce(self, row: int, step: int, lane_change_s: float = math.inf) -> None:
        """Tells who carries the vehicle, and when it is planned, of its new commitment."""
        pieces = self.ledger.trajectory(row)
        if self._plant is not None:
            self._plant.follow(row, pieces, self.ledger.merge_time_s(row), lane_change_s)
        if self._wakes.is_due(row):
            self._plan_when_due(row, pieces, step)

    def _refuse(
        self, decision: Decision, subjects: tuple[int, ...], step: int, verdict: Verdict
    ) -> None:
        time_s = step * self._step_s
        self._log.note_refused_plan(decision, subjects, verdict, time_s)
        retry_step = first_step_from(time_s + self._rules.control.retry_s, self._step_s)
        for row in subjects:
            self._wakes.ask(retry_step, row)
