"""A link that delivers messages late, twice, out of order or not at all."""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from coramp._kernel import BoolArray, FloatArray, IntArray
from coramp.scenarios.world_sections import Link

ROUNDING_S = 1e-9


@dataclass
class LossyLink:
    """Carries rows of numbers, a column ``(number of the vehicle, ...)`` each, between two ends.

    ``vehicles`` is how many there are: each has a state of its own where losses come in bursts.
    ``random_of`` returns random numbers by a fault's name. Each time is drawn for all vehicles,
    whoever sends, so that neither another fault nor who is on the road changes a vehicle's draws.
    """

    section: Link
    vehicles: int
    random_of: Callable[[str], np.random.Generator]
    sent: int = 0
    lost: int = 0
    _lost_last: tuple[float, IntArray] = (np.nan, np.empty(0, np.int64))
    _due_s: FloatArray = field(default_factory=lambda: np.empty(0))
    _rows: FloatArray = field(default_factory=lambda: np.empty((0, 0)))
    _bad: BoolArray = field(init=False)
    _asked_s: FloatArray = field(init=False)
    _loss: np.random.Generator = field(init=False)
    _twice: np.random.Generator = field(init=False)
    _delay: np.random.Generator = field(init=False)
    _delay_of_second: np.random.Generator = field(init=False)

    def __post_init__(self) -> None:
        """Every link begins in a good phase."""
        self._bad = np.zeros(self.vehicles, np.bool_)
        self._asked_s = np.zeros(self.vehicles)
        self._loss, self._twice = self.random_of("loss"), self.random_of("duplicates")
        self._delay, self._delay_of_second = self.random_of("delay"), self.random_of("delay twice")

    def send(self, now_s: float, rows: FloatArray) -> None:
        """Sends rows at a time; what is lost, late or doubled is drawn now."""
        number = rows[:, 0].astype(np.int64)
        arrives = ~self._lost(now_s, number)
        self.sent += len(rows)
        self.lost += int((~arrives).sum())
        self._lost_last = now_s, number[~arrives]
        due_s = [now_s + self._latency_s(self._delay, number)[arrives]]
        kept = [rows[arrives]]
        if self.section.duplicates > 0.0:
            twice = self._twice.random(self.vehicles)[number] < self.section.duplicates
            twice &= arrives
            due_s.append(now_s + self._latency_s(self._delay_of_second, number)[twice])
            kept.append(rows[twice])
        waiting = self._rows.reshape(-1, rows.shape[1])
        self._due_s = np.concatenate([self._due_s, *due_s])
        self._rows = np.concatenate([waiting, *kept])

    def lost_at(self, now_s: float) -> IntArray:
        """Returns whose messages of this time are lost."""
        sent_s, number = self._lost_last
        return number if sent_s == now_s else number[:0]

    def received(self, now_s: float) -> FloatArray:
        """Returns the rows that have arrived since this was last asked, in order of arrival."""
        there = self._due_s <= now_s + ROUNDING_S
        order = np.argsort(self._due_s[there], kind="stable")
        rows = self._rows[there][order]
        self._due_s, self._rows = self._due_s[~there], self._rows[~there]
        return rows

    def _latency_s(self, random: np.random.Generator, number: IntArray) -> FloatArray:
        section = self.section
        if section.delay_shape is None or section.delay_s == 0.0:
            return np.full(len(number), section.delay_s)
        scale_s = section.delay_s / section.delay_shape
        return np.asarray(random.gamma(section.delay_shape, scale_s, self.vehicles)[number])

    def _lost(self, now_s: float, number: IntArray) -> BoolArray:
        """Which messages are lost: each for itself, or all in a bad phase of a vehicle's link.

        Phases are exponential: bad ones last b on average, good ones b (1 - p) / p, so that a share
        p of the time is bad. Over t a phase changes as in a Markov chain of these two rates.
        """
        section = self.section
        if section.loss == 0.0:
            return np.zeros(len(number), np.bool_)
        if section.burst_s is None:
            return np.asarray(self._loss.random(self.vehicles)[number] < section.loss)
        rate_ps = 1.0 / section.burst_s + section.loss / (section.burst_s * (1.0 - section.loss))
        forgets = np.exp(-rate_ps * (now_s - self._asked_s[number]))
        was_bad = self._bad[number].astype(np.float64)
        chance = section.loss + (was_bad - section.loss) * forgets
        bad = self._loss.random(self.vehicles)[number] < chance
        self._bad[number], self._asked_s[number] = bad, now_s
        return np.asarray(bad)
