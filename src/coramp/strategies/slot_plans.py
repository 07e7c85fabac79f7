"""Trajectories into slots: one vehicle at a time, behind everyone who has a slot already.

A slot is a crossing time c: a vehicle that cruises at v0 on intercept ``-v0 c``. Slots follow one
another by the clearance of the two vehicles. A mainline vehicle takes its slot by one slower cruise
(``core.slow_phase``), a ramp vehicle by a slower cruise on the ramp, or by leaving its stop later.
"""

import math

import numpy as np

from coramp._kernel import FloatArray, kernel
from coramp.core.approach import change_speed
from coramp.core.fleet import (
    ROUNDING_M,
    Fleet,
    Proposal,
    committed,
    empty_proposal,
    proposed,
)
from coramp.core.gaps import least_acceleration_mps2
from coramp.core.proposals import find_unsafe_pair, propose_merge
from coramp.core.ramp_acceleration import lag_m
from coramp.core.rules import Rules, unpacked
from coramp.core.safe_distance import following_clearance_m, merge_clearance_m
from coramp.core.slow_phase import slow_phase
from coramp.core.trajectory import (
    MAX_PIECES,
    SPEED,
    STATION,
    TIME,
    begin,
    clip_end,
    clip_start,
    cruise_intercept_m,
    drive,
    drive_to_speed,
    station_and_speed,
    time_at_station,
)
from coramp.strategies.ladder import plan_of
from coramp.strategies.rungs import Merge, delay_followers, no_merge
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

SLOWEST_SHARE = 0.5
"""Of v0: what a slower cruise on the mainline does not go below."""
CRUISE_SHARES = (1.0, 0.3, 0.001, 0.0)
"""Of the time there is, how much of it is tried for a slower cruise; 0 goes to it at once."""
SHORTEST_CRUISE_S = 0.1
ROOM = 128
"""Vehicles that a plan may change: the subject and those behind it on the ramp."""
KEEP_M = 1e-3
"""A vehicle that can gain less than this keeps its way in."""
SETBACKS_M = (0.0, 0.25, 0.5, 1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0, 128.0)
"""How far behind the earliest slot a plan is tried."""
END_SHARES = (0.85, 0.7, 0.55, 0.4, 0.25)
"""Earlier ends of the slower cruise that are tried, as shares of the time to the latest."""
HALVINGS = 3
SAME_MPS = 1e-6
NOSES = ((0.0, 0.0), (0.0, 0.1), (0.0, 0.25), (0.0, 0.5), (0.0, 1.0), (1.0, 0.0), (1.0, 0.5))
"""How the nose is passed: how far from the ramp's speed to its limit, and after it, how far from
free movement's acceleration to the largest."""


