"""From the ledger's history to what each vehicle drove: one sequence of pieces a vehicle."""

import numpy as np

from coramp._kernel import FloatArray, IntArray, kernel
from coramp.coordination.book import BLOCKS
from coramp.coordination.ledger import Ledger
from coramp.kinematics.trajectory import (
    ACCEL,
    SPEED,
    STATION,
    TIME,
    piece_end_s,
    station_and_speed,
    time_to_cover,
)
from coramp.road.lanes import ACCELERATION_LANE, MAINLINE, RAMP
from coramp.vehicles.merge_state import NOT_PLANNED_S

SLIVER_S = 1e-9
"""Pieces that rounding leaves shorter than this are left out."""


def driven_pieces(
    ledger: Ledger, vehicle_of_row: IntArray, vehicles: int, end_s: float
) -> tuple[IntArray, IntArray, FloatArray]:
    """Returns first rows (one a vehicle and one more), codes of lanes and pieces, up to ``end_s``.

    Each commitment counts until the next one of its vehicle takes over, the last one until the
    vehicle leaves the zone. A piece lies on one lane: pieces are cut at the nose, at the merge, and
    where a vehicle begins to change to the next lane of the mainline.
    """
    book, blocks = ledger.book, ledger.book.used[BLOCKS]
    merge_s, until_s = np.full(vehicles, NOT_PLANNED_S), np.full(vehicles, end_s)
    came_by, change_s = np.zeros(vehicles, np.int64), np.full(vehicles, np.inf)
    merge_s[vehicle_of_row] = book.merge_time_s[: len(ledger)]
    until_s[vehicle_of_row] = np.minimum(end_s, book.exit_s[: len(ledger)])
    came_by[vehicle_of_row] = book.lane[: len(ledger)]
    change_s[vehicle_of_row] = book.change_s[: len(ledger)]
    of_block = vehicle_of_row[book.block_row[:blocks]]
    by_vehicle = np.argsort(of_block, kind="stable")
    return _stitched(
        book.pieces,
        of_block[by_vehicle],
        book.block_first[by_vehicle],
        book.block_count[by_vehicle],
        merge_s,
        until_s,
        came_by,
        change_s,
    )


@kernel
def _stitched(
    arena: FloatArray,
    block_vehicle: IntArray,
    block_first: IntArray,
    block_count: IntArray,
    merge_s: FloatArray,
    until_s: FloatArray,
    came_by: IntArray,
    change_s: FloatArray,
) -> tuple[IntArray, IntArray, FloatArray]:
    vehicles = len(until_s)
    capacity = 3 * np.sum(block_count) + vehicles + 8
    first = np.zeros(vehicles + 1, np.int64)
    lane = np.empty(capacity, np.int64)
    rows = np.empty((capacity, 4))
    n = 0
    for b in range(len(block_vehicle)):
        vehicle = block_vehicle[b]
        pieces = arena[block_first[b] : block_first[b] + block_count[b]]
        block_end_s = until_s[vehicle]
        if b + 1 < len(block_vehicle) and block_vehicle[b + 1] == vehicle:
            block_end_s = min(block_end_s, arena[block_first[b + 1], TIME])
        for k in range(len(pieces)):
            start_s = pieces[k, TIME]
            end_s = min(piece_end_s(pieces, k), block_end_s)
            while start_s < end_s - SLIVER_S:
                stay = merge_s[vehicle], came_by[vehicle], change_s[vehicle]
                n, start_s = _cut(pieces, k, start_s, end_s, stay, lane, rows, n)
        first[vehicle + 1] = n
    for vehicle in range(vehicles):
        first[vehicle + 1] = max(first[vehicle], first[vehicle + 1])
    return first, lane[:n].copy(), rows[:n].copy()


@kernel
def _cut(
    pieces: FloatArray,
    k: int,
    start_s: float,
    end_s: float,
    stay: tuple[float, int, float],
    lane: IntArray,
    rows: FloatArray,
    n: int,
) -> tuple[int, float]:
    """Writes a piece on one lane; ``stay``: when it merges, its lane, when it changes that."""
    merge_s, came_by, change_s = stay
    station_m, speed_mps = station_and_speed(pieces[: k + 1], start_s)
    if start_s >= merge_s - 1e-9:
        code = MAINLINE + came_by
        if start_s >= change_s - 1e-9:
            code += 1
        else:
            end_s = min(end_s, change_s)
    elif station_m < -1e-9:
        code = RAMP
        end_s = min(end_s, start_s + time_to_cover(-station_m, speed_mps, pieces[k, ACCEL]))
    else:
        code = ACCELERATION_LANE
        end_s = min(end_s, merge_s)
    rows[n, TIME], rows[n, STATION] = start_s, station_m
    rows[n, SPEED], rows[n, ACCEL] = speed_mps, pieces[k, ACCEL]
    lane[n] = code
    return n + 1, end_s
