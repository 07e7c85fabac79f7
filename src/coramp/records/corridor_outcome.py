"""What happened on a corridor, as arrays; and the columns of its tables."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import polars as pl

from coramp._kernel import BoolArray, FloatArray
from coramp.records.schemas import RUN_KEYS, Schema
from coramp.scenarios.corridors import Corridor

SITES: Schema = {
    "site": pl.String,
    "road": pl.Int64,
    "nose_m": pl.Float64,
    "zone_m": pl.Float64,
    "mainline_vehicles": pl.Int64,
    "ramp_vehicles": pl.Int64,
    "automated_vehicles": pl.Int64,
    "mainline_served": pl.Int64,
    "ramp_served": pl.Int64,
    "mainline_delay_s": pl.Float64,
    "ramp_delay_s": pl.Float64,
    "merges": pl.Int64,
    "made_way": pl.Int64,
    "hard_brakings_3": pl.Int64,
    "stopped_vehicles": pl.Int64,
    "taken_over": pl.Int64,
    "handed_on": pl.Int64,
    "reports_sent": pl.Int64,
    "reports_lost": pl.Int64,
    "commands_sent": pl.Int64,
    "commands_lost": pl.Int64,
    "fallbacks": pl.Int64,
}
MESSAGES = ("reports_sent", "reports_lost", "commands_sent", "commands_lost", "fallbacks")
TRIPS: Schema = {
    "vehicle_id": pl.String,
    "origin": pl.String,
    "leaves_by": pl.String,
    "automated": pl.Boolean,
    "scheduled_s": pl.Float64,
    "entered_s": pl.Float64,
    "left_s": pl.Float64,
    "waiting_s": pl.Float64,
    "driven_s": pl.Float64,
    "delay_s": pl.Float64,
    "way_m": pl.Float64,
}
PASSAGES: Schema = {
    "vehicle_id": pl.String,
    "site": pl.String,
    "stream": pl.String,
    "entered_s": pl.Float64,
    "merged_s": pl.Float64,
    "left_s": pl.Float64,
    "delay_s": pl.Float64,
    "hard_brakings_3": pl.Int64,
    "stopped": pl.Boolean,
    "made_way": pl.Int64,
}
HAND_OVERS: Schema = {
    "time_s": pl.Float64,
    "vehicle_id": pl.String,
    "site": pl.String,
    "event": pl.String,
    "station_m": pl.Float64,
    "lane": pl.Int64,
    "speed_mps": pl.Float64,
}
METERS: Schema = {
    "time_s": pl.Float64,
    "site": pl.String,
    "occupancy_percent": pl.Float64,
    "queue_occupancy_percent": pl.Float64,
    "arrivals_veh_h": pl.Float64,
    "queue_veh": pl.Int64,
    "room_veh": pl.Float64,
    "rate_veh_h": pl.Float64,
    "let_go": pl.Boolean,
    "role": pl.String,
    "master": pl.String,
}
METERS_FILE = "meters"
CORRIDOR_FILES: Mapping[str, Schema] = {
    "sites": SITES,
    "trips": TRIPS,
    "passages": PASSAGES,
    "hand_overs": HAND_OVERS,
    METERS_FILE: METERS,
}
"""The tables of a corridor's run by the names of their files; the last where ramps are metered."""
TOTALS = (
    "vehicles", "through", "unserved", "time_spent_s", "waiting_s", "delay_s", "mean_delay_s",
    "vehicle_km", "merges", "made_way", "hard_brakings_3", "stopped_vehicles", "hand_overs",
    "collisions", "collisions_by_automated", "plan_error_m", "until_s", "most_at_once",
)  # fmt: skip
"""What a corridor's run amounts to."""
TOTAL_KINDS: Schema = {
    name: pl.Float64 if name.endswith(("_s", "_km", "_m")) else pl.Int64 for name in TOTALS
}
TRIP_FIGURES: Schema = {
    "mainline_delay_s": pl.Float64,
    "ramp_delay_s": pl.Float64,
    "travel_p50_s": pl.Float64,
    "travel_p95_s": pl.Float64,
    "fallbacks": pl.Int64,
}
"""What a study has of each run beside the totals: of trips, and of all sites together."""
CORRIDOR_RUNS: Schema = {
    "run_id": pl.String,
    **RUN_KEYS,
    "overrides": pl.String,
    "status": pl.String,
    "error": pl.String,
    **TOTAL_KINDS,
    **TRIP_FIGURES,
    "wall_s": pl.Float64,
    "settings": pl.String,
}
"""The columns of ``runs.parquet`` of a corridor's study."""
CORRIDOR_SITES: Schema = {"run_id": pl.String, **SITES}
"""Those of its ``sites.parquet``."""


@dataclass(frozen=True)
class CorridorOutcome:
    """What happened; arrays have one entry a vehicle.

    Those of ``passages`` and ``hand_overs`` have one a row.
    ``trips`` are SUMO's own figures: when each vehicle entered and left (s; nan where it never
    did), how long it waited to enter, drove and lost against its wish, and how far it went.
    ``collided`` are time (s), rear and front vehicle of each pair. ``messages`` has one entry a
    site; it is empty where nobody coordinates. ``most_at_once`` is how many vehicles at most were
    in zones, or seen from them. ``meters`` has one entry an update of a meter, None without any.
    """

    corridor: Corridor
    vehicle_id: tuple[str, ...]
    origin: tuple[str, ...]
    leaves_by: tuple[str | None, ...]
    scheduled_s: FloatArray
    automated: BoolArray
    trips: Mapping[str, FloatArray]
    passages: Mapping[str, FloatArray]
    free_s: FloatArray
    hand_overs: Mapping[str, FloatArray]
    plan_error_m: FloatArray
    collided: tuple[tuple[float, int, int], ...]
    messages: tuple[Mapping[str, int], ...]
    until_s: float
    most_at_once: int
    meters: Mapping[str, Sequence[Any]] | None = None
