"""The ledger's arrays, and what kernels do with them.

Pieces are only ever appended: a new commitment gets a new block, and the old block stays as the
record of what was promised before. Rows are numbered in the order of entry.
"""

import math
from typing import NamedTuple

import numpy as np

from coramp._kernel import FloatArray, IntArray, kernel
from coramp.kinematics.trajectory import (
    MAX_PIECES,
    TIME,
    intercept_range_m,
    piece_at,
    station_and_speed,
    time_at_station,
)
from coramp.road.lanes import LANE_CHANGE_LASTS_S
from coramp.vehicles.fleet import Fleet, committed
from coramp.vehicles.merge_state import NOT_PLANNED_S, has_place_on_mainline
from coramp.vehicles.traits import Traits

ROWS, PIECES, LIVE, BLOCKS, MOST_PIECES, INNER = range(6)
"""Places in ``Book.used``; the last but one is the largest ``way_count`` that there has been."""
LONG = 500_000
"""From so many pieces on (16 MB) a book is made to forget what was never driven."""


class Book(NamedTuple):
    """All commitments, with room to spare; ``used`` tells how much of what is in use.

    The first fields are those of ``Fleet``. ``way_first`` and ``way_count`` are all that a row
    drives from its last decision on: before the pieces of its last commitment come those of earlier
    ones that it drives until that takes over, which is later by the actuation delay. ``exit_s`` is
    when a row's front leaves the zone, infinity while it would stop before. Block b is a commitment
    of ``block_row[b]``. ``lane``, ``change_s`` and ``inner`` are those of ``Fleet``, too.
    """

    pieces: FloatArray
    first_piece: IntArray
    piece_count: IntArray
    length_m: FloatArray
    merge_time_s: FloatArray
    intercepts_m: FloatArray
    traits: FloatArray
    exit_s: FloatArray
    way_first: IntArray
    way_count: IntArray
    live: IntArray
    block_row: IntArray
    block_first: IntArray
    block_count: IntArray
    lane: IntArray
    change_s: FloatArray
    inner: IntArray
    used: IntArray


def empty_book(rows: int, blocks: int, pieces: int) -> Book:
    """Returns a book with room for so many rows, commitments and pieces."""
    return Book(
        np.empty((pieces, 4)),
        np.zeros(rows, np.int64),
        np.zeros(rows, np.int64),
        np.zeros(rows),
        np.full(rows, NOT_PLANNED_S),
        np.tile(np.array([-math.inf, math.inf]), (rows, 1)),
        np.zeros((rows, len(Traits._fields))),
        np.full(rows, math.inf),
        np.zeros(rows, np.int64),
        np.zeros(rows, np.int64),
        np.zeros(rows, np.int64),
        np.zeros(blocks, np.int64),
        np.zeros(blocks, np.int64),
        np.zeros(blocks, np.int64),
        np.zeros(rows, np.int64),
        np.full(rows, math.inf),
        np.zeros(rows, np.int64),
        np.zeros(6, np.int64),
    )


def with_room(book: Book, commitments: int = 1) -> Book:
    """Returns the book, or one with more room where fewer commitments fit than that.

    From ``LONG`` pieces on, what was committed and never driven is left out of the new one: of a
    vehicle steered ten times a second that is nearly all.
    """
    rows, blocks, pieces = len(book.live), len(book.block_row), len(book.pieces)
    if not is_full(book.used, rows, blocks, pieces, commitments):
        return book
    used = book.used.copy()
    long = pieces >= LONG
    if long:
        used[PIECES] = driven_count(book)
    rows = 2 * rows if used[ROWS] >= rows else rows
    blocks = 2 * blocks + commitments if used[BLOCKS] + commitments > blocks else blocks
    while 2 * used[PIECES] > pieces or is_full(used, rows, blocks, pieces, commitments):
        pieces = 2 * pieces + MAX_PIECES
    larger = empty_book(rows, blocks, pieces)
    for old, new in zip(book[1:], larger[1:], strict=True):
        new[: len(old)] = old
    if long:
        _copy_driven(book, larger)
    else:
        larger.pieces[: len(book.pieces)] = book.pieces
    return larger


@kernel
def _kept_of_blocks(book: Book) -> IntArray:
    """Returns how many pieces of each commitment count: those that begin before the next one."""
    blocks = book.used[BLOCKS]
    kept = book.block_count[:blocks].copy()
    until_s = np.full(book.used[ROWS], math.inf)
    for block in range(blocks - 1, -1, -1):
        row, first = book.block_row[block], book.block_first[block]
        while kept[block] > 1 and book.pieces[first + kept[block] - 1, TIME] >= until_s[row]:
            kept[block] -= 1
        until_s[row] = book.pieces[first, TIME]
    return kept


@kernel
def driven_count(book: Book) -> int:
    """Returns for how many pieces there must be room if what was never driven is left out."""
    count = int(_kept_of_blocks(book).sum())
    for row in range(book.used[ROWS]):
        count += book.way_count[row] - book.piece_count[row]
    return count


