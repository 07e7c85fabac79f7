"""The ladder of both priorities where vehicles differ: the same rungs, judged one merge at a time.

Without a common cruising speed no intercept says where a vehicle ends up. So a small set of
accelerations and of late ways to the nose is tried, and each merge is looked at as it would be.
"""

import math
from typing import NamedTuple

import numpy as np

from coramp._kernel import FloatArray, kernel
from coramp.equations.conflict_risk import severity_of_masses_m2ps4
from coramp.equations.gaps import least_acceleration_mps2
from coramp.equations.safe_distance import merge_distance_m, merging_speed_along_mps
from coramp.kinematics.trajectory import (
    MAX_PIECES,
    SPEED,
    TIME,
    station_and_speed,
)
from coramp.motion.approach import approach_without_stop, brake_and_go, late_approach, late_start
from coramp.road.rules import Rules, unpacked
from coramp.strategies.situation import (
    RUNG_CREATE,
    RUNG_DELAY,
    RUNG_FREE,
    RUNG_HOLD,
    RUNG_REACH,
    MergePlan,
    foremost_unknown_m,
    ramp_neighbours,
)
from coramp.strategies.unequal_merge import (
    UnequalMerge,
    no_unequal_merge,
    try_merge,
)
from coramp.vehicles.fleet import Fleet, Proposal, committed, empty_proposal, trajectory_under
from coramp.vehicles.trace import (
    CURRENT,
    MOVES_MORE,
    NO_LATE_WAY,
    give_preference,
    note_choice,
    note_subject,
    open_attempt,
    refuse,
)
from coramp.vehicles.traits import LENGTH, MASS, able_mps2, cruise_mps, own_rules, pair_safety

ACCELERATIONS = 7
"""How many accelerations are tried besides that of free movement."""
LATER_S, LATEST_S = 0.5, 40.0
"""Steps of how much later the subject comes to the nose, and the most."""
STANDING_MPS = 0.1


class Subject(NamedTuple):
    """Whom a decision is about: its way to the nose and the accelerations that it may use."""

    row: int
    from_s: float
    approach: FloatArray
    free_mps2: float
    tried_mps2: FloatArray
    known_m: float


@kernel
def subject_of(
    fleet: Fleet, row: int, now_s: float, fastest_entry_mps: float, rules: Rules
) -> Subject:
    """Returns the subject of a decision at ``now_s``."""
    traits = fleet.traits[row]
    own = own_rules(traits, rules, True)
    from_s = now_s + rules.control.actuation_delay_s
    buffer = np.empty((MAX_PIECES, 4))
    n = approach_without_stop(committed(fleet, row), from_s, own.road, own.motion, buffer)
    nose_mps, cruise = buffer[n - 1, SPEED], cruise_mps(traits, rules)
    least = 0.0
    if cruise > nose_mps:
        least = least_acceleration_mps2(cruise, nose_mps, rules.road.last_merge_station_m)
    most = rules.motion.ramp_acceleration_mps2
    free = min(max(rules.motion.free_acceleration_mps2, least), most)
    known_m = foremost_unknown_m(now_s, fastest_entry_mps, rules)
    if station_and_speed(committed(fleet, row), from_s)[1] < STANDING_MPS:
        known_m = -math.inf  # a vehicle that stands must get away in the end
    return Subject(
        row,
        from_s,
        buffer[:n].copy(),
        free,
        _accelerations(traits, nose_mps, free, least, most),
        known_m,
    )


@kernel
def _accelerations(
    traits: FloatArray, nose_mps: float, free_mps2: float, least_mps2: float, most_mps2: float
) -> FloatArray:
    """Returns accelerations from least to most, evenly in their logarithm, nearest to free first.

    More than the vehicle can do at the nose makes no difference.
    """
    high = min(most_mps2, able_mps2(traits, nose_mps))
    low = max(0.1, min(least_mps2, high))
    if able_mps2(traits, nose_mps) < least_mps2:
        low = 0.5 * high  # it does not reach its cruise in time anyway
    tried = np.empty(ACCELERATIONS)
    for k in range(ACCELERATIONS):
        tried[k] = low * math.pow(high / low, k / (ACCELERATIONS - 1.0))
    off = np.abs(np.log(tried / min(free_mps2, high)))
    return tried[np.argsort(off)]


