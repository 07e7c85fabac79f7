"""Motion with the least control effort between two states (Rios-Torres and Malikopoulos 2017).

Minimising ``1/2 int u^2 dt`` under ``p' = v, v' = u`` gives ``u = a t + b``, so that
``v = a t^2 / 2 + b t + c`` and ``p = a t^3 / 6 + b t^2 / 2 + c t + d``; the four constants follow
from position and speed at both ends. Vehicles hold an acceleration over a period: what is driven is
the solution of the same problem among accelerations that are constant over equal periods.
"""

from typing import Any

import numpy as np
import quadprog as untyped_quadprog

from coramp._kernel import FloatArray

quadprog: Any = untyped_quadprog

ROUNDING = 1e-9


def coefficients(
    distance_m: float, duration_s: float, start_mps: float, end_mps: float
) -> tuple[float, float]:
    """Returns a (m/s3) and b (m/s2) of ``u = a t + b``, t from the start.

    With the mean acceleration ``m = (v_1 - v_0) / T`` and what it leaves of the way,
    ``e = p - (v_0 + v_1) T / 2``: ``a = -12 e / T^3``, ``b = m + 6 e / T^2``. Raises ValueError
    for a duration that is not positive.
    """
    if duration_s <= 0.0:
        raise ValueError("duration must be positive")
    mean_mps2 = (end_mps - start_mps) / duration_s
    excess_m = distance_m - 0.5 * (start_mps + end_mps) * duration_s
    return -12.0 * excess_m / duration_s**3, mean_mps2 + 6.0 * excess_m / duration_s**2


def held_optimum(
    distance_m: float, duration_s: float, start_mps: float, end_mps: float, periods: int
) -> FloatArray:
    """Returns the least-effort accelerations (m/s2) among those held over equal periods.

    They lie on a line like ``u(t)``, at the middles of the periods; holding them moves the vehicle
    ``1 - 1 / n^2`` of what the line's slope does, so the slope is larger by that.
    Needs two periods.
    """
    a, b = coefficients(distance_m, duration_s, start_mps, end_mps)
    middles_s = (np.arange(periods) + 0.5) * duration_s / periods - 0.5 * duration_s
    mean_mps2 = b + 0.5 * a * duration_s
    return mean_mps2 + a / (1.0 - 1.0 / periods**2) * middles_s


def speeds_mps(start_mps: float, accel_mps2: FloatArray, period_s: float) -> FloatArray:
    """Returns the speeds at the ends of all periods."""
    return start_mps + np.cumsum(accel_mps2) * period_s


def constrained_optimum(
    distance_m: float,
    duration_s: float,
    start_mps: float,
    end_mps: float,
    most_mps2: float,
    highest_mps: FloatArray,
) -> FloatArray | None:
    """Returns the least-effort accelerations (m/s2) within bounds, None where there are none.

    ``highest_mps`` has the speed limit at the end of each period; no speed may fall below 0.
    Where no limit binds this is ``held_optimum``. Otherwise it has arcs on the limits, found as a
    quadratic program.
    """
    periods = len(highest_mps)
    period_s = duration_s / periods
    free = held_optimum(distance_m, duration_s, start_mps, end_mps, periods)
    speed_mps = speeds_mps(start_mps, free, period_s)
    if (
        np.abs(free).max() <= most_mps2
        and (speed_mps <= highest_mps + ROUNDING).all()
        and speed_mps.min() >= 0.0
    ):
        return free
    sums = np.tril(np.full((periods, periods), period_s))
    way = period_s * (duration_s - (np.arange(periods) + 0.5) * period_s)
    one = np.eye(periods)
    rows = np.vstack([np.full(periods, period_s), way, one, -one, -sums[:-1], sums[:-1]])
    bounds = np.concatenate(
        [
            [end_mps - start_mps, distance_m - start_mps * duration_s],
            np.full(2 * periods, -most_mps2),
            start_mps - highest_mps[:-1],
            np.full(periods - 1, -start_mps),
        ]
    )
    try:
        solution: FloatArray = quadprog.solve_qp(one, np.zeros(periods), rows.T, bounds, 2)[0]
    except ValueError:  # no accelerations within the bounds lead there
        return None
    return solution


def held_shift(
    shift_m: float, duration_s: float, periods: int, most_mps2: float
) -> FloatArray | None:
    """Returns the accelerations (m/s2) to add for a shift at unchanged end speed, None if too far.

    ``u = 6 shift / T^2 (1 - 2 t / T)``, on arcs of ``most_mps2`` at both ends where that binds.
    Needs an even number of periods.
    """
    period_s = duration_s / periods
    line = 1.0 - (2.0 * np.arange(periods) + 1.0) / periods
    lever_s = duration_s - (np.arange(periods) + 0.5) * period_s

    def moved_m(height_mps2: float) -> float:
        return float(np.clip(height_mps2 * line, -most_mps2, most_mps2) @ lever_s) * period_s

    wanted_m = abs(shift_m)
    if wanted_m > 0.25 * most_mps2 * duration_s**2:
        return None
    low, high = 0.0, 6.0 * wanted_m / duration_s**2 / (1.0 - 1.0 / periods**2)
    while moved_m(high) < wanted_m - ROUNDING:
        low, high = high, 2.0 * high
        if high > most_mps2 * 1e6:
            return None
    for _ in range(100 if low > 0.0 else 0):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if moved_m(middle) < wanted_m else (low, middle)
    return np.asarray(np.copysign(1.0, shift_m) * np.clip(high * line, -most_mps2, most_mps2))
