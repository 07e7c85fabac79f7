"""Speeds over time and fuel, exactly, from pieces of constant acceleration."""

import math

import numpy as np

from coramp._kernel import BoolArray, FloatArray, IntArray, kernel
from coramp.kinematics.fuel import trajectory_fuel_l
from coramp.kinematics.trajectory import ACCEL, SPEED, TIME, piece_end_s, time_at_station
from coramp.vehicles.merge_state import came_by_mainline

BIN_S = 1.0
JERK_S = 1.0
HARD_S = 0.2
"""Braking shorter than this is no hard braking."""
STOPPED_MPS = 0.1
ROUNDING_S = 1e-6


@kernel
def fuel_of_each_l(
    first: IntArray, rows: FloatArray, until_s: FloatArray, models: IntArray, mass_kg: FloatArray
) -> FloatArray:
    """Returns the fuel (l) of each vehicle up to ``until_s``, by its own model and mass."""
    fuel_l = np.zeros(len(until_s))
    for i in range(len(until_s)):
        if first[i + 1] > first[i]:
            pieces = rows[first[i] : first[i + 1]]
            start_s = pieces[0, TIME]
            fuel_l[i] = trajectory_fuel_l(pieces, start_s, until_s[i], models[i], mass_kg[i])
    return fuel_l


@kernel
def distance_of_each_m(first: IntArray, rows: FloatArray, until_s: FloatArray) -> FloatArray:
    """Returns the distance (m) that each vehicle drove up to ``until_s``."""
    distance_m = np.zeros(len(until_s))
    for i in range(len(until_s)):
        for k in range(first[i], first[i + 1]):
            end_s = until_s[i] if k + 1 == first[i + 1] else min(until_s[i], rows[k + 1, TIME])
            x = max(0.0, end_s - rows[k, TIME])
            distance_m[i] += (rows[k, SPEED] + 0.5 * rows[k, ACCEL] * x) * x
    return distance_m


@kernel
def binned_motion(
    first: IntArray, rows: FloatArray, until_s: FloatArray, on_ramp: BoolArray, bins: int
) -> tuple[FloatArray, FloatArray, IntArray]:
    """Returns distance (m), time (s) and number of vehicles in each bin, shape (2, bins).

    Row 0 is the mainline stream, row 1 the ramp's. Distance over time is the space-mean speed.
    """
    distance_m, time_s = np.zeros((2, bins)), np.zeros((2, bins))
    vehicles = np.zeros((2, bins), np.int64)
    for i in range(len(until_s)):
        stream = 1 if on_ramp[i] else 0
        last_bin = -1
        pieces = rows[first[i] : first[i + 1]]
        for k in range(len(pieces)):
            start_s = pieces[k, TIME]
            end_s = min(until_s[i], piece_end_s(pieces, k))
            while start_s < end_s:
                b = int(start_s / BIN_S)
                if b >= bins:
                    break
                stop_s = min(end_s, (b + 1) * BIN_S)
                x, y = start_s - pieces[k, TIME], stop_s - pieces[k, TIME]
                way_m = (pieces[k, SPEED] + 0.5 * pieces[k, ACCEL] * (x + y)) * (y - x)
                distance_m[stream, b] += way_m
                time_s[stream, b] += stop_s - start_s
                if b != last_bin:
                    vehicles[stream, b] += 1
                    last_bin = b
                start_s = stop_s
    return distance_m, time_s, vehicles


@kernel
def hardest_braking_mps2(rows: FloatArray) -> float:
    """Returns the largest deceleration (m/s2, positive) of all pieces."""
    hardest = 0.0
    for k in range(len(rows)):
        hardest = max(hardest, -rows[k, ACCEL])
    return hardest


