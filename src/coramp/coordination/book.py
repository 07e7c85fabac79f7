"""The ledger's arrays, and what kernels do with them.

Pieces are only ever appended: a new commitment gets a new block, and the old block stays as the
record of what was promised before. Rows are numbered in the order of entry.
"""

import math
from typing import NamedTuple

import numpy as np

from coramp._kernel import BoolArray, FloatArray, IntArray, kernel
from coramp.kinematics.trajectory import (
    MAX_PIECES,
    intercept_range_m,
    station_and_speed,
    time_at_station,
)
from coramp.vehicles.fleet import Fleet, committed

ROWS, PIECES, LIVE, BLOCKS = range(4)
"""Places in ``Book.used``."""


class Book(NamedTuple):
    """All commitments, with room to spare; ``used`` tells how much of what is in use.

    The first fields are those of ``Fleet``. ``exit_s`` is when a row's front leaves the zone,
    infinity while it would stop before. Block b is a commitment of ``block_row[b]``.
    """

    pieces: FloatArray
    first_piece: IntArray
    piece_count: IntArray
    length_m: FloatArray
    merge_time_s: FloatArray
    lowest_m: FloatArray
    highest_m: FloatArray
    exit_s: FloatArray
    adjustable: BoolArray
    live: IntArray
    block_row: IntArray
    block_first: IntArray
    block_count: IntArray
    used: IntArray


def empty_book(rows: int, pieces: int) -> Book:
    """Returns a book with room for so many rows and pieces."""
    return Book(
        np.empty((pieces, 4)),
        np.zeros(rows, np.int64),
        np.zeros(rows, np.int64),
        np.zeros(rows),
        np.full(rows, math.inf),
        np.full(rows, -math.inf),
        np.full(rows, math.inf),
        np.full(rows, math.inf),
        np.zeros(rows, np.bool_),
        np.zeros(rows, np.int64),
        np.zeros(2 * rows, np.int64),
        np.zeros(2 * rows, np.int64),
        np.zeros(2 * rows, np.int64),
        np.zeros(4, np.int64),
    )


def with_room(book: Book, commitments: int = 1) -> Book:
    """Returns the book, or one with more room where fewer commitments fit than that."""
    rows, pieces = len(book.live), len(book.pieces)
    while is_full(book.used, rows, 2 * rows, pieces, commitments):
        rows, pieces = 2 * rows, 2 * pieces + MAX_PIECES
    if rows == len(book.live):
        return book
    larger = empty_book(rows, pieces)
    for old, new in zip(book, larger, strict=True):
        new[: len(old)] = old
    return larger


@kernel
def is_full(used: IntArray, rows: int, blocks: int, pieces: int, commitments: int = 1) -> bool:
    """Returns whether so much room may be too little for one more row, or so many commitments."""
    return bool(
        used[ROWS] >= rows
        or used[BLOCKS] + commitments > blocks
        or used[PIECES] + commitments * MAX_PIECES > pieces
    )


@kernel
def fleet_of(book: Book) -> Fleet:
    """Returns all commitments as planners read them."""
    return Fleet(
        book.pieces,
        book.first_piece,
        book.piece_count,
        book.length_m,
        book.merge_time_s,
        book.lowest_m,
        book.highest_m,
        book.adjustable,
        book.live[: book.used[LIVE]],
    )


@kernel
def add_row(book: Book, length_m: float, on_ramp: bool) -> int:
    """Makes room for a vehicle that is about to enter; returns its row.

    It counts as on the road only with its first commitment.
    """
    row = book.used[ROWS]
    book.length_m[row] = length_m
    book.merge_time_s[row] = math.inf if on_ramp else -math.inf
    book.adjustable[row] = True
    book.used[ROWS] += 1
    return int(row)


@kernel
def write_commitment(
    book: Book,
    row: int,
    pieces: FloatArray,
    merge_time_s: float,
    cruise_speed_mps: float,
    zone_end_m: float,
) -> None:
    """Records that ``row`` follows ``pieces`` from their first time on."""
    start, count = book.used[PIECES], len(pieces)
    book.pieces[start : start + count] = pieces
    entering = book.piece_count[row] == 0
    book.first_piece[row] = start
    book.piece_count[row] = count
    book.merge_time_s[row] = merge_time_s
    book.exit_s[row] = time_at_station(pieces, zone_end_m)
    if merge_time_s < math.inf:
        from_s = max(pieces[0, 0], merge_time_s)
        lowest_m, highest_m = intercept_range_m(pieces, from_s, cruise_speed_mps)
        book.lowest_m[row], book.highest_m[row] = lowest_m, highest_m
    block = book.used[BLOCKS]
    book.block_row[block], book.block_first[block], book.block_count[block] = row, start, count
    book.used[BLOCKS] += 1
    book.used[PIECES] += count
    if entering:
        book.live[book.used[LIVE]] = row
        book.used[LIVE] += 1


@kernel
def strike_exited(book: Book, time_s: float) -> None:
    """Takes vehicles off the live list that have left the zone by ``time_s``."""
    kept = 0
    for k in range(book.used[LIVE]):
        if book.exit_s[book.live[k]] > time_s:
            book.live[kept] = book.live[k]
            kept += 1
    book.used[LIVE] = kept


@kernel
def states_of_live(book: Book, time_s: float) -> tuple[FloatArray, FloatArray]:
    """Returns stations (m) and speeds (m/s) of the live vehicles as they promised them."""
    fleet = fleet_of(book)
    stations_m = np.empty(len(fleet.live))
    speeds_mps = np.empty(len(fleet.live))
    for k in range(len(fleet.live)):
        stations_m[k], speeds_mps[k] = station_and_speed(committed(fleet, fleet.live[k]), time_s)
    return stations_m, speeds_mps
