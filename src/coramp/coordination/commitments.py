"""The one writer of commitments: into the ledger, and into the checker's own record.

Whatever is commanded goes into both, or the checker would examine against what nobody drives.
Kernels write where there is room; ``Commitments`` makes it.
"""

import math

from coramp._kernel import FloatArray, kernel
from coramp.checker.record import Record, has_room, note_command, note_entry
from coramp.coordination.book import ROWS, Book, is_full, note_inner, write_commitment
from coramp.coordination.examination import Examiner
from coramp.coordination.ledger import Ledger
from coramp.kinematics.trajectory import MAX_PIECES
from coramp.road.rules import Road
from coramp.vehicles.merge_state import merge_time_at_entry_s
from coramp.vehicles.traits import LENGTH

NO_ROOM = -1


class Commitments:
    """Writes into a ledger and an examiner's record, which grow together."""

    def __init__(self, ledger: Ledger, examiner: Examiner, road: Road) -> None:
        self.ledger, self.examiner = ledger, examiner
        self._cruise_mps, self._zone_end_m = road.mainline_speed_mps, road.mainline_end_m

    def make_room(self, commitments: int = 1) -> None:
        """Makes sure that one more row and so many commitments fit."""
        self.ledger.make_room(commitments)
        self.examiner.make_room(commitments)

    def change(
        self,
        row: int,
        pieces: FloatArray,
        merge_s: float,
        now_s: float,
        lane_change_s: float = math.inf,
    ) -> None:
        """Commits ``row`` at ``now_s`` to ``pieces``, from their first time on."""
        self.make_room()
        commit_change(
            self.ledger.book,
            self.examiner.record,
            row,
            pieces,
            merge_s,
            now_s,
            self._cruise_mps,
            self._zone_end_m,
            lane_change_s,
        )


@kernel
def commit_entry(
    book: Book,
    record: Record,
    traits: FloatArray,
    on_ramp: bool,
    lane: int,
    pieces: FloatArray,
    now_s: float,
    cruise_mps: float,
    zone_end_m: float,
) -> int:
    """Commits a vehicle that enters a lane at ``now_s`` to ``pieces``; returns its row.

    Where there is no room for it, it changes nothing and returns ``NO_ROOM``.
    """
    full = is_full(book.used, len(book.live), len(book.block_row), len(book.pieces))
    if full or not has_room(record, MAX_PIECES):
        return NO_ROOM
    merge_s, row = merge_time_at_entry_s(on_ramp), book.used[ROWS]
    note_entry(record, traits, merge_s, pieces, zone_end_m, float(lane))
    book.lane[row] = lane
    book.length_m[row] = traits[LENGTH]
    book.traits[row] = traits
    book.used[ROWS] += 1
    write_commitment(book, row, pieces, merge_s, now_s, cruise_mps, zone_end_m)
    return int(row)


@kernel
def commit_change(
    book: Book,
    record: Record,
    row: int,
    pieces: FloatArray,
    merge_s: float,
    now_s: float,
    cruise_mps: float,
    zone_end_m: float,
    lane_change_s: float = math.inf,
) -> None:
    """Commits a vehicle on the road at ``now_s`` to ``pieces``, from their first time on.

    It begins to change to the next lane further in at ``lane_change_s``, if that is a time.
    """
    note_command(record, row, merge_s, pieces, now_s, zone_end_m, lane_change_s)
    if lane_change_s < math.inf:
        book.change_s[row] = lane_change_s
        note_inner(book, row)
    write_commitment(book, row, pieces, merge_s, now_s, cruise_mps, zone_end_m)
