"""The entrance: who asks to enter is let in; the strategy's wakes and the plant are told of it."""

from collections.abc import Callable
from functools import partial
from typing import NamedTuple

from coramp._kernel import IntArray
from coramp.checker.reasons import ACCEPTED
from coramp.coordination.commitments import Commitments
from coramp.coordination.decision_log import DecisionLog
from coramp.coordination.gate import (
    DONE,
    FULL,
    HEARD,
    NEVER,
    REFUSED,
    WAITS,
    admit_until,
    enter,
    entries_of,
    gate_for,
    next_step,
    open_gate,
    waiting_at,
    with_feed,
)
from coramp.coordination.plant import Plant
from coramp.coordination.wakes import Wakes
from coramp.messages.feed import RequestFeed
from coramp.road.rules import Rules, packed
from coramp.strategies.base import Entered, EntryPolicy, Waiting


class Listeners(NamedTuple):
    """Who is told of entries, and of those that are refused."""

    wakes: Wakes
    log: DecisionLog
    plant: Plant | None


class Entrance:
    """Lets in those whose requests a feed holds, each stream in its order.

    Of the ``listeners`` the wakes are told when a vehicle is to be planned, the plant whom it is to
    carry, the log what the checker refuses.
    """

    def __init__(
        self,
        feed: RequestFeed,
        policy: EntryPolicy,
        rules: Rules,
        commitments: Commitments,
        listeners: Listeners,
    ) -> None:
        slowest_mps = policy.slowest_share * rules.road.mainline_speed_mps
        self._gate = gate_for(feed, policy.asked, slowest_mps, rules.road.lanes)
        self._feed, self._asks = feed, policy.asked
        self._rules, self._packed = rules, packed(rules)
        self._step_s = rules.control.step_s
        self._commitments, self._ledger = commitments, commitments.ledger
        self._wakes, self._log, self._plant = listeners
        self._announced = 0

    def open(self) -> None:
        """Lets every request be heard at its step."""
        open_gate(self._gate)

    @property
    def next_step(self) -> int:
        """The step at which the next vehicle tries to enter."""
        return next_step(self._gate)

    def admit(self, last_step: int) -> None:
        """Lets in whoever is due by ``last_step`` or by the first decision that comes of it."""
        self._gate = with_feed(self._gate, self._feed)
        while True:
            stop = admit_until(
                self._ledger.book,
                self._commitments.examiner.record,
                self._gate,
                last_step,
                self._packed,
                self._commitments.examiner.bounds,
            )
            last_step = min(last_step, self._announce())
            if stop.why == DONE:
                return
            if stop.why == FULL:
                self._commitments.make_room()
            elif stop.why == REFUSED:
                self._note_refused_entry(stop.step, stop.code)

    def _announce(self) -> int:
        """Tells who has entered; returns the first step at which one of them is planned."""
        new = slice(self._announced, len(self._ledger))
        self._announced, first_due = new.stop, NEVER
        self._tell_plant(new)
        if self._asks:
            for row in range(new.start, new.stop):
                if self._ledger.lane(row) > 0:
                    continue
                step = int(self._gate.row_step[row])
                self._wakes.ask(step, row)
                first_due = min(first_due, step)
        for row, due in enumerate(self._gate.row_due_step[new].tolist(), new.start):
            if due != NEVER:
                self._wakes.due(due, row)
                first_due = min(first_due, due)
        return first_due

    def _tell_plant(self, new: slice) -> None:
        if self._plant is None:
            return
        gate, ledger = self._gate, self._ledger
        columns = (gate.row_arrival[new].tolist(), gate.row_step[new].tolist())
        for row, (arrival, step) in enumerate(zip(*columns, strict=True), new.start):
            self._plant.advance(step)
            self._plant.enter(row, self._feed[arrival], step)
            self._plant.follow(row, ledger.trajectory(row), ledger.merge_time_s(row))

    def entered(self) -> tuple[IntArray, IntArray]:
        """Returns, a row each, which arrival it is and at which step it entered."""
        count = len(self._ledger)
        return self._gate.row_arrival[:count], self._gate.row_step[:count]

    def waiting(self) -> list[int]:
        """Returns the requests (by number) that have been heard and have not entered."""
        return sorted(set(range(int(self._gate.feed[HEARD]))) - set(self.entered()[0].tolist()))

    def place(self, number: int, station_m: float, step: int) -> bool:
        """Puts who asks to enter on the road, from that station; False where that is not safe."""
        self._commitments.make_room()
        code = enter(
            self._ledger.book,
            self._commitments.examiner.record,
            self._gate,
            number,
            station_m,
            step,
            self._rules,
            self._commitments.examiner.bounds,
        )
        if code not in (ACCEPTED, WAITS):
            self._note_refused_entry(step, code)
        self._announce()
        return bool(code == ACCEPTED)

    def _note_refused_entry(self, step: int, code: int) -> None:
        self._log.note_refused_entry(len(self._ledger), code, step * self._step_s)

    def entries_since(self, first_row: int) -> Callable[[], tuple[Entered, ...]]:
        """Returns what tells who has entered from that row of the ledger on, up to now."""
        return partial(entries_of, self._gate, range(first_row, len(self._ledger)), self._step_s)

    def waiting_at(self, step: int) -> Callable[[], Waiting]:
        """Returns what tells who waits outside at a step."""
        return partial(waiting_at, self._gate, step, self._step_s)
