"""Fuel (Eq. 48 with the coefficients of Table 3, which are the published ones).

f(v, a) = p0 + p1 v + p2 v^2 + p3 v^3 + max(0, a) (q0 + q1 v + q2 v^2) in ml/s, v in m/s, a in m/s2.
Eq. 48 itself prints 0.1596 and -7.145e-4, misprints of Table 3's 0.1569 and -7.415e-4.
"""

import math

from coramp._kernel import FloatArray, kernel
from coramp.kinematics.trajectory import ACCEL, SPEED, TIME, piece_end_s

P0, P1, P2, P3 = 0.1569, 0.0245, -7.415e-4, 5.975e-5
Q0, Q1, Q2 = 0.07224, 0.09681, 1.075e-3
LITRES_PER_MILLILITRE = 1e-3
_GAUSS = 1.0 / math.sqrt(3.0)


@kernel
def fuel_rate_mlps(speed_mps: float, accel_mps2: float) -> float:
    """Returns the fuel rate in ml/s; an acceleration below 0 counts as 0 (Eq. 48, Table 3)."""
    cruise = P0 + speed_mps * (P1 + speed_mps * (P2 + speed_mps * P3))
    return cruise + max(0.0, accel_mps2) * (Q0 + speed_mps * (Q1 + speed_mps * Q2))


@kernel
def piece_fuel_l(speed_mps: float, accel_mps2: float, duration_s: float) -> float:
    """Returns the fuel (l) of a stretch of constant acceleration, exactly.

    Along it the rate is a polynomial of third degree in time, which Gauss' rule with two points
    integrates without error.
    """
    half_s = 0.5 * duration_s
    middle_mps = speed_mps + accel_mps2 * half_s
    offset_mps = accel_mps2 * half_s * _GAUSS
    rates_mlps = fuel_rate_mlps(middle_mps - offset_mps, accel_mps2) + fuel_rate_mlps(
        middle_mps + offset_mps, accel_mps2
    )
    return LITRES_PER_MILLILITRE * half_s * rates_mlps


@kernel
def trajectory_fuel_l(pieces: FloatArray, from_s: float, to_s: float) -> float:
    """Returns the fuel (l) of a trajectory between two times, exactly; 0 if ``to_s <= from_s``."""
    total_l = 0.0
    for k in range(len(pieces)):
        start_s = max(from_s, pieces[k, TIME])
        duration_s = min(to_s, piece_end_s(pieces, k)) - start_s
        if duration_s > 0.0:
            speed_mps = pieces[k, SPEED] + pieces[k, ACCEL] * (start_s - pieces[k, TIME])
            total_l += piece_fuel_l(speed_mps, pieces[k, ACCEL], duration_s)
    return total_l
