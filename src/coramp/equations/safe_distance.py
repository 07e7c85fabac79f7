"""Safe distance between vehicles (Eq. 1-4) and between merging vehicles (Eq. 15-17).

The paper writes speeds in km/h in Eq. 3, 15 and 16 and in m/s in Eq. 2; here all are in m/s.
Eq. 3's ``v^2 / (254 (phi + psi))`` with v in km/h is ``(3.6 v)^2 / (254 (phi + psi))``.
"""

import math

from coramp._kernel import kernel
from coramp.road.rules import Road, Rules, SafetyBudget

KM_H_PER_MPS = 3.6
BRAKING_CONSTANT = 254.0
"""2 g in the units of Eq. 3: (km/h)^2 per m."""


@kernel
def clock_distance_m(
    front_speed_mps: float,
    rear_speed_mps: float,
    clock_error_s: float,
    follower_extra_s: float = 0.0,
) -> float:
    """Returns L_2 = clock_error (v_1 + v_2) in m, the distance of the clock error (Eq. 2).

    ``follower_extra_s`` is by how much the follower's own clock error is larger.
    """
    return clock_error_s * (front_speed_mps + rear_speed_mps) + follower_extra_s * rear_speed_mps


@kernel
def braking_distance_m(speed_difference_mps: float, adhesion: float, resistance: float) -> float:
    """Returns (3.6 dv)^2 / (254 (phi + psi)) in m, the speed term of Eq. 3, 15 and 16."""
    difference_km_h = KM_H_PER_MPS * speed_difference_mps
    return difference_km_h * difference_km_h / (BRAKING_CONSTANT * (adhesion + resistance))


@kernel
def speed_difference_distance_m(
    front_speed_mps: float, rear_speed_mps: float, adhesion: float, resistance: float
) -> float:
    """Returns L_3 in m, the distance kept for a faster follower, 0 for a slower one (Eq. 3)."""
    closing_mps = max(0.0, rear_speed_mps - front_speed_mps)
    return braking_distance_m(closing_mps, adhesion, resistance)


@kernel
def safe_distance_m(front_speed_mps: float, rear_speed_mps: float, safety: SafetyBudget) -> float:
    """Returns L_safe = 2 L_1 + L_2 + L_3 in m, bumper to bumper (Eq. 1).

    A time gap in the budget adds ``time_gap v_rear`` and a standstill gap itself; the paper has
    neither.
    """
    return (
        2.0 * safety.positioning_error_m
        + clock_distance_m(
            front_speed_mps, rear_speed_mps, safety.clock_error_s, safety.follower_clock_extra_s
        )
        + speed_difference_distance_m(
            front_speed_mps, rear_speed_mps, safety.adhesion, safety.resistance
        )
        + safety.time_gap_s * rear_speed_mps
        + safety.standstill_gap_m
    )


@kernel
def minimum_gap_m(vehicle_length_m: float, safe_distance_m: float) -> float:
    """Returns L_min s = L_v + 2 L_safe in m, the gap that a merging vehicle needs (Eq. 4)."""
    return vehicle_length_m + 2.0 * safe_distance_m


@kernel
def merging_speed_along_mps(speed_mps: float, merge_angle_rad: float) -> float:
    """Returns v_Rx = v cos(angle) in m/s, a merging vehicle's speed along the mainline."""
    return speed_mps * math.cos(merge_angle_rad)


@kernel
def merge_distance_m(
    merging_along_mps: float, other_speed_mps: float, safety: SafetyBudget
) -> float:
    """Returns L_r-X or L_r-Y = 2 L_1 + (3.6 (v_Rx - v))^2 / (254 (phi + psi)) in m (Eq. 15, 16).

    The same for the vehicle in front of the gap and the one behind it: the speed term stands
    whichever of the two is faster.
    """
    return 2.0 * safety.positioning_error_m + braking_distance_m(
        merging_along_mps - other_speed_mps, safety.adhesion, safety.resistance
    )


@kernel
def minimum_merge_gap_m(
    vehicle_length_m: float, front_distance_m: float, rear_distance_m: float
) -> float:
    """Returns L_min s = L_v + L_r-X + L_r-Y in m, L_v of the ramp vehicle (Eq. 17)."""
    return vehicle_length_m + front_distance_m + rear_distance_m


@kernel
def merge_clearance_m(road: Road, safety: SafetyBudget) -> float:
    """Returns the bumper distance (m) planned between a merging vehicle and one cruising at v0.

    The larger of Eq. 15 (at the lane change) and Eq. 1 (from then on, both at v0), plus the
    execution allowance.
    """
    speed_mps = road.mainline_speed_mps
    along_mps = merging_speed_along_mps(speed_mps, road.merge_angle_rad)
    return (
        max(
            merge_distance_m(along_mps, speed_mps, safety),
            safe_distance_m(speed_mps, speed_mps, safety),
        )
        + safety.execution_allowance_m
    )


@kernel
def following_clearance_m(road: Road, safety: SafetyBudget) -> float:
    """Returns the bumper distance (m) planned between two vehicles that cruise at v0."""
    speed_mps = road.mainline_speed_mps
    return safe_distance_m(speed_mps, speed_mps, safety) + safety.execution_allowance_m


@kernel
def standing_clearance_m(road: Road, safety: SafetyBudget, stop_mps2: float) -> float:
    """Returns the bumper distance (m) planned between two vehicles that stop one behind the other.

    Eq. 1 at a stand, the standstill gap with it, plus what a time gap and the clock error ask for
    on the way. Per m/s these are ``T = time_gap + 2 clock_error`` at most. At speed v the follower
    is ``v^2 / (2 d)`` before its stop and must keep ``v^2 / (2 g (phi + psi)) + T v`` from the
    vehicle that stands, so its stop lies by the largest
    ``T v - v^2 (1 / (2 d) - 1 / (2 g (phi + psi)))`` further back.
    """
    still_m = safe_distance_m(0.0, 0.0, safety) + safety.execution_allowance_m
    per_speed_s = safety.time_gap_s + 2.0 * safety.clock_error_s + safety.follower_clock_extra_s
    spare_per_square = 0.5 / stop_mps2 - braking_distance_m(1.0, safety.adhesion, safety.resistance)
    speed_mps = road.ramp_limit_mps
    if spare_per_square > 0.0:
        speed_mps = min(speed_mps, 0.5 * per_speed_s / spare_per_square)
    return still_m + speed_mps * (per_speed_s - spare_per_square * speed_mps)


@kernel
def gap_time_s(rules: Rules) -> float:
    """Returns T_g + d_0 / v_0 (s), what the time gap and the standstill gap ask for at v_0."""
    return rules.safety.time_gap_s + rules.safety.standstill_gap_m / rules.road.mainline_speed_mps