@kernel
def rung_free(fleet: Fleet, proposal: Proposal, subject: Subject, rules: Rules) -> UnequalMerge:
    """Free movement, if nobody has to move."""
    open_attempt(proposal.trace, RUNG_FREE, 0, -1, -1)
    return try_merge(
        fleet,
        proposal,
        subject.row,
        subject.approach,
        subject.free_mps2,
        False,
        subject.known_m,
        rules,
    )


@kernel
def rung_reach(fleet: Fleet, proposal: Proposal, subject: Subject, rules: Rules) -> UnequalMerge:
    """The acceleration nearest to that of free movement with which nobody has to move."""
    for accel_mps2 in subject.tried_mps2:
        open_attempt(proposal.trace, RUNG_REACH, 0, -1, -1)
        merge = try_merge(
            fleet,
            proposal,
            subject.row,
            subject.approach,
            accel_mps2,
            False,
            subject.known_m,
            rules,
        )
        if merge.done:
            return merge
    return no_unequal_merge()


@kernel
def rung_create(
    fleet: Fleet, proposal: Proposal, subject: Subject, free_alone: bool, rules: Rules
) -> UnequalMerge:
    """Vehicles behind make room: the merge that moves fewest vehicles, then that costs them least.

    With ``free_alone`` the subject keeps its free movement.
    """
    best, best_attempt = no_unequal_merge(), 0
    latest_mps2 = math.nan
    for k in range(-1, 0 if free_alone else ACCELERATIONS):
        accel_mps2 = subject.free_mps2 if k < 0 else subject.tried_mps2[k]
        open_attempt(proposal.trace, RUNG_CREATE, 2, -1, -1)
        merge = try_merge(
            fleet,
            proposal,
            subject.row,
            subject.approach,
            accel_mps2,
            True,
            subject.known_m,
            rules,
        )
        latest_mps2 = accel_mps2
        if merge.done and (
            not best.done or (merge.moved, merge.lost_s) < (best.moved, best.lost_s)
        ):
            best = merge
            best_attempt = give_preference(proposal.trace, best_attempt)
        elif merge.done:
            refuse(proposal.trace, MOVES_MORE, -1, math.nan)
    if best.done:
        proposal.trace[0, CURRENT] = best_attempt
    if best.done and best.accel_mps2 != latest_mps2:
        return try_merge(
            fleet,
            proposal,
            subject.row,
            subject.approach,
            best.accel_mps2,
            True,
            subject.known_m,
            rules,
        )
    return best


@kernel
def rung_delay(fleet: Fleet, proposal: Proposal, subject: Subject, rules: Rules) -> UnequalMerge:
    """Come to the nose later, by as little as helps: first with nobody moving, then with room."""
    for make_room in (False, True):
        later_s = LATER_S
        while later_s <= LATEST_S:
            merge = come_later_by(fleet, proposal, subject, later_s, make_room, rules)
            if merge.done:
                return merge
            later_s += LATER_S
    return no_unequal_merge()


