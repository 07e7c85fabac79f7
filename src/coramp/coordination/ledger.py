"""The ledger of commitments: what every vehicle has promised to drive, in arrays.

Pieces are only ever appended: a new commitment gets a new block, and the old block stays as the
record of what was promised before. Rows are numbered in the order of entry.
"""

import math
from dataclasses import dataclass

import numpy as np

from coramp._kernel import BoolArray, FloatArray, IntArray, kernel
from coramp.core.fleet import Fleet, committed
from coramp.core.trajectory import intercept_range_m, station_and_speed, time_at_station
from coramp.strategies.base import Reports


@dataclass(frozen=True, slots=True)
class Commitment:
    """One block of pieces that a row has committed to, valid from its first piece's time."""

    row: int
    first_piece: int
    piece_count: int
    merge_time_s: float


class Ledger:
    """Holds all commitments of a run."""

    def __init__(self, cruise_speed_mps: float, zone_end_m: float) -> None:
        self._cruise_speed_mps = cruise_speed_mps
        self._zone_end_m = zone_end_m
        self._pieces: FloatArray = np.empty((4096, 4))
        self._pieces_used = 0
        self._rows = 0
        self._first: IntArray = np.zeros(512, np.int64)
        self._count: IntArray = np.zeros(512, np.int64)
        self._length_m: FloatArray = np.zeros(512)
        self._merge_s: FloatArray = np.full(512, math.inf)
        self._lowest_m: FloatArray = np.full(512, -math.inf)
        self._highest_m: FloatArray = np.full(512, math.inf)
        self._exit_s: FloatArray = np.full(512, math.inf)
        self._adjustable: BoolArray = np.zeros(512, np.bool_)
        self._live: IntArray = np.zeros(512, np.int64)
        self._live_count = 0
        self._fleet: Fleet | None = None
        self.history: list[Commitment] = []

    def __len__(self) -> int:
        return self._rows

    @property
    def fleet(self) -> Fleet:
        """All commitments as planners read them."""
        if self._fleet is None:
            self._fleet = Fleet(
                self._pieces,
                self._first,
                self._count,
                self._length_m,
                self._merge_s,
                self._lowest_m,
                self._highest_m,
                self._adjustable,
                self._live[: self._live_count],
            )
        return self._fleet

    def add(self, length_m: float, on_ramp: bool) -> int:
        """Makes room for a cooperative vehicle that is about to enter; returns its row.

        It counts as on the road only with its first commitment.
        """
        row = self._rows
        if row == len(self._length_m):
            self._grow_rows()
        self._length_m[row] = length_m
        self._merge_s[row] = math.inf if on_ramp else -math.inf
        self._adjustable[row] = True
        self._rows += 1
        return row

    def withdraw(self, row: int) -> None:
        """Takes back the last ``add`` of a vehicle that could not enter."""
        if row != self._rows - 1 or self._count[row]:
            raise ValueError("only the newest row without a commitment can be withdrawn")
        self._rows -= 1

    def commit(self, row: int, pieces: FloatArray, merge_time_s: float) -> None:
        """Records that ``row`` follows ``pieces`` from their first time on."""
        count = len(pieces)
        while self._pieces_used + count > len(self._pieces):
            self._pieces = np.concatenate([self._pieces, np.empty_like(self._pieces)])
            self._fleet = None
        first = self._pieces_used
        entering = self._count[row] == 0
        _store(
            self._pieces,
            first,
            pieces,
            row,
            merge_time_s,
            self._cruise_speed_mps,
            self._zone_end_m,
            self._first,
            self._count,
            self._merge_s,
            self._lowest_m,
            self._highest_m,
            self._exit_s,
        )
        self._pieces_used += count
        self.history.append(Commitment(row, first, count, merge_time_s))
        if entering:
            if self._live_count == len(self._live):
                self._live = np.concatenate([self._live, np.zeros_like(self._live)])
            self._live[self._live_count] = row
            self._live_count += 1
            self._fleet = None

    def forget_exited(self, time_s: float) -> None:
        """Takes vehicles off the live list that have left the zone by ``time_s``."""
        kept = _keep_live(self._live, self._live_count, self._exit_s, time_s)
        if kept != self._live_count:
            self._live_count = kept
            self._fleet = None

    def reports(self, time_s: float) -> Reports:
        """Returns what the live vehicles would report of themselves: exactly what they promised."""
        station_m, speed_mps = _states(self.fleet, time_s)
        return Reports(
            np.full_like(station_m, time_s), station_m, speed_mps, np.zeros_like(station_m)
        )

    def exit_time_s(self, row: int) -> float:
        """Returns when the vehicle's front leaves the zone, infinity while it would stop before."""
        return float(self._exit_s[row])

    def merge_time_s(self, row: int) -> float:
        """Returns the committed merge time (s): infinity for none, -infinity on the mainline."""
        return float(self._merge_s[row])

    def trajectory(self, row: int) -> FloatArray:
        """Returns what ``row`` has committed to, shape (n, 4); empty before it enters."""
        first = self._first[row]
        return self._pieces[first : first + self._count[row]]

    def block(self, commitment: Commitment) -> FloatArray:
        """Returns the pieces of any commitment of the history."""
        first = commitment.first_piece
        return self._pieces[first : first + commitment.piece_count]

    def _grow_rows(self) -> None:
        for name, fill in (
            ("_first", 0),
            ("_count", 0),
            ("_length_m", 0.0),
            ("_merge_s", math.inf),
            ("_lowest_m", -math.inf),
            ("_highest_m", math.inf),
            ("_exit_s", math.inf),
            ("_adjustable", False),
        ):
            old = getattr(self, name)
            setattr(self, name, np.concatenate([old, np.full_like(old, fill)]))
        self._fleet = None


@kernel
def _store(
    arena: FloatArray,
    first_piece: int,
    pieces: FloatArray,
    row: int,
    merge_time_s: float,
    cruise_speed_mps: float,
    zone_end_m: float,
    first: IntArray,
    count: IntArray,
    merge_s: FloatArray,
    lowest_m: FloatArray,
    highest_m: FloatArray,
    exit_s: FloatArray,
) -> None:
    n = len(pieces)
    arena[first_piece : first_piece + n] = pieces
    first[row] = first_piece
    count[row] = n
    merge_s[row] = merge_time_s
    exit_s[row] = time_at_station(pieces, zone_end_m)
    if merge_time_s < math.inf:
        from_s = max(pieces[0, 0], merge_time_s)
        lowest_m[row], highest_m[row] = intercept_range_m(pieces, from_s, cruise_speed_mps)


@kernel
def _states(fleet: Fleet, time_s: float) -> tuple[FloatArray, FloatArray]:
    stations_m = np.empty(len(fleet.live))
    speeds_mps = np.empty(len(fleet.live))
    for k in range(len(fleet.live)):
        stations_m[k], speeds_mps[k] = station_and_speed(committed(fleet, fleet.live[k]), time_s)
    return stations_m, speeds_mps


@kernel
def _keep_live(live: IntArray, count: int, exit_s: FloatArray, time_s: float) -> int:
    kept = 0
    for k in range(count):
        if exit_s[live[k]] > time_s:
            live[kept] = live[k]
            kept += 1
    return kept
