"""Whether a set of new trajectories may be committed."""

import math
from typing import NamedTuple

import numpy as np

from coramp._kernel import FloatArray, IntArray, kernel
from coramp.checker.distances import (
    ACCELERATION,
    BRAKING,
    POWER,
    TOP_SPEED,
    Bounds,
    state_at,
)
from coramp.checker.merging import comes_onto_mainline, merge_at_entry_s
from coramp.checker.pairs import (
    Way,
    envelope_on_mainline,
    examine_pair,
    surely_apart,
    way_with,
)
from coramp.checker.reasons import (
    ACCEPTED,
    BACKWARDS,
    CHANGES_LANE_WRONGLY,
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
    TAKES_NO_COMMANDS,
    TIMES_NOT_ASCENDING,
    TOO_FAST,
    TOO_HARD,
)
from coramp.checker.record import CHANGE, LANE, LIVE, ROWS, Record, forget_exited, way_of


class Change(NamedTuple):
    """New trajectories: entry k is for row ``rows[k]``, and is ``pieces[k, :piece_count[k]]``.

    ``makes_gap`` is 1 for vehicles that move aside, which may be faster than v0 until then.
    ``lane_change_s`` is when a vehicle begins to change to the next lane further in, infinity where
    the command tells of no change.
    """

    rows: IntArray
    piece_count: IntArray
    pieces: FloatArray
    merge_s: FloatArray
    makes_gap: IntArray
    lane_change_s: FloatArray


class Entry(NamedTuple):
    """A vehicle's request to enter: when (s), where (m), how fast (m/s), what it can do, by where.

    ``traits`` are columns of ``distances``. ``lane`` is that of the mainline, 0 next to the ramp.
    """

    time_s: float
    station_m: float
    speed_mps: float
    traits: FloatArray
    on_ramp: bool
    lane: float = 0.0


class Verdict(NamedTuple):
    """Outcome: a code of ``REASONS``, the row at fault, the other one, the least margin (m).

    Rows are -1 where there is none, as for a vehicle that has not entered.
    """

    code: int
    row: int
    other_row: int
    least_margin_m: float


@kernel
def examine(
    record: Record, change: Change, now_s: float, earliest_s: float, bounds: Bounds
) -> Verdict:
    """Returns whether a change may be committed at ``now_s``, and the least margin that it leaves.

    ``earliest_s`` is when a command of now takes effect. Checks every new trajectory by itself,
    then every pair of a changed vehicle and any other on the road over all time. The margin is over
    Eq. 1, and over Eq. 15, 16 at lane changes; the allowance is part of the test, not of the
    margin. A pair on the mainline whose envelopes show that its margin is neither too small nor the
    least is not looked at piece by piece.
    """
    forget_exited(record, now_s)
    for k in range(len(change.rows)):
        code = _examine_command(record, change, k, earliest_s, bounds)
        if code != ACCEPTED:
            return Verdict(code, change.rows[k], -1, math.nan)
    least = math.inf
    for k in range(len(change.rows)):
        row, mine = change.rows[k], _changed_way(record, change, k)
        code, other, least = _examine_against_others(record, change.rows, row, mine, least, bounds)
        if code != ACCEPTED:
            return Verdict(code, row, other, least)
        for k_other in range(k + 1, len(change.rows)):
            theirs = _changed_way(record, change, k_other)
            code, margin = examine_pair(mine, theirs, mine.pieces[0, 0], bounds)
            if code != ACCEPTED:
                return Verdict(code, row, change.rows[k_other], margin)
            least = min(least, margin)
    return Verdict(ACCEPTED, -1, -1, least)


