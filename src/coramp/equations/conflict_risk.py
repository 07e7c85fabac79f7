"""Severity of a conflict from collision acceleration and urgent acceleration (Eq. 5-9)."""

import math

from coramp._kernel import kernel

COLLISION_DURATION_S = 0.2
GRAVITY_MPS2 = 9.8
SEVERITY_THRESHOLD_M2PS4 = (0.3 * GRAVITY_MPS2) ** 2
"""J = (0.3 g)^2, below which passengers are comfortable (section IV.2)."""


@kernel
def severity_m2ps4(collision_accel_mps2: float, urgent_accel_mps2: float) -> float:
    """Returns J = a a_p in m2/s4 (Eq. 5)."""
    return collision_accel_mps2 * urgent_accel_mps2


@kernel
def collision_acceleration_from_masses_mps2(
    own_mass_kg: float, other_mass_kg: float, speed_difference_mps: float, duration_s: float
) -> float:
    """Returns a from ``m_2 v_2 = (m_1 + m_2) a t`` in m/s2 (Eq. 6), m_1 the vehicle's own mass.

    Raises ValueError where masses or duration are not positive.
    """
    if own_mass_kg <= 0.0 or other_mass_kg <= 0.0 or duration_s <= 0.0:
        raise ValueError("masses and duration must be positive")
    return other_mass_kg * abs(speed_difference_mps) / ((own_mass_kg + other_mass_kg) * duration_s)


@kernel
def collision_acceleration_mps2(
    speed_difference_mps: float, mass_ratio: float, duration_s: float
) -> float:
    """Returns a = |dv| / ((1 + k) t) in m/s2, k = m_1 / m_2 (Eq. 7).

    Raises ValueError where the ratio or the duration is not positive.
    """
    if mass_ratio <= 0.0 or duration_s <= 0.0:
        raise ValueError("mass ratio and duration must be positive")
    return abs(speed_difference_mps) / ((1.0 + mass_ratio) * duration_s)


@kernel
def collision_acceleration_of_log_ratio_mps2(
    speed_difference_mps: float, log10_mass_ratio: float
) -> float:
    """Returns a = 5 |dv| / (1 + 10^p) in m/s2, p = lg(m_1 / m_2), for t = 0.2 s (Eq. 8)."""
    return abs(speed_difference_mps) / (
        COLLISION_DURATION_S * (1.0 + math.pow(10.0, log10_mass_ratio))
    )


@kernel
def urgent_acceleration_mps2(
    faster_speed_mps: float, slower_speed_mps: float, distance_m: float
) -> float:
    """Returns a_p = (v_1^2 - v_2^2) / (2 S) in m/s2 as printed (Eq. 9); infinity for S <= 0.

    This depends on the observer's frame; see ``relative_urgent_acceleration_mps2``.
    """
    if distance_m <= 0.0:
        return math.inf
    return (faster_speed_mps * faster_speed_mps - slower_speed_mps * slower_speed_mps) / (
        2.0 * distance_m
    )


@kernel
def relative_urgent_acceleration_mps2(
    faster_speed_mps: float, slower_speed_mps: float, distance_m: float
) -> float:
    """Returns a_p = (v_1 - v_2)^2 / (2 S) in m/s2, Eq. 9 in the slower vehicle's frame."""
    if distance_m <= 0.0:
        return math.inf
    difference_mps = faster_speed_mps - slower_speed_mps
    return difference_mps * difference_mps / (2.0 * distance_m)


@kernel
def conflict_severity_m2ps4(
    one_speed_mps: float, other_speed_mps: float, distance_m: float
) -> tuple[float, float]:
    """Returns J of two vehicles of equal mass: ``severity_of_masses_m2ps4`` with k = 1."""
    return severity_of_masses_m2ps4(one_speed_mps, other_speed_mps, distance_m, 1.0, 1.0)


@kernel
def severity_of_masses_m2ps4(
    one_speed_mps: float,
    other_speed_mps: float,
    distance_m: float,
    one_mass_kg: float,
    other_mass_kg: float,
) -> tuple[float, float]:
    """Returns J of two vehicles, with Eq. 9 as printed and in its relative form.

    It is that of the lighter vehicle, which suffers more: k = 10^p = m_1 / m_2 <= 1 in Eq. 7.
    ``distance_m`` is bumper to bumper; vehicles that overlap have an infinite severity, or none if
    their speeds are equal.
    """
    lighter_kg, heavier_kg = min(one_mass_kg, other_mass_kg), max(one_mass_kg, other_mass_kg)
    faster_mps = max(one_speed_mps, other_speed_mps)
    slower_mps = min(one_speed_mps, other_speed_mps)
    if faster_mps == slower_mps:
        return 0.0, 0.0
    log_ratio = math.log10(lighter_kg / heavier_kg)
    collision_mps2 = collision_acceleration_of_log_ratio_mps2(faster_mps - slower_mps, log_ratio)
    return (
        severity_m2ps4(
            collision_mps2, urgent_acceleration_mps2(faster_mps, slower_mps, distance_m)
        ),
        severity_m2ps4(
            collision_mps2, relative_urgent_acceleration_mps2(faster_mps, slower_mps, distance_m)
        ),
    )