@kernel
def come_later_by(
    fleet: Fleet,
    proposal: Proposal,
    subject: Subject,
    later_s: float,
    make_room: bool,
    rules: Rules,
) -> UnequalMerge:
    """Proposes to pass the nose later: slower at once, slower all the way, or after a stand."""
    own = own_rules(fleet.traits[subject.row], rules, True)
    before, from_s = committed(fleet, subject.row), subject.from_s
    station_m, speed_mps = station_and_speed(before, from_s)
    nose_s = subject.approach[len(subject.approach) - 1, TIME] + later_s
    out = np.empty((MAX_PIECES, 4))
    for way in range(3):
        open_attempt(proposal.trace, RUNG_DELAY, 2 if make_room else 0, -1, -1)
        if way == 0:
            n = brake_and_go(from_s, station_m, speed_mps, nose_s, own.road, own.motion, out)
        elif way == 1:
            n = late_approach(from_s, station_m, speed_mps, nose_s, own.road, own.motion, out)
        else:
            n = late_start(before, from_s, 0.0, own.road, own.motion, out)
            if n > 0:
                wait_s = nose_s - out[n - 1, TIME]
                n = 0
                if wait_s > 0.0:
                    n = late_start(before, from_s, wait_s, own.road, own.motion, out)
        if n == 0:
            refuse(proposal.trace, NO_LATE_WAY, -1, math.nan)
            continue
        merge = try_merge(
            fleet,
            proposal,
            subject.row,
            out[:n],
            subject.free_mps2,
            make_room,
            subject.known_m,
            rules,
        )
        if merge.done:
            return merge
    return no_unequal_merge()


@kernel
def unequal_plan(
    fleet: Fleet,
    proposal: Proposal,
    subject: Subject,
    rung: int,
    merge: UnequalMerge,
    rules: Rules,
) -> MergePlan:
    """Returns the plan that a merge amounts to; one that is not done is a hold.

    The conflict vehicle is the nearer of the two around the merge, severities are those between it
    and the subject before and after they adapt.
    """
    nothing, row = math.nan, subject.row
    note_subject(proposal.trace, subject.free_mps2, fleet.traits[row, LENGTH], nothing)
    nose = subject.approach[len(subject.approach) - 1]
    if not merge.done:
        return MergePlan(
            RUNG_HOLD,
            0,
            -1,
            -1,
            -1,
            nothing,
            nothing,
            nothing,
            nothing,
            nothing,
            nothing,
            nothing,
            nothing,
            nothing,
            nothing,
            nose[TIME],
            nose[SPEED],
            nothing,
            nothing,
            nothing,
        )
    front_m = rear_m = nothing
    gap_m, needed_m = math.inf, fleet.traits[row, LENGTH]
    conflict, nearest_m = -1, math.inf
    for other in (merge.front_row, merge.rear_row):
        if other < 0:
            continue
        ways = trajectory_under(fleet, proposal, other)
        other_m, other_mps = station_and_speed(ways, merge.time_s)
        along_mps = merging_speed_along_mps(merge.speed_mps, rules.road.merge_angle_rad)
        pair = pair_safety(fleet.traits[other], fleet.traits[row], rules.safety)
        needed_m += merge_distance_m(along_mps, other_mps, pair)
        if other == merge.front_row:
            front_m = other_m - fleet.traits[other, LENGTH]
            distance_m = front_m - merge.station_m
        else:
            rear_m = other_m
            distance_m = merge.station_m - fleet.traits[row, LENGTH] - rear_m
        if distance_m < nearest_m:
            conflict, nearest_m = other, distance_m
    if merge.front_row >= 0 and merge.rear_row >= 0:
        gap_m = front_m - rear_m
    front_length_m = fleet.traits[merge.front_row, LENGTH] if merge.front_row >= 0 else nothing
    note_choice(proposal.trace, rung, 2 if merge.moved > 0 else 0, front_length_m)
    before = after = (nothing, nothing)
    if conflict >= 0:
        before = _severity(fleet, row, committed(fleet, conflict), conflict, merge, rules)
        after_way = trajectory_under(fleet, proposal, conflict)
        after = _severity(fleet, row, after_way, conflict, merge, rules)
    now_s = subject.from_s - rules.control.actuation_delay_s
    return MergePlan(
        rung,
        2 if merge.moved > 0 else 0,
        conflict,
        merge.front_row,
        merge.rear_row,
        gap_m,
        needed_m,
        merge.accel_mps2,
        merge.time_s,
        merge.station_m,
        _largest_shift_m(fleet, proposal, merge),
        before[0],
        after[0],
        before[1],
        after[1],
        nose[TIME],
        nose[SPEED],
        _station_now_m(fleet, conflict, now_s),
        _station_now_m(fleet, merge.front_row, now_s),
        _station_now_m(fleet, merge.rear_row, now_s),
    )


