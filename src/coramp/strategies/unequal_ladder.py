"""The ladder of both priorities in heterogeneous traffic: the same rungs, one merge at a time.

Without a common cruising speed no intercept says where a vehicle ends up. So the planner tries a
few accelerations and a few late ways to the nose, and examines each merge as it would happen.
"""

import math
from typing import NamedTuple

import numpy as np

from coramp._kernel import FloatArray, kernel
from coramp.equations.gaps import least_acceleration_mps2
from coramp.equations.safe_distance import merge_clearance_m
from coramp.kinematics.trajectory import (
    MAX_PIECES,
    SPEED,
    TIME,
    station_and_speed,
)
from coramp.motion.approach import approach_without_stop, brake_and_go, late_approach, late_start
from coramp.road.rules import Rules, unpacked
from coramp.strategies.make_way import Asked, propose_change, way_further_in
from coramp.strategies.situation import (
    RUNG_CREATE,
    RUNG_DELAY,
    RUNG_FREE,
    RUNG_MAKE_WAY,
    RUNG_REACH,
    MergePlan,
    foremost_unknown_m,
    ramp_neighbours,
)
from coramp.strategies.unequal_merge import (
    UnequalMerge,
    no_unequal_merge,
    try_merge,
    way_to_merge,
)
from coramp.strategies.unequal_plan import hold_plan, unequal_plan
from coramp.vehicles.fleet import Fleet, Proposal, committed, empty_proposal, with_change
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
from coramp.vehicles.traits import LENGTH, able_mps2, cruise_mps, own_rules, pair_safety

ACCELERATIONS = 7
"""How many accelerations are tried besides that of free movement."""
LATER_S, LATEST_S = 0.5, 40.0
"""Steps of how much later the subject comes to the nose, and the most."""
STANDING_MPS = 0.1


class Subject(NamedTuple):
    """The vehicle that a decision is about.

    ``approach`` is its way to the nose, ``tried_mps2`` are the accelerations that are tried besides
    that of free movement. ``known_m`` is as in ``try_merge``.
    """

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
def _try_by(
    fleet: Fleet,
    proposal: Proposal,
    subject: Subject,
    approach: FloatArray,
    accel_mps2: float,
    make_room: bool,
    rules: Rules,
) -> UnequalMerge:
    """Tries one merge of the subject, as ``try_merge`` does."""
    way = (approach, accel_mps2, make_room, subject.known_m)
    return try_merge(fleet, proposal, subject.row, *way, rules)


@kernel
def rung_free(fleet: Fleet, proposal: Proposal, subject: Subject, rules: Rules) -> UnequalMerge:
    """Free movement, if nobody has to move."""
    open_attempt(proposal.trace, RUNG_FREE, 0, -1, -1)
    return _try_by(fleet, proposal, subject, subject.approach, subject.free_mps2, False, rules)


@kernel
def rung_reach(fleet: Fleet, proposal: Proposal, subject: Subject, rules: Rules) -> UnequalMerge:
    """The acceleration nearest to that of free movement with which nobody has to move."""
    for accel_mps2 in subject.tried_mps2:
        open_attempt(proposal.trace, RUNG_REACH, 0, -1, -1)
        merge = _try_by(fleet, proposal, subject, subject.approach, accel_mps2, False, rules)
        if merge.done:
            return merge
    return no_unequal_merge()


