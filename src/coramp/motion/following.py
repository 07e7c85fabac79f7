"""How a vehicle follows a slower one: it drives on, brakes in time, and then drives as that does.

All functions write a trajectory into ``out`` and return its length, or 0 where there is none.
"""

import math
from typing import NamedTuple

from coramp._kernel import FloatArray, kernel
from coramp.kinematics.trajectory import (
    ACCEL,
    SPEED,
    TIME,
    clip_end,
    clip_start,
    drive,
    drive_to_speed,
    piece_at,
    piece_end_s,
    station_and_speed,
    time_at_station,
)
from coramp.road.rules import Rules
from coramp.vehicles.fleet import ROUNDING_M, pair_margin_m
from coramp.vehicles.traits import BRAKING, SPEED_BAND_MPS, able_mps2, cruise_mps

SAME_SPEED_MPS = 1e-9
LONGEST_LOOK_S = 60.0
DIPS = 32
"""In how many steps the depth of a dip in speed is chosen."""
LEAST_SPEED_MPS = 0.5
"""A vehicle that makes room on the road does not brake below this."""


class Leader(NamedTuple):
    """The vehicle ahead: what it drives, what it can do, and when it merges (s).

    The merge time is as ``vehicles.merge_state`` reads it.
    """

    pieces: FloatArray
    traits: FloatArray
    merge_time_s: float


@kernel
def speed_up(
    out: FloatArray, n: int, target_mps: float, most_mps2: float, traits: FloatArray
) -> int:
    """Appends the stretch that brings a vehicle up to ``target_mps`` with what it can do.

    A vehicle of limited power P per mass takes bands of speed, each with min(a_0, P / v) at its
    upper end, so that it never accelerates harder than it can.
    """
    start_mps = out[n - 1, SPEED]
    if target_mps <= start_mps + SAME_SPEED_MPS:
        return n
    bands = 1
    if able_mps2(traits, target_mps) < min(most_mps2, able_mps2(traits, start_mps)):
        bands = math.ceil((target_mps - start_mps) / SPEED_BAND_MPS)
    for band in range(bands):
        if n >= len(out) - 1:
            return 0
        ends_mps = start_mps + (target_mps - start_mps) * (band + 1) / bands
        if band == bands - 1:
            ends_mps = target_mps
        n = drive_to_speed(out, n, min(most_mps2, able_mps2(traits, ends_mps)), ends_mps)
    return n


@kernel
def follow(
    base: FloatArray,
    brake_from_s: float,
    dip_mps: float,
    leader: Leader,
    traits: FloatArray,
    common_rules: Rules,
    out: FloatArray,
) -> int:
    """Writes: drive ``base`` until ``brake_from_s``, brake to the leader's speed, drive as it does.

    The leader counts from its merge on, when it comes onto the lane; before that its speed at the
    merge is aimed at. ``dip_mps`` is by how much the vehicle brakes below that speed first,
    which opens the gap: it goes back up at once. It never drives faster than its own cruise.
    """
    slow_down_mps2 = min(common_rules.motion.slow_down_mps2, traits[BRAKING])
    n = clip_start(base, base[0, TIME], out)
    n = clip_end(out, n, max(base[0, TIME], brake_from_s))
    n = _brake_to_leader(out, n, dip_mps, leader, slow_down_mps2)
    if n == 0:
        return 0
    if dip_mps > 0.0:
        aim_mps = _leader_speed_mps(leader, out[n - 1, TIME])
        aim_mps = min(aim_mps, cruise_mps(traits, common_rules))
        n = speed_up(out, n, aim_mps, common_rules.motion.speed_up_mps2, traits)
        if n == 0:
            return 0
    return _drive_as(out, n, leader, traits, common_rules)


@kernel
def follow_safely(
    base: FloatArray,
    merge_s: float,
    brake_from_s: float,
    leader: Leader,
    traits: FloatArray,
    most_dip_mps: float,
    rules: Rules,
    out: FloatArray,
) -> int:
    """Writes what disturbs a vehicle least that is on its way by ``base`` and keeps its distance.

    That is ``base`` itself, or it braked for the leader as late as is safe, from ``brake_from_s``
    at the earliest, or as early as that and with the least dip of up to ``most_dip_mps``. Returns
    0 where nothing of that is safe.
    """
    from_s = base[0, TIME]
    if _is_safe(base, traits, merge_s, leader, from_s, rules):
        out[: len(base)] = base
        return len(base)
    brake_from_s, step_s = max(from_s, brake_from_s), rules.control.step_s
    enough, too_late = -1, _steps_to_brake(base, brake_from_s, leader, rules) + 1
    steps = 0
    while too_late - enough > 1:  # the latest step at which braking is safe
        n = follow(base, brake_from_s + steps * step_s, 0.0, leader, traits, rules, out)
        if _is_safe(out[:n], traits, merge_s, leader, from_s, rules):
            enough = steps
        elif steps == 0:
            break
        else:
            too_late = steps
        steps = (enough + too_late) // 2
    if enough >= 0:
        return follow(base, brake_from_s + enough * step_s, 0.0, leader, traits, rules, out)
    if most_dip_mps <= 0.0:
        return 0
    small, large, level = 0, DIPS, DIPS
    while large - small > 1:  # the least dip
        n = follow(base, brake_from_s, most_dip_mps * level / DIPS, leader, traits, rules, out)
        if _is_safe(out[:n], traits, merge_s, leader, from_s, rules):
            large = level
        elif level == DIPS:
            return 0
        else:
            small = level
        level = (small + large) // 2
    return follow(base, brake_from_s, most_dip_mps * large / DIPS, leader, traits, rules, out)


