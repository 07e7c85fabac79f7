"""The paper's road and budget, and random trajectories with a sampler of their own."""

import importlib
import itertools
import math
import pkgutil
from functools import partial

import numpy as np
import pytest
from hypothesis import strategies as st

from coramp.kinematics.trajectory import intercept_range_m
from coramp.road.rules import Control, MotionLimits, Road, Rules, SafetyBudget, Traffic
from coramp.vehicles.fleet import Fleet
from coramp.vehicles.traits import Traits

PACKAGES = ("equations", "kinematics", "motion", "road", "vehicles")
"""The folders that hold mathematics alone."""
PLANNING = ("coramp.strategies.proposals", "coramp.strategies.ramp_queue")


def mathematics():
    """Returns every module of mathematics by its last name."""
    names = list(PLANNING)
    for package in PACKAGES:
        path = importlib.import_module(f"coramp.{package}").__path__
        names += [f"coramp.{package}.{info.name}" for info in pkgutil.iter_modules(path)]
    return {name.rsplit(".", 1)[1]: importlib.import_module(name) for name in names}


close = partial(pytest.approx, rel=1e-9, abs=1e-9)

SAFETY = SafetyBudget(
    positioning_error_m=0.02,
    clock_error_s=3e-9,
    adhesion=0.4,
    resistance=0.11,
    time_gap_s=0.0,
    standstill_gap_m=0.0,
    execution_allowance_m=0.1,
)
MOTION = MotionLimits(
    speed_up_mps2=1.5,
    slow_down_mps2=2.0,
    comfort_mps2=2.94,
    stop_mps2=2.5,
    ramp_acceleration_mps2=6.0,
    free_acceleration_mps2=2.0,
    speed_deviation=0.1,
    slowest_ramp_speed_mps=2.0,
    slow_deviation=0.1,
)
RULES = Rules(
    Road(
        mainline_start_m=-400.0,
        mainline_end_m=400.0,
        ramp_start_m=-400.0,
        decision_station_m=-200.0,
        stop_station_m=-1.0,
        acceleration_lane_m=200.0,
        last_merge_station_m=197.5,
        mainline_speed_mps=20.0,
        ramp_speed_mps=16.0,
        ramp_limit_mps=17.0,
        merge_angle_rad=math.pi / 6.0,
    ),
    SAFETY,
    MOTION,
    Control(
        step_s=0.1,
        actuation_delay_s=0.1,
        retry_s=0.5,
        gap_at_front=False,
        create_from_nose=False,
    ),
)

PARTS = (Road, SafetyBudget, MotionLimits, Control, Traffic)
FLAGS = sum(hint is bool for part in PARTS for hint in part.__annotations__.values())
"""How many fields of the rules are true or false."""


def rules_of_numbers(flags):
    """Returns rules with another number in each field, in ascending order; the flags as given."""
    numbers, flags = itertools.count(1.0), iter(flags)
    return Rules(
        *(
            part(**{name: next(flags if hint is bool else numbers) for name, hint in hints.items()})
            for part, hints in ((part, part.__annotations__) for part in PARTS)
        )
    )


def with_safety(**changes):
    return RULES._replace(safety=SAFETY._replace(**changes))


def pieces(time_s, station_m, speed_mps, stretches=()):
    """A trajectory from ``(speed reached, duration)`` stretches; it cruises after the last."""
    rows = []
    for reached_mps, duration_s in stretches:
        rows.append([time_s, station_m, speed_mps, (reached_mps - speed_mps) / duration_s])
        station_m += 0.5 * (speed_mps + reached_mps) * duration_s
        time_s += duration_s
        speed_mps = reached_mps
    return np.array([*rows, [time_s, station_m, speed_mps, 0.0]])


@st.composite
def trajectories(draw, most_stretches=4, start_s=None, station_m=None, end_speed_mps=None):
    hundredths = st.integers(0, 3000).map(lambda n: n / 100.0)
    if start_s is None:
        start_s = draw(st.integers(-50, 50)) / 10.0
    if station_m is None:
        station_m = draw(st.integers(-3000, 1000)) / 10.0
    first_mps = speed_mps = draw(hundredths)
    stretches = []
    for _ in range(draw(st.integers(0, most_stretches))):
        speed_mps = draw(st.one_of(st.just(speed_mps), hundredths))
        stretches.append((speed_mps, draw(st.integers(1, 80)) / 10.0))
    if end_speed_mps is not None and speed_mps != end_speed_mps:
        stretches.append((end_speed_mps, draw(st.integers(10, 80)) / 10.0))
    return pieces(start_s, station_m, first_mps, stretches)