@kernel
def _copy_driven(book: Book, out: Book) -> None:
    """Copies the pieces that count into ``out``, and says there where they lie."""
    kept, n = _kept_of_blocks(book), 0
    for block in range(book.used[BLOCKS]):
        row, first = book.block_row[block], book.block_first[block]
        start = first
        if first == book.first_piece[row]:  # its last one, with what leads to it
            start = book.way_first[row]
            out.way_first[row], out.first_piece[row] = n, n + first - start
        out.block_first[block], out.block_count[block] = n + first - start, kept[block]
        end = first + kept[block]
        out.pieces[n : n + end - start] = book.pieces[start:end]
        n += end - start
    out.used[PIECES] = n


@kernel
def is_full(used: IntArray, rows: int, blocks: int, pieces: int, commitments: int = 1) -> bool:
    """Returns whether so much room may be too little for one more row, or so many commitments.

    What leads to a commitment is part of the way before, and so no longer than that.
    """
    most = MAX_PIECES + used[MOST_PIECES]
    return bool(
        used[ROWS] >= rows
        or used[BLOCKS] + commitments > blocks
        or used[PIECES] + commitments * most > pieces
    )


@kernel
def fleet_of(book: Book) -> Fleet:
    """Returns all commitments as planners read them: from when the last command takes effect."""
    return _as_fleet(book, book.first_piece, book.piece_count)


@kernel
def ways_of(book: Book) -> Fleet:
    """Returns what everyone drives from now on, with what leads to the last commitments."""
    return _as_fleet(book, book.way_first, book.way_count)


@kernel
def _as_fleet(book: Book, first_piece: IntArray, piece_count: IntArray) -> Fleet:
    return Fleet(
        book.pieces,
        first_piece,
        piece_count,
        book.length_m,
        book.merge_time_s,
        book.intercepts_m,
        book.traits,
        book.live[: book.used[LIVE]],
        book.lane,
        book.change_s,
        book.inner[: book.used[INNER]],
    )


@kernel
def write_commitment(
    book: Book,
    row: int,
    pieces: FloatArray,
    merge_time_s: float,
    now_s: float,
    cruise_speed_mps: float,
    zone_end_m: float,
) -> None:
    """Records at ``now_s`` that ``row`` follows ``pieces`` from their first time on.

    Until then it drives on as committed before. Whoever enters meanwhile must reckon with that.
    """
    entering = book.piece_count[row] == 0
    start = book.used[PIECES]
    lead = 0 if entering else _write_lead_in(book, row, now_s, pieces[0, TIME])
    first, count = start + lead, len(pieces)
    book.pieces[first : first + count] = pieces
    book.first_piece[row], book.piece_count[row] = first, count
    book.way_first[row], book.way_count[row] = start, lead + count
    way = book.pieces[start : first + count]
    book.merge_time_s[row] = merge_time_s
    book.exit_s[row] = time_at_station(way, zone_end_m)
    if has_place_on_mainline(merge_time_s):
        from_s = max(now_s, merge_time_s)
        lowest_m, highest_m = intercept_range_m(way, from_s, cruise_speed_mps)
        book.intercepts_m[row, 0], book.intercepts_m[row, 1] = lowest_m, highest_m
    block = book.used[BLOCKS]
    book.block_row[block], book.block_first[block], book.block_count[block] = row, first, count
    book.used[BLOCKS] += 1
    book.used[PIECES] += lead + count
    book.used[MOST_PIECES] = max(book.used[MOST_PIECES], lead + count)
    if entering and book.lane[row] > 0:
        note_inner(book, row)
    elif entering:
        book.live[book.used[LIVE]] = row
        book.used[LIVE] += 1


@kernel
def note_inner(book: Book, row: int) -> None:
    """Puts a vehicle on the list of those that are on the lanes further in."""
    book.inner[book.used[INNER]] = row
    book.used[INNER] += 1


@kernel
def _write_lead_in(book: Book, row: int, now_s: float, until_s: float) -> int:
    """Writes what ``row`` drives from ``now_s`` until ``until_s``; returns how many pieces."""
    start = book.used[PIECES]
    first, count = book.way_first[row], book.way_count[row]
    under_way = piece_at(book.pieces[first : first + count], now_s)
    lead = 0
    for k in range(first + under_way, first + count):
        if book.pieces[k, TIME] >= until_s:
            break
        book.pieces[start + lead] = book.pieces[k]
        lead += 1
    return lead


@kernel
def strike_exited(book: Book, time_s: float) -> None:
    """Takes vehicles off the lists that have left the zone, or the lane, by ``time_s``."""
    kept = 0
    for k in range(book.used[LIVE]):
        row = book.live[k]
        if book.exit_s[row] > time_s and book.change_s[row] + LANE_CHANGE_LASTS_S > time_s:
            book.live[kept] = row
            kept += 1
    book.used[LIVE] = kept
    kept = 0
    for k in range(book.used[INNER]):
        if book.exit_s[book.inner[k]] > time_s:
            book.inner[kept] = book.inner[k]
            kept += 1
    book.used[INNER] = kept


@kernel
def states_of_live(book: Book, time_s: float) -> tuple[FloatArray, FloatArray]:
    """Returns stations (m) and speeds (m/s) of the live vehicles as they promised them."""
    fleet = ways_of(book)
    stations_m = np.empty(len(fleet.live))
    speeds_mps = np.empty(len(fleet.live))
    for k in range(len(fleet.live)):
        stations_m[k], speeds_mps[k] = station_and_speed(committed(fleet, fleet.live[k]), time_s)
    return stations_m, speeds_mps
