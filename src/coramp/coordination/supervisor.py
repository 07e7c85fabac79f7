"""Keeps vehicles safe that are steered by acceleration: the safe fallback replaces what is not.

A command is held for its time, and the checker is shown where that leads: a mainline vehicle that
goes back to v0, a ramp vehicle that merges as in free movement or, where that is not safe yet,
stops before the nose. What it lets pass is committed. What it refuses is not driven: the vehicle
keeps its last commitment, which is safe to its end.
"""

import math
from collections.abc import Sequence

import numpy as np

from coramp._kernel import BoolArray, FloatArray, IntArray, kernel
from coramp.checker.checker import Change, examine
from coramp.checker.distances import Bounds
from coramp.checker.reasons import ACCEPTED
from coramp.checker.record import Record
from coramp.coordination.book import Book, fleet_of
from coramp.coordination.commitments import Commitments, commit_change
from coramp.equations.safe_distance import merge_clearance_m, standing_clearance_m
from coramp.kinematics.trajectory import MAX_PIECES, TIME, cruise_intercept_m
from coramp.motion.approach import stop_of_m
from coramp.motion.driving import hold_then_cruise, hold_then_merge, hold_then_stop
from coramp.motion.lane_change import lane_change_s
from coramp.road.rules import Rules, unpacked
from coramp.strategies.base import DriveWithAcceleration
from coramp.strategies.ramp_queue import next_ahead_on_ramp
from coramp.strategies.situation import foremost_unknown_m
from coramp.vehicles.fleet import Fleet, committed
from coramp.vehicles.merge_state import NOT_PLANNED_S, is_on_mainline, is_waiting

MOST_PASSES = 3
"""A command that another one stands in the way of is tried again after that."""


def drive_safely(
    commitments: Commitments,
    commands: Sequence[DriveWithAcceleration],
    now_s: float,
    fastest_entry_mps: float,
    packed_rules: FloatArray,
) -> list[bool]:
    """Commits what is safe of the commands; returns for each whether it was carried out."""
    rows = np.array([command.row for command in commands], np.int64)
    wishes = np.array([(c.accel_mps2, c.hold_s) for c in commands])
    merges = np.array([command.merge for command in commands], np.bool_)
    commitments.make_room(len(rows))
    done: BoolArray = drive_all(
        commitments.ledger.book,
        commitments.examiner.record,
        rows,
        wishes,
        merges,
        now_s,
        fastest_entry_mps,
        packed_rules,
        commitments.examiner.bounds,
    )
    return done.tolist()  # type: ignore[no-any-return]


@kernel
def drive_all(
    book: Book,
    record: Record,
    rows: IntArray,
    wishes: FloatArray,
    merges: BoolArray,
    now_s: float,
    fastest_entry_mps: float,
    packed_rules: FloatArray,
    bounds: Bounds,
) -> BoolArray:
    """Commits what is safe, and returns what that is; the book has room for all."""
    done = np.zeros(len(rows), np.bool_)
    rules = unpacked(packed_rules)
    known_m = foremost_unknown_m(now_s, fastest_entry_mps, rules)
    for _ in range(MOST_PASSES):
        progress = False
        for k in range(len(rows)):
            if done[k]:
                continue
            accel_mps2, hold_s = wishes[k]
            done[k] = _drive_one(
                book, record, rows[k], accel_mps2, hold_s, merges[k], now_s, known_m, rules, bounds
            )
            progress = progress or done[k]
        if not progress:
            break
    return done


@kernel
def _drive_one(
    book: Book,
    record: Record,
    row: int,
    accel_mps2: float,
    hold_s: float,
    merge: bool,
    now_s: float,
    known_m: float,
    rules: Rules,
    bounds: Bounds,
) -> bool:
    from_s = now_s + rules.control.actuation_delay_s
    fleet = fleet_of(book)
    out = np.empty((MAX_PIECES, 4))
    merge_s = fleet.merge_time_s[row]
    if is_on_mainline(merge_s, from_s):
        n = hold_then_cruise(fleet, row, accel_mps2, hold_s, from_s, rules, out)
        return _commit_if_safe(book, record, row, out[:n], merge_s, now_s, rules, bounds)
    if merge or not is_waiting(merge_s):
        n = hold_then_merge(fleet, row, accel_mps2, hold_s, from_s, rules, out)
        if n > 0 and _known_enough(fleet, row, out[:n], known_m, rules):
            change_s = lane_change_s(out[n - 1, TIME], rules.control.step_s)
            if _commit_if_safe(book, record, row, out[:n], change_s, now_s, rules, bounds):
                return True
    if not is_waiting(merge_s):
        return False
    stop_m = _place_to_stop_m(fleet, row, from_s, rules)
    n = hold_then_stop(fleet, row, accel_mps2, hold_s, from_s, stop_m, rules, out)
    return _commit_if_safe(book, record, row, out[:n], NOT_PLANNED_S, now_s, rules, bounds)


@kernel
def _known_enough(fleet: Fleet, row: int, pieces: FloatArray, known_m: float, rules: Rules) -> bool:
    """Whether the merge lies ahead of everyone who may still enter the mainline."""
    end_m = cruise_intercept_m(pieces, rules.road.mainline_speed_mps)
    room_m = fleet.length_m[row] + merge_clearance_m(rules.road, rules.safety)
    return bool(end_m - room_m >= known_m)


@kernel
def _place_to_stop_m(fleet: Fleet, row: int, from_s: float, rules: Rules) -> float:
    """Returns where a ramp vehicle is to stop: before the nose, or behind who is before it."""
    stop_m = rules.road.stop_station_m
    leader = next_ahead_on_ramp(fleet, row, from_s)
    if leader < 0:
        return stop_m
    standing_m = standing_clearance_m(rules.road, rules.safety, rules.motion.stop_mps2)
    behind_m = stop_of_m(committed(fleet, leader)) - fleet.length_m[leader] - standing_m
    return float(min(stop_m, behind_m))


@kernel
def _commit_if_safe(
    book: Book,
    record: Record,
    row: int,
    pieces: FloatArray,
    merge_s: float,
    now_s: float,
    rules: Rules,
    bounds: Bounds,
) -> bool:
    if len(pieces) == 0:
        return False
    from_s, road = now_s + rules.control.actuation_delay_s, rules.road
    change = Change(
        np.array([row]),
        np.array([len(pieces)]),
        pieces.reshape((1, len(pieces), 4)),
        np.array([merge_s]),
        np.zeros(1, np.int64),
        np.full(1, math.inf),
    )
    if examine(record, change, now_s, from_s, bounds).code != ACCEPTED:
        return False
    cruise_mps, zone_end_m = road.mainline_speed_mps, road.mainline_end_m
    commit_change(book, record, row, pieces, merge_s, now_s, cruise_mps, zone_end_m)
    return True