@kernel
def plan_in_lane(
    fleet: Fleet, row: int, now_s: float, clears: bool, packed_rules: FloatArray
) -> tuple[FloatArray, float]:
    """Returns the pieces into the slot of a mainline vehicle that has just entered, and its lag.

    None, an array of length 0, where it keeps the way on which it entered: that is safe, and where
    nothing better is found it is what is left. The lag (m) is what the plan loses to free movement.
    With ``clears`` others wait to enter behind it, and it speeds up at once as hard as is comfortable.
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
    if free_m - entry_m < KEEP_M and not clears:
        return out[:0], 0.0
    slot_m, leader = slot_behind_m(fleet, row, entry_m, from_s, rules)
    slot_m = min(slot_m, free_m)
    proposal = empty_proposal(1)
    failed_m, found_m = -1.0, -1.0
    for setback_m in SETBACKS_M:
        if slot_m - setback_m < entry_m - KEEP_M:
            break
        n = slow_down_to_slot(
            fleet, proposal, row, leader, from_s, slot_m - setback_m, clears, rules
        )
        if n > 0:
            found_m = setback_m
            break
        failed_m = setback_m
    if found_m < 0.0:
        return out[:0], free_m - entry_m
    halvings = HALVINGS if failed_m >= 0.0 else 0
    for _ in range(halvings):
        middle_m = 0.5 * (failed_m + found_m)
        if slow_down_to_slot(
            fleet, proposal, row, leader, from_s, slot_m - middle_m, clears, rules
        ):
            found_m = middle_m
        else:
            failed_m = middle_m
    if halvings > 0:
        n = slow_down_to_slot(fleet, proposal, row, leader, from_s, slot_m - found_m, clears, rules)
    return proposal.pieces[0, :n], free_m - slot_m + found_m


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
        if other == row or fleet.merge_time_s[other] == math.inf:
            continue
        other_m = cruise_intercept_m(committed(fleet, other), v0)
        if other_m < entry_m:
            continue
        clearance_m = merging_m if fleet.merge_time_s[other] > from_s else following_m
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
    clears: bool,
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
    if ends_safely(fleet, proposal, row, from_s, latest_s, slot_m, clears, rules):
        return proposal.piece_count[0]
    too_late_s, good_s = latest_s, -math.inf
    if leader >= 0:
        ahead = committed(fleet, leader)
        wave_s = ahead[len(ahead) - 1, TIME] + rules.safety.time_gap_s
        if from_s < wave_s < latest_s and ends_safely(
            fleet, proposal, row, from_s, wave_s, slot_m, clears, rules
        ):
            return proposal.piece_count[0]
    for share in END_SHARES:
        end_s = from_s + share * (latest_s - from_s)
        if ends_safely(fleet, proposal, row, from_s, end_s, slot_m, clears, rules):
            good_s = end_s
            break
        too_late_s = end_s
    if good_s == -math.inf:
        return 0
    for _ in range(HALVINGS):
        middle_s = 0.5 * (good_s + too_late_s)
        if ends_safely(fleet, proposal, row, from_s, middle_s, slot_m, clears, rules):
            good_s = middle_s
        else:
            too_late_s = middle_s
    ends_safely(fleet, proposal, row, from_s, good_s, slot_m, clears, rules)
    return proposal.piece_count[0]


@kernel
def ends_safely(
    fleet: Fleet,
    proposal: Proposal,
    row: int,
    from_s: float,
    end_s: float,
    slot_m: float,
    clears: bool,
    rules: Rules,
) -> bool:
    """Fills the proposal with the slower cruise that ends at ``end_s``; returns if it is safe."""
    lowest_mps = min(
        station_and_speed(committed(fleet, row), from_s)[1],
        SLOWEST_SHARE * rules.road.mainline_speed_mps,
    )
    out = proposal.pieces[0]
    for share in CRUISE_SHARES:
        n = slow_cruise(out, committed(fleet, row), from_s, end_s, slot_m, share, clears, rules)
        if n == 0 or out[:n, SPEED].min() < lowest_mps:
            continue
        proposal.size[0], proposal.rows[0], proposal.piece_count[0] = 1, row, n
        proposal.merge_time_s[0] = -math.inf
        unsafe, _ = find_unsafe_pair(fleet, proposal, from_s, rules)
        if unsafe < 0:
            return True
    return False


@kernel
def slow_cruise(
    out: FloatArray,
    entry: FloatArray,
    from_s: float,
    end_s: float,
    slot_m: float,
    share: float,
    clears: bool,
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
        if clears and speed_mps < v0:
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


@kernel
def plan_onto_lane(
    fleet: Fleet, row: int, now_s: float, claim_s: float, packed_rules: FloatArray
) -> tuple[MergePlan, Proposal, bool, int]:
    """Returns a ramp vehicle's plan into the first slot that it can take, and its trajectories.

    The slots tried lie in the gaps of the lane order, from its earliest backwards: that of free
    movement or, for a vehicle that was held up, one nearer to the crossing time ``claim_s`` that it
    would have had. The rest is what ``ramp_neighbours`` tells.
    """
    rules = unpacked(packed_rules)
    proposal = empty_proposal(ROOM)
    situation = assess(fleet, row, now_s, 0.0, rules)
    blocked, behind = ramp_neighbours(fleet, row, situation.from_s)
    conflict = conflict_position(fleet, situation, rules)
    merge = no_merge()
    if not blocked:
        earliest_m = earliest_slot_m(fleet, situation, claim_s, rules)
        merge = first_slot(fleet, proposal, situation, earliest_m, rules)
    rung = RUNG_HOLD
    if merge.gap >= 0:
        rung = RUNG_DELAY
        if merge.largest_shift_m < KEEP_M:
            rung = RUNG_FREE if merge.accel_mps2 == situation.free_accel_mps2 else RUNG_REACH
    plan = plan_of(fleet, proposal, situation, merge, rung, 0, conflict, rules)
    return plan, proposal, blocked, behind


@kernel
def earliest_slot_m(fleet: Fleet, situation: Situation, claim_s: float, rules: Rules) -> float:
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
    return max(situation.free_m, min(fastest_m, -v0 * claim_s))


@kernel
def first_slot(
    fleet: Fleet, proposal: Proposal, situation: Situation, earliest_m: float, rules: Rules
) -> Merge:
    """Proposes the first slot that the subject can take; ``gap`` is -1 where there is none."""
    order, intercepts_m = situation.order, situation.intercepts_m
    own_m = fleet.length_m[situation.subject] + situation.clearance_m
    for gap in range(len(order) + 1):
        low_m, high_m = bounds_between_m(
            order, intercepts_m, fleet.length_m, gap, -math.inf, own_m, situation.clearance_m
        )
        first_m = min(high_m, earliest_m)
        if first_m < low_m:
            continue
        tried_m = -1.0
        for setback_m in SETBACKS_M:
            if first_m - setback_m < low_m:
                break
            merge = merge_in_slot(fleet, proposal, situation, gap, first_m - setback_m, rules)
            if merge.gap >= 0:
                return nearer_slot(
                    fleet, proposal, situation, merge, first_m, tried_m, setback_m, rules
                )
            tried_m = setback_m
    proposal.size[0] = 0
    return no_merge()


@kernel
def nearer_slot(
    fleet: Fleet,
    proposal: Proposal,
    situation: Situation,
    found: Merge,
    first_m: float,
    failed_m: float,
    setback_m: float,
    rules: Rules,
) -> Merge:
    """Proposes the slot with the least setback between one that failed and one that was found."""
    if failed_m < 0.0:
        return found
    latest_m = setback_m
    for _ in range(HALVINGS):
        middle_m = 0.5 * (failed_m + setback_m)
        merge = merge_in_slot(fleet, proposal, situation, found.gap, first_m - middle_m, rules)
        latest_m = middle_m
        if merge.gap >= 0:
            setback_m = middle_m
        else:
            failed_m = middle_m
    if latest_m != setback_m:
        return merge_in_slot(fleet, proposal, situation, found.gap, first_m - setback_m, rules)
    return merge


@kernel
def merge_in_slot(
    fleet: Fleet, proposal: Proposal, situation: Situation, gap: int, slot_m: float, rules: Rules
) -> Merge:
    """Proposes a merge on intercept ``slot_m``: a slower cruise on the ramp, or a later departure.

    After a slower cruise the nose is passed at the ramp's speed; higher accelerations behind it are
    tried as well, since they put the subject further behind its leader on the ramp.
    """
    road, motion = rules.road, rules.motion
    free, most = situation.free_accel_mps2, motion.ramp_acceleration_mps2
    lag_behind_m = situation.free_m - slot_m
    way = np.empty((MAX_PIECES, 4))
    if abs(lag_behind_m) < KEEP_M and merges_safely(
        fleet, proposal, situation, situation.approach, free, rules
    ):
        return merge_of(proposal, gap, free, max(0.0, lag_behind_m))
    regained_s = leader_regains_s(fleet, situation, rules)
    for nose_mps, share in NOSES:
        accel_mps2 = free + share * (most - free)
        nose_mps = road.ramp_speed_mps + nose_mps * (road.ramp_limit_mps - road.ramp_speed_mps)
        nose_s = -(slot_m + lag_m(road.mainline_speed_mps, nose_mps, accel_mps2)) / (
            road.mainline_speed_mps
        )
        for end_s in (
            nose_s,
            regained_s + rules.safety.time_gap_s,
            situation.from_s + 0.7 * (nose_s - situation.from_s),
            situation.from_s + 0.4 * (nose_s - situation.from_s),
        ):
            if not situation.from_s < end_s <= nose_s:
                continue
            n = slow_on_ramp(fleet, situation, nose_s, nose_mps, end_s, way, rules)
            if n > 0 and merges_safely(fleet, proposal, situation, way[:n], accel_mps2, rules):
                return merge_of(proposal, gap, accel_mps2, lag_behind_m)
    n, accel_mps2 = leave_stop_for_slot(fleet, situation, slot_m, way, rules)
    if n > 0 and merges_safely(fleet, proposal, situation, way[:n], accel_mps2, rules):
        return merge_of(proposal, gap, accel_mps2, lag_behind_m)
    return no_merge()


@kernel
def leader_regains_s(fleet: Fleet, situation: Situation, rules: Rules) -> float:
    """Returns when (s) the next vehicle ahead on the ramp is back at the ramp's speed for good.

    When it passes the nose if it does so more slowly; infinity without such a vehicle.
    """
    own_m, _ = station_and_speed(committed(fleet, situation.subject), situation.from_s)
    found, found_m = -1, math.inf
    for row in fleet.live:
        if situation.from_s < fleet.merge_time_s[row] < math.inf:
            row_m, _ = station_and_speed(committed(fleet, row), situation.from_s)
            if own_m < row_m < found_m:
                found, found_m = row, row_m
    if found < 0:
        return math.inf
    ahead = committed(fleet, found)
    regained_s = ahead[0, TIME]
    for k in range(len(ahead) - 1):
        if ahead[k, SPEED] < rules.road.ramp_speed_mps - SAME_MPS and ahead[k, STATION] < 0.0:
            regained_s = ahead[k + 1, TIME]
    return float(regained_s)


@kernel
def slow_on_ramp(
    fleet: Fleet,
    situation: Situation,
    nose_s: float,
    nose_mps: float,
    end_s: float,
    out: FloatArray,
    rules: Rules,
) -> int:
    """Writes the approach that passes the nose at ``nose_s`` with ``nose_mps``.

    It goes to a slower speed at once and is back by ``end_s``. Returns 0 where that asks for less
    than ``slowest_ramp_speed_mps``.
    """
    motion = rules.motion
    station_m, speed_mps = station_and_speed(committed(fleet, situation.subject), situation.from_s)
    n = slow_phase(
        out,
        situation.from_s,
        station_m,
        speed_mps,
        end_s,
        -nose_mps * nose_s,
        nose_mps,
        motion.slow_down_mps2,
        motion.speed_up_mps2,
    )
    if n == 0 or out[:n, SPEED].min() < motion.slowest_ramp_speed_mps:
        return 0
    return clip_end(out, n, max(out[n - 1, TIME], nose_s))


@kernel
def merge_of(proposal: Proposal, gap: int, accel_mps2: float, lag_behind_m: float) -> Merge:
    """Returns the merge that the proposal's first entry makes."""
    pieces = proposed(proposal, 0)
    merge_m = pieces[len(pieces) - 1, STATION]
    return Merge(gap, accel_mps2, proposal.merge_time_s[0], merge_m, lag_behind_m)