@kernel
def _station_now_m(fleet: Fleet, row: int, now_s: float) -> float:
    return station_and_speed(committed(fleet, row), now_s)[0] if row >= 0 else math.nan


@kernel
def _severity(
    fleet: Fleet, row: int, way: FloatArray, other: int, merge: UnequalMerge, rules: Rules
) -> tuple[float, float]:
    """Returns J (m2/s4) at the merge with another vehicle's way, as printed and relative."""
    other_m, other_mps = station_and_speed(way, merge.time_s)
    along_mps = merging_speed_along_mps(merge.speed_mps, rules.road.merge_angle_rad)
    distance_m = max(
        other_m - fleet.traits[other, LENGTH] - merge.station_m,
        merge.station_m - fleet.traits[row, LENGTH] - other_m,
    )
    masses = (fleet.traits[row, MASS], fleet.traits[other, MASS])
    return severity_of_masses_m2ps4(along_mps, other_mps, distance_m, *masses)


@kernel
def _largest_shift_m(fleet: Fleet, proposal: Proposal, merge: UnequalMerge) -> float:
    """Returns by how far (m) at most a vehicle that makes room is back when the subject merges."""
    largest_m = 0.0
    for entry in range(1, proposal.size[0]):
        row = proposal.rows[entry]
        if fleet.merge_time_s[row] < math.inf:
            was_m, _ = station_and_speed(committed(fleet, row), merge.time_s)
            now_m, _ = station_and_speed(trajectory_under(fleet, proposal, row), merge.time_s)
            largest_m = max(largest_m, was_m - now_m)
    return largest_m


@kernel
def plan_unequal(
    fleet: Fleet,
    row: int,
    now_s: float,
    fastest_entry_mps: float,
    packed_rules: FloatArray,
    ramp_first: bool,
) -> tuple[MergePlan, Proposal, bool, int]:
    """Returns plan and trajectories of the first rung that helps, and who is near on the ramp.

    With ``ramp_first`` the subject keeps its free movement and the mainline makes room; else it
    looks for its own gap first.
    """
    rules, proposal = unpacked(packed_rules), empty_proposal()
    subject = subject_of(fleet, row, now_s, fastest_entry_mps, rules)
    blocked, behind = ramp_neighbours(fleet, row, subject.from_s)
    rung, merge = RUNG_FREE, rung_free(fleet, proposal, subject, rules)
    if not merge.done and not ramp_first:
        rung, merge = RUNG_REACH, rung_reach(fleet, proposal, subject, rules)
    if not merge.done:
        rung, merge = RUNG_CREATE, rung_create(fleet, proposal, subject, ramp_first, rules)
    if not merge.done:
        rung, merge = RUNG_DELAY, rung_delay(fleet, proposal, subject, rules)
    if not merge.done:
        rung, proposal.size[0] = RUNG_HOLD, 0
    return unequal_plan(fleet, proposal, subject, rung, merge, rules), proposal, blocked, behind


@kernel
def plan_unequal_mainline(
    fleet: Fleet, subject: int, now_s: float, fastest_entry_mps: float, packed_rules: FloatArray
) -> tuple[MergePlan, Proposal, bool, int]:
    """Returns what ``plan_unequal`` does under mainline priority."""
    return plan_unequal(fleet, subject, now_s, fastest_entry_mps, packed_rules, False)


@kernel
def plan_unequal_ramp(
    fleet: Fleet, subject: int, now_s: float, fastest_entry_mps: float, packed_rules: FloatArray
) -> tuple[MergePlan, Proposal, bool, int]:
    """Returns what ``plan_unequal`` does under ramp priority."""
    return plan_unequal(fleet, subject, now_s, fastest_entry_mps, packed_rules, True)
