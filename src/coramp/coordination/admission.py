"""How a vehicle enters: harmonised to its lane's speed as early as its leaders allow, or not yet.

A mainline vehicle is brought to v0, a ramp vehicle to v_R0 with a stop before the nose. It may
have to brake first, as briefly as is safe; where even a full stop is not safe it waits outside.
"""

import math

import numpy as np

from coramp._kernel import FloatArray, IntArray, kernel
from coramp.coordination.entry_behind import entry_behind_others
from coramp.kinematics.trajectory import (
    MAX_PIECES,
    intercept_range_m,
    station_and_speed,
    time_at_station,
)
from coramp.motion.approach import append_stop, harmonise, stop_of_m, stop_starts_s
from coramp.road.rules import Rules
from coramp.strategies.proposals import largest_safe_distance_m
from coramp.strategies.ramp_queue import propose_place_ahead
from coramp.vehicles.fleet import (
    ROUNDING_M,
    Fleet,
    Proposal,
    committed,
    empty_proposal,
    pair_margin_m,
    trajectory_under,
)
from coramp.vehicles.merge_state import is_on_mainline, is_waiting, merge_time_at_entry_s
from coramp.vehicles.traits import own_rules, standing_behind_m

LEAST_MOVE_M = 1.0
"""Places that would move up by less are left alone."""


@kernel
def plan_entry(
    fleet: Fleet,
    traits: FloatArray,
    on_ramp: bool,
    time_s: float,
    station_m: float,
    speed_mps: float,
    slowest_mps: float,
    common_rules: Rules,
) -> FloatArray:
    """Returns the trajectory with which a vehicle enters now, of length 0 if it must wait.

    It brakes for the least whole number of steps that is safe, but not below ``slowest_mps``; at 0
    it may come to a stand.
    """
    out = np.empty((MAX_PIECES, 4))
    rules = own_rules(traits, common_rules, on_ramp)
    if common_rules.traffic.differs and not on_ramp:
        n = entry_behind_others(
            fleet, traits, time_s, station_m, speed_mps, slowest_mps, common_rules, out
        )
        safe = safe_to_enter(fleet, out[:n], traits, on_ramp, time_s, common_rules)
        return out[:n] if safe else out[:0]
    stop_m = stop_behind_m(fleet, traits, common_rules) if on_ramp else math.inf
    step_s = rules.control.step_s
    most = math.ceil(speed_mps / rules.motion.slow_down_mps2 / step_s)
    if slowest_mps > 0.0:
        spare_mps = max(0.0, speed_mps - slowest_mps)
        most = math.floor(spare_mps / rules.motion.slow_down_mps2 / step_s)
    too_short, enough, steps = -1, most + 1, 0
    while enough - too_short > 1:
        n = entry_with_brake(
            out, on_ramp, time_s, station_m, speed_mps, steps * step_s, stop_m, rules
        )
        if safe_to_enter(fleet, out[:n], traits, on_ramp, time_s, common_rules):
            enough = steps
        elif steps == most:
            return out[:0]
        else:
            too_short = steps
        steps = most if enough > most else (too_short + enough) // 2
    n = entry_with_brake(out, on_ramp, time_s, station_m, speed_mps, enough * step_s, stop_m, rules)
    return out[:n]


@kernel
def entry_with_brake(
    out: FloatArray,
    on_ramp: bool,
    time_s: float,
    station_m: float,
    speed_mps: float,
    brake_s: float,
    stop_m: float,
    rules: Rules,
) -> int:
    """Writes the entry that brakes for ``brake_s``; returns its length, 0 if it stops too late."""
    road = rules.road
    n = harmonise(
        out,
        time_s,
        station_m,
        speed_mps,
        rules.control.actuation_delay_s,
        brake_s,
        road.ramp_speed_mps if on_ramp else road.mainline_speed_mps,
        rules.motion,
    )
    if on_ramp:
        return append_stop(out, n, stop_m, rules.motion.stop_mps2)
    return n


