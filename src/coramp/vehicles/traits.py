"""What one vehicle can do, and how exactly it knows where it is: a row of numbers per vehicle."""

import math
from typing import NamedTuple

import numpy as np

from coramp._kernel import FloatArray, kernel
from coramp.equations.safe_distance import safe_distance_m, standing_clearance_m
from coramp.road.rules import MotionLimits, Road, Rules, SafetyBudget

(
    LENGTH,
    POSITIONING,
    CLOCK,
    TIME_GAP,
    TOP_SPEED,
    ACCELERATION,
    POWER,
    BRAKING,
    MASS,
) = range(9)
"""Columns of arrays of traits, in the order of the fields of ``Traits``."""
CAR, CAR_MASS_KG = "car", 1500.0
SPEED_BAND_MPS = 1.5
"""A vehicle with limited power speeds up at a constant rate over bands of at most this width."""


class Traits(NamedTuple):
    """One vehicle. Infinity means that only the common limits of the scenario bind it.

    ``positioning_error_m`` and ``clock_error_s`` are the errors of Eq. 1; ``time_gap_s`` is what
    the vehicle keeps as a follower. ``acceleration_mps2`` is the largest acceleration at rest,
    ``power_wpkg`` the power per mass, so that it accelerates by at most
    min(acceleration, power / v). ``braking_mps2`` is the hardest braking that plans may use.
    """

    length_m: float
    positioning_error_m: float
    clock_error_s: float
    time_gap_s: float
    top_speed_mps: float = math.inf
    acceleration_mps2: float = math.inf
    power_wpkg: float = math.inf
    braking_mps2: float = math.inf
    mass_kg: float = CAR_MASS_KG


@kernel
def traits_or_usual(traits: FloatArray, rules: Rules) -> FloatArray:
    """Returns a row of traits, filled in for a vehicle that only the common limits bind (nan)."""
    if not math.isnan(traits[MASS]):
        return traits
    usual = np.full(len(traits), math.inf)
    usual[LENGTH], usual[MASS] = traits[LENGTH], CAR_MASS_KG
    usual[POSITIONING] = rules.safety.positioning_error_m
    usual[CLOCK] = rules.safety.clock_error_s
    usual[TIME_GAP] = rules.safety.time_gap_s
    return usual


@kernel
def cruise_mps(traits: FloatArray, rules: Rules) -> float:
    """Returns the speed (m/s) at which a vehicle cruises: v0, or its own top speed below that."""
    return float(min(rules.road.mainline_speed_mps, traits[TOP_SPEED]))


@kernel
def able_mps2(traits: FloatArray, speed_mps: float) -> float:
    """Returns the largest acceleration (m/s2) at a speed: min(a_0, P / (m v))."""
    most_mps2 = traits[ACCELERATION]
    if speed_mps > 0.0:
        most_mps2 = min(most_mps2, traits[POWER] / speed_mps)
    return float(most_mps2)


@kernel
def pair_safety(front: FloatArray, rear: FloatArray, safety: SafetyBudget) -> SafetyBudget:
    """Returns the budget of Eq. 1 for two vehicles: each one's errors, the follower's time gap."""
    return SafetyBudget(
        positioning_error_m=0.5 * (front[POSITIONING] + rear[POSITIONING]),
        clock_error_s=front[CLOCK],
        adhesion=safety.adhesion,
        resistance=safety.resistance,
        time_gap_s=rear[TIME_GAP],
        standstill_gap_m=safety.standstill_gap_m,
        execution_allowance_m=safety.execution_allowance_m,
        follower_clock_extra_s=rear[CLOCK] - front[CLOCK],
    )


@kernel
def standing_behind_m(front: FloatArray, rear: FloatArray, rules: Rules) -> float:
    """Returns the bumper distance (m) planned between a vehicle that stops and one behind it.

    It does for one that brakes to its stop, and once the one ahead starts with a: by then its clock
    error e asks for e a t, of which a t^2 / 2 come about, so that e^2 a / 2 must be there before.
    """
    stop_mps2 = min(rules.motion.stop_mps2, rear[BRAKING])
    safety = pair_safety(front, rear, rules.safety)
    still_m = safe_distance_m(0.0, 0.0, safety) + safety.execution_allowance_m
    starts_m = still_m + 0.5 * front[CLOCK] ** 2 * rules.motion.speed_up_mps2
    return float(max(standing_clearance_m(rules.road, safety, stop_mps2), starts_m))


@kernel
def own_rules(traits: FloatArray, rules: Rules, on_ramp: bool) -> Rules:
    """Returns the rules for one vehicle: its own speeds and accelerations where they are lower.

    ``speed_up_mps2`` becomes what it can do up to the common speed of its lane, the ramp's or the
    mainline's.
    """
    road, motion, safety = rules.road, rules.motion, rules.safety
    cruise, ramp_mps = cruise_mps(traits, rules), min(road.ramp_speed_mps, traits[TOP_SPEED])
    able = able_mps2(traits, ramp_mps if on_ramp else cruise)
    hardest = traits[BRAKING]
    return Rules(
        road=Road(
            mainline_start_m=road.mainline_start_m,
            mainline_end_m=road.mainline_end_m,
            ramp_start_m=road.ramp_start_m,
            decision_station_m=road.decision_station_m,
            stop_station_m=road.stop_station_m,
            acceleration_lane_m=road.acceleration_lane_m,
            last_merge_station_m=road.last_merge_station_m,
            mainline_speed_mps=cruise,
            ramp_speed_mps=ramp_mps,
            ramp_limit_mps=min(road.ramp_limit_mps, traits[TOP_SPEED]),
            merge_angle_rad=road.merge_angle_rad,
            lanes=road.lanes,
        ),
        safety=SafetyBudget(
            positioning_error_m=traits[POSITIONING],
            clock_error_s=traits[CLOCK],
            adhesion=safety.adhesion,
            resistance=safety.resistance,
            time_gap_s=traits[TIME_GAP],
            standstill_gap_m=safety.standstill_gap_m,
            execution_allowance_m=safety.execution_allowance_m,
            follower_clock_extra_s=0.0,
        ),
        motion=MotionLimits(
            speed_up_mps2=min(motion.speed_up_mps2, able),
            slow_down_mps2=min(motion.slow_down_mps2, hardest),
            comfort_mps2=min(motion.comfort_mps2, hardest),
            stop_mps2=min(motion.stop_mps2, hardest),
            ramp_acceleration_mps2=motion.ramp_acceleration_mps2,
            free_acceleration_mps2=motion.free_acceleration_mps2,
            speed_deviation=motion.speed_deviation,
            slowest_ramp_speed_mps=min(motion.slowest_ramp_speed_mps, ramp_mps),
            slow_deviation=motion.slow_deviation,
        ),
        control=rules.control,
        traffic=rules.traffic,
    )
