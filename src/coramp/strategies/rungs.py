"""The rungs of the ladder: free, reach, create, delay; each fills a proposal or says that it can't.

The functions return the chosen acceleration, merge time and merge station, and the gap's number,
in a ``Merge``; ``gap`` is -1 where the rung does not help.
"""

import math
from typing import NamedTuple

import numpy as np

from coramp._kernel import FloatArray, kernel
from coramp.core.approach import brake_and_go, late_approach, late_start, stop_of_m
from coramp.core.fleet import (
    ROUNDING_M,
    Fleet,
    Proposal,
    committed,
    entry_of,
    pair_margin_m,
    proposed,
)
from coramp.core.proposals import (
    find_unsafe_pair,
    propose_merge,
    push_ahead,
    push_back,
)
from coramp.core.ramp_acceleration import acceleration_for_lag_mps2, lag_m
from coramp.core.ramp_queue import longest_wait_s, next_behind_on_ramp, propose_stop
from coramp.core.rules import Rules
from coramp.core.trajectory import MAX_PIECES, station_and_speed
from coramp.strategies.situation import (
    Situation,
    gap_bounds_m,
    gap_of_free_movement,
    situation_from,
)


EVENLY, AT_ONCE, AT_THE_STOP = range(3)
"""How a ramp vehicle that comes late loses its time."""


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
    if merge_m > rules.road.last_merge_station_m + ROUNDING_M:
        return no_merge()
    ahead_m, back_m = 0.0, 0.0
    if make_room:
        low_m, high_m = gap_bounds_m(fleet, situation, gap)
        ahead_m, back_m = max(0.0, intercept_m - high_m), max(0.0, low_m - intercept_m)
        start_s = situation.nose_s if rules.control.create_from_nose else situation.from_s
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
    if situation.free_m < unknown_bound_m(fleet, situation):
        return no_merge()
    gap = gap_of_free_movement(situation)
    return merge_at(fleet, proposal, situation, gap, situation.free_m, False, rules)


@kernel
def reach(fleet: Fleet, proposal: Proposal, situation: Situation, gap: int, rules: Rules) -> Merge:
    """Rung reach: an acceleration of Eq. 22 that puts the subject into a gap that is large enough.

    The one nearest to free movement's, or with ``gap_at_front`` that of Eq. 30. Where a vehicle
    before it on the acceleration lane is in the way, others within the gap are tried.
    """
    low_m, high_m = gap_bounds_m(fleet, situation, gap)
    front_m = high_m
    low_m, high_m = max(low_m, situation.lowest_m), min(high_m, situation.highest_m)
    if low_m > high_m:
        return no_merge()
    if rules.control.gap_at_front and not math.isinf(front_m):
        if front_m > high_m + ROUNDING_M:
            return no_merge()
        return merge_at(fleet, proposal, situation, gap, front_m, False, rules)
    nearest_m = min(max(situation.free_m, low_m), high_m)
    for share in (0.0, 0.25, 0.5, 1.0):
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
    if intercept_m < situation.lowest_m or intercept_m > situation.highest_m:
        return no_merge()
    if intercept_m < unknown_bound_m(fleet, situation):
        return no_merge()
    return merge_at(fleet, proposal, situation, gap, intercept_m, True, rules)


@kernel
def unknown_bound_m(fleet: Fleet, situation: Situation) -> float:
    """Returns the lowest intercept (m) that bothers no vehicle which is yet to enter."""
    return situation.known_m + float(fleet.length_m[situation.subject]) + situation.clearance_m


@kernel
def delay(fleet: Fleet, proposal: Proposal, situation: Situation, gap: int, rules: Rules) -> Merge:
    """Rung delay: come late to a later gap that is large enough, as ``come_late`` does."""
    return come_late(fleet, proposal, situation, gap, 0.0, rules)


@kernel
def delay_and_create(
    fleet: Fleet, proposal: Proposal, situation: Situation, gap: int, rules: Rules
) -> Merge:
    """Rung delay with gap creation: come late to a gap whose rear vehicle falls back (scenario 2).

    By no more than what the time gaps before and behind the subject ask for; the safe distances of
    the paper alone leave gaps enough.
    """
    room_m = 2.0 * rules.safety.time_gap_s * rules.road.mainline_speed_mps
    low_m, high_m = gap_bounds_m(fleet, situation, gap)
    if room_m <= 0.0 or low_m <= min(high_m, situation.free_m):
        return no_merge()
    return come_late(fleet, proposal, situation, gap, room_m, rules)


@kernel
def come_late(
    fleet: Fleet,
    proposal: Proposal,
    situation: Situation,
    gap: int,
    room_m: float,
    rules: Rules,
) -> Merge:
    """Slow down on the ramp, or start late, so as to end at the front of a later gap.

    The subject passes the nose late, as ``late_way`` does, and accelerates as in free movement.
    Vehicles behind it on the ramp brake where they would come too near. The vehicle behind a gap
    that is too small falls back by what is missing, up to ``room_m``, with its cascade. By the
    distances of Eq. 1 alone those behind on the ramp can do the same, so that one way to come late
    is enough; with a time gap the others are tried as well.
    """
    low_m, high_m = gap_bounds_m(fleet, situation, gap)
    target_m = min(high_m, situation.free_m)
    back_m = max(0.0, low_m - target_m)
    if back_m > room_m:
        return no_merge()
    if back_m > 0.0 and (
        gap == len(situation.order) or target_m < unknown_bound_m(fleet, situation)
    ):
        return no_merge()
    if longest_wait_s(rules.safety) > 0.0:
        for way in (AT_ONCE, AT_THE_STOP):
            merge = come_late_by(fleet, proposal, situation, gap, way, target_m, back_m, rules)
            if merge.gap >= 0:
                return merge
    return come_late_by(fleet, proposal, situation, gap, EVENLY, target_m, back_m, rules)


