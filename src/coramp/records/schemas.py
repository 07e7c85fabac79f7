"""The columns of all result files, in one place; ``messages.kinds`` has those of messages."""

from typing import Any

import polars as pl

from coramp.strategies.situation import RUNGS_OF_ONE_LANE

Row = dict[str, Any]
"""One row of a table, by column."""
Schema = dict[str, type[pl.DataType] | pl.DataType]

RESULT_VERSION = 10
"""Raised whenever the same specification gives other numbers or other columns."""

VEHICLES: Schema = {
    "vehicle_id": pl.String,
    "stream": pl.String,
    "scheduled_s": pl.Float64,
    "entry_s": pl.Float64,
    "exit_s": pl.Float64,
    "waiting_s": pl.Float64,
    "travel_s": pl.Float64,
    "free_flow_s": pl.Float64,
    "delay_s": pl.Float64,
    "mean_speed_mps": pl.Float64,
    "fuel_l": pl.Float64,
    "finished": pl.Boolean,
    "plan_error_m": pl.Float64,
    "vehicle_type": pl.String,
    "length_m": pl.Float64,
    "positioning_error_m": pl.Float64,
    "clock_error_s": pl.Float64,
    "time_gap_s": pl.Float64,
    "top_speed_mps": pl.Float64,
    "acceleration_mps2": pl.Float64,
    "power_wpkg": pl.Float64,
    "braking_mps2": pl.Float64,
    "mass_kg": pl.Float64,
    "automated": pl.Boolean,
}

TYPES: Schema = {
    "vehicle_type": pl.String,
    "stream": pl.String,
    "vehicles": pl.Int64,
    "unserved": pl.Int64,
    "delay_s": pl.Float64,
    "fuel_l": pl.Float64,
}

TRAJECTORIES: Schema = {
    "vehicle_id": pl.String,
    "lane": pl.String,
    "time_s": pl.Float64,
    "station_m": pl.Float64,
    "speed_mps": pl.Float64,
    "accel_mps2": pl.Float64,
}

DECISIONS: Schema = {
    "time_s": pl.Float64,
    "vehicle_id": pl.String,
    "rung": pl.String,
    "scenario": pl.Int64,
    "conflict_vehicle_id": pl.String,
    "severity_before": pl.Float64,
    "severity_after": pl.Float64,
    "front_vehicle_id": pl.String,
    "rear_vehicle_id": pl.String,
    "gap_m": pl.Float64,
    "required_gap_m": pl.Float64,
    "accel_mps2": pl.Float64,
    "merge_time_s": pl.Float64,
    "merge_station_m": pl.Float64,
    "adjusted_vehicle_ids": pl.List(pl.String),
    "largest_shift_m": pl.Float64,
    "min_margin_m": pl.Float64,
    "relative_severity_before": pl.Float64,
    "relative_severity_after": pl.Float64,
    "nose_time_s": pl.Float64,
    "nose_speed_mps": pl.Float64,
    "conflict_station_m": pl.Float64,
    "front_station_m": pl.Float64,
    "rear_station_m": pl.Float64,
}

ATTEMPTS: Schema = {
    "time_s": pl.Float64,
    "vehicle_id": pl.String,
    "attempt": pl.Int64,
    "rung": pl.String,
    "scenario": pl.Int64,
    "front_vehicle_id": pl.String,
    "rear_vehicle_id": pl.String,
    "reason": pl.String,
    "checker_reason": pl.String,
    "other_vehicle_id": pl.String,
    "moved_vehicle_id": pl.String,
    "missing_m": pl.Float64,
    "intercept_m": pl.Float64,
    "accel_mps2": pl.Float64,
    "merge_time_s": pl.Float64,
    "merge_station_m": pl.Float64,
    "nose_time_s": pl.Float64,
    "nose_speed_mps": pl.Float64,
    "ahead_m": pl.Float64,
    "back_m": pl.Float64,
    "moves_from_s": pl.Float64,
    "free_accel_mps2": pl.Float64,
    "length_m": pl.Float64,
    "front_length_m": pl.Float64,
    "clearance_m": pl.Float64,
}

