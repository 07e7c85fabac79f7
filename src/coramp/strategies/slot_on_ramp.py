"""A ramp vehicle's ways to its slot: slower on the ramp, of least effort, or later from a stop."""

import math

from coramp._kernel import FloatArray, kernel
from coramp.equations.gaps import least_acceleration_mps2
from coramp.equations.ramp_acceleration import lag_m
from coramp.kinematics.trajectory import (
    SPEED,
    STATION,
    TIME,
    clip_end,
    clip_start,
    station_and_speed,
    time_at_station,
)
from coramp.motion.approach import change_speed
from coramp.motion.slow_phase import least_effort_way, slow_phase
from coramp.road.rules import Rules
from coramp.strategies.situation import Situation
from coramp.strategies.slot_in_lane import KEEP_M
from coramp.vehicles.fleet import Fleet, committed
from coramp.vehicles.merge_state import is_yet_to_merge

SAME_MPS = 1e-6
LONGEST_WAIT_S = 1e4


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

    It goes to a slower speed at once and is back by ``end_s``. Returns its length, 0 where that
    asks for less than ``slowest_ramp_speed_mps``.
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
    if n == 0 or out[:n, SPEED].min() < min(speed_mps, motion.slowest_ramp_speed_mps):
        return 0
    return clip_end(out, n, max(out[n - 1, TIME], nose_s))


@kernel
def smooth_on_ramp(
    fleet: Fleet,
    situation: Situation,
    nose_s: float,
    nose_mps: float,
    jerk_mps3: float,
    out: FloatArray,
    rules: Rules,
) -> int:
    """Writes the approach of least effort that passes the nose at ``nose_s`` with ``nose_mps``."""
    station_m, speed_mps = station_and_speed(committed(fleet, situation.subject), situation.from_s)
    n = least_effort_way(
        out,
        situation.from_s,
        station_m,
        speed_mps,
        nose_s,
        -nose_mps * nose_s,
        nose_mps,
        jerk_mps3,
        rules.motion,
    )
    if n == 0 or out[:n, SPEED].min() < rules.motion.slowest_ramp_speed_mps:
        return 0
    if out[:n, SPEED].max() > rules.road.ramp_limit_mps + SAME_MPS:
        return 0
    return n


@kernel
def leave_stop_for_slot(
    fleet: Fleet, situation: Situation, slot_m: float, out: FloatArray, rules: Rules
) -> tuple[int, float]:
    """Writes the approach that keeps to its commitment until it must leave it for the slot.

    The later it speeds up to the ramp's speed, the later it comes; the time is found by halving.
    Returns the approach's length, 0 for none, and the acceleration (m/s2) behind the nose.
    """
    before, from_s = committed(fleet, situation.subject), situation.from_s
    if leave_stop_at(before, from_s, from_s, out, rules)[2] < slot_m - KEEP_M:
        return 0, math.nan
    early_s, late_s = from_s, from_s + 1.0
    while leave_stop_at(before, from_s, late_s, out, rules)[2] > slot_m:
        early_s, late_s = late_s, late_s + 2.0 * (late_s - from_s)
        if late_s > from_s + LONGEST_WAIT_S:
            return 0, math.nan
    while late_s - early_s > 1e-9 * late_s:
        middle_s = 0.5 * (early_s + late_s)
        if leave_stop_at(before, from_s, middle_s, out, rules)[2] > slot_m:
            early_s = middle_s
        else:
            late_s = middle_s
    n, accel_mps2, _ = leave_stop_at(before, from_s, late_s, out, rules)
    return n, accel_mps2


@kernel
def leave_stop_at(
    before: FloatArray, from_s: float, leave_s: float, out: FloatArray, rules: Rules
) -> tuple[int, float, float]:
    """Writes the approach that leaves a commitment at ``leave_s`` for the ramp's speed.

    Returns its length, the acceleration (m/s2) behind the nose, free movement's within Eq. 22, and
    the intercept (m) that it ends on.
    """
    road, motion = rules.road, rules.motion
    v0 = road.mainline_speed_mps
    n = clip_start(before, from_s, out)
    n = clip_end(out, n, leave_s)
    n = change_speed(out, n, road.ramp_speed_mps, motion)
    n = clip_end(out, n, time_at_station(out[:n], 0.0))
    nose_s, nose_mps = out[n - 1, TIME], out[n - 1, SPEED]
    least = least_acceleration_mps2(v0, nose_mps, road.last_merge_station_m)
    accel_mps2 = min(max(motion.free_acceleration_mps2, least), motion.ramp_acceleration_mps2)
    return n, accel_mps2, -v0 * nose_s - lag_m(v0, nose_mps, accel_mps2)


@kernel
def leader_regains_s(fleet: Fleet, situation: Situation, rules: Rules) -> float:
    """Returns when (s) the next vehicle ahead on the ramp is back at the ramp's speed for good.

    When it passes the nose if it does so more slowly; infinity without such a vehicle.
    """
    own_m, _ = station_and_speed(committed(fleet, situation.subject), situation.from_s)
    found, found_m = -1, math.inf
    for row in fleet.live:
        if is_yet_to_merge(fleet.merge_time_s[row], situation.from_s):
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
