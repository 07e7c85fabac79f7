"""Fuel (Eq. 48 with the coefficients of Table 3, which are the published ones).

f(v, a) = p0 + p1 v + p2 v^2 + p3 v^3 + max(0, a) (q0 + q1 v + q2 v^2) in ml/s, v in m/s, a in m/s2.
Eq. 48 itself prints 0.1596 and -7.145e-4, misprints of Table 3's 0.1569 and -7.415e-4.
"""

import math
from typing import Literal, get_args

from coramp._kernel import FloatArray, kernel
from coramp.kinematics.trajectory import ACCEL, SPEED, TIME, piece_end_s

FuelModel = Literal["passenger-car", "heavy-duty"]
"""Names of the models: Eq. 48, and a Willans line for trucks."""
FUEL_MODELS: tuple[FuelModel, ...] = get_args(FuelModel)
PASSENGER_CAR, HEAVY_DUTY = range(len(FUEL_MODELS))
ROLLING, GRAVITY_MPS2 = 0.006, 9.8
AIR_KG_PER_M = 0.5 * 1.2 * 5.2
"""Half of air density (kg/m3) times drag area c_w A (m2) of an articulated truck."""
IDLE_MLPS, WHEEL_J_PER_ML = 0.8, 0.40 * 35500.0
"""Fuel of the idling engine; work at the wheels per ml: efficiency times 35.5 kJ/ml (diesel)."""
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
def heavy_duty_rate_mlps(mass_kg: float, speed_mps: float, accel_mps2: float) -> float:
    """Returns the fuel rate (ml/s) of a truck: f_0 + max(0, P) / (eta H), a Willans line.

    The road load is ``P = v (m (a + g f_r) + rho c_w A v^2 / 2)``: Guzzella and Sciarretta, Vehicle
    Propulsion Systems, chapters 2 and 3. 40 t at 80 km/h take 31 l per 100 km.
    """
    force_n = mass_kg * (accel_mps2 + GRAVITY_MPS2 * ROLLING) + AIR_KG_PER_M * speed_mps**2
    return IDLE_MLPS + max(0.0, force_n * speed_mps) / WHEEL_J_PER_ML


@kernel
def heavy_duty_piece_fuel_l(
    mass_kg: float, speed_mps: float, accel_mps2: float, duration_s: float
) -> float:
    """Returns the fuel (l) of a truck over a stretch of constant acceleration, exactly.

    The power is a cubic in time, which Gauss' rule with two points integrates without error. While
    the truck brakes by a, with a + g f_r < 0, the engine pulls only above the speed at which
    ``v^2 = -m (a + g f_r) / c``; below that it idles.
    """
    pulls_s, load_n = duration_s, mass_kg * (accel_mps2 + GRAVITY_MPS2 * ROLLING)
    if load_n < 0.0:
        turns_mps = math.sqrt(-load_n / AIR_KG_PER_M)
        pulls_s = min(duration_s, max(0.0, (speed_mps - turns_mps) / -accel_mps2))
    half_s = 0.5 * pulls_s
    middle_mps = speed_mps + accel_mps2 * half_s
    offset_mps = accel_mps2 * half_s * _GAUSS
    fuel_ml = IDLE_MLPS * (duration_s - pulls_s)
    for at_mps in (middle_mps - offset_mps, middle_mps + offset_mps):
        fuel_ml += half_s * heavy_duty_rate_mlps(mass_kg, at_mps, accel_mps2)
    return LITRES_PER_MILLILITRE * fuel_ml


@kernel
def trajectory_fuel_l(
    pieces: FloatArray, from_s: float, to_s: float, model: int, mass_kg: float
) -> float:
    """Returns the fuel (l) of a trajectory between two times, exactly; 0 if ``to_s <= from_s``.

    ``model`` is a place in ``FUEL_MODELS``, else ValueError; the mass counts for trucks alone.
    """
    total_l = 0.0
    for k in range(len(pieces)):
        start_s = max(from_s, pieces[k, TIME])
        duration_s = min(to_s, piece_end_s(pieces, k)) - start_s
        if duration_s > 0.0:
            speed_mps = pieces[k, SPEED] + pieces[k, ACCEL] * (start_s - pieces[k, TIME])
            if model == HEAVY_DUTY:
                accel_mps2 = pieces[k, ACCEL]
                total_l += heavy_duty_piece_fuel_l(mass_kg, speed_mps, accel_mps2, duration_s)
            elif model == PASSENGER_CAR:
                total_l += piece_fuel_l(speed_mps, pieces[k, ACCEL], duration_s)
            else:
                raise ValueError("there is no such model of fuel")
    return total_l