@kernel
def come_late_by(
    fleet: Fleet,
    proposal: Proposal,
    situation: Situation,
    gap: int,
    way: int,
    target_m: float,
    back_m: float,
    rules: Rules,
) -> Merge:
    """Proposes to end at ``target_m`` by one way to come late, Y falling back by ``back_m``."""
    buffer = np.empty((MAX_PIECES, 4))
    n = late_way(fleet, situation, way, target_m, rules, buffer)
    if n == 0:
        return no_merge()
    later = with_approach(situation, buffer[:n], rules)
    accel_mps2 = later.free_accel_mps2
    merge_s, merge_m = propose_merge(proposal, later.subject, later.approach, accel_mps2, rules)
    if merge_m > rules.road.last_merge_station_m + ROUNDING_M:
        return no_merge()
    if too_near_ahead(fleet, proposal, situation, gap, rules):
        return no_merge()
    if not delay_followers(fleet, proposal, situation, rules):
        return no_merge()
    if not push_back(
        fleet,
        proposal,
        situation.order,
        gap,
        situation.from_s,
        situation.from_s,
        merge_s,
        back_m,
        rules,
    ):
        return no_merge()
    unsafe, _ = find_unsafe_pair(fleet, proposal, situation.from_s, rules)
    if unsafe >= 0:
        return no_merge()
    return Merge(gap, accel_mps2, merge_s, merge_m, back_m)


@kernel
def too_near_ahead(
    fleet: Fleet, proposal: Proposal, situation: Situation, gap: int, rules: Rules
) -> bool:
    """Returns whether the subject comes too near to X or to one before it that is to merge.

    Nobody moves these aside when the subject comes late, so it is not worth asking those behind.
    """
    row = situation.subject
    for place in range(gap - 1, -1, -1):
        other = situation.order[place]
        if place < gap - 1 and fleet.merge_time_s[other] <= situation.from_s:
            continue
        margin_m = pair_margin_m(
            proposed(proposal, 0),
            fleet.length_m[row],
            proposal.merge_time_s[0],
            committed(fleet, other),
            fleet.length_m[other],
            fleet.merge_time_s[other],
            situation.from_s,
            rules,
        )
        if margin_m < rules.safety.execution_allowance_m - ROUNDING_M:
            return True
    return False


@kernel
def late_way(
    fleet: Fleet, situation: Situation, way: int, target_m: float, rules: Rules, out: FloatArray
) -> int:
    """Writes the subject's way to the nose with which free movement ends at ``target_m``.

    ``way`` says how it loses its time. AT_ONCE, so that those behind lose no more. EVENLY, by a
    slower speed for as long as there is. AT_THE_STOP: it goes on to its stop, stands, and starts in
    time. Returns the number of pieces, 0 where there is no such way.
    """
    road, motion, from_s = rules.road, rules.motion, situation.from_s
    v0 = road.mainline_speed_mps
    before = committed(fleet, situation.subject)
    if way == AT_THE_STOP:
        n = late_start(before, from_s, 0.0, road, motion, out)
        if n == 0:
            return 0
        wait_s = (with_approach(situation, out[:n], rules).free_m - target_m) / v0
        if not 0.0 < wait_s <= longest_wait_s(rules.safety):
            return 0
        return late_start(before, from_s, wait_s, road, motion, out)
    station_m, speed_mps = station_and_speed(before, from_s)
    lag = lag_m(v0, road.ramp_speed_mps, motion.free_acceleration_mps2)
    nose_s = -(target_m + lag) / v0
    if way == AT_ONCE:
        return brake_and_go(from_s, station_m, speed_mps, nose_s, road, motion, out)
    return late_approach(from_s, station_m, speed_mps, nose_s, road, motion, out)


@kernel
def with_approach(situation: Situation, approach: FloatArray, rules: Rules) -> Situation:
    """Returns the situation of the same subject if it comes to the nose by ``approach``."""
    return situation_from(
        situation.subject,
        situation.from_s,
        approach,
        situation.known_m,
        situation.order,
        situation.intercepts_m,
        rules,
    )


@kernel
def delay_followers(fleet: Fleet, proposal: Proposal, situation: Situation, rules: Rules) -> bool:
    """Adds those behind the subject on the ramp that would come too near to who is before them."""
    leader = situation.subject
    while True:
        follower = next_behind_on_ramp(fleet, leader, situation.from_s)
        if follower < 0:
            return True
        entry = entry_of(proposal, leader)
        margin_m = pair_margin_m(
            proposed(proposal, entry),
            fleet.length_m[leader],
            proposal.merge_time_s[entry],
            committed(fleet, follower),
            fleet.length_m[follower],
            math.inf,
            situation.from_s,
            rules,
        )
        if margin_m >= rules.safety.execution_allowance_m - ROUNDING_M:
            return True
        stop_m = stop_of_m(committed(fleet, follower))
        if not propose_stop(fleet, proposal, follower, stop_m, situation.from_s, rules):
            return False
        leader = follower
