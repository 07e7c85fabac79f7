"""Rung delay of the ladder: the subject comes late; those behind it on the ramp brake for it."""

import math

import numpy as np

from coramp._kernel import FloatArray, kernel
from coramp.equations.ramp_acceleration import lag_m
from coramp.equations.safe_distance import gap_time_s
from coramp.kinematics.trajectory import MAX_PIECES, station_and_speed
from coramp.motion.approach import brake_and_go, late_approach, late_start, stop_of_m
from coramp.road.rules import Rules
from coramp.strategies.proposals import find_unsafe_pair, propose_merge, push_back
from coramp.strategies.ramp_queue import longest_wait_s, next_behind_on_ramp, propose_stop
from coramp.strategies.rungs import Merge, no_merge, unknown_bound_m
from coramp.strategies.situation import RUNG_DELAY, Situation, gap_bounds_m, situation_from
from coramp.vehicles.fleet import (
    ROUNDING_M,
    Fleet,
    Proposal,
    committed,
    entry_of,
    pair_margin_m,
    proposed,
)
from coramp.vehicles.merge_state import is_on_mainline
from coramp.vehicles.trace import (
    FOLLOWERS_CANNOT_BRAKE,
    GAP_TOO_SMALL,
    HOLDS_UP_NEWCOMER,
    NO_LATE_WAY,
    PAST_LAST_STATION,
    note_merge,
    note_moves,
    open_in_gap,
    refuse,
    refuse_as_too_near,
)

EVENLY, AT_ONCE, AT_THE_STOP = range(3)
"""How a ramp vehicle that comes late loses its time."""


@kernel
def come_later(
    fleet: Fleet, proposal: Proposal, situation: Situation, rules: Rules
) -> tuple[Merge, int]:
    """Returns the merge of rung delay in the first gap that it helps in, and its scenario.

    That is 0 where nobody in the lane moves, 2 where who is behind the gap falls back.
    """
    for gap in range(len(situation.order) + 1):
        merge = delay(fleet, proposal, situation, gap, rules)
        if merge.gap >= 0:
            return merge, 0
    for gap in range(len(situation.order) + 1):
        merge = delay_and_create(fleet, proposal, situation, gap, rules)
        if merge.gap >= 0:
            return merge, 2
    return no_merge(), 0


@kernel
def delay(fleet: Fleet, proposal: Proposal, situation: Situation, gap: int, rules: Rules) -> Merge:
    """Rung delay: come late to a later gap that is large enough, as ``come_late`` does."""
    return come_late(fleet, proposal, situation, gap, 0.0, rules)


@kernel
def delay_and_create(
    fleet: Fleet, proposal: Proposal, situation: Situation, gap: int, rules: Rules
) -> Merge:
    """Rung delay with gap creation: come late to a gap whose rear vehicle falls back (scenario 2).

    By no more than what the time and standstill gaps before and behind the subject ask for; the
    safe distances of the paper alone leave gaps enough.
    """
    room_m = 2.0 * gap_time_s(rules) * rules.road.mainline_speed_mps
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
    scenario = 2 if room_m > 0.0 else 0
    open_in_gap(proposal.trace, RUNG_DELAY, scenario, situation.order, gap)
    unknown_m = unknown_bound_m(fleet, situation)
    if back_m > 0.0 and (gap == len(situation.order) or target_m < unknown_m):
        refuse(proposal.trace, HOLDS_UP_NEWCOMER, -1, unknown_m - target_m)
        return no_merge()
    if back_m > room_m:
        refuse(proposal.trace, GAP_TOO_SMALL, -1, back_m - room_m)
        return no_merge()
    if longest_wait_s(rules) > 0.0:
        for way in (AT_ONCE, AT_THE_STOP):
            merge = come_late_by(fleet, proposal, situation, gap, way, target_m, back_m, rules)
            if merge.gap >= 0:
                return merge
            open_in_gap(proposal.trace, RUNG_DELAY, scenario, situation.order, gap)
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
        refuse(proposal.trace, NO_LATE_WAY, -1, math.nan)
        return no_merge()
    later = with_approach(situation, buffer[:n], rules)
    accel_mps2 = later.free_accel_mps2
    merge_s, merge_m = propose_merge(proposal, later.subject, later.approach, accel_mps2, rules)
    note_merge(
        proposal.trace, target_m, accel_mps2, merge_s, merge_m, later.nose_s, later.nose_speed_mps
    )
    note_moves(proposal.trace, 0.0, back_m, situation.from_s)
    if merge_m > rules.road.last_merge_station_m + ROUNDING_M:
        past_m = merge_m - rules.road.last_merge_station_m
        refuse(proposal.trace, PAST_LAST_STATION, -1, past_m)
        return no_merge()
    if too_near_ahead(fleet, proposal, situation, gap, rules):
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
    if not delay_followers(fleet, proposal, situation.subject, situation.from_s, rules):
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
        if place < gap - 1 and is_on_mainline(fleet.merge_time_s[other], situation.from_s):
            continue
        margin_m = pair_margin_m(
            proposed(proposal, 0),
            fleet.traits[row],
            proposal.merge_time_s[0],
            committed(fleet, other),
            fleet.traits[other],
            fleet.merge_time_s[other],
            situation.from_s,
            rules,
        )
        if margin_m < rules.safety.execution_allowance_m - ROUNDING_M:
            missing_m = rules.safety.execution_allowance_m - margin_m
            refuse_as_too_near(proposal.trace, -1, other, missing_m)
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
        if not 0.0 < wait_s <= longest_wait_s(rules):
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
def delay_followers(
    fleet: Fleet, proposal: Proposal, subject: int, from_s: float, rules: Rules
) -> bool:
    """Adds those behind the subject on the ramp that would come too near to who is before them."""
    leader = subject
    while True:
        follower = next_behind_on_ramp(fleet, leader, from_s)
        if follower < 0:
            return True
        entry = entry_of(proposal, leader)
        margin_m = pair_margin_m(
            proposed(proposal, entry),
            fleet.traits[leader],
            proposal.merge_time_s[entry],
            committed(fleet, follower),
            fleet.traits[follower],
            math.inf,
            from_s,
            rules,
        )
        if margin_m >= rules.safety.execution_allowance_m - ROUNDING_M:
            return True
        stop_m = stop_of_m(committed(fleet, follower))
        if not propose_stop(fleet, proposal, follower, stop_m, from_s, rules):
            refuse(proposal.trace, FOLLOWERS_CANNOT_BRAKE, follower, math.nan)
            return False
        leader = follower
