"""Slots of ramp vehicles: a slower cruise on the ramp, or a later departure from their stop."""

import math
from typing import NamedTuple

import numpy as np

from coramp._kernel import FloatArray, kernel
from coramp.equations.ramp_acceleration import lag_m
from coramp.kinematics.trajectory import (
    MAX_PIECES,
    SPEED,
    STATION,
    TIME,
    begin,
    clip_end,
    station_and_speed,
    time_at_station,
)
from coramp.motion.approach import change_speed
from coramp.road.rules import Rules, unpacked
from coramp.strategies.delays import delay_followers
from coramp.strategies.ladder import plan_of
from coramp.strategies.proposals import find_unsafe_pair, propose_merge
from coramp.strategies.rungs import Merge, no_merge
from coramp.strategies.situation import (
    RUNG_DELAY,
    RUNG_FREE,
    RUNG_HOLD,
    RUNG_REACH,
    MergePlan,
    Situation,
    assess,
    bounds_between_m,
    conflict_position,
    ramp_neighbours,
)
from coramp.strategies.slot_in_lane import HALVINGS, KEEP_M, SETBACKS_M
from coramp.strategies.slot_on_ramp import (
    leader_regains_s,
    leave_stop_at,
    leave_stop_for_slot,
    slow_on_ramp,
    smooth_on_ramp,
)
from coramp.strategies.slot_pushing import SETBACKS_M as PUSHING_SETBACKS_M
from coramp.strategies.slot_pushing import fall_back_behind
from coramp.vehicles.fleet import ROUNDING_M, Fleet, Proposal, committed, empty_proposal, proposed
from coramp.vehicles.trace import (
    AHEAD_OF_REACH,
    CANNOT_FALL_BACK,
    GAP_TOO_SMALL,
    LEADER_WAITS,
    NO_LATE_WAY,
    PAST_LAST_STATION,
    TOO_LATE,
    accept,
    note_merge,
    note_moves,
    open_attempt,
    open_in_gap,
    refuse,
)

ROOM = 128
"""Vehicles that a plan may change: the subject and those behind it."""
NOSES = ((0.0, 0.0), (0.0, 0.1), (0.0, 0.25), (0.0, 0.5), (0.0, 1.0), (1.0, 0.0), (1.0, 0.5))
"""How the nose is passed: how far from the ramp's speed to its limit and, behind it, how far from
free movement's acceleration to the largest."""
MOST_TRIES_PUSHING = 3
"""Ways of the subject that are tried where others fall back: each try has them all planned."""
PATIENCE_S = 5.0
"""Where others may fall back, a slot this much later is not taken yet: those behind it on the ramp
would have to come later still."""


class Wish(NamedTuple):
    """What a ramp vehicle asks for: its foremost intercept and that of its claim (m).

    With ``pushes`` mainline vehicles that cross after its claim fall back behind it. ``jerk_mps3``
    is as in ``Manner``.
    """

    earliest_m: float
    claim_m: float
    pushes: bool
    jerk_mps3: float


class Place(NamedTuple):
    """Where a merge is tried: gap of the lane order, intercept (m), who may have to fall back.

    That is everyone of the lane order from ``first_behind`` on; nobody where it is its length.
    """

    gap: int
    slot_m: float
    first_behind: int
    jerk_mps3: float


@kernel
def crossing_of_s(fleet: Fleet, row: int, now_s: float, packed_rules: FloatArray) -> float:
    """Returns when (s) a ramp vehicle in free movement crosses the nose as if it were at v0."""
    rules = unpacked(packed_rules)
    out = np.empty((MAX_PIECES, 4))
    from_s = now_s + rules.control.actuation_delay_s
    _, _, slot_m = leave_stop_at(committed(fleet, row), from_s, from_s, out, rules)
    return -slot_m / rules.road.mainline_speed_mps


@kernel
def plan_onto_lane(
    fleet: Fleet,
    row: int,
    now_s: float,
    claim_s: float,
    pushes: bool,
    jerk_mps3: float,
    packed_rules: FloatArray,
) -> tuple[MergePlan, Proposal, bool, int]:
    """Returns a ramp vehicle's plan into the first slot that it can take, and its trajectories.

    The slots tried lie in the gaps of the lane order, from its earliest backwards: that of free
    movement or, for a vehicle that was held up, one nearer to the crossing time ``claim_s`` that it
    would have had. With ``pushes`` the first one tried is behind all that cross before the claim,
    and those behind it on the mainline fall back; a much later one is not taken. The rest is what
    ``ramp_neighbours`` tells.
    """
    rules = unpacked(packed_rules)
    proposal = empty_proposal(ROOM)
    situation = assess(fleet, row, now_s, 0.0, rules)
    blocked, behind = ramp_neighbours(fleet, row, situation.from_s)
    conflict = conflict_position(fleet, situation, rules)
    merge = no_merge()
    if blocked:
        open_attempt(proposal.trace, RUNG_DELAY, 0, -1, -1)
        refuse(proposal.trace, LEADER_WAITS, -1, math.nan)
    else:
        claim_m = -rules.road.mainline_speed_mps * claim_s
        earliest_m = earliest_slot_m(fleet, situation, claim_m, rules)
        wish = Wish(earliest_m, claim_m, pushes, jerk_mps3)
        if pushes:
            merge = slot_among(fleet, proposal, situation, wish, rules)
        if merge.gap < 0:
            merge = first_slot(fleet, proposal, situation, wish, rules)
            patience_m = rules.road.mainline_speed_mps * PATIENCE_S
            if pushes and merge.largest_shift_m > patience_m:
                refuse(proposal.trace, TOO_LATE, -1, merge.largest_shift_m - patience_m)
                proposal.size[0] = 0
                merge = no_merge()
    rung = RUNG_HOLD
    if merge.gap >= 0:
        rung = RUNG_DELAY
        if merge.largest_shift_m < KEEP_M:
            rung = RUNG_FREE if merge.accel_mps2 == situation.free_accel_mps2 else RUNG_REACH
    plan = plan_of(fleet, proposal, situation, merge, rung, 0, conflict, rules)
    return plan, proposal, blocked, behind


