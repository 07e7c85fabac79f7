"""Trajectories made of pieces of constant acceleration, and what is exact about them.

A trajectory is an array of shape ``(n, 4)``. Row k holds the time (s), station (m), speed (m/s) and
acceleration (m/s2) at which piece k starts; the piece lasts until the next row's time, the last one
for ever. Within a piece, with ``x = t - time``,

    station(t) = station + speed x + acceleration x^2 / 2,    speed(t) = speed + acceleration x.
"""

import math

import numpy as np

from coramp._kernel import FloatArray, kernel

TIME, STATION, SPEED, ACCEL = 0, 1, 2, 3
MAX_PIECES = 48
"""Rows of the buffers that trajectories are built in."""


@kernel
def piece_at(pieces: FloatArray, time_s: float) -> int:
    """Returns the index of the piece that is under way at ``time_s``, 0 before the first."""
    k = len(pieces) - 1
    while k > 0 and pieces[k, TIME] > time_s:
        k -= 1
    return k


@kernel
def station_and_speed(pieces: FloatArray, time_s: float) -> tuple[float, float]:
    """Returns station (m) and speed (m/s) at ``time_s``; before the first piece it is run back."""
    k = piece_at(pieces, time_s)
    x = time_s - pieces[k, TIME]
    speed_mps = pieces[k, SPEED] + pieces[k, ACCEL] * x
    return pieces[k, STATION] + 0.5 * (pieces[k, SPEED] + speed_mps) * x, speed_mps


@kernel
def piece_end_s(pieces: FloatArray, k: int) -> float:
    """Returns the time at which piece ``k`` ends, infinity for the last."""
    if k + 1 < len(pieces):
        return float(pieces[k + 1, TIME])
    return math.inf


@kernel
def time_to_cover(distance_m: float, speed_mps: float, accel_mps2: float) -> float:
    """Returns the time (s) to cover a distance >= 0 from speed >= 0, infinity if it never is.

    The smaller root of ``accel t^2 / 2 + speed t = distance``, in the form that loses no digits:
    ``t = 2 d / (v + sqrt(v^2 + 2 a d))``.
    """
    if distance_m <= 0.0:
        return 0.0
    discriminant = speed_mps * speed_mps + 2.0 * accel_mps2 * distance_m
    if discriminant < 0.0:
        return math.inf
    denominator = speed_mps + math.sqrt(discriminant)
    if denominator <= 0.0:
        return math.inf
    return 2.0 * distance_m / denominator


@kernel
def time_at_station(pieces: FloatArray, station_m: float) -> float:
    """Returns the first time (s) at which ``station_m`` is reached, infinity if it never is.

    A station behind the first piece gives the first piece's time. Speeds are taken to be >= 0.
    """
    for k in range(len(pieces)):
        needed_s = time_to_cover(station_m - pieces[k, STATION], pieces[k, SPEED], pieces[k, ACCEL])
        if pieces[k, TIME] + needed_s <= piece_end_s(pieces, k):
            return float(pieces[k, TIME] + needed_s)
    return math.inf


@kernel
def begin(out: FloatArray, time_s: float, station_m: float, speed_mps: float) -> int:
    """Starts a trajectory in ``out`` with a cruise from the given state; returns its length, 1."""
    out[0, TIME] = time_s
    out[0, STATION] = station_m
    out[0, SPEED] = speed_mps
    out[0, ACCEL] = 0.0
    return 1


@kernel
def drive(out: FloatArray, n: int, accel_mps2: float, duration_s: float) -> int:
    """Appends a stretch of constant acceleration (m/s2, signed) to the ``n`` pieces in ``out``.

    After it the trajectory cruises. Returns the new length; a stretch shorter than 1e-12 s is left
    out. Speeds that rounding leaves below 1e-12 m/s become 0.
    """
    if duration_s < 1e-12:
        return n
    k = n - 1
    end_speed_mps = out[k, SPEED] + accel_mps2 * duration_s
    if abs(end_speed_mps) < 1e-12:
        end_speed_mps = 0.0
    out[k, ACCEL] = accel_mps2
    end_station_m = out[k, STATION] + 0.5 * (out[k, SPEED] + end_speed_mps) * duration_s
    return _cruise_after(out, k, out[k, TIME] + duration_s, end_station_m, end_speed_mps)


