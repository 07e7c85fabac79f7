"""What feedback strategies share: both streams as one platoon, in the order in which they merge."""

import math
from typing import NamedTuple

import numpy as np

from coramp._kernel import FloatArray, IntArray, kernel
from coramp.equations.ramp_acceleration import lag_m
from coramp.kinematics.trajectory import station_and_speed
from coramp.road.lanes import ACCELERATION_LANE, MAINLINE, RAMP
from coramp.road.rules import Rules, unpacked
from coramp.vehicles.fleet import Fleet, committed
from coramp.vehicles.merge_state import is_on_mainline


class Platoon(NamedTuple):
    """All live vehicles in the order of merging, front first, one entry each.

    ``virtual_m`` is where a vehicle counts on the mainline: where one that cruises at v0 would have
    to be now to be beside it once it has merged, but not before the tail of who is ahead of it on
    the ramp. For mainline vehicles that is their station. ``virtual_mps`` is the speed of that
    place. ``stage`` is the vehicle's lane (``road.lanes``). ``same_road`` is the entry of the next
    vehicle ahead on the same road, -1 for none.
    """

    rows: IntArray
    stage: IntArray
    station_m: FloatArray
    speed_mps: FloatArray
    length_m: FloatArray
    virtual_m: FloatArray
    virtual_mps: FloatArray
    same_road: IntArray


STATION, SPEED, LENGTH, VIRTUAL, VIRTUAL_SPEED = range(5)
"""Columns of ``_road_users``."""


@kernel
def virtual_platoon(fleet: Fleet, at_s: float, packed_rules: FloatArray) -> Platoon:
    """Returns where everyone will be at ``at_s`` by his commitment, mapped onto the mainline."""
    rules = unpacked(packed_rules)
    lane_rows, lane_stage, lane = _road_users(fleet, at_s, True, rules)
    ramp_rows, ramp_stage, ramp = _road_users(fleet, at_s, False, rules)
    _keep_ramp_order(ramp)
    count = len(lane_rows) + len(ramp_rows)
    rows, stage = np.empty(count, np.int64), np.empty(count, np.int64)
    same_road, numbers = np.empty(count, np.int64), np.empty((count, 5))
    i, j, last_lane, last_ramp = 0, 0, -1, -1
    for k in range(count):
        if j == len(ramp_rows) or (i < len(lane_rows) and lane[i, VIRTUAL] >= ramp[j, VIRTUAL]):
            rows[k], stage[k], numbers[k] = lane_rows[i], lane_stage[i], lane[i]
            same_road[k], last_lane, i = last_lane, k, i + 1
        else:
            rows[k], stage[k], numbers[k] = ramp_rows[j], ramp_stage[j], ramp[j]
            same_road[k], last_ramp, j = last_ramp, k, j + 1
    return Platoon(
        rows,
        stage,
        numbers[:, STATION].copy(),
        numbers[:, SPEED].copy(),
        numbers[:, LENGTH].copy(),
        numbers[:, VIRTUAL].copy(),
        numbers[:, VIRTUAL_SPEED].copy(),
        same_road,
    )


@kernel
def _road_users(
    fleet: Fleet, at_s: float, merged: bool, rules: Rules
) -> tuple[IntArray, IntArray, FloatArray]:
    """Returns rows, stages and numbers of who is on the mainline, or on ramp and lane, in order."""
    rows, stage = np.empty(len(fleet.live), np.int64), np.empty(len(fleet.live), np.int64)
    numbers = np.empty((len(fleet.live), 5))
    n = 0
    for row in fleet.live:
        if is_on_mainline(fleet.merge_time_s[row], at_s) != merged:
            continue
        station_m, speed_mps = station_and_speed(committed(fleet, row), at_s)
        k = n
        while k > 0 and numbers[k - 1, STATION] < station_m:
            rows[k], stage[k], numbers[k] = rows[k - 1], stage[k - 1], numbers[k - 1]
            k -= 1
        rows[k], stage[k] = row, MAINLINE
        virtual_m, virtual_mps = station_m, speed_mps
        if not merged:
            stage[k] = RAMP if station_m < 0.0 else ACCELERATION_LANE
            virtual_m, virtual_mps = place_on_mainline(station_m, speed_mps, rules)
        numbers[k, STATION], numbers[k, SPEED] = station_m, speed_mps
        numbers[k, LENGTH] = fleet.length_m[row]
        numbers[k, VIRTUAL], numbers[k, VIRTUAL_SPEED] = virtual_m, virtual_mps
        n += 1
    return rows[:n], stage[:n], numbers[:n]


@kernel
def _keep_ramp_order(ramp: FloatArray) -> None:
    """Keeps every place behind the tail of the vehicle ahead, however slow that vehicle is."""
    for k in range(1, len(ramp)):
        tail_m = ramp[k - 1, VIRTUAL] - ramp[k - 1, LENGTH]
        if ramp[k, VIRTUAL] > tail_m:
            ramp[k, VIRTUAL] = tail_m
            ramp[k, VIRTUAL_SPEED] = min(ramp[k, VIRTUAL_SPEED], ramp[k - 1, VIRTUAL_SPEED])


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
