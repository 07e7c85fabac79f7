"""When the strategy is asked next, and about which vehicles."""

import heapq

from coramp.coordination.gate import NEVER

PERIOD = -1
"""Stands for a vehicle's row where the strategy is woken by its own clock."""
ASKED, DUE = range(2)
"""Kinds of wakes: the strategy asked for it, or the vehicle reaches its decision station."""


class Wakes:
    """Steps at which the strategy is woken, each with the row of a vehicle.

    A vehicle has at most one step at which it is due. A new one replaces it, and none is left once
    the vehicle is planned; what it asked for itself stays. ``next_step`` is the earliest step of
    all, ``NEVER`` where there is none.
    """

    def __init__(self) -> None:
        self.next_step = NEVER
        self._heap: list[tuple[int, int, int]] = []
        self._due_step: dict[int, int] = {}

    def ask(self, step: int, row: int) -> None:
        """Has the strategy asked about a vehicle at a step."""
        self._push(step, row, ASKED)

    def due(self, step: int, row: int) -> None:
        """Has the strategy asked about a vehicle when it reaches its decision station."""
        self._due_step[row] = step
        self._push(step, row, DUE)

    def is_due(self, row: int) -> bool:
        """Returns whether a vehicle is yet to reach its decision station unplanned."""
        return row in self._due_step

    def planned(self, row: int) -> None:
        """Forgets when a vehicle is due."""
        self._due_step.pop(row, None)

    def tick(self, step: int, period_steps: int) -> bool:
        """Returns whether the strategy's own clock wakes it at a step, and sets it on if so."""
        if not self._heap or self._heap[0][:2] != (step, PERIOD):
            return False
        heapq.heapreplace(self._heap, (step + period_steps, PERIOD, ASKED))
        self.next_step = self._heap[0][0]
        return True

    def woken(self, step: int) -> tuple[int, ...]:
        """Takes and returns the rows that the strategy is asked about at a step, each once."""
        rows: dict[int, None] = {}
        heap = self._heap
        while heap and heap[0][0] == step:
            _, row, kind = heapq.heappop(heap)
            if kind == ASKED:
                rows[row] = None
            elif self._due_step.get(row) == step:  # else its way has changed since
                del self._due_step[row]
                rows[row] = None
        self.next_step = heap[0][0] if heap else NEVER
        return tuple(rows)

    def _push(self, step: int, row: int, kind: int) -> None:
        heapq.heappush(self._heap, (step, row, kind))
        self.next_step = self._heap[0][0]