@kernel
def stop_behind_m(fleet: Fleet, traits: FloatArray, rules: Rules) -> float:
    """Returns where the next ramp vehicle must be able to stop: before the nose, or another."""
    stop_m = rules.road.stop_station_m
    for row in fleet.live:
        if is_waiting(fleet.merge_time_s[row]):
            standing_m = standing_behind_m(fleet.traits[row], traits, rules)
            behind_m = stop_of_m(committed(fleet, row)) - fleet.length_m[row] - standing_m
            stop_m = min(stop_m, behind_m)
    return stop_m


@kernel
def plan_moving_up(fleet: Fleet, from_s: float, rules: Rules) -> Proposal:
    """Returns new trajectories for ramp vehicles whose stop can move up behind those before them.

    Each vehicle without a committed merge must be able to stop behind the one before it. As those
    at the head merge, the places move up; a vehicle is only asked to when its own stop is near.
    """
    proposal = empty_proposal()
    rows = undecided_in_lane_order(fleet, from_s)
    place_m = rules.road.stop_station_m
    for k in range(len(rows)):
        row = rows[k]
        if k > 0:
            standing_m = standing_behind_m(fleet.traits[rows[k - 1]], fleet.traits[row], rules)
            stop_m = stop_of_m(trajectory_under(fleet, proposal, rows[k - 1]))
            place_m = min(place_m, stop_m - fleet.length_m[rows[k - 1]] - standing_m)
        if place_m > stop_of_m(committed(fleet, row)) + LEAST_MOVE_M:
            propose_place_ahead(fleet, proposal, row, place_m, from_s, rules)
    return proposal


@kernel
def undecided_in_lane_order(fleet: Fleet, time_s: float) -> IntArray:
    """Returns the ramp rows whose merge is not committed, front first."""
    rows = np.empty(len(fleet.live), np.int64)
    stations_m = np.empty(len(fleet.live))
    n = 0
    for row in fleet.live:
        if is_waiting(fleet.merge_time_s[row]):
            station_m, _ = station_and_speed(committed(fleet, row), time_s)
            k = n
            while k > 0 and stations_m[k - 1] < station_m:
                stations_m[k], rows[k] = stations_m[k - 1], rows[k - 1]
                k -= 1
            stations_m[k], rows[k] = station_m, row
            n += 1
    return rows[:n]


@kernel
def safe_to_enter(
    fleet: Fleet,
    pieces: FloatArray,
    traits: FloatArray,
    on_ramp: bool,
    time_s: float,
    rules: Rules,
) -> bool:
    """Returns whether the entry keeps its distance, the allowance included, from everyone ahead."""
    if len(pieces) == 0:
        return False
    merge_s = merge_time_at_entry_s(on_ramp)
    far_m = largest_safe_distance_m(rules)
    highest_m = math.inf
    if not on_ramp:
        _, highest_m = intercept_range_m(pieces, time_s, rules.road.mainline_speed_mps)
    for row in fleet.live:
        if on_ramp and is_on_mainline(fleet.merge_time_s[row], time_s):
            continue
        if fleet.intercepts_m[row, 0] - fleet.length_m[row] - highest_m > far_m:
            continue
        margin_m = pair_margin_m(
            pieces,
            traits,
            merge_s,
            committed(fleet, row),
            fleet.traits[row],
            fleet.merge_time_s[row],
            time_s,
            rules,
        )
        if margin_m < rules.safety.execution_allowance_m - ROUNDING_M:
            return False
    return True


@kernel
def decision_due_s(pieces: FloatArray, decision_station_m: float) -> float:
    """Returns when a ramp vehicle is to be planned: at its decision station, or where it must stop.

    A vehicle whose stop behind others begins before the station is planned from there on.
    """
    return min(time_at_station(pieces, decision_station_m), stop_starts_s(pieces))