@kernel
def _cruise_after(
    out: FloatArray, k: int, time_s: float, station_m: float, speed_mps: float
) -> int:
    """Ends piece ``k`` with a cruise; one that only continues piece k - 1 becomes part of that."""
    if k > 0 and out[k - 1, ACCEL] == out[k, ACCEL]:
        k -= 1
    return k + begin(out[k + 1 :], time_s, station_m, speed_mps) + 1


@kernel
def drive_to_speed(out: FloatArray, n: int, accel_mps2: float, speed_mps: float) -> int:
    """Appends the stretch that reaches ``speed_mps`` with ``accel_mps2`` (signed, towards it)."""
    if out[n - 1, SPEED] == speed_mps or accel_mps2 == 0.0:
        return n
    n = drive(out, n, accel_mps2, (speed_mps - out[n - 1, SPEED]) / accel_mps2)
    out[n - 1, SPEED] = speed_mps
    return n


@kernel
def clip_start(pieces: FloatArray, time_s: float, out: FloatArray) -> int:
    """Writes the trajectory from ``time_s`` on into ``out``; returns its length."""
    k = piece_at(pieces, time_s)
    station_m, speed_mps = station_and_speed(pieces, time_s)
    begin(out, time_s, station_m, speed_mps)
    out[0, ACCEL] = pieces[k, ACCEL]
    n = len(pieces) - k
    out[1:n] = pieces[k + 1 :]
    return n


@kernel
def clip_end(out: FloatArray, n: int, time_s: float) -> int:
    """Ends the ``n`` pieces in ``out`` at ``time_s`` with a cruise; returns the new length."""
    k = piece_at(out[:n], time_s)
    station_m, speed_mps = station_and_speed(out[:n], time_s)
    if time_s - out[k, TIME] < 1e-12:
        return k + begin(out[k:], time_s, station_m, speed_mps)
    return _cruise_after(out, k, time_s, station_m, speed_mps)


@kernel
def cruise_intercept_m(pieces: FloatArray, cruise_speed_mps: float) -> float:
    """Returns where a trajectory's last piece, run at ``cruise_speed_mps``, meets time 0 (m).

    For a vehicle that ends in a cruise at v0 this one number says where it drives for ever:
    station(t) = intercept + v0 t.
    """
    last = len(pieces) - 1
    return float(pieces[last, STATION] - cruise_speed_mps * pieces[last, TIME])


@kernel
def intercept_range_m(
    pieces: FloatArray, from_s: float, cruise_speed_mps: float
) -> tuple[float, float]:
    """Returns bounds of ``station(t) - cruise_speed t`` (m) from ``from_s`` on.

    The lower bound is minus infinity for a trajectory that ends slower than the cruise, the upper
    one infinity for one that ends faster.
    """
    station_m, _ = station_and_speed(pieces, from_s)
    low_m = high_m = station_m - cruise_speed_mps * from_s
    last = len(pieces) - 1
    for k in range(piece_at(pieces, from_s), last + 1):
        if pieces[k, TIME] > from_s:
            intercept_m = pieces[k, STATION] - cruise_speed_mps * pieces[k, TIME]
            low_m = min(low_m, intercept_m)
            high_m = max(high_m, intercept_m)
        if pieces[k, ACCEL] != 0.0:
            turn_s = pieces[k, TIME] + (cruise_speed_mps - pieces[k, SPEED]) / pieces[k, ACCEL]
            if max(from_s, pieces[k, TIME]) < turn_s < piece_end_s(pieces, k):
                station_m, _ = station_and_speed(pieces, turn_s)
                intercept_m = station_m - cruise_speed_mps * turn_s
                low_m = min(low_m, intercept_m)
                high_m = max(high_m, intercept_m)
    if pieces[last, SPEED] < cruise_speed_mps:
        low_m = -math.inf
    if pieces[last, SPEED] > cruise_speed_mps:
        high_m = math.inf
    return low_m, high_m


