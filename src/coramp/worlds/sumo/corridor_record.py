"""What is kept of a corridor's run as it goes on: who passed which zone, who was handed over.

Rows are added as vehicles leave a zone. What is kept of positions is that of who is in a zone.
"""

from array import array
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from coramp._kernel import BoolArray, FloatArray, IntArray
from coramp.worlds.sumo.mixed_plant import NO_SITE
from coramp.worlds.sumo.network import RAMP_LANE

HARD_MPS2 = 3.0
STOPPED_MPS = 0.1
PASSAGE = (
    "site", "number", "on_ramp", "entered_s", "left_s", "merged_s", "hard_brakings", "stopped",
    "changes",
)  # fmt: skip
HAND_OVER = ("time_s", "number", "site", "enters", "station_m", "lane", "speed_mps")


@dataclass
class CorridorRecord:
    """Who is in which zone, and the rows of those that have left; arrays have one entry a vehicle.

    ``changes`` counts how often a vehicle changed to a lane further in by command, its merge aside.
    """

    count: int
    period_s: float
    passages: "array[float]" = field(default_factory=lambda: array("d"))
    hand_overs: "array[float]" = field(default_factory=lambda: array("d"))
    _inside: IntArray = field(default_factory=lambda: np.empty(0, np.int64))
    _inside_at: IntArray = field(default_factory=lambda: np.empty(0, np.int64))
    _site: IntArray = field(init=False)
    _next_site: IntArray = field(init=False)
    _entered_s: FloatArray = field(init=False)
    _merged_s: FloatArray = field(init=False)
    _was_mps: FloatArray = field(init=False)
    _on_ramp: BoolArray = field(init=False)
    _braking: BoolArray = field(init=False)
    _stopped: BoolArray = field(init=False)
    _hard: IntArray = field(init=False)
    _changes: IntArray = field(init=False)

    def __post_init__(self) -> None:
        """Nobody is in any zone yet."""
        count = self.count
        self._site, self._next_site = np.full(count, NO_SITE), np.full(count, NO_SITE)
        self._entered_s, self._merged_s = np.full(count, np.nan), np.full(count, np.nan)
        self._was_mps = np.full(count, np.nan)
        self._on_ramp, self._braking = np.zeros(count, np.bool_), np.zeros(count, np.bool_)
        self._stopped = np.zeros(count, np.bool_)
        self._hard, self._changes = np.zeros(count, np.int64), np.zeros(count, np.int64)

    def look(
        self,
        now_s: float,
        site: IntArray,
        number: IntArray,
        lane: IntArray,
        speed_mps: FloatArray,
        beyond_start_m: FloatArray,
    ) -> None:
        """Notes who is in which zone now; ``beyond_start_m`` is how far each is beyond its start.

        Vehicles are in the order of sites, and of numbers in each zone. Of those that have
        ``gone``, it must have been noted that they ``leave``.
        """
        new = self._site[number] != site
        self._enter(now_s, number[new], lane[new], speed_mps[new], beyond_start_m[new])
        self._site[self._inside] = NO_SITE
        self._site[number] = site
        self._inside, self._inside_at = number, site
        since_mps = speed_mps - self._was_mps[number]
        hard = since_mps < -HARD_MPS2 * self.period_s
        self._hard[number] += hard & ~self._braking[number]
        self._braking[number] = hard
        self._stopped[number] |= speed_mps < STOPPED_MPS
        merged = self._on_ramp[number] & (lane > RAMP_LANE) & np.isnan(self._merged_s[number])
        self._merged_s[number[merged]] = now_s
        self._was_mps[number] = speed_mps

    def _enter(
        self,
        now_s: float,
        number: IntArray,
        lane: IntArray,
        speed_mps: FloatArray,
        beyond_start_m: FloatArray,
    ) -> None:
        ago_s = beyond_start_m / np.maximum(speed_mps, STOPPED_MPS)
        self._entered_s[number] = now_s - np.clip(ago_s, 0.0, self.period_s)
        self._merged_s[number], self._was_mps[number] = np.nan, speed_mps
        self._on_ramp[number] = lane == RAMP_LANE
        self._braking[number] = self._stopped[number] = False
        self._hard[number] = self._changes[number] = 0

    def gone(self, site: IntArray, number: IntArray) -> list[tuple[int, int]]:
        """Returns who was in a zone at the last look, and is not in it now: numbers and sites.

        ``number`` and ``site`` are who is in which zone now.
        """
        now = self._next_site
        now[number] = site
        left = now[self._inside] != self._inside_at
        now[number] = NO_SITE
        return list(zip(self._inside[left].tolist(), self._inside_at[left].tolist(), strict=True))

    def site_of(self, number: IntArray) -> IntArray:
        """Returns in which zone these vehicles were at the last look, ``NO_SITE`` for none."""
        return np.asarray(self._site[number])

    def leave(self, now_s: float, site: int, number: int, beyond_end_m: float) -> None:
        """Notes that a vehicle has left a zone, and how far (m) it is beyond the zone's end."""
        ago_s = beyond_end_m / max(self._was_mps[number], STOPPED_MPS)
        self._add(site, number, now_s - min(max(ago_s, 0.0), self.period_s))

    def change(self, number: Sequence[int]) -> None:
        """Notes who changes to a lane further in by command."""
        self._changes[list(number)] += 1

    def hand_over(
        self, now_s: float, number: int, site: int, enters: bool, place: tuple[float, float, float]
    ) -> None:
        """Notes that a coordinator takes over a vehicle or leaves it: its station, lane, speed."""
        self.hand_overs.extend((now_s, number, site, enters, *place))

    def end(self) -> None:
        """Notes who is still in a zone at the end of a run; that it left is not known."""
        for number, site in zip(self._inside.tolist(), self._inside_at.tolist(), strict=True):
            self._add(site, number, np.nan)
        self._inside, self._inside_at = self._inside[:0], self._inside_at[:0]

    def _add(self, site: int, number: int, left_s: float) -> None:
        self.passages.extend(
            (
                site,
                number,
                self._on_ramp[number],
                self._entered_s[number],
                left_s,
                self._merged_s[number],
                self._hard[number],
                self._stopped[number],
                self._changes[number],
            )
        )

    def table(self, rows: "array[float]", columns: Sequence[str]) -> dict[str, FloatArray]:
        """Returns rows as columns."""
        found = np.array(rows, np.float64).reshape(-1, len(columns))
        return {name: found[:, k] for k, name in enumerate(columns)}