@kernel
def rung_make_way(
    fleet: Fleet, proposal: Proposal, subject: Subject, free_alone: bool, rules: Rules
) -> tuple[UnequalMerge, int]:
    """The vehicle in conflict with free movement changes lanes; nobody else has to move.

    With ``free_alone`` the subject keeps its free movement, else it is tried first. Returns who
    makes way too, -1 for nobody.
    """
    row = nearest_at_merge(fleet, subject, rules)
    if row < 0:
        return no_unequal_merge(), -1
    nose_s = subject.approach[len(subject.approach) - 1, TIME]
    traits = fleet.traits[row]
    clearance_m = merge_clearance_m(rules.road, pair_safety(traits, traits, rules.safety))
    asked = Asked(row, -1, -1, subject.from_s, nose_s, subject.known_m, clearance_m)
    way = np.empty((MAX_PIECES, 4))
    n, change_s, _ = way_further_in(fleet, proposal, asked, rules, way)
    if n == 0:
        return no_unequal_merge(), -1
    leaving = with_change(fleet, row, change_s)
    for k in range(-1, 0 if free_alone else ACCELERATIONS):
        accel_mps2 = subject.free_mps2 if k < 0 else subject.tried_mps2[k]
        if k >= 0:
            open_attempt(proposal.trace, RUNG_MAKE_WAY, 0, -1, -1)
        merge = _try_by(leaving, proposal, subject, subject.approach, accel_mps2, False, rules)
        if merge.done:
            propose_change(fleet, proposal, row, way[:n], change_s)
            return merge, row
    return no_unequal_merge(), -1


@kernel
def nearest_at_merge(fleet: Fleet, subject: Subject, rules: Rules) -> int:
    """Returns who on the mainline is nearest to the subject at the merge of free movement.

    -1 where there is no such merge, or nobody.
    """
    out = np.empty((MAX_PIECES, 4))
    m, merge_s, order, place = way_to_merge(
        fleet, subject.row, subject.approach, subject.free_mps2, rules, out
    )
    if m == 0 or len(order) == 0:
        return -1
    merge_m, _ = station_and_speed(out[:m], merge_s)
    nearest, nearest_m = -1, math.inf
    for k in range(max(0, place - 1), min(len(order), place + 1)):
        other = order[k]
        other_m, _ = station_and_speed(committed(fleet, other), merge_s)
        length_m = fleet.length_m[other] if other_m > merge_m else fleet.length_m[subject.row]
        gap_m = abs(other_m - merge_m) - length_m
        if gap_m < nearest_m:
            nearest, nearest_m = other, gap_m
    return int(nearest)


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
        merge = _try_by(fleet, proposal, subject, subject.approach, accel_mps2, True, rules)
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
        return _try_by(fleet, proposal, subject, subject.approach, best.accel_mps2, True, rules)
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
        merge = _try_by(fleet, proposal, subject, out[:n], subject.free_mps2, make_room, rules)
        if merge.done:
            return merge
    return no_unequal_merge()


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
    note_subject(proposal.trace, subject.free_mps2, fleet.traits[row, LENGTH], math.nan)
    blocked, behind = ramp_neighbours(fleet, row, subject.from_s)
    rung, merge = RUNG_FREE, rung_free(fleet, proposal, subject, rules)
    if not merge.done and not ramp_first:
        rung, merge = RUNG_REACH, rung_reach(fleet, proposal, subject, rules)
    made_way = -1
    if not merge.done and rules.road.lanes > 1:
        rung = RUNG_MAKE_WAY
        merge, made_way = rung_make_way(fleet, proposal, subject, ramp_first, rules)
    if not merge.done:
        rung, merge = RUNG_CREATE, rung_create(fleet, proposal, subject, ramp_first, rules)
    if not merge.done:
        rung, merge = RUNG_DELAY, rung_delay(fleet, proposal, subject, rules)
    nose = subject.approach[len(subject.approach) - 1]
    if not merge.done:
        proposal.size[0] = 0
        return hold_plan(nose), proposal, blocked, behind
    front_length_m = fleet.traits[merge.front_row, LENGTH] if merge.front_row >= 0 else math.nan
    note_choice(proposal.trace, rung, 2 if merge.moved > 0 else 0, front_length_m)
    plan = unequal_plan(fleet, proposal, row, now_s, nose, rung, merge, made_way, rules)
    return plan, proposal, blocked, behind


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