@kernel
def earliest_slot_m(fleet: Fleet, situation: Situation, claim_m: float, rules: Rules) -> float:
    """Returns the foremost intercept (m) that the subject may take.

    A vehicle that was held up makes up for it at the ramp's limit and with the largest acceleration
    behind the nose, but is never before its claim.
    """
    road, motion = rules.road, rules.motion
    station_m, speed_mps = station_and_speed(committed(fleet, situation.subject), situation.from_s)
    out = np.empty((MAX_PIECES, 4))
    n = begin(out, situation.from_s, station_m, speed_mps)
    n = change_speed(out, n, road.ramp_limit_mps, motion)
    n = clip_end(out, n, time_at_station(out[:n], 0.0))
    v0 = road.mainline_speed_mps
    fastest_m = -v0 * out[n - 1, TIME] - lag_m(v0, out[n - 1, SPEED], motion.ramp_acceleration_mps2)
    return float(max(situation.free_m, min(fastest_m, claim_m)))


@kernel
def first_slot(
    fleet: Fleet, proposal: Proposal, situation: Situation, wish: Wish, rules: Rules
) -> Merge:
    """Proposes the first slot that the subject can take; ``gap`` is -1 where there is none."""
    order, intercepts_m = situation.order, situation.intercepts_m
    own_m = fleet.length_m[situation.subject] + situation.clearance_m
    for gap in range(len(order) + 1):
        low_m, high_m = bounds_between_m(
            order, intercepts_m, fleet.length_m, gap, -math.inf, own_m, situation.clearance_m
        )
        first_m, failed_m = min(high_m, wish.earliest_m), -1.0
        if first_m < low_m:
            open_in_gap(proposal.trace, RUNG_DELAY, 0, order, gap)
            reason = GAP_TOO_SMALL if high_m < low_m else AHEAD_OF_REACH
            refuse(proposal.trace, reason, -1, low_m - first_m)
        for setback_m in SETBACKS_M:
            if first_m - setback_m < low_m:
                break
            open_in_gap(proposal.trace, RUNG_DELAY, 0, order, gap)
            place = Place(gap, first_m - setback_m, len(order), wish.jerk_mps3)
            merge = merge_in_slot(fleet, proposal, situation, place, rules)
            if merge.gap >= 0:
                if failed_m < 0.0:
                    return merge
                return nearer_slot(fleet, proposal, situation, place, setback_m - failed_m, rules)
            failed_m = setback_m
    proposal.size[0] = 0
    return no_merge()


@kernel
def nearer_slot(
    fleet: Fleet,
    proposal: Proposal,
    situation: Situation,
    found: Place,
    nearer_m: float,
    rules: Rules,
) -> Merge:
    """Proposes the slot nearest to one that failed, ``nearer_m`` before one that was found."""
    gain_m, step_m = 0.0, nearer_m
    for _ in range(HALVINGS):
        step_m *= 0.5
        place = Place(
            found.gap, found.slot_m + gain_m + step_m, found.first_behind, found.jerk_mps3
        )
        if merge_in_slot(fleet, proposal, situation, place, rules).gap >= 0:
            gain_m += step_m
    place = Place(found.gap, found.slot_m + gain_m, found.first_behind, found.jerk_mps3)
    return merge_in_slot(fleet, proposal, situation, place, rules)


@kernel
def slot_among(
    fleet: Fleet, proposal: Proposal, situation: Situation, wish: Wish, rules: Rules
) -> Merge:
    """Proposes the slot behind all that cross before the claim; who is behind it falls back."""
    order, intercepts_m = situation.order, situation.intercepts_m
    gap = 0
    while gap < len(order) and intercepts_m[gap] >= min(wish.claim_m, wish.earliest_m):
        gap += 1
    first_m = wish.earliest_m
    if gap > 0:
        ahead_m = intercepts_m[gap - 1] - fleet.length_m[order[gap - 1]] - situation.clearance_m
        first_m = min(first_m, ahead_m)
    for setback_m in PUSHING_SETBACKS_M:
        open_in_gap(proposal.trace, RUNG_DELAY, 0, order, gap)
        place = Place(gap, first_m - setback_m, gap, wish.jerk_mps3)
        merge = merge_in_slot(fleet, proposal, situation, place, rules)
        if merge.gap >= 0:
            return merge
    return no_merge()


