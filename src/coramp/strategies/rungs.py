"""The rungs free, reach and create of the ladder; each fills a proposal or says that it cannot.

Rung delay is in ``delays``.

The functions return the chosen acceleration, merge time and merge station, and the gap's number,
in a ``Merge``; ``gap`` is -1 where the rung does not help.
"""

import math
from typing import NamedTuple

from coramp._kernel import kernel
from coramp.equations.ramp_acceleration import acceleration_for_lag_mps2
from coramp.road.rules import Rules
from coramp.strategies.proposals import (
    find_unsafe_pair,
    propose_merge,
    push_ahead,
    push_back,
)
from coramp.strategies.situation import (
    RUNG_CREATE,
    RUNG_FREE,
    RUNG_REACH,
    Situation,
    gap_bounds_m,
    gap_of_free_movement,
)
from coramp.vehicles.fleet import (
    ROUNDING_M,
    Fleet,
    Proposal,
)
from coramp.vehicles.trace import (
    AHEAD_OF_REACH,
    BEHIND_REACH,
    FRONT_OUT_OF_REACH,
    GAP_TOO_SMALL,
    HOLDS_UP_NEWCOMER,
    PAST_LAST_STATION,
    note_merge,
    note_moves,
    open_in_gap,
    refuse,
)


class Merge(NamedTuple):
    """Where a rung puts the subject."""

    gap: int
    accel_mps2: float
    merge_time_s: float
    merge_station_m: float
    largest_shift_m: float


@kernel
def no_merge() -> Merge:
    """Returns the answer of a rung that does not help."""
    return Merge(-1, math.nan, math.nan, math.nan, math.nan)


@kernel
def merge_at(
    fleet: Fleet,
    proposal: Proposal,
    situation: Situation,
    gap: int,
    intercept_m: float,
    make_room: bool,
    rules: Rules,
) -> Merge:
    """Proposes that the subject ends at ``intercept_m`` in ``gap``; moves others aside if asked to.

    The vehicle before the gap is pushed ahead and the one behind it back by what is missing, each
    with its cascade. Nothing is moved where nothing is missing. The result's ``gap`` is -1 where a
    bound or a safe distance would be broken.
    """
    v0 = rules.road.mainline_speed_mps
    accel_mps2 = acceleration_for_lag_mps2(
        v0, situation.nose_speed_mps, -v0 * situation.nose_s - intercept_m
    )
    accel_mps2 = min(accel_mps2, rules.motion.ramp_acceleration_mps2)
    merge_s, merge_m = propose_merge(
        proposal, situation.subject, situation.approach, accel_mps2, rules
    )
    note_merge(
        proposal.trace,
        intercept_m,
        accel_mps2,
        merge_s,
        merge_m,
        situation.nose_s,
        situation.nose_speed_mps,
    )
    if merge_m > rules.road.last_merge_station_m + ROUNDING_M:
        past_m = merge_m - rules.road.last_merge_station_m
        refuse(proposal.trace, PAST_LAST_STATION, -1, past_m)
        return no_merge()
    ahead_m, back_m = 0.0, 0.0
    if make_room:
        low_m, high_m = gap_bounds_m(fleet, situation, gap)
        ahead_m, back_m = max(0.0, intercept_m - high_m), max(0.0, low_m - intercept_m)
        start_s = situation.nose_s if rules.control.create_from_nose else situation.from_s
        note_moves(proposal.trace, ahead_m, back_m, start_s)
        if not push_ahead(
            fleet,
            proposal,
            situation.order,
            gap - 1,
            situation.from_s,
            start_s,
            merge_s,
            ahead_m,
            rules,
        ) or not push_back(
            fleet,
            proposal,
            situation.order,
            gap,
            situation.from_s,
            start_s,
            merge_s,
            back_m,
            rules,
        ):
            return no_merge()
    unsafe, _ = find_unsafe_pair(fleet, proposal, situation.from_s, rules)
    if unsafe >= 0:
        return no_merge()
    return Merge(gap, accel_mps2, merge_s, merge_m, max(ahead_m, back_m))


@kernel
def merge_freely(fleet: Fleet, proposal: Proposal, situation: Situation, rules: Rules) -> Merge:
    """Rung free: free movement, if it is safe as it is."""
    gap = gap_of_free_movement(situation)
    open_in_gap(proposal.trace, RUNG_FREE, 0, situation.order, gap)
    unknown_m = unknown_bound_m(fleet, situation)
    if situation.free_m < unknown_m:
        refuse(proposal.trace, HOLDS_UP_NEWCOMER, -1, unknown_m - situation.free_m)
        return no_merge()
    return merge_at(fleet, proposal, situation, gap, situation.free_m, False, rules)


@kernel
def reach(fleet: Fleet, proposal: Proposal, situation: Situation, gap: int, rules: Rules) -> Merge:
    """Rung reach: an acceleration of Eq. 22 that puts the subject into a gap that is large enough.

    ``reach_as`` says which one.
    """
    open_in_gap(proposal.trace, RUNG_REACH, 0, situation.order, gap)
    return reach_as(fleet, proposal, situation, gap, RUNG_REACH, rules)


