"""The ledger of commitments: what every vehicle has promised to drive."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from coramp._kernel import FloatArray
from coramp.coordination.book import (
    BLOCKS,
    INNER,
    LIVE,
    ROWS,
    Book,
    empty_book,
    states_of_live,
    with_room,
)
from coramp.strategies.base import Reports
from coramp.vehicles.fleet import Fleet


@dataclass(frozen=True, slots=True)
class Commitment:
    """What a row committed to at some time, valid from its first piece's time."""

    row: int
    pieces: FloatArray


class Ledger:
    """Holds all commitments of a run. ``book`` is for kernels; it is replaced as it grows.

    Only ``commitments`` writes into it.
    """

    def __init__(self, vehicles: int = 0) -> None:
        rows = max(16, vehicles)
        self.book: Book = empty_book(rows, 2 * rows, 8 * rows)

    def __len__(self) -> int:
        return int(self.book.used[ROWS])

    @property
    def fleet(self) -> Fleet:
        """All commitments as planners read them."""
        book = self.book
        live, inner = book.live[: book.used[LIVE]], book.inner[: book.used[INNER]]
        return Fleet(*book[:7], live, book.lane, book.change_s, inner)

    @property
    def history(self) -> Iterator[Commitment]:
        """All commitments ever made, in their order.

        Of those that another one replaced a very long run keeps only what was driven.
        """
        book = self.book
        for block in range(book.used[BLOCKS]):
            first = book.block_first[block]
            pieces = book.pieces[first : first + book.block_count[block]]
            yield Commitment(int(book.block_row[block]), pieces)

    def make_room(self, commitments: int = 1) -> None:
        """Makes sure that one more row and so many commitments fit into the book."""
        self.book = with_room(self.book, commitments)

    def reports(self, time_s: float) -> Reports:
        """Returns what the live vehicles would report of themselves: exactly what they promised."""
        station_m, speed_mps = states_of_live(self.book, time_s)
        return Reports(
            np.full_like(station_m, time_s), station_m, speed_mps, np.zeros_like(station_m)
        )

    def exit_time_s(self, row: int) -> float:
        """Returns when the vehicle's front leaves the zone, infinity while it would stop before."""
        return float(self.book.exit_s[row])

    def merge_time_s(self, row: int) -> float:
        """Returns the committed merge time (s), as ``vehicles.merge_state`` reads it."""
        return float(self.book.merge_time_s[row])

    def lane(self, row: int) -> int:
        """Returns the mainline's lane by which a vehicle came, 0 for the outermost and the ramp."""
        return int(self.book.lane[row])

    def length_m(self, row: int) -> float:
        """Returns the length (m) of a vehicle."""
        return float(self.book.length_m[row])

    def trajectory(self, row: int) -> FloatArray:
        """Returns what ``row`` committed to last, shape (n, 4); empty before it enters.

        It begins when that takes over: later than the decision by the actuation delay.
        """
        first = self.book.first_piece[row]
        return self.book.pieces[first : first + self.book.piece_count[row]]

    def way(self, row: int) -> FloatArray:
        """Returns what ``row`` drives from its last decision on, shape (n, 4)."""
        first = self.book.way_first[row]
        return self.book.pieces[first : first + self.book.way_count[row]]
