"""Few pieces instead of many samples: what a run keeps of vehicles that their drivers drive."""

import numpy as np

from coramp._kernel import FloatArray, IntArray, kernel
from coramp.kinematics.trajectory import STATION, TIME

TOLERANCE_M = 0.05
"""How far a fitted piece may be from a sample."""
LONGEST = 100
"""Samples that one piece may stand for."""


@kernel
def fitted_pieces(
    first: IntArray, rows: FloatArray, lane: IntArray
) -> tuple[IntArray, FloatArray, IntArray]:
    """Returns pieces through some of the samples that stay within 5 cm of all others.

    ``first`` and ``rows`` are samples as pieces, ``lane`` each sample's lane code. A piece begins
    and ends at samples of one vehicle, and at each change of lane. The result is of the same form:
    each vehicle's first piece, pieces of shape (n, 4) with the last sample of each vehicle as a
    piece that cruises, and their lanes.
    """
    fitted, lanes = np.empty_like(rows), np.empty_like(lane)
    starts = np.zeros_like(first)
    count = 0
    for i in range(len(first) - 1):
        starts[i] = count
        k, end = first[i], first[i + 1]
        while k < end:
            last = _last_within(rows, lane, k, end)
            speed_mps, accel_mps2 = _through(rows, k, last)
            fitted[count] = rows[k]
            if last > k:
                fitted[count, 2], fitted[count, 3] = speed_mps, accel_mps2
            else:
                fitted[count, 3] = 0.0
            lanes[count] = lane[k]
            count += 1
            if last == k:
                break
            k = last
    starts[-1] = count
    return starts, fitted[:count].copy(), lanes[:count].copy()


@kernel
def _last_within(rows: FloatArray, lane: IntArray, start: int, end: int) -> int:
    """The last sample up to which one piece from ``start`` fits; ``start`` itself if it is last."""
    last = min(start + 1, end - 1)
    while last + 1 < end and last - start < LONGEST and lane[last] == lane[start]:
        if not _fits(rows, start, last + 1):
            break
        last += 1
    return last


@kernel
def _fits(rows: FloatArray, start: int, last: int) -> bool:
    speed_mps, accel_mps2 = _through(rows, start, last)
    for k in range(start + 1, last):
        x = rows[k, TIME] - rows[start, TIME]
        station_m = rows[start, STATION] + (speed_mps + 0.5 * accel_mps2 * x) * x
        if abs(station_m - rows[k, STATION]) > TOLERANCE_M:
            return False
    return True


@kernel
def _through(rows: FloatArray, start: int, last: int) -> tuple[float, float]:
    """Speed (m/s) and acceleration (m/s2) through two samples, nearest to those in between.

    With D the time between the two, s = s_0 + v x + a x^2 / 2 passes through both if
    v = (s_1 - s_0) / D - a D / 2; a is that of least squares.
    """
    duration_s = rows[last, TIME] - rows[start, TIME]
    if duration_s <= 0.0:
        return 0.0, 0.0
    mean_mps = (rows[last, STATION] - rows[start, STATION]) / duration_s
    weighed, squares = 0.0, 0.0
    for k in range(start + 1, last):
        x = rows[k, TIME] - rows[start, TIME]
        basis = 0.5 * x * (x - duration_s)
        weighed += basis * (rows[k, STATION] - rows[start, STATION] - mean_mps * x)
        squares += basis * basis
    accel_mps2 = weighed / squares if squares > 0.0 else 0.0
    return mean_mps - 0.5 * accel_mps2 * duration_s, accel_mps2
