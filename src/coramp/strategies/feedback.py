"""What feedback strategies share: both streams as one platoon, in the order in which they merge."""

import math
from typing import NamedTuple

import numpy as np

from coramp._kernel import FloatArray, IntArray, kernel
from coramp.core.fleet import Fleet, committed
from coramp.core.ramp_acceleration import lag_m
from coramp.core.rules import Rules, unpacked
from coramp.core.trajectory import station_and_speed

RAMP, LANE, MAINLINE = range(3)
"""Stages of a vehicle: before the nose, on the acceleration lane, on the mainline."""


class Platoon(NamedTuple):
    """All live vehicles, front first, one entry each.

    ``virtual_m`` is where a vehicle counts on the mainline: where one that cruises at v0 would have
    to be now to be beside it once it has merged. For mainline vehicles that is their station.
    ``virtual_mps`` is the speed of that place. ``same_lane`` is the entry of the next vehicle
    ahead on the same road, -1 for none.
    """

    rows: IntArray
    stage: IntArray
    station_m: FloatArray
    speed_mps: FloatArray
    length_m: FloatArray
    virtual_m: FloatArray
    virtual_mps: FloatArray
    same_lane: IntArray


@kernel
def virtual_platoon(fleet: Fleet, at_s: float, packed_rules: FloatArray) -> Platoon:
    """Returns where everyone will be at ``at_s`` by his commitment, mapped onto the mainline."""
    rules = unpacked(packed_rules)
    count = len(fleet.live)
    rows, stage = np.empty(count, np.int64), np.empty(count, np.int64)
    numbers = np.empty((5, count))
    for i in range(count):
        row = fleet.live[i]
        station_m, speed_mps = station_and_speed(committed(fleet, row), at_s)
        own_stage, at_m, at_mps = MAINLINE, station_m, speed_mps
        if fleet.merge_time_s[row] > at_s:
            own_stage = RAMP if station_m < 0.0 else LANE
            at_m, at_mps = place_on_mainline(station_m, speed_mps, rules)
        k = i
        while k > 0 and numbers[3, k - 1] < at_m:
            rows[k], stage[k], numbers[:, k] = rows[k - 1], stage[k - 1], numbers[:, k - 1]
            k -= 1
        rows[k], stage[k] = row, own_stage
        numbers[0, k], numbers[1, k], numbers[2, k] = station_m, speed_mps, fleet.length_m[row]
        numbers[3, k], numbers[4, k] = at_m, at_mps
    return Platoon(
        rows,
        stage,
        numbers[0],
        numbers[1],
        numbers[2],
        numbers[3],
        numbers[4],
        _next_on_same_road(stage),
    )


@kernel
def place_on_mainline(station_m: float, speed_mps: float, rules: Rules) -> tuple[float, float]:
    """Returns the virtual place (m) of a vehicle before its merge, and the speed of that (m/s).

    It would go to v_R0 and to the nose, and from there to v0 as in free movement: it loses
    ``v0 t - d`` to one that cruises at v0. On the ramp the virtual speed is v v0 / v_R0.
    """
    road, motion = rules.road, rules.motion
    v0, ramp_mps, up = road.mainline_speed_mps, road.ramp_speed_mps, motion.speed_up_mps2
    if station_m >= 0.0:
        return station_m - lag_m(v0, min(v0, speed_mps), motion.free_acceleration_mps2), v0
    now_mps = min(speed_mps, ramp_mps)
    gaining_m = min(-station_m, 0.5 * (ramp_mps * ramp_mps - now_mps * now_mps) / up)
    nose_mps = math.sqrt(now_mps * now_mps + 2.0 * up * gaining_m)
    to_nose_s = (nose_mps - now_mps) / up + (-station_m - gaining_m) / ramp_mps
    virtual_m = -v0 * to_nose_s - lag_m(v0, nose_mps, motion.free_acceleration_mps2)
    return virtual_m, speed_mps * v0 / ramp_mps


@kernel
def _next_on_same_road(stage: IntArray) -> IntArray:
    ahead = np.full(len(stage), -1)
    last_on = np.full(2, -1)
    for k in range(len(stage)):
        road = 1 if stage[k] == MAINLINE else 0
        ahead[k] = last_on[road]
        last_on[road] = k
    return ahead
