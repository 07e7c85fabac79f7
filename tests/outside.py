"""An outside checker: what SUMO wrote and the scenario's numbers, and nothing of coramp's code."""

import json
import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import polars as pl

POSITION_ROUNDING_M = 2e-4  # SUMO writes four decimals
JUNCTION_M = 2.5e-3  # two junctions of 1 mm, which an outsider does not know of, and rounding


@dataclass(frozen=True)
class Outside:
    """What an outsider finds."""

    vehicles: int
    smallest_gap_m: float
    smallest_margin_m: float  # over Eq. 1, any two that follow each other in a lane, any step
    smallest_merge_margin_m: float  # over Eq. 15, 16, at the first step after a lane change
    last_merge_station_m: float
    delays_s: dict[str, float]


def examine(folder: Path) -> Outside:
    """Returns what ``sumo/fcd.parquet`` of a run says, with scheduled times of the vehicles."""
    spec = json.loads((folder / "run.json").read_text())["specification"]
    vehicles = pl.read_parquet(folder / "vehicles.parquet")
    fcd = _positions(folder, spec)
    fronts = fcd.with_columns(
        pl.col("station_m", "speed_mps", "length_m", "vehicle_id")
        .shift(-1)
        .over("time_s", "lane", order_by="station_m")
        .name.prefix("front_")
    ).drop_nulls("front_station_m")
    gap_m = (fronts["front_station_m"] - fronts["front_length_m"] - fronts["station_m"]).to_numpy()
    needed_m = _eq_1(fronts["front_speed_mps"].to_numpy(), fronts["speed_mps"].to_numpy(), spec)
    merges = _merges(fcd.filter(pl.col("lane") < 1), spec)
    return Outside(
        fcd["vehicle_id"].n_unique(),
        float(gap_m.min(initial=math.inf)),
        float((gap_m - needed_m).min(initial=math.inf)),
        min((margin for margin, _ in merges), default=math.inf),
        max((station for _, station in merges), default=0.0),
        _delays(fcd, vehicles, spec),
    )


def _positions(folder: Path, spec: dict) -> pl.DataFrame:
    starts_m = {
        "ramp": spec["ramp"]["start_m"],
        "mainline": spec["mainline"]["start_m"],
        "merge": 0.0,
        "downstream": spec["ramp"]["acceleration_lane_m"],
    }
    lengths_m = {a["id"]: a["length_m"] for a in _lengths(folder)}
    return (
        pl.read_parquet(folder / "sumo" / "fcd.parquet")
        .drop_nulls("vehicle_id")
        .filter(~pl.col("vehicle_lane").str.starts_with(":"))
        .select(
            "vehicle_id",
            time_s="timestep_time",
            lane=_lane(),
            station_m=pl.col("vehicle_lane")
            .str.replace(r"_\d+$", "")
            .replace_strict(starts_m, return_dtype=pl.Float64)
            + pl.col("vehicle_pos"),
            speed_mps="vehicle_speed",
            length_m=pl.col("vehicle_id").replace_strict(lengths_m, return_dtype=pl.Float64),
        )
    )


def _lane() -> pl.Expr:
    """The mainline's lane, 0 next to the ramp; -1 on the ramp and the acceleration lane."""
    edge = pl.col("vehicle_lane").str.replace(r"_\d+$", "")
    index = pl.col("vehicle_lane").str.extract(r"_(\d+)$").cast(pl.Int64)
    return index - edge.is_in(["ramp", "merge"]).cast(pl.Int64)


def changes(folder: Path) -> list[tuple[str, int, int, float]]:
    """Returns who changed lanes, from which to which, and when it was first seen there (s)."""
    spec = json.loads((folder / "run.json").read_text())["specification"]
    fcd = _positions(folder, spec).sort("vehicle_id", "time_s")
    before = fcd.select(pl.col("vehicle_id", "lane").shift(1).name.prefix("from_"))
    rows = fcd.hstack(before).filter(
        pl.col("vehicle_id") == pl.col("from_vehicle_id"), pl.col("lane") != pl.col("from_lane")
    )
    return list(rows.select("vehicle_id", "from_lane", "lane", "time_s").iter_rows())


