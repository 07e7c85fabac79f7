"""A decision where vehicles differ: the merge with each vehicle's own limits and errors.

The paper's quantities rest on vehicles that all reach v0. Here the merge is told as it was
planned, from the run's records: what the vehicle can do, how fast it merges, and what it keeps to
the others.
"""

import math

import numpy as np
import polars as pl

from coramp._kernel import FloatArray
from coramp.equations.safe_distance import (
    clock_distance_m,
    merge_distance_m,
    merging_speed_along_mps,
    safe_distance_m,
    speed_difference_distance_m,
)
from coramp.explain.quantity import Quantity
from coramp.kinematics.trajectory import station_and_speed
from coramp.records.run import RunRecords
from coramp.records.schemas import Row
from coramp.road.rules import Rules
from coramp.scenarios.model import Scenario
from coramp.vehicles.traits import (
    LENGTH,
    MASS,
    POWER,
    Traits,
    able_mps2,
    cruise_mps,
    pair_safety,
)

TRAJECTORY = ("time_s", "station_m", "speed_mps", "accel_mps2")


def own_quantities(decision: Row, run: RunRecords) -> list[Quantity]:
    """Returns the quantities behind a decision, from the tables of its run."""
    scenario, rules = run.scenario, run.scenario.rules()
    own = traits_in(run, decision["vehicle_id"], scenario)
    lines = _abilities(own, rules, decision["nose_speed_mps"])
    merge_s = decision["merge_time_s"]
    if merge_s is None:
        return lines
    merge_m, merge_mps = state_in(run, decision["vehicle_id"], merge_s)
    lines += [
        Quantity("", "", "merge time, from the decision", merge_s - decision["time_s"], "s"),
        Quantity("", "S_R'", "merge station", merge_m, "m"),
        Quantity("", "v_R", "speed at the merge", merge_mps, "m/s"),
    ]
    along_mps = merging_speed_along_mps(merge_mps, rules.road.merge_angle_rad)
    lines.append(Quantity("", "v_Rx", "its part along the mainline", along_mps, "m/s"))
    for key, symbol, number in (("front", "X", "15"), ("rear", "Y", "16")):
        other_id = decision[f"{key}_vehicle_id"]
        if other_id is not None:
            other = traits_in(run, other_id, scenario)
            other_m, other_mps = state_in(run, other_id, merge_s)
            name, subject = f"{symbol} ({other_id})", (own, merge_m, merge_mps)
            lines += _to_other(name, number, subject, (other, other_m, other_mps), rules)
    return lines


def traits_in(run: RunRecords, vehicle_id: str, scenario: Scenario) -> FloatArray:
    """Returns what a vehicle can do, from ``vehicles.parquet``; null there means no own limit."""
    row = run.vehicle(vehicle_id)
    usual = scenario.usual_traits(row["length_m"])._asdict()
    told = {name: usual[name] if row[name] is None else row[name] for name in Traits._fields}
    return np.array(Traits(**told), np.float64)


def state_in(run: RunRecords, vehicle_id: str, time_s: float) -> tuple[float, float]:
    """Returns station (m) and speed (m/s) of a vehicle at a time, from ``trajectories.parquet``."""
    driven = run.motion.filter(pl.col("vehicle_id") == vehicle_id).sort("time_s")
    return station_and_speed(driven.select(TRAJECTORY).to_numpy(), time_s)


def _abilities(own: FloatArray, rules: Rules, nose_mps: float | None) -> list[Quantity]:
    lines = [
        Quantity("", "L_v", "length", own[LENGTH], "m"),
        Quantity("", "m", "mass", own[MASS], "kg"),
        Quantity(
            "", "v_c", "cruising speed: v0 or its own top speed", cruise_mps(own, rules), "m/s"
        ),
    ]
    if not math.isinf(own[POWER]):
        lines.append(Quantity("", "P", "power per mass", own[POWER], "W/kg"))
    if nose_mps is not None:
        lines.append(Quantity("25", "v_R0", "speed at the nose", nose_mps, "m/s"))
        able = min(able_mps2(own, nose_mps), rules.motion.ramp_acceleration_mps2)
        meaning = "most that it can accelerate there: min(a_0, P / v)"
        lines.append(Quantity("22", "a_max", meaning, able, "m/s2"))
    return lines


def _to_other(
    name: str,
    number: str,
    subject: tuple[FloatArray, float, float],
    other: tuple[FloatArray, float, float],
    rules: Rules,
) -> list[Quantity]:
    """Returns what is kept to the vehicle in front or behind at the merge, and what is needed."""
    (own, own_m, own_mps), (theirs, other_m, other_mps) = subject, other
    front, rear = (theirs, own) if other_m >= own_m else (own, theirs)
    front_mps, rear_mps = (other_mps, own_mps) if other_m >= own_m else (own_mps, other_mps)
    distance_m = abs(other_m - own_m) - front[LENGTH]
    budget = pair_safety(front, rear, rules.safety)
    along_mps = merging_speed_along_mps(own_mps, rules.road.merge_angle_rad)
    lane_change = "L_r-X" if number == "15" else "L_r-Y"
    clock_m = clock_distance_m(
        front_mps, rear_mps, budget.clock_error_s, budget.follower_clock_extra_s
    )
    closing_m = speed_difference_distance_m(front_mps, rear_mps, budget.adhesion, budget.resistance)
    safe_m = safe_distance_m(front_mps, rear_mps, budget)
    needed_m = merge_distance_m(along_mps, other_mps, budget)
    return [
        Quantity("", "v", f"speed of {name} at the merge", other_mps, "m/s"),
        Quantity("", "", f"bumper distance to {name} at the merge", distance_m, "m"),
        Quantity(number, lane_change, f"least distance to {name} at the merge", needed_m, "m"),
        Quantity("2", "L_2", f"clock distance to {name}", clock_m, "m"),
        Quantity("3", "L_3", f"speed distance to {name}", closing_m, "m"),
        Quantity("1", "L_safe", f"safe distance to {name} from then on", safe_m, "m"),
    ]
