"""Ramp vehicles without a committed merge: they stop one behind the other, before the nose.

Functions add vehicles to a proposal; in it, the order on the ramp is as committed.
"""

import math

from coramp._kernel import FloatArray, kernel
from coramp.equations.safe_distance import gap_time_s
from coramp.kinematics.trajectory import station_and_speed
from coramp.motion.approach import append_stop, approach_without_stop, harmonise
from coramp.road.rules import Rules
from coramp.vehicles.fleet import (
    MAX_CHANGED,
    ROUNDING_M,
    Fleet,
    Proposal,
    committed,
    is_full,
    merge_time_under_s,
    pair_margin_m,
    trajectory_under,
)
from coramp.vehicles.merge_state import NOT_PLANNED_S, is_on_mainline, is_waiting
from coramp.vehicles.traits import own_rules


@kernel
def propose_stop(
    fleet: Fleet, proposal: Proposal, row: int, stop_m: float, from_s: float, common_rules: Rules
) -> bool:
    """Adds a ramp vehicle that goes on to a stop at ``stop_m``, braking before that if it must.

    It brakes for the least number of steps with which it keeps its distance from everyone ahead on
    the ramp; one that stands, or comes to a stand, waits. Returns False, and adds nothing, where
    the longest wait is not enough or the stop is too near.
    """
    entry = proposal.size[0]
    if is_full(proposal):
        return False
    rules = own_rules(fleet.traits[row], common_rules, True)
    before = committed(fleet, row)
    station_m, speed_mps = station_and_speed(before, from_s)
    out = proposal.pieces[entry]
    step_s = rules.control.step_s
    most = math.ceil((speed_mps / rules.motion.slow_down_mps2 + longest_wait_s(rules)) / step_s)
    too_short, enough, steps = -1, most + 1, 0
    while enough - too_short > 1:
        n = _stop_after_brake(out, from_s, station_m, speed_mps, steps * step_s, stop_m, rules)
        if _safe_on_ramp(fleet, proposal, row, out[:n], from_s, rules):
            enough = steps
        elif steps == most:
            return False
        else:
            too_short = steps
        steps = most if enough > most else (too_short + enough) // 2
    n = _stop_after_brake(out, from_s, station_m, speed_mps, enough * step_s, stop_m, rules)
    _add_stop(proposal, row, n)
    return True


@kernel
def longest_wait_s(rules: Rules) -> float:
    """Returns for how long (s) a vehicle in a queue may have to stand until it can go on.

    In a queue that starts, each vehicle follows the way of the one ahead a time gap later. By the
    distances of Eq. 1 alone all can start at once.
    """
    return MAX_CHANGED * gap_time_s(rules)


@kernel
def propose_place_ahead(
    fleet: Fleet, proposal: Proposal, row: int, stop_m: float, from_s: float, common_rules: Rules
) -> bool:
    """Adds a ramp vehicle that goes on to a stop further ahead without touching who is behind it.

    It drives as committed and leaves out its old stop or, where someone ahead is in the way, brakes
    before that. Returns False, and adds nothing, where neither is safe.
    """
    entry = proposal.size[0]
    if is_full(proposal):
        return False
    rules = own_rules(fleet.traits[row], common_rules, True)
    before = committed(fleet, row)
    out = proposal.pieces[entry]
    n = approach_without_stop(before, from_s, rules.road, rules.motion, out)
    n = append_stop(out, n, stop_m, rules.motion.stop_mps2)
    if _safe_on_ramp(fleet, proposal, row, out[:n], from_s, rules):
        _add_stop(proposal, row, n)
    elif not propose_stop(fleet, proposal, row, stop_m, from_s, common_rules):
        return False
    behind = next_behind_on_ramp(fleet, row, from_s)
    if behind >= 0 and not _safe_on_ramp(
        fleet, proposal, behind, committed(fleet, behind), from_s, rules
    ):
        proposal.size[0] = entry
        return False
    return True


@kernel
def _add_stop(proposal: Proposal, row: int, n: int) -> None:
    entry = proposal.size[0]
    proposal.rows[entry] = row
    proposal.piece_count[entry] = n
    proposal.merge_time_s[entry] = NOT_PLANNED_S
    proposal.size[0] = entry + 1


@kernel
def _stop_after_brake(
    out: FloatArray,
    from_s: float,
    station_m: float,
    speed_mps: float,
    brake_s: float,
    stop_m: float,
    rules: Rules,
) -> int:
    ramp_mps = rules.road.ramp_speed_mps
    n = harmonise(out, from_s, station_m, speed_mps, 0.0, brake_s, ramp_mps, rules.motion)
    return append_stop(out, n, stop_m, rules.motion.stop_mps2)


@kernel
def _safe_on_ramp(
    fleet: Fleet, proposal: Proposal, row: int, pieces: FloatArray, from_s: float, rules: Rules
) -> bool:
    """Whether a ramp vehicle keeps its distance from those ahead: the next one without a merge.

    And from all that have one but are not on the mainline yet.
    """
    if len(pieces) == 0:
        return False
    leader = next_ahead_on_ramp(fleet, row, from_s)
    own_m, _ = station_and_speed(pieces, from_s)
    for other in fleet.live:
        merge_s = merge_time_under_s(fleet, proposal, other)
        if is_on_mainline(merge_s, from_s) or other == row:
            continue
        if is_waiting(merge_s) and other != leader:
            continue
        ahead = trajectory_under(fleet, proposal, other)
        if station_and_speed(ahead, from_s)[0] < own_m:
            continue
        margin_m = pair_margin_m(
            ahead,
            fleet.traits[other],
            merge_s,
            pieces,
            fleet.traits[row],
            NOT_PLANNED_S,
            from_s,
            rules,
        )
        if margin_m < rules.safety.execution_allowance_m - ROUNDING_M:
            return False
    return True


@kernel
def next_behind_on_ramp(fleet: Fleet, leader: int, from_s: float) -> int:
    """Returns the next ramp vehicle behind ``leader`` without a committed merge, or -1."""
    leader_m, _ = station_and_speed(committed(fleet, leader), from_s)
    found, found_m = -1, -math.inf
    for row in fleet.live:
        if row != leader and is_waiting(fleet.merge_time_s[row]):
            row_m, _ = station_and_speed(committed(fleet, row), from_s)
            if found_m < row_m < leader_m:
                found, found_m = row, row_m
    return found


@kernel
def next_ahead_on_ramp(fleet: Fleet, row: int, from_s: float) -> int:
    """Returns the next ramp vehicle ahead of ``row`` without a committed merge, or -1."""
    own_m, _ = station_and_speed(committed(fleet, row), from_s)
    found, found_m = -1, math.inf
    for other in fleet.live:
        if other != row and is_waiting(fleet.merge_time_s[other]):
            other_m, _ = station_and_speed(committed(fleet, other), from_s)
            if own_m < other_m < found_m:
                found, found_m = other, other_m
    return found