@kernel
def examine_entry(record: Record, entry: Entry, pieces: FloatArray, bounds: Bounds) -> Verdict:
    """Returns whether a vehicle may enter on ``pieces``, and the least margin that it leaves."""
    forget_exited(record, entry.time_s)
    merge_s = merge_at_entry_s(entry.on_ramp)
    code = _examine_form(pieces, merge_s)
    if code == ACCEPTED:
        code = _examine_start(pieces, entry.time_s, entry.time_s, entry.station_m, entry.speed_mps)
    if code == ACCEPTED:
        code = _examine_end(pieces, merge_s, bounds)
    if code == ACCEPTED:
        made_s = -math.inf
        code = _examine_speeds(pieces, merge_s, entry.traits, pieces, False, made_s, bounds)
    if code == ACCEPTED:
        code = _examine_accelerations(pieces, merge_s, entry.traits, bounds)
    if code != ACCEPTED:
        return Verdict(code, -1, -1, math.nan)
    mine = way_with(pieces, merge_s, entry.traits, entry.lane, math.inf)
    nobody = np.empty(0, np.int64)
    code, other, least = _examine_against_others(record, nobody, -1, mine, math.inf, bounds)
    return Verdict(code, -1, other, least)


@kernel
def _examine_against_others(
    record: Record, changed: IntArray, row: int, mine: Way, least: float, bounds: Bounds
) -> tuple[int, int, float]:
    """Returns a reason, the other row, and the least margin (m) to everyone who is not changed."""
    from_s = mine.pieces[0, 0]
    envelope = envelope_on_mainline(mine, bounds)
    for k in range(record.used[LIVE] - 1, -1, -1):  # who entered last is nearest to who enters
        other = record.live[k]
        if other == row or _entry(changed, other) >= 0:
            continue
        theirs = way_of(record, other)
        if surely_apart(mine, envelope, theirs, from_s, least, bounds):
            continue
        code, margin = examine_pair(mine, theirs, from_s, bounds)
        if code != ACCEPTED:
            return code, other, margin
        least = min(least, margin)
    return ACCEPTED, -1, least


@kernel
def _changed_way(record: Record, change: Change, k: int) -> Way:
    pieces = change.pieces[k, : change.piece_count[k]]
    known = record.rows[change.rows[k]]
    change_s = min(change.lane_change_s[k], known[CHANGE])
    return way_with(pieces, change.merge_s[k], known, known[LANE], change_s)


@kernel
def _entry(rows: IntArray, row: int) -> int:
    for k in range(len(rows)):
        if rows[k] == row:
            return k
    return -1


@kernel
def _examine_command(
    record: Record, change: Change, k: int, earliest_s: float, bounds: Bounds
) -> int:
    """Returns the reason why one new trajectory may not be commanded, by itself."""
    if not 0 <= change.rows[k] < record.used[ROWS]:
        return TAKES_NO_COMMANDS
    pieces = change.pieces[k, : change.piece_count[k]]
    merge_s = change.merge_s[k]
    before = way_of(record, change.rows[k])
    code = _examine_form(pieces, merge_s)
    if code == ACCEPTED and len(before.pieces) == 0:  # it has left, and what it drove is forgotten
        code = LEAVES_ITS_PATH
    if code == ACCEPTED:
        station_m, speed_mps, _ = state_at(before.pieces, pieces[0, 0])
        code = _examine_start(pieces, earliest_s, pieces[0, 0], station_m, speed_mps)
    if code == ACCEPTED and _changes_the_past(before.merge_s, merge_s, pieces[0, 0]):
        code = CHANGES_THE_PAST
    if code == ACCEPTED:
        known = record.rows[change.rows[k]]
        change_s = change.lane_change_s[k]
        code = _examine_lane_change(change_s, merge_s, earliest_s, known, bounds)
    if code == ACCEPTED:
        code = _examine_end(pieces, merge_s, bounds)
    if code == ACCEPTED:
        makes_gap = change.makes_gap[k] == 1
        gap_made_s = _last_merge_s(change)
        traits = record.rows[change.rows[k]]
        code = _examine_speeds(
            pieces, merge_s, traits, before.pieces, makes_gap, gap_made_s, bounds
        )
    if code == ACCEPTED:
        code = _examine_accelerations(pieces, merge_s, record.rows[change.rows[k]], bounds)
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
def _examine_start(
    pieces: FloatArray, earliest_s: float, time_s: float, station_m: float, speed_mps: float
) -> int:
    """A command replaces what was committed, so that it must say all that is driven from now on.

    It begins at the time, station and speed at which the vehicle then is.
    """
    if pieces[0, 0] < earliest_s - JOIN:
        return STARTS_TOO_EARLY
    if pieces[0, 0] > earliest_s + JOIN:
        return STARTS_TOO_LATE
    time_s_off = abs(pieces[0, 0] - time_s)
    if max(time_s_off, abs(pieces[0, 1] - station_m), abs(pieces[0, 2] - speed_mps)) > JOIN:
        return LEAVES_ITS_PATH
    return ACCEPTED


