"""Whether a set of new trajectories may be committed."""

import math
from typing import NamedTuple

import numpy as np

from coramp._kernel import FloatArray, IntArray, kernel
from coramp.checker.distances import Bounds, state_at
from coramp.checker.pairs import Way, envelope_on_mainline, examine_pair, surely_apart
from coramp.checker.reasons import (
    ACCEPTED,
    BACKWARDS,
    CHANGES_THE_PAST,
    EXACT,
    HAS_A_JUMP,
    JOIN,
    LEAVES_ITS_PATH,
    MERGES_OUTSIDE_LANE,
    NO_SAFE_END,
    NOT_FINITE,
    STARTS_TOO_EARLY,
    STARTS_TOO_LATE,
    TIMES_NOT_ASCENDING,
    TOO_FAST,
    TOO_HARD,
)


class Vehicles(NamedTuple):
    """What is committed; row i drives ``pieces[first[i] : first[i] + piece_count[i]]``.

    ``merge_s`` is minus infinity for mainline vehicles, infinity while no merge is committed.
    """

    pieces: FloatArray
    first: IntArray
    piece_count: IntArray
    length_m: FloatArray
    merge_s: FloatArray
    live: IntArray


class Change(NamedTuple):
    """New trajectories: entry k is for row ``rows[k]``, and is ``pieces[k, :piece_count[k]]``.

    ``start`` of shape (k, 3) is the time, station and speed at which each must take over.
    ``makes_gap`` is 1 for vehicles that move aside, which may be faster than v0 until then.
    """

    rows: IntArray
    piece_count: IntArray
    pieces: FloatArray
    merge_s: FloatArray
    start: FloatArray
    makes_gap: IntArray


class Verdict(NamedTuple):
    """Outcome: a code of ``REASONS``, the row at fault, the other one, the least margin (m)."""

    code: int
    row: int
    other_row: int
    least_margin_m: float


@kernel
def examine(vehicles: Vehicles, change: Change, earliest_s: float, bounds: Bounds) -> Verdict:
    """Returns whether the change may be committed, and the least margin that it leaves.

    Checks every new trajectory by itself, then every pair of a changed vehicle and any other on
    the road over all time. The margin is over Eq. 1, and over Eq. 15, 16 at lane changes; the
    allowance is part of the test, not of the margin. A pair on the mainline whose envelopes show
    that its margin is neither too small nor the least is not looked at piece by piece.
    """
    for k in range(len(change.rows)):
        code = _examine_alone(vehicles, change, k, earliest_s, bounds)
        if code != ACCEPTED:
            return Verdict(code, change.rows[k], -1, math.nan)
    least = math.inf
    for k in range(len(change.rows)):
        row, mine = change.rows[k], _changed_way(vehicles, change, k)
        from_s = mine.pieces[0, 0]
        envelope = envelope_on_mainline(mine, bounds)
        for other in vehicles.live[::-1]:  # who entered last is nearest to who enters
            if other == row or _entry(change.rows, other) >= 0:
                continue
            theirs = _committed_way(vehicles, other)
            if surely_apart(mine, envelope, theirs, from_s, least, bounds):
                continue
            code, margin = examine_pair(mine, theirs, from_s, bounds)
            if code != ACCEPTED:
                return Verdict(code, row, other, margin)
            least = min(least, margin)
        for k_other in range(k + 1, len(change.rows)):
            theirs = _changed_way(vehicles, change, k_other)
            code, margin = examine_pair(mine, theirs, from_s, bounds)
            if code != ACCEPTED:
                return Verdict(code, row, change.rows[k_other], margin)
            least = min(least, margin)
    return Verdict(ACCEPTED, -1, -1, least)


@kernel
def _changed_way(vehicles: Vehicles, change: Change, k: int) -> Way:
    pieces = change.pieces[k, : change.piece_count[k]]
    return Way(pieces, vehicles.length_m[change.rows[k]], change.merge_s[k])


@kernel
def _committed_way(vehicles: Vehicles, row: int) -> Way:
    first = vehicles.first[row]
    pieces = vehicles.pieces[first : first + vehicles.piece_count[row]]
    return Way(pieces, vehicles.length_m[row], vehicles.merge_s[row])


@kernel
def _entry(rows: IntArray, row: int) -> int:
    for k in range(len(rows)):
        if rows[k] == row:
            return k
    return -1


@kernel
def _examine_alone(
    vehicles: Vehicles, change: Change, k: int, earliest_s: float, bounds: Bounds
) -> int:
    pieces = change.pieces[k, : change.piece_count[k]]
    merge_s = change.merge_s[k]
    code = _examine_form(pieces, merge_s)
    if code == ACCEPTED:
        code = _examine_start(pieces, change.start[k], earliest_s)
    if code == ACCEPTED and _changes_the_past(
        vehicles.merge_s[change.rows[k]], merge_s, pieces[0, 0]
    ):
        code = CHANGES_THE_PAST
    if code == ACCEPTED:
        code = _examine_end(pieces, merge_s, bounds)
    if code == ACCEPTED:
        code = _examine_speeds(vehicles, change, k, bounds)
    if code == ACCEPTED:
        code = _examine_accelerations(pieces, merge_s, bounds)
    return code