@kernel
def _is_safe(
    pieces: FloatArray,
    traits: FloatArray,
    merge_s: float,
    leader: Leader,
    from_s: float,
    rules: Rules,
) -> bool:
    """Whether a vehicle that drives these pieces keeps its distance; never one that has none."""
    if len(pieces) == 0:
        return False
    ahead = (leader.pieces, leader.traits, leader.merge_time_s)
    margin_m = pair_margin_m(pieces, traits, merge_s, *ahead, from_s, rules)
    return bool(margin_m >= rules.safety.execution_allowance_m - ROUNDING_M)


@kernel
def _steps_to_brake(base: FloatArray, from_s: float, leader: Leader, rules: Rules) -> int:
    """Returns how many steps later than ``from_s`` it makes sense to brake: until one leaves."""
    end_m = rules.road.mainline_end_m
    leaves_s = min(time_at_station(leader.pieces, end_m), time_at_station(base, end_m))
    if math.isinf(leaves_s) or leaves_s <= from_s:
        leaves_s = from_s + LONGEST_LOOK_S
    return math.ceil((leaves_s - from_s) / rules.control.step_s)


@kernel
def _leader_speed_mps(leader: Leader, time_s: float) -> float:
    _, speed_mps = station_and_speed(leader.pieces, max(time_s, leader.merge_time_s))
    return float(speed_mps)


@kernel
def _brake_to_leader(
    out: FloatArray,
    n: int,
    dip_mps: float,
    leader: Leader,
    slow_down_mps2: float,
) -> int:
    """Appends braking at d until the speed is the leader's less the dip: v - d x = v_L - dip.

    While the leader changes its speed by a, that is after ``(v - v_L + dip) / (d + a)``.
    """
    driven, merge_s = leader.pieces, leader.merge_time_s
    for _ in range(len(driven) + 1):
        if n >= len(out) - 1:
            return 0
        now_s, speed_mps = out[n - 1, TIME], out[n - 1, SPEED]
        aim_mps = max(LEAST_SPEED_MPS, _leader_speed_mps(leader, now_s) - dip_mps)
        if speed_mps <= aim_mps + SAME_SPEED_MPS:
            return n
        k = piece_at(driven, max(now_s, merge_s))
        accel_mps2, until_s = driven[k, ACCEL], piece_end_s(driven, k)
        if now_s < merge_s:
            accel_mps2, until_s = 0.0, merge_s
        closing_mps2 = slow_down_mps2 + accel_mps2
        needed_s = math.inf
        if closing_mps2 > 1e-9:
            needed_s = (speed_mps - aim_mps) / closing_mps2
        most_s = min(until_s - now_s, (speed_mps - LEAST_SPEED_MPS) / slow_down_mps2)
        n = drive(out, n, -slow_down_mps2, min(needed_s, most_s))
        if needed_s <= until_s - now_s:
            return n
    return n


@kernel
def _brake_along(
    out: FloatArray, n: int, mps2: float, at_once: bool, lasts_s: float, ends_mps: float
) -> int:
    """Appends braking by ``mps2`` to the speed with which a leader's piece ends.

    It begins at once, or so that it is over with that piece if that is possible.
    """
    needed_s = (out[n - 1, SPEED] - max(LEAST_SPEED_MPS, ends_mps)) / mps2
    if needed_s <= 0.0:
        return n
    if not at_once:
        n = drive(out, n, 0.0, max(0.0, lasts_s - needed_s))
    return drive(out, n, -mps2, min(lasts_s, needed_s))


@kernel
def _drive_as(
    out: FloatArray,
    n: int,
    leader: Leader,
    traits: FloatArray,
    common_rules: Rules,
) -> int:
    """Appends what the leader drives from here on, as far as the vehicle can, up to its cruise.

    One that cannot brake as hard as the leader does goes on braking after it.
    """
    cruise, now_s = cruise_mps(traits, common_rules), out[n - 1, TIME]
    comfort_mps2 = common_rules.motion.comfort_mps2
    hardest_mps2 = min(comfort_mps2, traits[BRAKING])
    slow_down_mps2 = min(common_rules.motion.slow_down_mps2, hardest_mps2)
    driven, merge_s = leader.pieces, leader.merge_time_s
    if now_s < merge_s:
        n = drive(out, n, 0.0, merge_s - now_s)
        now_s = merge_s
    k = piece_at(driven, now_s)
    while k + 1 < len(driven):
        if n >= len(out) - 8:
            return 0
        lasts_s = piece_end_s(driven, k) - now_s
        accel_mps2 = driven[k, ACCEL]
        speed_mps = out[n - 1, SPEED]
        if accel_mps2 > 0.0:
            ends_mps = min(cruise, driven[k + 1, SPEED])
            if ends_mps > speed_mps:
                accel_mps2 = min(accel_mps2, comfort_mps2, able_mps2(traits, ends_mps))
                n = drive(out, n, accel_mps2, min(lasts_s, (ends_mps - speed_mps) / accel_mps2))
        elif speed_mps > driven[k + 1, SPEED] + SAME_SPEED_MPS:
            steady = accel_mps2 == 0.0
            brake_mps2 = slow_down_mps2 if steady else min(-accel_mps2, hardest_mps2)
            n = _brake_along(out, n, brake_mps2, steady, lasts_s, driven[k + 1, SPEED])
        left_s = piece_end_s(driven, k) - out[n - 1, TIME]
        n = drive(out, n, 0.0, left_s)
        k += 1
        now_s = driven[k, TIME]
    ends_mps = min(cruise, driven[len(driven) - 1, SPEED])
    if out[n - 1, SPEED] > ends_mps + SAME_SPEED_MPS:
        return _brake_to_leader(out, n, 0.0, leader, slow_down_mps2)
    return speed_up(out, n, ends_mps, common_rules.motion.speed_up_mps2, traits)