@kernel
def _changes_the_past(committed_s: float, merge_s: float, from_s: float) -> bool:
    if merge_s == committed_s:
        return False
    return committed_s < from_s or merge_s < from_s


@kernel
def _examine_lane_change(
    change_s: float, merge_s: float, earliest_s: float, known: FloatArray, bounds: Bounds
) -> int:
    """A vehicle changes lanes once, from when it can act on, to a lane that there is."""
    if math.isnan(change_s):
        return NOT_FINITE
    if change_s == math.inf:
        return ACCEPTED
    is_first = known[CHANGE] == math.inf
    is_later = earliest_s - JOIN <= change_s and merge_s <= change_s
    if is_first and is_later and known[LANE] + 1.0 < bounds.lanes:
        return ACCEPTED
    return CHANGES_LANE_WRONGLY


@kernel
def _examine_end(pieces: FloatArray, merge_s: float, bounds: Bounds) -> int:
    _, s, v, a = pieces[len(pieces) - 1]
    if a != 0.0:
        return NO_SAFE_END
    if not comes_onto_mainline(merge_s):
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
def _examine_speeds(
    pieces: FloatArray,
    merge_s: float,
    traits: FloatArray,
    before: FloatArray,
    makes_gap: bool,
    gap_made_s: float,
    bounds: Bounds,
) -> int:
    """``before`` is what was commanded until now; the gap is made by ``gap_made_s``.

    No vehicle is commanded more than its own top speed, but for one that enters faster.
    """
    v0, top_mps, entered_mps = bounds.mainline_speed_mps, traits[TOP_SPEED], pieces[0, 2]
    for i in range(len(pieces)):
        t, s, v, _ = pieces[i]
        if v < -EXACT:
            return BACKWARDS
        limit_mps = bounds.ramp_limit_mps if t < merge_s and s < -JOIN else v0
        if makes_gap and t >= merge_s:
            _, before_mps, _ = state_at(before, t)
            limit_mps = max(limit_mps, before_mps)
            if t < gap_made_s:
                limit_mps = max(limit_mps, v0 * bounds.gap_speed_factor)
        limit_mps = min(limit_mps, top_mps)
        if not (makes_gap and t >= merge_s) and v <= entered_mps:  # it slows down from its entry
            limit_mps = max(limit_mps, entered_mps)
        if v > limit_mps + JOIN:
            return TOO_FAST
    return ACCEPTED


@kernel
def _last_merge_s(change: Change) -> float:
    last_s = -math.inf
    for k in range(len(change.rows)):
        if change.makes_gap[k] == 0 and comes_onto_mainline(change.merge_s[k]):
            last_s = max(last_s, change.merge_s[k])
    return last_s


@kernel
def _examine_accelerations(
    pieces: FloatArray, merge_s: float, traits: FloatArray, bounds: Bounds
) -> int:
    """A vehicle of limited power P per mass may speed up by P / v at the end of each piece."""
    for i in range(len(pieces)):
        t, s, v, a = pieces[i]
        most_mps2 = min(bounds.comfort_mps2, traits[BRAKING])
        if a > 0.0:
            most_mps2 = bounds.comfort_mps2
            if s > -JOIN and t < merge_s and comes_onto_mainline(merge_s):
                most_mps2 = bounds.ramp_acceleration_mps2
            most_mps2 = min(most_mps2, traits[ACCELERATION])
            ends_mps = pieces[i + 1, 2] if i + 1 < len(pieces) else v
            if a * ends_mps > traits[POWER] * (1.0 + JOIN):
                return TOO_HARD
        if abs(a) > most_mps2 + JOIN:
            return TOO_HARD
    return ACCEPTED