def _lengths(folder: Path) -> list[dict]:
    import xml.etree.ElementTree as ET

    root = ET.parse(folder / "sumo" / "routes.rou.xml").getroot()
    of_type = {t.get("id"): float(t.get("length")) for t in root.iter("vType")}
    return [{"id": v.get("id"), "length_m": of_type[v.get("type")]} for v in root.iter("vehicle")]


def _eq_1(front_mps: np.ndarray, rear_mps: np.ndarray, spec: dict) -> np.ndarray:
    safety = spec["safety"]
    friction = safety["adhesion"] + safety["resistance"]
    closing_km_h = 3.6 * np.maximum(0.0, rear_mps - front_mps)
    return (
        2 * safety["positioning_error_m"]
        + safety["clock_error_s"] * (front_mps + rear_mps)
        + closing_km_h**2 / (254 * friction)
        + safety["time_gap_s"] * rear_mps
        + safety["standstill_gap_m"]
    )


def _merges(fcd: pl.DataFrame, spec: dict) -> list[tuple[float, float]]:
    """Margin and station of each ramp vehicle at its first step on the outermost lane."""
    safety = spec["safety"]
    friction = safety["adhesion"] + safety["resistance"]
    along = math.cos(math.radians(spec["ramp"]["merge_angle_deg"]))
    on_mainline = fcd.filter(pl.col("lane") == 0)
    at = {time: group for (time,), group in on_mainline.group_by("time_s")}
    found = []
    merged = on_mainline.filter(pl.col("vehicle_id").str.starts_with("r"))
    for row in merged.sort("time_s").unique("vehicle_id", keep="first").iter_rows(named=True):
        worst = math.inf
        for other in at[row["time_s"]].iter_rows(named=True):
            if other["vehicle_id"] == row["vehicle_id"]:
                continue
            front, rear = sorted((row, other), key=lambda v: -v["station_m"])
            gap_m = front["station_m"] - front["length_m"] - rear["station_m"]
            difference_km_h = 3.6 * (row["speed_mps"] * along - other["speed_mps"])
            needed_m = 2 * safety["positioning_error_m"] + difference_km_h**2 / (254 * friction)
            worst = min(worst, gap_m - needed_m)
        found.append((worst, row["station_m"]))
    return found


def _delays(fcd: pl.DataFrame, vehicles: pl.DataFrame, spec: dict) -> dict[str, float]:
    """Mean delay by stream: the last sample is run on to the zone's end."""
    mainline, ramp = spec["mainline"], spec["ramp"]
    v0, ramp_mps = mainline["speed_mps"], ramp["speed_mps"]
    free_mps2 = spec["motion"]["free_acceleration_mps2"]
    lane_m = (v0**2 - ramp_mps**2) / (2 * free_mps2)
    free_flow_s = {
        "mainline": (mainline["end_m"] - mainline["start_m"]) / v0,
        "ramp": -ramp["start_m"] / ramp_mps
        + (v0 - ramp_mps) / free_mps2
        + (mainline["end_m"] - lane_m) / v0,
    }
    last = fcd.sort("time_s").unique("vehicle_id", keep="last", maintain_order=True)
    joined = vehicles.join(last, on="vehicle_id")
    exit_s = joined["time_s"] + (mainline["end_m"] - joined["station_m"]) / joined["speed_mps"]
    delay_s = exit_s - joined["scheduled_s"] - joined["stream"].replace_strict(free_flow_s)
    table = pl.DataFrame({"stream": joined["stream"], "delay_s": delay_s})
    return dict(table.group_by("stream").mean().iter_rows())
