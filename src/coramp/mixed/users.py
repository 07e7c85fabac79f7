"""Who is on the road, and which gaps they keep: what the laws of mixed traffic read."""

from typing import NamedTuple

import numpy as np

from coramp._kernel import BoolArray, FloatArray, IntArray, kernel

NOBODY = -1
ACCEL_LASTS_S = 0.5
"""A vehicle is taken to go on accelerating as it does for so long, then to keep its speed."""


class RoadUsers(NamedTuple):
    """All vehicles on the road, one entry each, in any order.

    ``number`` is the vehicle's own for the whole run. ``station_m`` is that of its front bumper,
    negative before the nose. ``accel_mps2`` is what it accelerates with now, smoothed.
    ``on_mainline`` is False on the ramp and the acceleration lane.
    ``cruise_mps`` is v0, or its own top speed below that. min(a_0, P / (m v)), of
    ``acceleration_mps2`` and ``power_wpkg``, bounds how it speeds up. ``braking_mps2`` is what it
    relies on of its own brakes.
    """

    number: IntArray
    station_m: FloatArray
    speed_mps: FloatArray
    accel_mps2: FloatArray
    length_m: FloatArray
    on_mainline: BoolArray
    automated: BoolArray
    cruise_mps: FloatArray
    acceleration_mps2: FloatArray
    power_wpkg: FloatArray
    braking_mps2: FloatArray


class Gaps(NamedTuple):
    """Distances to the vehicle ahead, each s_0 (m) and T (s) of s_0 + T v.

    An automated vehicle keeps ``behind_automated`` or ``behind_driver``. A driver keeps
    ``of_driver`` on average, and no less than ``least_of_driver_s``; ``for_driver`` is room for a
    driver who is to merge ahead.
    """

    behind_automated_m: float
    behind_automated_s: float
    behind_driver_m: float
    behind_driver_s: float
    of_driver_m: float
    of_driver_s: float
    for_driver_m: float
    for_driver_s: float
    least_of_driver_s: float


class MixedRoad(NamedTuple):
    """The road as the laws see it: common speeds, and the ramp's limit."""

    mainline_speed_mps: float
    ramp_speed_mps: float
    ramp_limit_mps: float


@kernel
def gap_m(rear_automated: bool, front_automated: bool, speed_mps: float, gaps: Gaps) -> float:
    """Returns s_0 + T v (m) that the vehicle behind keeps at a speed."""
    if not rear_automated:
        return float(gaps.of_driver_m + gaps.of_driver_s * speed_mps)
    if front_automated:
        return float(gaps.behind_automated_m + gaps.behind_automated_s * speed_mps)
    return float(gaps.behind_driver_m + gaps.behind_driver_s * speed_mps)


@kernel
def gap_for_m(rear_automated: bool, merging_automated: bool, speed_mps: float, gaps: Gaps) -> float:
    """Returns the distance (m) to leave behind a vehicle that is to merge ahead."""
    if rear_automated and not merging_automated:
        return float(gaps.for_driver_m + gaps.for_driver_s * speed_mps)
    return gap_m(rear_automated, merging_automated, speed_mps, gaps)


@kernel
def in_order(station_m: FloatArray, chosen: BoolArray) -> IntArray:
    """Returns the entries of the chosen vehicles, front first."""
    order, count = np.empty(len(station_m), np.int64), 0
    for i in range(len(station_m)):
        if chosen[i]:
            k = count
            while k > 0 and station_m[order[k - 1]] < station_m[i]:
                order[k] = order[k - 1]
                k -= 1
            order[k] = i
            count += 1
    return order[:count]


def onwards(
    speed_mps: FloatArray, accel_mps2: FloatArray, time_s: FloatArray | float
) -> tuple[FloatArray, FloatArray]:
    """Returns how far vehicles go in a time (m), and their speeds (m/s) then.

    They accelerate as they do for up to ``ACCEL_LASTS_S``, and keep their speed after that.
    """
    accel_s = np.minimum(time_s, ACCEL_LASTS_S)
    then_mps = np.maximum(0.0, speed_mps + accel_mps2 * accel_s)
    way_m = 0.5 * (speed_mps + then_mps) * accel_s + then_mps * (time_s - accel_s)
    return np.asarray(way_m), np.asarray(then_mps)


def soon(users: RoadUsers, time_s: float) -> RoadUsers:
    """Returns the users as they are taken to be in a time."""
    if time_s == 0.0:
        return users
    way_m, then_mps = onwards(users.speed_mps, users.accel_mps2, time_s)
    return users._replace(station_m=users.station_m + way_m, speed_mps=then_mps)