@kernel
def _examine_form(pieces: FloatArray, merge_s: float) -> int:
    if len(pieces) == 0 or math.isnan(merge_s) or not np.isfinite(pieces).all():
        return NOT_FINITE
    for i in range(1, len(pieces)):
        dt = pieces[i, 0] - pieces[i - 1, 0]
        if dt <= 0.0:
            return TIMES_NOT_ASCENDING
        v, a = pieces[i - 1, 2], pieces[i - 1, 3]
        if abs(pieces[i - 1, 1] + v * dt + a * dt * dt / 2.0 - pieces[i, 1]) > JOIN:
            return HAS_A_JUMP
        if abs(v + a * dt - pieces[i, 2]) > JOIN:
            return HAS_A_JUMP
    return ACCEPTED


@kernel
def _examine_start(pieces: FloatArray, start: FloatArray, earliest_s: float) -> int:
    """A change replaces what was committed, so that it must say all that is driven from now on."""
    if pieces[0, 0] < earliest_s - JOIN:
        return STARTS_TOO_EARLY
    if pieces[0, 0] > earliest_s + JOIN:
        return STARTS_TOO_LATE
    for column in range(3):
        if abs(pieces[0, column] - start[column]) > JOIN:
            return LEAVES_ITS_PATH
    return ACCEPTED


@kernel
def _changes_the_past(committed_s: float, merge_s: float, from_s: float) -> bool:
    if merge_s == committed_s:
        return False
    return committed_s < from_s or merge_s < from_s


@kernel
def _examine_end(pieces: FloatArray, merge_s: float, bounds: Bounds) -> int:
    _, s, v, a = pieces[len(pieces) - 1]
    if a != 0.0:
        return NO_SAFE_END
    if merge_s == math.inf:
        if v > EXACT or s > bounds.stop_station_m + EXACT:
            return NO_SAFE_END
        return ACCEPTED
    if v <= 0.0 or v > bounds.mainline_speed_mps + JOIN:
        return NO_SAFE_END
    if merge_s >= pieces[0, 0]:
        s_merge, _, _ = state_at(pieces, merge_s)
        if s_merge <= 0.0 or s_merge > bounds.last_merge_station_m + JOIN:
            return MERGES_OUTSIDE_LANE
    return ACCEPTED


@kernel
def _examine_speeds(vehicles: Vehicles, change: Change, k: int, bounds: Bounds) -> int:
    pieces = change.pieces[k, : change.piece_count[k]]
    merge_s = change.merge_s[k]
    v0 = bounds.mainline_speed_mps
    gap_made_s = _last_merge_s(change)
    entered_mps = pieces[0, 2]
    for i in range(len(pieces)):
        t, s, v, _ = pieces[i]
        if v < -EXACT:
            return BACKWARDS
        limit_mps = bounds.ramp_limit_mps if t < merge_s and s < -JOIN else v0
        if change.makes_gap[k] == 1 and t >= merge_s:
            before_mps = _committed_speed_mps(vehicles, change.rows[k], t)
            limit_mps = max(limit_mps, before_mps)
            if t < gap_made_s:
                limit_mps = max(limit_mps, v0 * bounds.gap_speed_factor)
        elif v <= entered_mps:  # one that enters too fast slows down from there
            limit_mps = max(limit_mps, entered_mps)
        if v > limit_mps + JOIN:
            return TOO_FAST
    return ACCEPTED


@kernel
def _last_merge_s(change: Change) -> float:
    last_s = -math.inf
    for k in range(len(change.rows)):
        if change.makes_gap[k] == 0 and change.merge_s[k] < math.inf:
            last_s = max(last_s, change.merge_s[k])
    return last_s


@kernel
def _committed_speed_mps(vehicles: Vehicles, row: int, time_s: float) -> float:
    first = vehicles.first[row]
    _, v, _ = state_at(vehicles.pieces[first : first + vehicles.piece_count[row]], time_s)
    return v


@kernel
def _examine_accelerations(pieces: FloatArray, merge_s: float, bounds: Bounds) -> int:
    for i in range(len(pieces)):
        t, s, _, a = pieces[i]
        most_mps2 = bounds.comfort_mps2
        if a > 0.0 and s > -JOIN and t < merge_s < math.inf:
            most_mps2 = bounds.ramp_acceleration_mps2
        if abs(a) > most_mps2 + JOIN:
            return TOO_HARD
    return ACCEPTED
