"""Slots of mainline vehicles: a slower cruise that ends as late as is safe.

A slot is a crossing time c: a vehicle that cruises at v0 on intercept ``-v0 c``. Slots follow one
another by the clearance of the two vehicles.
"""

import math
from typing import NamedTuple

import numpy as np

from coramp._kernel import FloatArray, kernel
from coramp.equations.safe_distance import following_clearance_m, merge_clearance_m
from coramp.kinematics.trajectory import (
    MAX_PIECES,
    SPEED,
    STATION,
    TIME,
    begin,
    cruise_intercept_m,
    drive,
    drive_to_speed,
    station_and_speed,
)
from coramp.motion.approach import change_speed
from coramp.motion.slow_phase import least_effort_way, slow_phase
from coramp.road.rules import Rules, unpacked
from coramp.strategies.proposals import find_unsafe_pair
from coramp.vehicles.fleet import Fleet, Proposal, committed, empty_proposal
from coramp.vehicles.merge_state import BY_MAINLINE_S, is_on_mainline, is_waiting

SLOWEST_SHARE = 0.5
"""Of v0: what a slower cruise on the mainline does not go below."""
CRUISE_SHARES = (1.0, 0.3, 0.001, 0.0)
"""Of the time there is, how much of it is tried for a slower cruise; 0 goes to it at once."""
SHORTEST_CRUISE_S = 0.1
KEEP_M = 1e-3
"""A vehicle that can gain less than this keeps its way in."""
SETBACKS_M = (0.0, 0.25, 0.5, 1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0, 128.0)
"""How far behind the earliest slot a plan is tried."""
END_SHARES = (0.85, 0.7, 0.55, 0.4, 0.25)
"""Earlier ends of the slower cruise that are tried, as shares of the time to the latest."""
HALVINGS = 3


class Manner(NamedTuple):
    """How slots are taken.

    ``clears``: mainline vehicles speed up at once as hard as is comfortable as they enter, so that
    the next can. ``jerk_mps3``: the largest jerk of ways of least effort, which are then tried
    first; 0 for none.
    """

    clears: bool
    jerk_mps3: float


@kernel
def plan_in_lane(
    fleet: Fleet,
    row: int,
    now_s: float,
    manner: Manner,
    packed_rules: FloatArray,
) -> FloatArray:
    """Returns the pieces into the slot of a mainline vehicle that has just entered.

    None, an array of length 0, where it keeps the way on which it entered: that is safe, and where
    nothing better is found it is what is left.
    """
    rules = unpacked(packed_rules)
    road, motion = rules.road, rules.motion
    v0 = road.mainline_speed_mps
    from_s = now_s + rules.control.actuation_delay_s
    entry = committed(fleet, row)
    station_m, speed_mps = station_and_speed(entry, from_s)
    out = np.empty((MAX_PIECES, 4))
    n = begin(out, from_s, station_m, speed_mps)
    n = change_speed(out, n, v0, motion)
    free_m, entry_m = cruise_intercept_m(out[:n], v0), cruise_intercept_m(entry, v0)
    if free_m - entry_m < KEEP_M and (not manner.clears or speed_mps >= v0):
        return out[:0]
    slot_m, leader = slot_behind_m(fleet, row, entry_m, from_s, rules)
    slot_m = min(slot_m, free_m)
    proposal = empty_proposal(1)
    failed_m, found_m = -1.0, -1.0
    for setback_m in SETBACKS_M:
        if slot_m - setback_m < entry_m - KEEP_M:
            break
        n = slow_down_to_slot(
            fleet, proposal, row, leader, from_s, slot_m - setback_m, manner, rules
        )
        if n > 0:
            found_m = setback_m
            break
        failed_m = setback_m
    if found_m < 0.0:
        return out[:0]
    halvings = HALVINGS if failed_m >= 0.0 else 0
    for _ in range(halvings):
        middle_m = 0.5 * (failed_m + found_m)
        if slow_down_to_slot(
            fleet, proposal, row, leader, from_s, slot_m - middle_m, manner, rules
        ):
            found_m = middle_m
        else:
            failed_m = middle_m
    if halvings > 0:
        n = slow_down_to_slot(fleet, proposal, row, leader, from_s, slot_m - found_m, manner, rules)
    return proposal.pieces[0, :n]


@kernel
def slot_behind_m(
    fleet: Fleet, row: int, entry_m: float, from_s: float, rules: Rules
) -> tuple[float, int]:
    """Returns the foremost intercept (m) behind all that are ahead of ``entry_m``, and the leader.

    The leader is the vehicle ahead whose slot is the last of those on the mainline, -1 for none.
    """
    v0 = rules.road.mainline_speed_mps
    following_m = following_clearance_m(rules.road, rules.safety)
    merging_m = max(following_m, merge_clearance_m(rules.road, rules.safety))
    slot_m, leader, leader_m = math.inf, -1, math.inf
    for other in fleet.live:
        if other == row or is_waiting(fleet.merge_time_s[other]):
            continue
        other_m = cruise_intercept_m(committed(fleet, other), v0)
        if other_m < entry_m:
            continue
        clearance_m = following_m
        if not is_on_mainline(fleet.merge_time_s[other], from_s):
            clearance_m = merging_m
        slot_m = min(slot_m, other_m - fleet.length_m[other] - clearance_m)
        if other_m < leader_m:
            leader, leader_m = other, other_m
    return slot_m, leader