VIOLATIONS: Schema = {
    "time_s": pl.Float64,
    "front_vehicle_id": pl.String,
    "rear_vehicle_id": pl.String,
    "margin_m": pl.Float64,
}

SAFETY_EVENTS: Schema = {
    "time_s": pl.Float64,
    "event": pl.String,
    "rear_vehicle_id": pl.String,
    "front_vehicle_id": pl.String,
}

HEARD: Schema = {
    "time_s": pl.Float64,
    "vehicle_id": pl.String,
    "lane": pl.String,
    "station_m": pl.Float64,
    "speed_mps": pl.Float64,
    "age_s": pl.Float64,
    "error_m": pl.Float64,
    "report_lost": pl.Boolean,
    "command_lost": pl.Boolean,
    "fallback": pl.Boolean,
}

ON_BOARD: Schema = {
    "time_s": pl.Float64,
    "vehicle_id": pl.String,
    "lane": pl.String,
    "station_m": pl.Float64,
    "speed_mps": pl.Float64,
    "measured_mps2": pl.Float64,
    "law": pl.String,
    "accel_mps2": pl.Float64,
    "told_mps2": pl.Float64,
    "given_s": pl.Float64,
    "fallback": pl.Boolean,
    "place": pl.Int64,
    "after_vehicle_id": pl.String,
    "leader_vehicle_id": pl.String,
    "leader_gap_m": pl.Float64,
    "leader_speed_mps": pl.Float64,
    "leader_accel_mps2": pl.Float64,
    "front_vehicle_id": pl.String,
    "front_gap_m": pl.Float64,
    "front_speed_mps": pl.Float64,
    "front_accel_mps2": pl.Float64,
    "rear_vehicle_id": pl.String,
    "rear_gap_m": pl.Float64,
    "rear_speed_mps": pl.Float64,
    "rear_accel_mps2": pl.Float64,
    "changes_lane": pl.Boolean,
    "ahead_m": pl.Float64,
    "ahead_mps": pl.Float64,
}

SPEEDS: Schema = {
    "stream": pl.String,
    "time_s": pl.Float64,
    "mean_speed_mps": pl.Float64,
    "vehicles": pl.Int64,
}

RUN_KEYS: Schema = {
    "scenario": pl.String,
    "drivers": pl.String,
    "strategy": pl.String,
    "engine": pl.String,
    "mainline_veh_h": pl.Float64,
    "ramp_veh_h": pl.Float64,
    "seed": pl.Int64,
}
"""What runs are sorted by."""

_FIRST_METRICS: Schema = {
    "vehicles_mainline": pl.Int64,
    "vehicles_ramp": pl.Int64,
    "unserved": pl.Int64,
    "mainline_delay_s": pl.Float64,
    "ramp_delay_s": pl.Float64,
    "mainline_delay_p95_s": pl.Float64,
    "ramp_delay_p95_s": pl.Float64,
    "mainline_speed_mps": pl.Float64,
    "ramp_speed_mps": pl.Float64,
    "mainline_speed_std_mps": pl.Float64,
    "ramp_speed_std_mps": pl.Float64,
    "fuel_l": pl.Float64,
    "collisions": pl.Int64,
    "safety_violations": pl.Int64,
    "min_margin_m": pl.Float64,
    "min_ttc_s": pl.Float64,
    "max_drac_mps2": pl.Float64,
    "max_severity": pl.Float64,
    "max_decel_mps2": pl.Float64,
    "plan_error_m": pl.Float64,
    "adjusted_vehicles": pl.Int64,
    **{f"rung_{rung}": pl.Int64 for rung in RUNGS_OF_ONE_LANE},
    "refused_plans": pl.Int64,
    "interventions": pl.Int64,
    "max_jerk_mps3": pl.Float64,
}

