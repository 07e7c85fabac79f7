"""How long a strategy takes to decide."""

import time
from statistics import quantiles
from typing import Any

from coramp.mixed.situation import MixedSituation, Places, Steering
from coramp.strategies.base import (
    Decider,
    Decision,
    Memory,
    View,
    entry_policy_of,
    is_metered,
    period_of,
)


class Timed:
    """A strategy, and the wall time of each of its decisions."""

    def __init__(self, strategy: Decider) -> None:
        self.period_s = period_of(strategy)
        self.metered = is_metered(strategy)
        self.entry_policy = entry_policy_of(strategy)
        self._strategy = strategy
        self._taken_s: list[float] = []

    def decide(self, view: View, memory: Memory) -> Decision:
        """Returns what the strategy decides."""
        started = time.perf_counter()
        try:
            return self._strategy.decide(view, memory)
        finally:
            self._taken_s.append(time.perf_counter() - started)

    @property
    def decision_s(self) -> float:
        """The time (s) between two decisions of a strategy for mixed traffic."""
        return float(getattr(self._strategy, "decision_s"))  # noqa: B009 - not all have it

    def steer(self, situation: MixedSituation, places: Places) -> Steering:
        """Returns what a strategy for mixed traffic answers."""
        started = time.perf_counter()
        try:
            steers: Any = self._strategy
            answer: Steering = steers.steer(situation, places)
            return answer
        finally:
            self._taken_s.append(time.perf_counter() - started)

    def planning_times_s(self) -> tuple[float | None, float | None]:
        """Returns median and 95th percentile (s) of a decision; None where there was none."""
        if len(self._taken_s) < 2:
            only = self._taken_s[0] if self._taken_s else None
            return only, only
        cuts = quantiles(self._taken_s, n=20, method="inclusive")
        return cuts[9], cuts[18]