@kernel
def slow_down_to_slot(
    fleet: Fleet,
    proposal: Proposal,
    row: int,
    leader: int,
    from_s: float,
    slot_m: float,
    manner: Manner,
    rules: Rules,
) -> int:
    """Fills the proposal with a slower cruise into a slot; returns its length, 0 for none.

    The cruise ends as late as is safe: where a ramp vehicle in free movement would merge, where
    the leader's ends, a time gap later, or at an earlier time.
    """
    road = rules.road
    v0 = road.mainline_speed_mps
    ramp_mps = road.ramp_speed_mps
    merge_m = 0.5 * (v0 * v0 - ramp_mps * ramp_mps) / rules.motion.free_acceleration_mps2
    latest_s = (merge_m - slot_m) / v0
    if ends_safely(fleet, proposal, row, from_s, latest_s, slot_m, manner, rules):
        return int(proposal.piece_count[0])
    too_late_s, good_s = latest_s, -math.inf
    if leader >= 0:
        ahead = committed(fleet, leader)
        wave_s = ahead[len(ahead) - 1, TIME] + rules.safety.time_gap_s
        if from_s < wave_s < latest_s and ends_safely(
            fleet, proposal, row, from_s, wave_s, slot_m, manner, rules
        ):
            return int(proposal.piece_count[0])
    for share in END_SHARES:
        end_s = from_s + share * (latest_s - from_s)
        if ends_safely(fleet, proposal, row, from_s, end_s, slot_m, manner, rules):
            good_s = end_s
            break
        too_late_s = end_s
    if good_s == -math.inf:
        return 0
    for _ in range(HALVINGS):
        middle_s = 0.5 * (good_s + too_late_s)
        if ends_safely(fleet, proposal, row, from_s, middle_s, slot_m, manner, rules):
            good_s = middle_s
        else:
            too_late_s = middle_s
    ends_safely(fleet, proposal, row, from_s, good_s, slot_m, manner, rules)
    return int(proposal.piece_count[0])


@kernel
def ends_safely(
    fleet: Fleet,
    proposal: Proposal,
    row: int,
    from_s: float,
    end_s: float,
    slot_m: float,
    manner: Manner,
    rules: Rules,
) -> bool:
    """Fills the proposal with the slower cruise that ends at ``end_s``; returns if it is safe."""
    v0 = rules.road.mainline_speed_mps
    station_m, speed_mps = station_and_speed(committed(fleet, row), from_s)
    lowest_mps = min(speed_mps, SLOWEST_SHARE * v0)
    out = proposal.pieces[0]
    if manner.jerk_mps3 > 0.0:
        n = least_effort_way(
            out, from_s, station_m, speed_mps, end_s, slot_m, v0, manner.jerk_mps3, rules.motion
        )
        if (
            n > 0
            and out[:n, SPEED].min() >= lowest_mps
            and is_safe(fleet, proposal, row, n, from_s, rules)
        ):
            return True
    for share in CRUISE_SHARES:
        n = slow_cruise(out, committed(fleet, row), from_s, end_s, slot_m, share, manner, rules)
        if n == 0 or out[:n, SPEED].min() < lowest_mps:
            continue
        if is_safe(fleet, proposal, row, n, from_s, rules):
            return True
    return False


@kernel
def is_safe(
    fleet: Fleet, proposal: Proposal, row: int, n: int, from_s: float, rules: Rules
) -> bool:
    """Makes the pieces in the first entry those of a mainline vehicle; returns if all is safe."""
    proposal.size[0], proposal.rows[0], proposal.piece_count[0] = 1, row, n
    proposal.merge_time_s[0] = BY_MAINLINE_S
    unsafe, _ = find_unsafe_pair(fleet, proposal, from_s, rules)
    return bool(unsafe < 0)


@kernel
def slow_cruise(
    out: FloatArray,
    entry: FloatArray,
    from_s: float,
    end_s: float,
    slot_m: float,
    share: float,
    manner: Manner,
    rules: Rules,
) -> int:
    """Writes the way into a slot with a slower cruise that ends at ``end_s``; returns its length.

    The vehicle goes up to v0 first, to make room at the entrance, and begins to slow down so late
    that its slower cruise takes ``share`` of the time there is for it. With a share of 0 it goes to
    the slower speed at once. 0 where there is no such way.
    """
    v0, motion = rules.road.mainline_speed_mps, rules.motion
    station_m, speed_mps = station_and_speed(entry, from_s)
    n = begin(out, from_s, station_m, speed_mps)
    if share > 0.0:
        if manner.clears and speed_mps < v0:
            n = drive_to_speed(out, n, motion.comfort_mps2, v0)
        else:
            n = change_speed(out, n, v0, motion)
        lag = max(0.0, out[n - 1, STATION] - v0 * out[n - 1, TIME] - slot_m)
        rates = 1.0 / motion.slow_down_mps2 + 1.0 / motion.speed_up_mps2
        spare_s = end_s - out[n - 1, TIME] - (math.sqrt(2.0 * lag * rates) + SHORTEST_CRUISE_S)
        if spare_s < 0.0:
            return 0
        n = drive(out, n, 0.0, (1.0 - share) * spare_s)
    more = slow_phase(
        out[n - 1 :],
        out[n - 1, TIME],
        out[n - 1, STATION],
        out[n - 1, SPEED],
        end_s,
        slot_m,
        v0,
        motion.slow_down_mps2,
        motion.speed_up_mps2,
    )
    return n - 1 + more if more > 0 else 0
