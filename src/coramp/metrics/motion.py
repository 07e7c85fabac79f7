"""Speeds over time and fuel, exactly, from pieces of constant acceleration."""

import math

import numpy as np

from coramp._kernel import BoolArray, FloatArray, IntArray, kernel
from coramp.core.fuel import trajectory_fuel_l
from coramp.core.trajectory import ACCEL, SPEED, TIME, piece_end_s

BIN_S = 1.0
JERK_GRID_S = 0.1


@kernel
def fuel_of_each_l(first: IntArray, rows: FloatArray, until_s: FloatArray) -> FloatArray:
    """Returns the fuel (l) of each vehicle up to ``until_s``."""
    fuel_l = np.zeros(len(until_s))
    for i in range(len(until_s)):
        if first[i + 1] > first[i]:
            pieces = rows[first[i] : first[i + 1]]
            fuel_l[i] = trajectory_fuel_l(pieces, pieces[0, TIME], until_s[i])
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
def largest_jerk_mps3(first: IntArray, rows: FloatArray, until_s: FloatArray) -> float:
    """Returns the largest change of acceleration (m/s3) of all vehicles, over 1 s.

    ``|v(t + 1) - 2 v(t) + v(t - 1)| / (1 s)^2``, at the times of a grid: accelerations that jump,
    as planned and commanded ones do, have no other finite jerk.
    """
    largest = 0.0
    lag = round(1.0 / JERK_GRID_S)
    for i in range(len(until_s)):
        pieces = rows[first[i] : first[i + 1]]
        if len(pieces) == 0 or not until_s[i] > pieces[0, TIME]:
            continue
        count = int((until_s[i] - pieces[0, TIME]) / JERK_GRID_S) + 1
        speeds_mps = np.empty(count)
        k = 0
        for j in range(count):
            now_s = pieces[0, TIME] + j * JERK_GRID_S
            while k + 1 < len(pieces) and pieces[k + 1, TIME] <= now_s:
                k += 1
            speeds_mps[j] = pieces[k, SPEED] + pieces[k, ACCEL] * (now_s - pieces[k, TIME])
        for j in range(lag, count - lag):
            second = speeds_mps[j + lag] - 2.0 * speeds_mps[j] + speeds_mps[j - lag]
            largest = max(largest, abs(second))
    return largest


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
