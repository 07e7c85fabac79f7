"""The order of merging by dynamic programming.

Source: H. Pei, S. Feng, Y. Zhang, D. Yao, "A cooperative driving strategy for merging at on-ramps
based on dynamic programming", IEEE Trans. Veh. Technol. 68(12):11646-11656, 2019.
"""

import math
from dataclasses import dataclass
from typing import ClassVar, NamedTuple

from coramp.strategies.base import Decision, Memory, View
from coramp.strategies.parameters import parameter
from coramp.strategies.sequence import Crossings, decide_in_sequence


class Label(NamedTuple):
    """A partial order: its last crossing, the sum of delays, and who crosses (True: ramp)."""

    last_s: float
    delay_s: float
    ramp: tuple[bool, ...]


@dataclass(frozen=True)
class DpSequence:
    """The order with the least ``w t_last + sum(t - t_min)`` over all vehicles in the zone.

    Each vehicle crosses at ``t = max(t_min, t_prev + h)``. The state is how many of each stream
    have crossed, and which stream was last; h is what the safe distance asks for, or a time
    of its own. Solved anew for each ramp vehicle at its decision; its place is then committed.
    """

    name: ClassVar[str] = "dp-sequence"
    summary: ClassVar[str] = "the order of merging with the least delay, by dynamic programming"
    cooperative: ClassVar[bool] = True

    same_stream_s: float = parameter(0.0, 0.0, 10.0, meaning="smallest headway h within a stream")
    cross_stream_s: float = parameter(0.0, 0.0, 10.0, meaning="smallest headway h between streams")
    last_weight: float = parameter(1.0, 0.0, 100.0, meaning="w, weight of the last crossing")

    def decide(self, view: View, memory: Memory) -> Decision:
        """Returns the decision for the first subject, in its place of the best order."""
        return decide_in_sequence(self.vehicles_before, view, memory)

    def vehicles_before(self, seen: Crossings) -> int:
        """Returns how many lane vehicles cross before the subject in the best order."""
        first = self.surely_first(seen)
        return first + self.best(behind(seen, first)).ramp.index(True)

    def surely_first(self, seen: Crossings) -> int:
        """Returns how many lane vehicles have crossed, in their order, before anyone else can.

        They keep nobody waiting by going first, so that the rest can be put in order by itself.
        """
        crosses_s, needs_s, first = -math.inf, 0.0, 0
        earliest_s = [*seen.mainline_s.tolist(), math.inf]
        for k in range(len(seen.mainline_s)):
            crosses_s = max(earliest_s[k], crosses_s + max(needs_s, self.same_stream_s))
            needs_s = float(seen.mainline_next_s[k])
            free_s = crosses_s + max(needs_s, self.same_stream_s, self.cross_stream_s)
            if free_s <= min(earliest_s[k + 1], float(seen.ramp_s[0])):
                first = k + 1
        return first

    def best(self, seen: Crossings) -> Label:
        """Returns the best order of all, by states of how many of each stream have crossed."""
        lanes, ramps = len(seen.mainline_s), len(seen.ramp_s)
        states: dict[tuple[int, int, bool], list[Label]] = {
            (0, 0, False): [Label(-float("inf"), 0.0, ())]
        }
        for _ in range(lanes + ramps):
            reached: dict[tuple[int, int, bool], list[Label]] = {}
            for (m, n, by_ramp), labels in states.items():
                for next_ramp in (False, True):
                    if (n if next_ramp else m) >= (ramps if next_ramp else lanes):
                        continue
                    key = (m + (not next_ramp), n + next_ramp, next_ramp)
                    grown = [
                        self._with_next(seen, label, m, n, by_ramp, next_ramp) for label in labels
                    ]
                    reached[key] = not_dominated(reached.get(key, []) + grown)
            states = reached
        ends = [label for labels in states.values() for label in labels]
        return min(ends, key=lambda label: (self.last_weight * label.last_s + label.delay_s, label))

    def _with_next(
        self, seen: Crossings, label: Label, m: int, n: int, by_ramp: bool, next_ramp: bool
    ) -> Label:
        earliest_s = float(seen.ramp_s[n] if next_ramp else seen.mainline_s[m])
        if label.ramp:
            needs_s = seen.ramp_next_s[n - 1] if by_ramp else seen.mainline_next_s[m - 1]
            least_s = self.same_stream_s if by_ramp == next_ramp else self.cross_stream_s
            crosses_s = max(earliest_s, label.last_s + max(float(needs_s), least_s))
        else:
            crosses_s = earliest_s
        delay_s = label.delay_s + crosses_s - earliest_s
        return Label(crosses_s, delay_s, (*label.ramp, next_ramp))


def behind(seen: Crossings, first: int) -> Crossings:
    """Returns what is left once the first lane vehicles have crossed."""
    return Crossings(
        seen.mainline_s[first:], seen.ramp_s, seen.mainline_next_s[first:], seen.ramp_next_s
    )


def not_dominated(labels: list[Label]) -> list[Label]:
    """Returns the labels than which no other has crossed as early with as little delay."""
    kept: list[Label] = []
    for label in sorted(labels):
        if not kept or label.delay_s < kept[-1].delay_s:
            kept.append(label)
    return kept
