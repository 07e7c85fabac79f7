"""Building a proposal vehicle by vehicle, and the planner's own check of it."""

import math

from coramp._kernel import FloatArray, IntArray, kernel
from coramp.equations.gap_creation import cascade_shift_m, largest_shift_m
from coramp.equations.safe_distance import (
    braking_distance_m,
    following_clearance_m,
    safe_distance_m,
)
from coramp.kinematics.trajectory import (
    STATION,
    TIME,
    cruise_intercept_m,
    drive_to_speed,
    intercept_range_m,
    largest_acceleration_mps2,
    speed_range_mps,
    superpose_shift,
)
from coramp.road.rules import Rules
from coramp.vehicles.fleet import (
    MAX_CHANGED,
    ROUNDING_M,
    Fleet,
    Proposal,
    committed,
    entry_of,
    leaves_lane_s,
    pair_margin_m,
    place_among,
    proposed,
    trajectory_under,
)
from coramp.vehicles.merge_state import has_place_on_mainline
from coramp.vehicles.trace import (
    LEAVES_LANE,
    SHIFT_TOO_FAR,
    SHIFT_TOO_FAST,
    SHIFT_TOO_HARD,
    TOO_MANY_MOVE,
    refuse,
    refuse_as_too_near,
)


@kernel
def propose_merge(
    proposal: Proposal, row: int, approach: FloatArray, accel_mps2: float, rules: Rules
) -> tuple[float, float]:
    """Makes ``row`` the proposal's only entry: the approach to the nose, then ``accel`` up to v0.

    Returns merge time (s) and merge station (m).
    """
    n = len(approach)
    out = proposal.pieces[0]
    out[:n] = approach
    n = drive_to_speed(out, n, accel_mps2, rules.road.mainline_speed_mps)
    proposal.size[0] = 1
    proposal.rows[0] = row
    proposal.piece_count[0] = n
    proposal.merge_time_s[0] = out[n - 1, TIME]
    return out[n - 1, TIME], out[n - 1, STATION]


@kernel
def propose_shift(
    fleet: Fleet,
    proposal: Proposal,
    row: int,
    from_s: float,
    window_start_s: float,
    window_end_s: float,
    shift_m: float,
    rules: Rules,
) -> bool:
    """Adds ``row``, moved by ``shift_m`` (positive: ahead) within the window, to the proposal.

    A vehicle that is still to merge moves only after its merge. Returns False, and leaves the
    proposal as it was, where the bounds on acceleration and speed do not allow it.
    """
    entry = proposal.size[0]
    if entry >= MAX_CHANGED or entry_of(proposal, row) >= 0:
        refuse(proposal.trace, TOO_MANY_MOVE, row, math.nan)
        return False
    start_s = max(window_start_s, fleet.merge_time_s[row])
    if fleet.change_s[row] < math.inf:
        refuse(proposal.trace, LEAVES_LANE, row, math.nan)
        return False
    v0 = rules.road.mainline_speed_mps
    motion = rules.motion
    duration_s = window_end_s - start_s
    deviation = motion.speed_deviation if shift_m >= 0.0 else motion.slow_deviation
    most_m = largest_shift_m(v0, duration_s, motion.comfort_mps2, deviation)
    if abs(shift_m) > most_m:
        refuse(proposal.trace, SHIFT_TOO_FAR, row, abs(shift_m) - most_m)
        return False
    before = committed(fleet, row)
    n = superpose_shift(before, from_s, start_s, window_end_s, shift_m, proposal.pieces[entry])
    if n == 0:
        refuse(proposal.trace, SHIFT_TOO_FAR, row, math.nan)
        return False
    after = proposal.pieces[entry, :n]
    old_lowest, old_highest = speed_range_mps(before, from_s)
    lowest, highest = speed_range_mps(after, from_s)
    if (
        highest > max(old_highest, (1.0 + motion.speed_deviation) * v0) + ROUNDING_M
        or lowest < min(old_lowest, (1.0 - motion.slow_deviation) * v0) - ROUNDING_M
    ):
        refuse(proposal.trace, SHIFT_TOO_FAST, row, math.nan)
        return False
    if largest_acceleration_mps2(after, from_s) > max(
        motion.comfort_mps2, largest_acceleration_mps2(before, from_s)
    ):
        refuse(proposal.trace, SHIFT_TOO_HARD, row, math.nan)
        return False
    proposal.rows[entry] = row
    proposal.piece_count[entry] = n
    proposal.merge_time_s[entry] = fleet.merge_time_s[row]
    proposal.size[0] = entry + 1
    return True


@kernel
def intercept_m(fleet: Fleet, row: int, rules: Rules) -> float:
    """Returns where a committed vehicle ends up: station less v0 times time (m)."""
    return cruise_intercept_m(committed(fleet, row), rules.road.mainline_speed_mps)