@kernel
def merges_safely(
    fleet: Fleet,
    proposal: Proposal,
    situation: Situation,
    approach: FloatArray,
    accel_mps2: float,
    rules: Rules,
) -> bool:
    """Proposes an approach with its merge, and stops for those behind; returns if all is safe."""
    _, merge_m = propose_merge(proposal, situation.subject, approach, accel_mps2, rules)
    if merge_m > rules.road.last_merge_station_m + ROUNDING_M:
        return False
    if not delay_followers(fleet, proposal, situation, rules):
        return False
    unsafe, _ = find_unsafe_pair(fleet, proposal, situation.from_s, rules)
    return bool(unsafe < 0)


@kernel
def leave_stop_for_slot(
    fleet: Fleet, situation: Situation, slot_m: float, out: FloatArray, rules: Rules
) -> tuple[int, float]:
    """Writes the approach that keeps to its commitment until it must leave it for the slot.

    The later it speeds up to the ramp's speed, the later it comes; the time is found by halving.
    Returns the approach's length, 0 for none, and the acceleration (m/s2) after the nose.
    """
    early_s = situation.from_s
    n, _, slot_now_m = leave_stop_at(fleet, situation, early_s, out, rules)
    if n == 0 or slot_now_m < slot_m - KEEP_M:
        return 0, math.nan
    late_s = early_s + 1.0
    while leave_stop_at(fleet, situation, late_s, out, rules)[2] > slot_m:
        early_s, late_s = late_s, late_s + 2.0 * (late_s - situation.from_s)
        if late_s > situation.from_s + 1e4:
            return 0, math.nan
    for _ in range(40):
        middle_s = 0.5 * (early_s + late_s)
        if leave_stop_at(fleet, situation, middle_s, out, rules)[2] > slot_m:
            early_s = middle_s
        else:
            late_s = middle_s
    n, accel_mps2, _ = leave_stop_at(fleet, situation, late_s, out, rules)
    return n, accel_mps2


@kernel
def leave_stop_at(
    fleet: Fleet, situation: Situation, leave_s: float, out: FloatArray, rules: Rules
) -> tuple[int, float, float]:
    """Writes the approach that leaves the commitment at ``leave_s`` for the ramp's speed.

    Returns its length, the acceleration (m/s2) after the nose, free movement's within Eq. 22, and
    the intercept (m) that it ends on.
    """
    road, motion = rules.road, rules.motion
    v0 = road.mainline_speed_mps
    n = clip_start(committed(fleet, situation.subject), situation.from_s, out)
    n = clip_end(out, n, leave_s)
    n = change_speed(out, n, road.ramp_speed_mps, motion)
    n = clip_end(out, n, time_at_station(out[:n], 0.0))
    nose_s, nose_mps = out[n - 1, TIME], out[n - 1, SPEED]
    least = least_acceleration_mps2(v0, nose_mps, road.last_merge_station_m)
    accel_mps2 = min(max(motion.free_acceleration_mps2, least), motion.ramp_acceleration_mps2)
    return n, accel_mps2, -v0 * nose_s - lag_m(v0, nose_mps, accel_mps2)
