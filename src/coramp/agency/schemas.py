"""The columns of the tables that agencies read."""

import polars as pl

from coramp.records.schemas import Schema

INTERVALS: Schema = {
    "stream": pl.String,
    "from_s": pl.Float64,
    "to_s": pl.Float64,
    "arrivals": pl.Int64,
    "entries": pl.Int64,
    "exits": pl.Int64,
    "flow_veh_h": pl.Float64,
    "time_spent_s": pl.Float64,
    "waiting_s": pl.Float64,
    "vehicle_km": pl.Float64,
    "mean_speed_mps": pl.Float64,
    "delay_s": pl.Float64,
    "due_delay_s": pl.Float64,
    "fuel_l": pl.Float64,
    "loop_speed_mps": pl.Float64,
    "broken_down": pl.Boolean,
}

QUEUES: Schema = {
    "road": pl.String,
    "time_s": pl.Float64,
    "queued": pl.Int64,
    "queue_m": pl.Float64,
    "congested_m": pl.Float64,
    "waiting": pl.Int64,
}

CONTOUR: Schema = {
    "road": pl.String,
    "time_s": pl.Float64,
    "station_m": pl.Float64,
    "flow_veh_h": pl.Float64,
    "density_veh_km": pl.Float64,
    "mean_speed_mps": pl.Float64,
}

LEVELS: Schema = {
    "segment": pl.String,
    "start_m": pl.Float64,
    "end_m": pl.Float64,
    "from_s": pl.Float64,
    "to_s": pl.Float64,
    "density_pc_km_ln": pl.Float64,
    "density_pc_mi_ln": pl.Float64,
    "mean_speed_mps": pl.Float64,
    "level_of_service": pl.String,
}

EMISSIONS: Schema = {
    "vehicle_type": pl.String,
    "stream": pl.String,
    "automated": pl.Boolean,
    "vehicles": pl.Int64,
    "vehicle_km": pl.Float64,
    "fuel_l": pl.Float64,
    "co2_kg": pl.Float64,
}

TRAVEL_TIMES: Schema = {
    "stream": pl.String,
    "from_s": pl.Float64,
    "to_s": pl.Float64,
    "vehicles": pl.Int64,
    "unserved": pl.Int64,
    "free_flow_s": pl.Float64,
    "mean_s": pl.Float64,
    "p15_s": pl.Float64,
    "p50_s": pl.Float64,
    "p85_s": pl.Float64,
    "p95_s": pl.Float64,
    "planning_time_index": pl.Float64,
}

DETECTORS: Schema = {
    "detector": pl.String,
    "lane": pl.String,
    "position_m": pl.Float64,
    "station_m": pl.Float64,
    "from_s": pl.Float64,
    "to_s": pl.Float64,
    "vehicles": pl.Int64,
    "trucks": pl.Int64,
    "passed": pl.Int64,
    "flow_veh_h": pl.Float64,
    "occupancy_percent": pl.Float64,
    "mean_speed_mps": pl.Float64,
    "harmonic_speed_mps": pl.Float64,
    "car_speed_mps": pl.Float64,
    "truck_speed_mps": pl.Float64,
    "mean_length_m": pl.Float64,
}

AGENCY: dict[str, Schema] = {
    "intervals": INTERVALS,
    "queues": QUEUES,
    "contour": CONTOUR,
    "levels_of_service": LEVELS,
    "emissions": EMISSIONS,
    "travel_times": TRAVEL_TIMES,
    "detectors": DETECTORS,
}
"""By the name of the table, which is also that of its CSV file."""