@kernel
def push_ahead(
    fleet: Fleet,
    proposal: Proposal,
    order: IntArray,
    first: int,
    from_s: float,
    window_start_s: float,
    window_end_s: float,
    shift_m: float,
    rules: Rules,
) -> bool:
    """Moves ``order[first]`` ahead by ``shift_m`` and as many before it as come too near (cascade).

    ``order`` lists rows in lane order, front first. Returns False where one of them cannot.
    """
    clearance_m = following_clearance_m(rules.road, rules.safety)
    k = first
    while shift_m > ROUNDING_M:
        row = order[k]
        if not propose_shift(
            fleet, proposal, row, from_s, window_start_s, window_end_s, shift_m, rules
        ):
            return False
        if k == 0:
            return True
        leader = order[k - 1]
        distance_m = (
            intercept_m(fleet, leader, rules)
            - fleet.length_m[leader]
            - intercept_m(fleet, row, rules)
        )
        shift_m = cascade_shift_m(
            shift_m,
            distance_m - clearance_m,
            rules.safety.time_gap_s,
            window_end_s - max(window_start_s, fleet.merge_time_s[row]),
        )
        k -= 1
    return True


@kernel
def push_back(
    fleet: Fleet,
    proposal: Proposal,
    order: IntArray,
    first: int,
    from_s: float,
    window_start_s: float,
    window_end_s: float,
    shift_m: float,
    rules: Rules,
) -> bool:
    """Moves ``order[first]`` back by ``shift_m`` > 0 and as many behind it as come too near."""
    clearance_m = following_clearance_m(rules.road, rules.safety)
    k = first
    while shift_m > ROUNDING_M:
        row = order[k]
        if not propose_shift(
            fleet, proposal, row, from_s, window_start_s, window_end_s, -shift_m, rules
        ):
            return False
        if k + 1 == len(order):
            return True
        follower = order[k + 1]
        distance_m = (
            intercept_m(fleet, row, rules)
            - fleet.length_m[row]
            - intercept_m(fleet, follower, rules)
        )
        shift_m = cascade_shift_m(shift_m, distance_m - clearance_m, 0.0, 0.0)
        k += 1
    return True


@kernel
def largest_safe_distance_m(rules: Rules) -> float:
    """Returns a distance (m) that Eq. 1, 15 and 16 never exceed on this road."""
    fastest_mps = (1.0 + rules.motion.speed_deviation) * rules.road.mainline_speed_mps
    return (
        safe_distance_m(fastest_mps, fastest_mps, rules.safety)
        + braking_distance_m(fastest_mps, rules.safety.adhesion, rules.safety.resistance)
        + rules.safety.execution_allowance_m
        + rules.traffic.extra_safe_distance_m
    )


@kernel
def miss_each_other(fleet: Fleet, one: int, other: int, last_merge_s: float, rules: Rules) -> bool:
    """Returns whether one of two has left the outermost lane when the last of them comes to it."""
    if rules.road.lanes == 1:
        return False
    leaves_s = min(leaves_lane_s(fleet, one), leaves_lane_s(fleet, other))
    return bool(leaves_s < math.inf and last_merge_s >= leaves_s)


@kernel
def find_unsafe_pair(
    fleet: Fleet, proposal: Proposal, from_s: float, rules: Rules
) -> tuple[int, int]:
    """Returns rows of a changed vehicle and of one it would come too near, or (-1, -1).

    Every changed vehicle is compared with every live one, but for those whose ways along the
    mainline stay so far apart that no safe distance reaches across. Who is to leave the lane counts
    as if it stayed, but for those that come onto it afterwards.
    """
    far_m = largest_safe_distance_m(rules)
    v0 = rules.road.mainline_speed_mps
    for entry in range(proposal.size[0]):
        row = proposal.rows[entry]
        one = proposed(proposal, entry)
        one_merge_s = proposal.merge_time_s[entry]
        low_m, high_m = -math.inf, math.inf
        if has_place_on_mainline(one_merge_s):
            low_m, high_m = intercept_range_m(one, max(from_s, one_merge_s), v0)
        for other_row in fleet.live:
            other_entry = place_among(proposal.rows, proposal.size[0], other_row)
            if other_row == row or 0 <= other_entry < entry:
                continue
            other_merge_s = fleet.merge_time_s[other_row]
            if other_entry >= 0:
                other_merge_s = proposal.merge_time_s[other_entry]
            if miss_each_other(fleet, row, other_row, max(one_merge_s, other_merge_s), rules):
                continue
            if other_entry < 0 and min(one_merge_s, other_merge_s) <= from_s:
                ahead_m = fleet.intercepts_m[other_row, 0] - fleet.length_m[other_row] - high_m
                behind_m = low_m - fleet.length_m[row] - fleet.intercepts_m[other_row, 1]
                if max(ahead_m, behind_m) > far_m:
                    continue
            margin_m = pair_margin_m(
                one,
                fleet.traits[row],
                one_merge_s,
                trajectory_under(fleet, proposal, other_row),
                fleet.traits[other_row],
                other_merge_s,
                from_s,
                rules,
            )
            if margin_m < rules.safety.execution_allowance_m - ROUNDING_M:
                missing_m = rules.safety.execution_allowance_m - margin_m
                moved = -1 if entry == 0 else row
                refuse_as_too_near(proposal.trace, moved, other_row, missing_m)
                return row, other_row
    return -1, -1