_LATER_METRICS: Schema = {
    "delay_s": pl.Float64,
    "delay_bound_s": pl.Float64,
    "delay_bound_ratio": pl.Float64,
    "mainline_fcfs_delay_s": pl.Float64,
    "ramp_fcfs_delay_s": pl.Float64,
    "lane_limit_veh_h": pl.Float64,
    "hard_brakings_3": pl.Int64,
    "hard_brakings_4_5": pl.Int64,
    "stops": pl.Int64,
    "breakdown_time_s": pl.Float64,
    "prebreakdown_flow_veh_h": pl.Float64,
    "discharge_flow_veh_h": pl.Float64,
    "min_margin_equation": pl.Int64,
    "min_merge_margin_m": pl.Float64,
}
"""They stand at the end of ``runs.parquet``, so that what was there keeps its place."""

MIXED_METRICS: Schema = {
    "automated_vehicles": pl.Int64,
    "automated_delay_s": pl.Float64,
    "driver_delay_s": pl.Float64,
    "automated_hard_brakings_3": pl.Int64,
    "driver_hard_brakings_3": pl.Int64,
    "ramp_stops": pl.Int64,
    "collisions_by_automated": pl.Int64,
    "collisions_by_driver": pl.Int64,
    "collisions_among_drivers": pl.Int64,
    "broken_assumptions": pl.Int64,
    "automated_violations": pl.Int64,
    "reports_sent": pl.Int64,
    "reports_lost": pl.Int64,
    "commands_sent": pl.Int64,
    "commands_lost": pl.Int64,
    "fallbacks": pl.Int64,
    "vehicle_km": pl.Float64,
    "conflicts_ttc_3": pl.Int64,
    "conflicts_ttc_1_5": pl.Int64,
    "conflicts_ttc_1": pl.Int64,
    "conflicts_drac_2": pl.Int64,
    "conflicts_drac_3_4": pl.Int64,
    "conflicts_drac_6": pl.Int64,
    "conflicts_pet_1": pl.Int64,
    "conflicts_pet_0_5": pl.Int64,
    "conflicts_pet_0_2": pl.Int64,
    "conflicts_j_1": pl.Int64,
    "conflicts_j_10": pl.Int64,
    "conflicts_j_100": pl.Int64,
}
"""Figures of automated vehicles among drivers, null in other runs but for the distance.

Conflicts are also of drivers alone where the world is not perfect.
"""

LANE_METRICS: Schema = {"outer_lane_delay_s": pl.Float64, "made_way": pl.Int64}
"""Figures of roads with several mainline lanes, null in other runs."""

RUN_METRICS: Schema = {**_FIRST_METRICS, **_LATER_METRICS, **MIXED_METRICS, **LANE_METRICS}

RUNS: Schema = {
    "run_id": pl.String,
    **RUN_KEYS,
    "overrides": pl.String,
    "status": pl.String,
    "error": pl.String,
    **_FIRST_METRICS,
    "wall_s": pl.Float64,
    "planning_median_s": pl.Float64,
    "planning_p95_s": pl.Float64,
    **_LATER_METRICS,
    "settings": pl.String,
    **MIXED_METRICS,
    **LANE_METRICS,
}
"""``settings`` are the overrides as JSON, a dotted key each; ``overrides`` shows them."""
PLANNING_TIMES = ("planning_median_s", "planning_p95_s")
MEASURED = ("wall_s", *PLANNING_TIMES)
"""Columns that hold wall times: all that differs between equal runs."""

STREAM_ROWS: Schema = {
    "run_id": pl.String,
    "stream": pl.String,
    "flow_veh_h": pl.Float64,
    "vehicles": pl.Int64,
    "unserved": pl.Int64,
    "delay_s": pl.Float64,
    "delay_p95_s": pl.Float64,
    "waiting_s": pl.Float64,
    "speed_mps": pl.Float64,
    "speed_std_mps": pl.Float64,
    "fuel_l": pl.Float64,
}
