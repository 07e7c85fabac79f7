"""What a road, a vehicle and a controller may do: the constants that every kernel is given."""

from typing import NamedTuple

import numpy as np

from coramp._kernel import FloatArray, kernel


class Road(NamedTuple):
    """The mainline, one ramp and the acceleration lane between them.

    Stations are metres of a front bumper along the mainline, 0 at the end of the ramp (the nose),
    growing downstream; the ramp has negative stations of its own, the acceleration lane positive
    ones that run beside the mainline's. Of the mainline's ``lanes`` the outermost is next to the
    ramp.
    """

    mainline_start_m: float
    mainline_end_m: float
    ramp_start_m: float
    decision_station_m: float
    stop_station_m: float
    acceleration_lane_m: float
    last_merge_station_m: float
    mainline_speed_mps: float
    ramp_speed_mps: float
    ramp_limit_mps: float
    merge_angle_rad: float
    lanes: int = 1


class SafetyBudget(NamedTuple):
    """The errors and road conditions that the safe distance of Eq. 1 is made of.

    ``time_gap_s`` is an optional addition of ``time_gap_s`` times the follower's speed, and
    ``standstill_gap_m`` one of so many metres at every speed; both are 0 in the paper.
    ``execution_allowance_m`` is what planning adds for each pair so that the driven
    positions keep Eq. 1; it is no part of the safe distance itself. ``clock_error_s`` is that of
    the vehicle in front; the follower's is larger by ``follower_clock_extra_s``.
    """

    positioning_error_m: float
    clock_error_s: float
    adhesion: float
    resistance: float
    time_gap_s: float
    standstill_gap_m: float
    execution_allowance_m: float
    follower_clock_extra_s: float = 0.0


class MotionLimits(NamedTuple):
    """Accelerations in m/s2, all positive, and how far speed may leave v0 while a gap is made.

    ``speed_up_mps2`` and ``slow_down_mps2`` bring vehicles to the common speed of their lane.
    ``comfort_mps2`` (0.3 g) binds everyone but a ramp vehicle that speeds up, which is bound by
    ``ramp_acceleration_mps2`` (6). ``stop_mps2`` is the braking towards a stop before the nose.
    ``free_acceleration_mps2`` is that
    of free movement (Eq. 12). ``speed_deviation`` is how far above v0, ``slow_deviation`` how far
    below it a vehicle that makes a gap may drive, both as fractions of v0.
    """

    speed_up_mps2: float
    slow_down_mps2: float
    comfort_mps2: float
    stop_mps2: float
    ramp_acceleration_mps2: float
    free_acceleration_mps2: float
    speed_deviation: float
    slowest_ramp_speed_mps: float
    slow_deviation: float


class Control(NamedTuple):
    """The control clock and the readings of the paper that a scenario may choose.

    ``gap_at_front`` pins a merging vehicle to the tail of the gap's front vehicle, as Eq. 29 does;
    otherwise it takes the acceleration nearest to that of free movement. ``create_from_nose``
    starts gap creation when the ramp vehicle passes the nose, as Eq. 34 does; otherwise it starts
    with the decision.
    """

    step_s: float
    actuation_delay_s: float
    retry_s: float
    gap_at_front: bool
    create_from_nose: bool


class Traffic(NamedTuple):
    """How unlike vehicles are: whether planners must look at each one's limits.

    ``extra_safe_distance_m`` is by how much more than the common budget two vehicles may ask for at
    most, at any speed.
    """

    differs: bool = False
    extra_safe_distance_m: float = 0.0


class Rules(NamedTuple):
    """Everything a planner is bound by; a vehicle may have lower limits (``vehicles.traits``)."""

    road: Road
    safety: SafetyBudget
    motion: MotionLimits
    control: Control
    traffic: Traffic = Traffic()


def packed(rules: Rules) -> FloatArray:
    """Returns the rules as one array: numba takes that in a thirtieth of the time."""
    return np.array([float(value) for part in rules for value in part])


@kernel
def unpacked(numbers: FloatArray) -> Rules:
    """Returns the rules that ``packed`` made an array of."""
    n = numbers
    return Rules(
        road=Road(
            mainline_start_m=n[0],
            mainline_end_m=n[1],
            ramp_start_m=n[2],
            decision_station_m=n[3],
            stop_station_m=n[4],
            acceleration_lane_m=n[5],
            last_merge_station_m=n[6],
            mainline_speed_mps=n[7],
            ramp_speed_mps=n[8],
            ramp_limit_mps=n[9],
            merge_angle_rad=n[10],
            lanes=int(n[11]),
        ),
        safety=SafetyBudget(
            positioning_error_m=n[12],
            clock_error_s=n[13],
            adhesion=n[14],
            resistance=n[15],
            time_gap_s=n[16],
            standstill_gap_m=n[17],
            execution_allowance_m=n[18],
            follower_clock_extra_s=n[19],
        ),
        motion=MotionLimits(
            speed_up_mps2=n[20],
            slow_down_mps2=n[21],
            comfort_mps2=n[22],
            stop_mps2=n[23],
            ramp_acceleration_mps2=n[24],
            free_acceleration_mps2=n[25],
            speed_deviation=n[26],
            slowest_ramp_speed_mps=n[27],
            slow_deviation=n[28],
        ),
        control=Control(
            step_s=n[29],
            actuation_delay_s=n[30],
            retry_s=n[31],
            gap_at_front=n[32] != 0.0,
            create_from_nose=n[33] != 0.0,
        ),
        traffic=Traffic(
            differs=n[34] != 0.0,
            extra_safe_distance_m=n[35],
        ),
    )
