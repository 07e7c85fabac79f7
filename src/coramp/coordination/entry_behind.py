"""How a vehicle enters the mainline where vehicles differ: behind one that may stay slower."""

import numpy as np

from coramp._kernel import FloatArray, kernel
from coramp.kinematics.trajectory import (
    MAX_PIECES,
    SPEED,
    begin,
    drive,
    drive_to_speed,
    station_and_speed,
)
from coramp.motion.following import Leader, follow_safely, speed_up
from coramp.road.rules import Rules
from coramp.vehicles.fleet import Fleet, committed
from coramp.vehicles.merge_state import BY_MAINLINE_S, is_waiting
from coramp.vehicles.traits import BRAKING, cruise_mps


@kernel
def entry_behind_others(
    fleet: Fleet,
    traits: FloatArray,
    time_s: float,
    station_m: float,
    speed_mps: float,
    slowest_mps: float,
    rules: Rules,
    out: FloatArray,
) -> int:
    """Writes how a mainline vehicle enters: to its own cruise, braking in time for who is ahead.

    It brakes below the speed of the vehicle ahead if need be, but not below ``slowest_mps``.
    Returns 0 where it must wait outside.
    """
    base = np.empty((MAX_PIECES, 4))
    n = begin(base, time_s, station_m, speed_mps)
    n = drive(base, n, 0.0, rules.control.actuation_delay_s)
    cruise = cruise_mps(traits, rules)
    if speed_mps > cruise:
        n = drive_to_speed(base, n, -min(rules.motion.slow_down_mps2, traits[BRAKING]), cruise)
    n = speed_up(base, n, cruise, rules.motion.speed_up_mps2, traits)
    leader = last_on_mainline(fleet, time_s)
    if leader < 0:
        out[:n] = base[:n]
        return n
    return follow_safely(
        base[:n],
        BY_MAINLINE_S,
        time_s + rules.control.actuation_delay_s,
        Leader(committed(fleet, leader), fleet.traits[leader], fleet.merge_time_s[leader]),
        traits,
        max(0.0, base[0, SPEED] - slowest_mps),
        rules,
        out,
    )


@kernel
def last_on_mainline(fleet: Fleet, time_s: float) -> int:
    """Returns the hindmost vehicle that is or will be on the mainline, -1 for none.

    A ramp vehicle counts where it will be at its merge, compared with the others at that time.
    """
    last, last_s = -1, time_s
    for row in fleet.live:
        if is_waiting(fleet.merge_time_s[row]):
            continue
        if last < 0:
            last, last_s = row, max(time_s, fleet.merge_time_s[row])
            continue
        at_s = max(last_s, fleet.merge_time_s[row])
        own_m, _ = station_and_speed(committed(fleet, row), at_s)
        last_m, _ = station_and_speed(committed(fleet, last), at_s)
        if own_m < last_m:
            last, last_s = row, max(time_s, fleet.merge_time_s[row])
    return last
