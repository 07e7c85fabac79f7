"""Whether two vehicles keep their distance, over all time."""

import math
from typing import NamedTuple

from coramp._kernel import FloatArray, kernel
from coramp.checker.distances import (
    CLOCK,
    LENGTH,
    POSITIONING,
    TIME_GAP,
    Bounds,
    Envelope,
    Needs,
    envelope_of,
    lane_change_distance_m,
    least_margin_m,
    margin_at_least_m,
    passes_s,
    state_at,
)
from coramp.checker.merging import comes_onto_mainline
from coramp.checker.reasons import ACCEPTED, EXACT, TOO_NEAR, TOO_NEAR_AT_MERGE


class Way(NamedTuple):
    """One vehicle's trajectory and merge time (``checker.merging``).

    With them come its length, its errors of Eq. 1 and its time gap as a follower: as numbers, since
    kernels handle these faster than an array.
    """

    pieces: FloatArray
    merge_s: float
    length_m: float
    positioning_error_m: float
    clock_error_s: float
    time_gap_s: float


@kernel
def way_with(pieces: FloatArray, merge_s: float, traits: FloatArray) -> Way:
    """Returns the way of a vehicle with these traits (columns of ``distances``)."""
    return Way(
        pieces,
        merge_s,
        traits[LENGTH],
        traits[POSITIONING],
        traits[CLOCK],
        traits[TIME_GAP],
    )


@kernel
def needs_between(front: Way, rear: Way) -> Needs:
    """Returns what two vehicles need of each other."""
    return Needs(
        front.length_m,
        front.positioning_error_m + rear.positioning_error_m,
        front.clock_error_s,
        rear.clock_error_s,
        rear.time_gap_s,
    )


@kernel
def examine_pair(mine: Way, theirs: Way, from_s: float, bounds: Bounds) -> tuple[int, float]:
    """Returns a reason and the least margin (m) of two vehicles from ``from_s`` on.

    Eq. 1 while both are on the ramp or the acceleration lane, Eq. 15, 16 at the moment at which
    the second of them comes onto the mainline, Eq. 1 from then on.
    """
    least = math.inf
    ramp_until_s = min(mine.merge_s, theirs.merge_s)
    if ramp_until_s > from_s:
        least = _least_of_pair_m(mine, theirs, from_s, ramp_until_s, bounds)
        if least < bounds.allowance_m - EXACT:
            return TOO_NEAR, least
    mainline_from_s = max(mine.merge_s, theirs.merge_s)
    if not comes_onto_mainline(mainline_from_s):
        return ACCEPTED, least
    if mainline_from_s >= from_s:
        if mine.merge_s >= theirs.merge_s:
            at_merge = _margin_at_merge_m(mine, theirs, mainline_from_s, bounds)
        else:
            at_merge = _margin_at_merge_m(theirs, mine, mainline_from_s, bounds)
        if at_merge < bounds.allowance_m - EXACT:
            return TOO_NEAR_AT_MERGE, at_merge
        least = min(least, at_merge)
    start_s = max(from_s, mainline_from_s)
    on_mainline = _least_of_pair_m(mine, theirs, start_s, math.inf, bounds)
    if on_mainline < bounds.allowance_m - EXACT:
        return TOO_NEAR, on_mainline
    return ACCEPTED, min(least, on_mainline)


@kernel
def envelope_on_mainline(way: Way, bounds: Bounds) -> Envelope:
    """Returns the envelope of a vehicle from its merge on, unbounded where it has none."""
    from_s = max(way.pieces[0, 0], way.merge_s)
    if not comes_onto_mainline(way.merge_s):
        return Envelope(-math.inf, math.inf, 0.0, math.inf)
    return envelope_of(way.pieces, from_s, bounds.mainline_speed_mps)


@kernel
def surely_apart(
    mine: Way, my_envelope: Envelope, theirs: Way, from_s: float, least: float, bounds: Bounds
) -> bool:
    """Returns whether a pair need not be looked at: it meets on the mainline only, far apart.

    Then its margin is above the allowance and above ``least``, so it is neither too small nor the
    least. ``my_envelope`` is that of ``envelope_on_mainline``.
    """
    if min(mine.merge_s, theirs.merge_s) > from_s:
        return False
    start_s = max(from_s, mine.merge_s, theirs.merge_s)
    if not (comes_onto_mainline(mine.merge_s) and comes_onto_mainline(theirs.merge_s)):
        return True
    envelope = envelope_of(theirs.pieces, start_s, bounds.mainline_speed_mps)
    if my_envelope.lowest_m >= envelope.highest_m:
        needs = needs_between(mine, theirs)
        at_least = margin_at_least_m(my_envelope, envelope, needs, bounds)
    else:
        needs = needs_between(theirs, mine)
        at_least = margin_at_least_m(envelope, my_envelope, needs, bounds)
    return at_least > max(least, bounds.allowance_m)


@kernel
def _least_of_pair_m(mine: Way, theirs: Way, start_s: float, end_s: float, bounds: Bounds) -> float:
    my_station_m, _, _ = state_at(mine.pieces, start_s)
    their_station_m, _, _ = state_at(theirs.pieces, start_s)
    front, rear = (mine, theirs) if my_station_m > their_station_m else (theirs, mine)
    until_s = min(end_s, passes_s(front.pieces, bounds.zone_end_m))
    needs = needs_between(front, rear)
    return least_margin_m(front.pieces, rear.pieces, start_s, until_s, needs, bounds)


@kernel
def _margin_at_merge_m(merging: Way, other: Way, merge_s: float, bounds: Bounds) -> float:
    s_merging, v_merging, _ = state_at(merging.pieces, merge_s)
    s_other, v_other, _ = state_at(other.pieces, merge_s)
    errors_m = merging.positioning_error_m + other.positioning_error_m
    needed_m = lane_change_distance_m(v_merging, v_other, errors_m, bounds)
    if s_other > s_merging:
        return float(s_other - other.length_m - s_merging - needed_m)
    return float(s_merging - merging.length_m - s_other - needed_m)
