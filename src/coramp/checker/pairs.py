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
    kernels handle these faster than an array. ``lane`` is that of the mainline by which it came, 0
    next to the ramp, and ``change_s`` when it begins to change to the next one further in, infinity
    for never.
    """

    pieces: FloatArray
    merge_s: float
    length_m: float
    positioning_error_m: float
    clock_error_s: float
    time_gap_s: float
    lane: float
    change_s: float


@kernel
def way_with(
    pieces: FloatArray,
    merge_s: float,
    traits: FloatArray,
    lane: float = 0.0,
    change_s: float = math.inf,
) -> Way:
    """Returns the way of a vehicle with these traits (columns of ``distances``)."""
    return Way(
        pieces,
        merge_s,
        traits[LENGTH],
        traits[POSITIONING],
        traits[CLOCK],
        traits[TIME_GAP],
        lane,
        change_s,
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
    the second of them comes onto the mainline, Eq. 1 from then on. Where the mainline has several
    lanes, while they share one.
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
    if bounds.lanes > 1:
        return _examine_in_lanes(mine, theirs, from_s, least, bounds)
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
def _examine_in_lanes(
    mine: Way, theirs: Way, from_s: float, least: float, bounds: Bounds
) -> tuple[int, float]:
    """Returns a reason and the least margin (m) of two vehicles in each lane that they share.

    Who merges comes onto lane 0, where Eq. 15 and 16 hold if the other is there at that moment.
    """
    for my_change in range(2):
        my_lane, my_start_s, my_end_s = _stay(mine, my_change, bounds)
        for their_change in range(2):
            their_lane, their_start_s, their_end_s = _stay(theirs, their_change, bounds)
            together_s, end_s = max(my_start_s, their_start_s), min(my_end_s, their_end_s)
            if my_lane != their_lane or max(from_s, together_s) >= end_s:
                continue
            if together_s >= from_s and together_s == max(mine.merge_s, theirs.merge_s):
                merging, other = (mine, theirs) if mine.merge_s == together_s else (theirs, mine)
                at_merge = _margin_at_merge_m(merging, other, together_s, bounds)
                if at_merge < bounds.allowance_m - EXACT:
                    return TOO_NEAR_AT_MERGE, at_merge
                least = min(least, at_merge)
            margin = _least_of_pair_m(mine, theirs, max(from_s, together_s), end_s, bounds)
            if margin < bounds.allowance_m - EXACT:
                return TOO_NEAR, margin
            least = min(least, margin)
    return ACCEPTED, least


@kernel
def _stay(way: Way, after_change: int, bounds: Bounds) -> tuple[float, float, float]:
    """Returns a lane of the mainline, from when and until when (s) a vehicle counts on it.

    That is the lane by which it came, or the one to which it changes: it counts on both of them
    while it changes. A stay that never is begins at infinity.
    """
    if after_change == 1:
        return way.lane + 1.0, way.change_s, math.inf
    return way.lane, way.merge_s, way.change_s + bounds.lane_change_lasts_s


@kernel
def never_share_a_lane(mine: Way, theirs: Way) -> bool:
    """Returns whether two vehicles on the mainline keep to different lanes."""
    if mine.lane == theirs.lane:
        return False
    further_in, outer = (mine, theirs) if mine.lane > theirs.lane else (theirs, mine)
    return bool(further_in.lane != outer.lane + 1.0 or math.isinf(outer.change_s))


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
    if bounds.lanes > 1 and never_share_a_lane(mine, theirs):
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