@kernel
def hard_brakings(
    first: IntArray, rows: FloatArray, until_s: FloatArray, harder_than_mps2: float
) -> int:
    """Returns how often vehicles braked harder than that (m/s2, positive) for 0.2 s or longer.

    One interval counts once however its deceleration changes; vehicles count up to ``until_s``.
    """
    found = 0
    for i in range(len(until_s)):
        own = rows[first[i] : first[i + 1]]
        since_s = math.inf
        for k in range(len(own)):
            start_s = own[k, TIME]
            end_s = min(until_s[i], piece_end_s(own, k))
            if end_s <= start_s:
                continue
            if own[k, ACCEL] >= -harder_than_mps2:
                since_s = math.inf
                continue
            counted = start_s - since_s >= HARD_S - ROUNDING_S
            since_s = min(since_s, start_s)
            if not counted and end_s - since_s >= HARD_S - ROUNDING_S:
                found += 1
    return found


@kernel
def stopped_vehicles(
    first: IntArray,
    rows: FloatArray,
    until_s: FloatArray,
    merge_s: FloatArray,
    lane_end_m: float,
) -> int:
    """Returns how many vehicles were below 0.1 m/s between entry and merge.

    ``merge_s`` is as in ``vehicles.merge_state`` for mainline vehicles, which count until they pass
    ``lane_end_m``, and nan for who never merged, which counts up to ``until_s``.
    """
    found = 0
    for i in range(len(until_s)):
        own = rows[first[i] : first[i + 1]]
        last_s = until_s[i]
        if came_by_mainline(merge_s[i]):
            last_s = min(last_s, time_at_station(own, lane_end_m))
        elif merge_s[i] < last_s:
            last_s = merge_s[i]
        for k in range(len(own)):
            start_s, end_s = own[k, TIME], min(last_s, piece_end_s(own, k))
            if end_s < start_s:
                break
            end_mps = own[k, SPEED] + own[k, ACCEL] * (end_s - start_s)
            if min(own[k, SPEED], end_mps) < STOPPED_MPS:
                found += 1
                break
    return found


@kernel
def largest_jerk_mps3(first: IntArray, rows: FloatArray, until_s: FloatArray) -> float:
    """Returns the largest change of acceleration (m/s3) of all vehicles, over 1 s.

    ``|v(t + 1) - 2 v(t) + v(t - 1)| / (1 s)^2``: accelerations that jump, as planned and commanded
    ones do, have no other finite jerk. Speeds are lines between knots, so that it is largest where
    a knot lies at t or 1 s from it.
    """
    largest = 0.0
    for i in range(len(until_s)):
        own = rows[first[i] : first[i + 1]]
        at = np.zeros(5, np.int64)
        speeds_mps = np.zeros(5)
        for k in range(len(own)):
            for j in range(5):
                now_s = own[k, TIME] + (j - 2) * JERK_S
                at[j] = _last_started(own, at[j], now_s)
                speeds_mps[j] = own[at[j], SPEED] + own[at[j], ACCEL] * (now_s - own[at[j], TIME])
            for j in range(1, 4):
                now_s = own[k, TIME] + (j - 2) * JERK_S
                if own[0, TIME] <= now_s - JERK_S and now_s + JERK_S <= until_s[i]:
                    second = speeds_mps[j + 1] - 2.0 * speeds_mps[j] + speeds_mps[j - 1]
                    largest = max(largest, abs(second) / JERK_S**2)
    return largest


@kernel
def _last_started(rows: FloatArray, from_row: int, now_s: float) -> int:
    """Returns the last row that has started by then, from ``from_row`` on."""
    row = from_row
    while row + 1 < len(rows) and rows[row + 1, TIME] <= now_s:
        row += 1
    return row


def pieces_of_samples(
    vehicle: IntArray,
    time_s: FloatArray,
    station_m: FloatArray,
    speed_mps: FloatArray,
    count: int,
) -> tuple[IntArray, FloatArray]:
    """Returns sampled motion as pieces, and each vehicle's first row, of length ``count`` + 1.

    Between two samples of one vehicle speed changes evenly; the station follows the samples. The
    last piece of a vehicle cruises.
    """
    first = np.searchsorted(vehicle, np.arange(count + 1)).astype(np.int64)
    accel_mps2 = np.zeros(len(time_s))
    same = vehicle[1:] == vehicle[:-1]
    steps_s = np.where(same, np.diff(time_s), math.inf)
    accel_mps2[:-1] = np.where(same, np.diff(speed_mps) / steps_s, 0.0)
    return first, np.column_stack([time_s, station_m, speed_mps, accel_mps2])