@kernel
def superpose_shift(
    pieces: FloatArray, from_s: float, start_s: float, end_s: float, shift_m: float, out: FloatArray
) -> int:
    """Writes into ``out`` the trajectory from ``from_s`` on, moved by ``shift_m`` within a window.

    The shift adds an acceleration ``4 shift / T^2`` over the first half of the window of length T
    and takes it away over the second (Eq. 42, 43), so that speed is as before at its end and the
    station differs by ``shift_m`` (positive: ahead) from there on. Returns the new length, or 0 if
    the pieces do not fit into ``out``. ``start_s`` must not lie before ``from_s``.
    """
    if len(pieces) + 4 > len(out):
        return 0
    half_s = 0.5 * (end_s - start_s)
    extra_mps2 = shift_m / (half_s * half_s)
    middle_s = start_s + half_s
    station_m, speed_mps = station_and_speed(pieces, from_s)
    n = begin(out, from_s, station_m, speed_mps)
    k = piece_at(pieces, from_s)
    now_s = from_s
    while True:
        next_s = piece_end_s(pieces, k)
        accel_mps2 = pieces[k, ACCEL]
        if now_s < start_s:
            next_s = min(next_s, start_s)
        elif now_s < middle_s:
            next_s = min(next_s, middle_s)
            accel_mps2 += extra_mps2
        elif now_s < end_s:
            next_s = min(next_s, end_s)
            accel_mps2 -= extra_mps2
        if math.isinf(next_s):
            out[n - 1, ACCEL] = accel_mps2
            break
        n = drive(out, n, accel_mps2, next_s - now_s)
        now_s = next_s
        while k + 1 < len(pieces) and pieces[k + 1, TIME] <= now_s:
            k += 1
    out[n - 1, SPEED] = pieces[len(pieces) - 1, SPEED]
    return n


@kernel
def superpose(
    pieces: FloatArray,
    from_s: float,
    start_s: float,
    end_s: float,
    extra_mps2: FloatArray,
    out: FloatArray,
) -> int:
    """Writes the trajectory from ``from_s`` on, with accelerations added within a window.

    The window's equal parts have one entry of ``extra_mps2`` each. Returns the new length, or 0 if
    the pieces do not fit into ``out``. ``start_s`` must not lie before ``from_s``.
    """
    parts = len(extra_mps2)
    if len(pieces) + parts + 2 > len(out):
        return 0
    station_m, speed_mps = station_and_speed(pieces, from_s)
    n = begin(out, from_s, station_m, speed_mps)
    k, part, now_s = piece_at(pieces, from_s), -1, from_s
    while True:
        part_end_s = math.inf
        if part < parts:
            part_end_s = start_s + (part + 1) * (end_s - start_s) / parts
        next_s = min(piece_end_s(pieces, k), part_end_s)
        accel_mps2 = pieces[k, ACCEL]
        if 0 <= part < parts:
            accel_mps2 += extra_mps2[part]
        if math.isinf(next_s):
            out[n - 1, ACCEL] = accel_mps2
            break
        n = drive(out, n, accel_mps2, next_s - now_s)
        now_s = next_s
        if next_s == part_end_s:
            part += 1
        while k + 1 < len(pieces) and pieces[k + 1, TIME] <= now_s:
            k += 1
    out[n - 1, SPEED] = pieces[len(pieces) - 1, SPEED]
    return n


@kernel
def speed_range_mps(pieces: FloatArray, from_s: float) -> tuple[float, float]:
    """Returns the lowest and highest speed (m/s) from ``from_s`` on; the last piece must cruise."""
    _, lowest_mps = station_and_speed(pieces, from_s)
    highest_mps = lowest_mps
    for k in range(len(pieces)):
        if pieces[k, TIME] >= from_s:
            lowest_mps = min(lowest_mps, pieces[k, SPEED])
            highest_mps = max(highest_mps, pieces[k, SPEED])
    return lowest_mps, highest_mps


@kernel
def largest_acceleration_mps2(pieces: FloatArray, from_s: float) -> float:
    """Returns the largest magnitude of acceleration (m/s2) from ``from_s`` on."""
    largest = 0.0
    for k in range(len(pieces)):
        if piece_end_s(pieces, k) > from_s:
            largest = max(largest, abs(pieces[k, ACCEL]))
    return largest


def build(
    time_s: float, station_m: float, speed_mps: float, stretches: list[tuple[float, float]]
) -> FloatArray:
    """Returns a trajectory from a state and ``(acceleration m/s2, duration s)`` stretches.

    After the last stretch it cruises. For examples, tests and notebooks; kernels use ``drive``.

    Examples:
        >>> build(0.0, 0.0, 10.0, [(2.0, 5.0)])[-1].tolist()
        [5.0, 75.0, 20.0, 0.0]
    """
    out = np.empty((len(stretches) + 1, 4))
    n = begin(out, time_s, station_m, speed_mps)
    for accel_mps2, duration_s in stretches:
        n = drive(out, n, accel_mps2, duration_s)
    return out[:n].copy()