def random_pairs(seed, how_many):
    """Pairs of trajectories in which much happens, the first ahead of the second at time 0."""
    rng = np.random.default_rng(seed)
    for _ in range(how_many):
        ways = []
        for station_m in (30.0, 0.0):
            speeds_mps, durations_s = rng.uniform(0.0, 25.0, 5), rng.uniform(0.5, 5.0, 4)
            stretches = list(zip(speeds_mps[1:], durations_s, strict=True))
            ways.append(pieces(0.0, station_m, speeds_mps[0], stretches))
        yield *ways, rng.uniform(0.0, 4.0), rng.uniform(1.0, 15.0)


def sampled(trajectory, times_s):
    """Stations and speeds at an array of times."""
    k = np.clip(np.searchsorted(trajectory[:, 0], times_s, side="right") - 1, 0, None)
    x = times_s - trajectory[k, 0]
    speeds = trajectory[k, 2] + trajectory[k, 3] * x
    return trajectory[k, 1] + trajectory[k, 2] * x + trajectory[k, 3] * x * x / 2.0, speeds


def sampled_margins(front, front_length_m, rear, times_s, safety):
    """Bumper distances less Eq. 1, written out from the paper's km/h."""
    front_m, front_mps = sampled(front, times_s)
    rear_m, rear_mps = sampled(rear, times_s)
    closing_km_h = np.maximum(0.0, 3.6 * rear_mps - 3.6 * front_mps)
    return (
        front_m
        - front_length_m
        - rear_m
        - 2.0 * safety.positioning_error_m
        - safety.clock_error_s * (front_mps + rear_mps)
        - closing_km_h**2 / (254.0 * (safety.adhesion + safety.resistance))
        - safety.time_gap_s * rear_mps
        - safety.standstill_gap_m
    )


def sampled_own_margins(front, front_traits, rear, rear_traits, times_s, safety):
    """Bumper distances less Eq. 1 with each vehicle's own errors and the follower's time gap."""
    front_own, rear_own = Traits(*front_traits), Traits(*rear_traits)
    front_m, front_mps = sampled(front, times_s)
    rear_m, rear_mps = sampled(rear, times_s)
    closing_km_h = np.maximum(0.0, 3.6 * rear_mps - 3.6 * front_mps)
    return (
        front_m
        - front_own.length_m
        - rear_m
        - front_own.positioning_error_m
        - rear_own.positioning_error_m
        - front_own.clock_error_s * front_mps
        - rear_own.clock_error_s * rear_mps
        - closing_km_h**2 / (254.0 * (safety.adhesion + safety.resistance))
        - rear_own.time_gap_s * rear_mps
        - safety.standstill_gap_m
    )


def truck(**own):
    """What the built-in truck can do that cruises at 24 m/s, but for ``own``."""
    usual = {
        "top_speed_mps": 24.0,
        "acceleration_mps2": 1.0,
        "power_wpkg": 5.5,
        "braking_mps2": 2.5,
        "mass_kg": 40000.0,
    }
    return sized(16.5, **{**usual, **own})


def sized(length_m=5.0, safety=SAFETY, **own):
    """What a vehicle of a length can do: only the common limits bind it, but for ``own``."""
    usual = Traits(length_m, safety.positioning_error_m, safety.clock_error_s, safety.time_gap_s)
    return np.array(usual._replace(**own))


def fleet_of(*vehicles, live=None, safety=SAFETY, lanes=None, changes_s=None):
    """Commitments of ``(pieces, merge time)``, 5 m long unless a length, or traits, follow.

    Of a mainline of several lanes: by which each came, and when it begins to change to the next.
    """
    rows = [vehicle[0] for vehicle in vehicles]
    counts = [len(row) for row in rows]
    ranges = [intercept_range_m(row, row[0, 0], 20.0) for row in rows]
    told = [vehicle[2] if len(vehicle) > 2 else 5.0 for vehicle in vehicles]
    traits = np.array([sized(own, safety) if np.isscalar(own) else own for own in told])
    lane = np.zeros(len(rows), np.int64) if lanes is None else np.array(lanes)
    change_s = np.full(len(rows), math.inf) if changes_s is None else np.array(changes_s)
    return Fleet(
        pieces=np.concatenate(rows),
        first_piece=np.cumsum([0, *counts[:-1]]),
        piece_count=np.array(counts),
        length_m=traits[:, 0].copy(),
        merge_time_s=np.array([vehicle[1] for vehicle in vehicles]),
        intercepts_m=np.array(ranges),
        traits=traits,
        live=np.flatnonzero(lane == 0) if live is None else np.array(live),
        lane=lane,
        change_s=change_s,
        inner=np.flatnonzero((lane > 0) | np.isfinite(change_s)),
    )
