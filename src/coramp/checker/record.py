"""What the checker has been told of every vehicle: what it can do, its stream, its commands.

The checker reads nothing else. Where a vehicle is, on which lane, how fast, and whether it is still
on the road follows from its commands by the checker's own mathematics, not from the bookkeeping of
the loop.
"""

import math
from typing import NamedTuple

import numpy as np

from coramp._kernel import FloatArray, IntArray, kernel
from coramp.checker.distances import CLOCK, LENGTH, POSITIONING, TIME_GAP, TRAITS, passes_s
from coramp.checker.pairs import Way

FIRST, COUNT = range(2)
"""Columns of ``Record.places``."""
MERGE, EXIT, LANE, CHANGE = range(TRAITS, TRAITS + 4)
"""Columns of ``Record.rows`` behind those of what a vehicle can do."""
ROWS, PIECES, LIVE, LONGEST = range(4)
"""Places in ``Record.used``; the last is the largest number of pieces that a row has had."""


class Record(NamedTuple):
    """All that was commanded, with room to spare; ``used`` tells how much of what is in use.

    Row i drives ``pieces[first : first + count]`` with (first, count) = ``places[i]``. What it can
    do is ``rows[i, :TRAITS]`` (columns of ``distances``). It comes onto the mainline at
    ``rows[i, MERGE]`` (``checker.merging``) and leaves the zone at ``rows[i, EXIT]`` (s; infinity
    while it would stop before). It came by the mainline's lane ``rows[i, LANE]``, and begins to
    change to the next one at ``rows[i, CHANGE]`` (s; infinity for never). ``live`` lists the rows
    on the road, by entry.
    """

    pieces: FloatArray
    places: IntArray
    rows: FloatArray
    live: IntArray
    used: IntArray


def empty_record(rows: int, pieces: int) -> Record:
    """Returns a record with room for so many rows and pieces."""
    return Record(
        np.empty((pieces, 4)),
        np.zeros((rows, 2), np.int64),
        np.full((rows, TRAITS + 4), math.inf),
        np.zeros(rows, np.int64),
        np.zeros(4, np.int64),
    )


def with_room(record: Record, commands: int, most_pieces: int) -> Record:
    """Returns the record, or another one where a row and so many commands do not fit.

    ``most_pieces`` is the most that one command may have. What vehicles drove that are off the road
    is forgotten first, so that the record of a long run stays small.
    """
    rows, pieces = len(record.live), len(record.pieces)
    in_use, filled, _, longest = record.used.tolist()
    more = commands * (longest + most_pieces)
    if in_use < rows and filled + more <= pieces:
        return record
    on_road = _pieces_on_road(record)
    while on_road + more > pieces // 2:
        pieces *= 2
    other = empty_record(rows if in_use < rows else 2 * rows, pieces)
    _copy_live(record, other)
    return other


@kernel
def _pieces_on_road(record: Record) -> int:
    """Returns how many pieces those who are on the road have."""
    count = 0
    for row in record.live[: record.used[LIVE]]:
        count += record.places[row, COUNT]
    return count


@kernel
def _copy_live(record: Record, other: Record) -> None:
    """Copies everything but the pieces of those who are off the road into an empty record."""
    rows, live = record.used[ROWS], record.used[LIVE]
    other.rows[:rows] = record.rows[:rows]
    other.live[:live] = record.live[:live]
    at = 0
    for row in record.live[:live]:
        first, count = record.places[row, FIRST], record.places[row, COUNT]
        other.pieces[at : at + count] = record.pieces[first : first + count]
        other.places[row, FIRST], other.places[row, COUNT] = at, count
        at += count
    other.used[:] = record.used
    other.used[PIECES] = at


@kernel
def has_room(record: Record, most_pieces: int) -> bool:
    """Returns whether one more row with a command of so many pieces fits."""
    used = record.used
    return bool(
        used[ROWS] < len(record.live)
        and used[PIECES] + used[LONGEST] + most_pieces <= len(record.pieces)
    )


@kernel
def way_of(record: Record, row: int) -> Way:
    """Returns what a row drives from its last command on, and until that takes effect."""
    first = record.places[row, FIRST]
    pieces = record.pieces[first : first + record.places[row, COUNT]]
    return Way(
        pieces,
        record.rows[row, MERGE],
        record.rows[row, LENGTH],
        record.rows[row, POSITIONING],
        record.rows[row, CLOCK],
        record.rows[row, TIME_GAP],
        record.rows[row, LANE],
        record.rows[row, CHANGE],
    )


@kernel
def note_entry(
    record: Record,
    traits: FloatArray,
    merge_s: float,
    pieces: FloatArray,
    zone_end_m: float,
    lane: float = 0.0,
) -> int:
    """Notes a vehicle that enters on ``pieces``, in a lane of the mainline; returns its row."""
    row = record.used[ROWS]
    record.rows[row, :TRAITS] = traits
    record.rows[row, LANE] = lane
    _write(record, row, record.used[PIECES], pieces, merge_s, zone_end_m)
    record.live[record.used[LIVE]] = row
    record.used[LIVE] += 1
    record.used[ROWS] += 1
    return int(row)


@kernel
def note_command(
    record: Record,
    row: int,
    merge_s: float,
    pieces: FloatArray,
    now_s: float,
    zone_end_m: float,
    change_s: float = math.inf,
) -> None:
    """Notes at ``now_s`` that a row follows ``pieces`` from their first time on.

    Until then it drives what it was told before, which is kept in front of them. A command that
    tells of no change of lanes leaves it to an earlier one.
    """
    record.rows[row, CHANGE] = min(record.rows[row, CHANGE], change_s)
    start = record.used[PIECES]
    first, count = record.places[row, FIRST], record.places[row, COUNT]
    kept = 0
    for k in range(first, first + count):
        begins_s = record.pieces[k, 0]
        ends_s = record.pieces[k + 1, 0] if k + 1 < first + count else math.inf
        if ends_s > now_s and begins_s < pieces[0, 0]:
            record.pieces[start + kept] = record.pieces[k]
            kept += 1
    record.places[row, FIRST] = start
    _write(record, row, start + kept, pieces, merge_s, zone_end_m)


@kernel
def _write(
    record: Record, row: int, at: int, pieces: FloatArray, merge_s: float, zone_end_m: float
) -> None:
    """Writes pieces at a place; the row's pieces begin at ``used[PIECES]``."""
    start, end = record.used[PIECES], at + len(pieces)
    record.pieces[at:end] = pieces
    record.places[row, FIRST], record.places[row, COUNT] = start, end - start
    record.rows[row, MERGE] = merge_s
    record.rows[row, EXIT] = passes_s(record.pieces[start:end], zone_end_m)
    record.used[PIECES] = end
    record.used[LONGEST] = max(record.used[LONGEST], end - start)


@kernel
def forget_exited(record: Record, time_s: float) -> None:
    """Takes rows off the live list that have left the zone by ``time_s``."""
    kept = 0
    for k in range(record.used[LIVE]):
        if record.rows[record.live[k], EXIT] > time_s:
            record.live[kept] = record.live[k]
            kept += 1
    record.used[LIVE] = kept