@kernel
def reach_as(
    fleet: Fleet, proposal: Proposal, situation: Situation, gap: int, rung: int, rules: Rules
) -> Merge:
    """Reaches a gap for any rung, by an acceleration of Eq. 22, in the attempt under way.

    The one nearest to free movement's, or with ``gap_at_front`` that of Eq. 30. Where a vehicle
    before it on the acceleration lane is in the way, others within the gap are tried.
    """
    low_m, high_m = gap_bounds_m(fleet, situation, gap)
    front_m = high_m
    low_m, high_m = max(low_m, situation.lowest_m), min(high_m, situation.highest_m)
    if low_m > high_m:
        refuse_gap(fleet, proposal, situation, gap)
        return no_merge()
    if rules.control.gap_at_front and not math.isinf(front_m):
        if front_m > high_m + ROUNDING_M:
            refuse(proposal.trace, FRONT_OUT_OF_REACH, -1, front_m - high_m)
            return no_merge()
        return merge_at(fleet, proposal, situation, gap, front_m, False, rules)
    nearest_m = min(max(situation.free_m, low_m), high_m)
    for share in (0.0, 0.25, 0.5, 1.0):
        if share > 0.0:
            open_in_gap(proposal.trace, rung, 0, situation.order, gap)
        merge = merge_at(
            fleet,
            proposal,
            situation,
            gap,
            nearest_m + share * (low_m - nearest_m),
            False,
            rules,
        )
        if merge.gap >= 0 or nearest_m <= low_m + ROUNDING_M:
            return merge
    return no_merge()


@kernel
def create(
    fleet: Fleet,
    proposal: Proposal,
    situation: Situation,
    gap: int,
    scenario: int,
    rules: Rules,
) -> Merge:
    """Rung create: a gap that is too small is made large enough.

    Scenario 1: X moves ahead, Y stays (Eq. 36-45). 2: Y falls back, X stays. 3: both, in equal
    parts, or as the subject's reach allows. The subject ends right before Y, right behind X, or in
    between.
    """
    low_m, high_m = gap_bounds_m(fleet, situation, gap)
    if low_m <= high_m:
        return no_merge()
    if scenario != 2 and gap == 0:
        return no_merge()
    if scenario != 1 and gap == len(situation.order):
        return no_merge()
    if scenario == 1:
        intercept_m = max(low_m, situation.lowest_m)
    elif scenario == 2:
        intercept_m = min(high_m, situation.highest_m)
    else:
        intercept_m = min(max(0.5 * (low_m + high_m), situation.lowest_m), situation.highest_m)
        if not high_m < intercept_m < low_m:  # only one of them would move
            return no_merge()
    open_in_gap(proposal.trace, RUNG_CREATE, scenario, situation.order, gap)
    unknown_m = unknown_bound_m(fleet, situation)
    if intercept_m < situation.lowest_m:
        refuse(proposal.trace, BEHIND_REACH, -1, situation.lowest_m - intercept_m)
        return no_merge()
    if intercept_m > situation.highest_m:
        refuse(proposal.trace, AHEAD_OF_REACH, -1, intercept_m - situation.highest_m)
        return no_merge()
    if intercept_m < unknown_m:
        refuse(proposal.trace, HOLDS_UP_NEWCOMER, -1, unknown_m - intercept_m)
        return no_merge()
    return merge_at(fleet, proposal, situation, gap, intercept_m, True, rules)


@kernel
def refuse_gap(fleet: Fleet, proposal: Proposal, situation: Situation, gap: int) -> None:
    """Says why a gap that the subject cannot reach as it is does not help, in the trace.

    It is too small, or large enough and out of reach; or what is left of it, or within reach, could
    hold up a vehicle that is yet to enter.
    """
    low_m, high_m = gap_bounds_m(fleet, situation, gap)
    rear_known = gap < len(situation.order) and situation.intercepts_m[gap] >= situation.known_m
    if low_m > min(high_m, situation.highest_m) and not rear_known:
        missing_m = low_m - min(high_m, situation.highest_m)
        refuse(proposal.trace, HOLDS_UP_NEWCOMER, -1, missing_m)
    elif low_m > high_m:
        refuse(proposal.trace, GAP_TOO_SMALL, -1, low_m - high_m)
    elif low_m > situation.highest_m:
        refuse(proposal.trace, AHEAD_OF_REACH, -1, low_m - situation.highest_m)
    else:
        refuse(proposal.trace, BEHIND_REACH, -1, situation.lowest_m - high_m)


@kernel
def unknown_bound_m(fleet: Fleet, situation: Situation) -> float:
    """Returns the lowest intercept (m) that holds up no vehicle which is yet to enter."""
    return situation.known_m + float(fleet.length_m[situation.subject]) + situation.clearance_m