@kernel
def merge_in_slot(
    fleet: Fleet, proposal: Proposal, situation: Situation, place: Place, rules: Rules
) -> Merge:
    """Proposes a merge into a place: a slower cruise on the ramp, or a later departure.

    After a slower cruise the nose is passed at the ramp's speed. Where others are in the way, the
    ramp's limit and higher accelerations behind the nose are tried: with these it is further behind
    its leader on the ramp for the same slot.
    """
    road, motion = rules.road, rules.motion
    free, most = situation.free_accel_mps2, motion.ramp_acceleration_mps2
    behind_free_m = situation.free_m - place.slot_m
    refuse(proposal.trace, NO_LATE_WAY, -1, math.nan)
    way = np.empty((MAX_PIECES, 4))
    if abs(behind_free_m) < KEEP_M and merges_safely(
        fleet, proposal, situation, situation.approach, free, place, rules
    ):
        return merge_of(proposal, place.gap, free, max(0.0, behind_free_m))
    regained_s, tried = leader_regains_s(fleet, situation, rules), 0
    for faster, share in NOSES:
        if place.first_behind < len(situation.order) and tried >= MOST_TRIES_PUSHING:
            return no_merge()
        accel_mps2 = free + share * (most - free)
        nose_mps = road.ramp_speed_mps + faster * (road.ramp_limit_mps - road.ramp_speed_mps)
        lag = lag_m(road.mainline_speed_mps, nose_mps, accel_mps2)
        nose_s = -(place.slot_m + lag) / road.mainline_speed_mps
        if place.jerk_mps3 > 0.0:
            n = smooth_on_ramp(fleet, situation, nose_s, nose_mps, place.jerk_mps3, way, rules)
            if n > 0 and merges_safely(
                fleet, proposal, situation, way[:n], accel_mps2, place, rules
            ):
                return merge_of(proposal, place.gap, accel_mps2, behind_free_m)
        for end_s in (
            nose_s,
            regained_s + rules.safety.time_gap_s,
            situation.from_s + 0.7 * (nose_s - situation.from_s),
            situation.from_s + 0.4 * (nose_s - situation.from_s),
        ):
            if not situation.from_s < end_s <= nose_s:
                continue
            tried += 1
            n = slow_on_ramp(fleet, situation, nose_s, nose_mps, end_s, way, rules)
            if n > 0 and merges_safely(
                fleet, proposal, situation, way[:n], accel_mps2, place, rules
            ):
                return merge_of(proposal, place.gap, accel_mps2, behind_free_m)
    n, accel_mps2 = leave_stop_for_slot(fleet, situation, place.slot_m, way, rules)
    if n > 0 and merges_safely(fleet, proposal, situation, way[:n], accel_mps2, place, rules):
        return merge_of(proposal, place.gap, accel_mps2, behind_free_m)
    return no_merge()


@kernel
def merge_of(proposal: Proposal, gap: int, accel_mps2: float, behind_free_m: float) -> Merge:
    """Returns the merge that the proposal's first entry makes."""
    pieces = proposed(proposal, 0)
    merge_s, merge_m = proposal.merge_time_s[0], pieces[len(pieces) - 1, STATION]
    accept(proposal.trace)
    return Merge(gap, accel_mps2, merge_s, merge_m, behind_free_m)


@kernel
def merges_safely(
    fleet: Fleet,
    proposal: Proposal,
    situation: Situation,
    approach: FloatArray,
    accel_mps2: float,
    place: Place,
    rules: Rules,
) -> bool:
    """Proposes an approach with its merge and what it asks of others; returns if all is safe.

    Those behind on the ramp brake for their stops, those behind on the mainline fall back.
    """
    merge_s, merge_m = propose_merge(proposal, situation.subject, approach, accel_mps2, rules)
    nose = approach[len(approach) - 1]
    note_merge(proposal.trace, place.slot_m, accel_mps2, merge_s, merge_m, nose[TIME], nose[SPEED])
    note_moves(proposal.trace, 0.0, 0.0, situation.from_s)
    if merge_m > rules.road.last_merge_station_m + ROUNDING_M:
        past_m = merge_m - rules.road.last_merge_station_m
        refuse(proposal.trace, PAST_LAST_STATION, -1, past_m)
        return False
    if not delay_followers(fleet, proposal, situation.subject, situation.from_s, rules):
        return False
    if not fall_back_behind(fleet, proposal, situation, place.first_behind, place.slot_m, rules):
        refuse(proposal.trace, CANNOT_FALL_BACK, -1, math.nan)
        return False
    unsafe, _ = find_unsafe_pair(fleet, proposal, situation.from_s, rules)
    return bool(unsafe < 0)
