"""Whether a set of new trajectories may be committed."""

import math
from typing import NamedTuple

import numpy as np

from coramp._kernel import FloatArray, IntArray, kernel
from coramp.audit.distances import (
    Bounds,
    Envelope,
    envelope_of,
    lane_change_distance_m,
    least_margin_m,
    margin_at_least_m,
    passes_s,
    state_at,
)

(
    ACCEPTED,
    NOT_FINITE,
    TIMES_NOT_ASCENDING,
    STARTS_TOO_EARLY,
    LEAVES_ITS_PATH,
    HAS_A_JUMP,
    TOO_FAST,
    BACKWARDS,
    TOO_HARD,
    MERGES_OUTSIDE_LANE,
    NO_SAFE_END,
    TOO_NEAR,
    TOO_NEAR_AT_MERGE,
    CHANGES_THE_PAST,
) = range(14)

REASONS = (
    "accepted",
    "a value is not finite",
    "times do not ascend",
    "starts before the vehicle can act",
    "does not start where the vehicle is",
    "pieces do not join",
    "faster than allowed",
    "drives backwards",
    "accelerates or brakes harder than allowed",
    "merges outside the acceleration lane",
    "does not end in a cruise on the mainline or a stop before the nose",
    "comes nearer than the safe distance of Eq. 1",
    "comes nearer than Eq. 15 or 16 at the lane change",
    "changes a lane change that has happened, or the stream",
)

JOIN = 1e-6
"""Tolerance (s, m, m/s, m/s2) for pieces to join and bounds to hold."""
EXACT = 1e-9
"""Tolerance (m) for distances."""


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
        row = change.rows[k]
        own = _envelope_on_mainline(change, k, bounds)
        for other in vehicles.live[::-1]:  # who entered last is nearest to who enters
            k_other = _entry(change, other)
            if other == row or 0 <= k_other < k:
                continue
            code, margin = _examine_pair(vehicles, change, k, other, k_other, own, least, bounds)
            if code != ACCEPTED:
                return Verdict(code, row, other, margin)
            least = min(least, margin)
        for k_other in range(k + 1, len(change.rows)):
            other = change.rows[k_other]
            if not _is_live(vehicles, other):
                code, margin = _examine_pair(
                    vehicles, change, k, other, k_other, own, least, bounds
                )
                if code != ACCEPTED:
                    return Verdict(code, row, other, margin)
                least = min(least, margin)
    return Verdict(ACCEPTED, -1, -1, least)


@kernel
def _entry(change: Change, row: int) -> int:
    for k in range(len(change.rows)):
        if change.rows[k] == row:
            return k
    return -1


@kernel
def _is_live(vehicles: Vehicles, row: int) -> bool:
    return bool(np.any(vehicles.live == row))


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
    if pieces[0, 0] < earliest_s - JOIN:
        return STARTS_TOO_EARLY
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


@kernel
def _examine_pair(
    vehicles: Vehicles,
    change: Change,
    k: int,
    other: int,
    k_other: int,
    my_envelope: Envelope,
    least_so_far: float,
    bounds: Bounds,
) -> tuple[int, float]:
    row = change.rows[k]
    mine, my_merge_s = change.pieces[k, : change.piece_count[k]], change.merge_s[k]
    first = vehicles.first[other] if k_other < 0 else 0
    theirs = vehicles.pieces[first : first + vehicles.piece_count[other]]
    their_merge_s = vehicles.merge_s[other]
    from_s = mine[0, 0]
    if k_other >= 0:
        theirs = change.pieces[k_other, : change.piece_count[k_other]]
        their_merge_s = change.merge_s[k_other]
        from_s = max(from_s, theirs[0, 0])
    my_length_m, their_length_m = vehicles.length_m[row], vehicles.length_m[other]
    least = math.inf
    ramp_until_s = min(my_merge_s, their_merge_s)
    if ramp_until_s > from_s:
        least = _least_of_pair_m(
            mine, my_length_m, theirs, their_length_m, from_s, ramp_until_s, bounds
        )
        if least < bounds.allowance_m - EXACT:
            return TOO_NEAR, least
    mainline_from_s = max(my_merge_s, their_merge_s)
    if mainline_from_s == math.inf:
        return ACCEPTED, least
    if mainline_from_s >= from_s:
        i_merge = my_merge_s >= their_merge_s
        at_merge = _margin_at_merge_m(
            mine if i_merge else theirs,
            my_length_m if i_merge else their_length_m,
            theirs if i_merge else mine,
            their_length_m if i_merge else my_length_m,
            mainline_from_s,
            bounds,
        )
        if at_merge < bounds.allowance_m - EXACT:
            return TOO_NEAR_AT_MERGE, at_merge
        least = min(least, at_merge)
    start_s = max(from_s, mainline_from_s)
    their_envelope = envelope_of(theirs, start_s, bounds.mainline_speed_mps)
    my_station_m, _, _ = state_at(mine, start_s)
    their_station_m, _, _ = state_at(theirs, start_s)
    if my_station_m > their_station_m:
        at_least = margin_at_least_m(my_envelope, my_length_m, their_envelope, bounds)
    else:
        at_least = margin_at_least_m(their_envelope, their_length_m, my_envelope, bounds)
    if at_least > max(min(least, least_so_far), bounds.allowance_m):
        return ACCEPTED, least
    on_mainline = _least_of_pair_m(
        mine, my_length_m, theirs, their_length_m, start_s, math.inf, bounds
    )
    if on_mainline < bounds.allowance_m - EXACT:
        return TOO_NEAR, on_mainline
    return ACCEPTED, min(least, on_mainline)


@kernel
def _envelope_on_mainline(change: Change, k: int, bounds: Bounds) -> Envelope:
    """The envelope of a changed vehicle from when it is on the mainline, if ever."""
    pieces = change.pieces[k, : change.piece_count[k]]
    from_s = max(pieces[0, 0], change.merge_s[k])
    if from_s == math.inf:
        return Envelope(-math.inf, math.inf, 0.0, math.inf)
    return envelope_of(pieces, from_s, bounds.mainline_speed_mps)


@kernel
def _least_of_pair_m(
    mine: FloatArray,
    my_length_m: float,
    theirs: FloatArray,
    their_length_m: float,
    start_s: float,
    end_s: float,
    bounds: Bounds,
) -> float:
    my_station_m, _, _ = state_at(mine, start_s)
    their_station_m, _, _ = state_at(theirs, start_s)
    if my_station_m > their_station_m:
        until_s = min(end_s, passes_s(mine, bounds.zone_end_m))
        return least_margin_m(mine, my_length_m, theirs, start_s, until_s, bounds)
    until_s = min(end_s, passes_s(theirs, bounds.zone_end_m))
    return least_margin_m(theirs, their_length_m, mine, start_s, until_s, bounds)


@kernel
def _margin_at_merge_m(
    merging: FloatArray,
    merging_length_m: float,
    other: FloatArray,
    other_length_m: float,
    merge_s: float,
    bounds: Bounds,
) -> float:
    s_merging, v_merging, _ = state_at(merging, merge_s)
    s_other, v_other, _ = state_at(other, merge_s)
    needed_m = lane_change_distance_m(v_merging, v_other, bounds)
    if s_other > s_merging:
        return s_other - other_length_m - s_merging - needed_m
    return s_merging - merging_length_m - s_other - needed_m
