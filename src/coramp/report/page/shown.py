"""A run as a page shows it: plain data of where all vehicles are, and why."""

import math
from collections.abc import Iterable, Iterator, Mapping
from typing import Any

import numpy as np
import polars as pl

from coramp.explain.mixed_story import acts_of
from coramp.explain.story import quantities_in, told, tried_in
from coramp.records.run import RunRecords
from coramp.records.schemas import Row
from coramp.records.world_told import HAPPENED
from coramp.report.page.heard_shown import heard_data
from coramp.report.page.lanes_shown import lanes_data
from coramp.report.page.network_shown import shapes_data
from coramp.report.style import look_of
from coramp.runs.running import UNCONTROLLED
from coramp.scenarios.model import Scenario
from coramp.vehicles.traits import CAR
from coramp.worlds.sumo.network import LANE_WIDTH_M, ramp_shape_m, road_plan

PIECE_COLUMNS = ("time_s", "station_m", "speed_mps", "accel_mps2")
DIGITS = (4, 4, 6, 7)
"""Of the columns of pieces: after a minute still within a millimetre of the records."""


def title_of(run: RunRecords) -> str:
    """Returns what the run is called beside others on the same arrivals."""
    return called(run.content["strategy"], run.content["drivers"], run.scenario)


def called(strategy: str, drivers: str | None, scenario: Scenario) -> str:
    """Returns what a strategy is called in a scenario, whose vehicles may be automated alone."""
    if strategy == UNCONTROLLED and scenario.gives_shares and scenario.has_automated:
        return f"automation alone, {drivers} drivers" if scenario.is_mixed else "automation alone"
    return look_of(strategy, drivers).label


def page_data(run: RunRecords) -> Row:
    """Returns what the page's scripts take for one run; times in s, lengths in m.

    ``pieces`` are rows of time, station, speed and acceleration, one after the other; those of
    vehicle i are ``first[i]`` to ``first[i + 1]``. Vehicles are named by their place in ``ids``.
    """
    ids = run.vehicles["vehicle_id"].to_list()
    place_of = {name: place for place, name in enumerate(ids)}
    first, pieces, merge_s = _pieces(run, place_of)
    templates: dict[tuple[str, str, str], int] = {}
    decisions = [_decision(row, run, place_of, templates) for row in _rows(run.decisions)]
    exits_s = run.vehicles["exit_s"].to_list()
    last_s = max([exit_s for exit_s in exits_s if exit_s is not None], default=0.0)
    simulation = run.scenario.simulation
    capped = any(exit_s is None for exit_s in exits_s)
    end_s = simulation.horizon_s + simulation.drain_s if capped else last_s
    return {
        **lanes_data(run, place_of),
        "title": title_of(run),
        "strategy": run.summary["strategy"],
        "drivers": run.summary["drivers"],
        "seed": run.summary["seed"],
        "end_s": end_s,
        "road": road_data(run.scenario),
        "safety": run.scenario.safety.model_dump(mode="json"),
        "ids": ids,
        "on_ramp": [int(stream == "ramp") for stream in run.vehicles["stream"].to_list()],
        "length": _lengths_m(run),
        "type": _types(run),
        "automated": _automated(run),
        "position_error": run.vehicles["positioning_error_m"].to_list(),
        "clock_error": run.vehicles["clock_error_s"].to_list(),
        "time_gap": run.vehicles["time_gap_s"].to_list(),
        "scheduled": _rounded(run.vehicles["scheduled_s"].to_list()),
        "exit": _rounded(exits_s),
        "free": _rounded(run.vehicles["free_flow_s"].to_list()),
        "merge": _rounded(merge_s),
        "first": first,
        "pieces": pieces,
        "decisions": decisions,
        "templates": [list(template) for template in templates],
        "violations": [
            {
                "time": round(row["time_s"], 3),
                "front": place_of[row["front_vehicle_id"]],
                "rear": place_of[row["rear_vehicle_id"]],
                "margin": row["margin_m"],
            }
            for row in _rows(run.violations)
        ],
        "events": _events(run, place_of),
        "heard": heard_data(run, place_of, end_s),
        "acts": acts_of(run),
    }


def road_data(scenario: Scenario) -> Row:
    """Returns the road's shape, as it is built in SUMO; lengths in m, the angle in degrees."""
    _, (bend_m, _), _ = ramp_shape_m(road_plan(scenario))
    lanes = scenario.mainline.lanes
    return {
        **({"lanes": lanes} if lanes > 1 else {}),
        **({} if scenario.network is None else {"shapes": shapes_data(scenario)}),
        "start_m": scenario.mainline.start_m,
        "end_m": scenario.mainline.end_m,
        "ramp_start_m": scenario.ramp.start_m,
        "beside_m": -bend_m,
        "lane_m": scenario.ramp.acceleration_lane_m,
        "lane_width_m": LANE_WIDTH_M,
        "merge_angle_deg": scenario.ramp.merge_angle_deg,
        "decision_m": scenario.decision_station_m,
        "v0_mps": scenario.mainline.speed_mps,
        "ramp_mps": scenario.ramp.speed_mps,
        "free_accel_mps2": scenario.motion.free_acceleration_mps2,
    }


def _rows(frame: pl.DataFrame | None) -> Iterator[Row]:
    return iter(()) if frame is None else frame.iter_rows(named=True)


def _rounded(values: Iterable[float | None]) -> list[float | None]:
    return [None if value is None else round(value, 3) for value in values]


def _pieces(
    run: RunRecords, place_of: dict[str, int]
) -> tuple[list[int], list[float], list[float | None]]:
    """First piece of each vehicle, all pieces, and when each ramp vehicle changed lane."""
    place = run.motion["vehicle_id"].replace_strict(place_of, return_dtype=pl.Int64).to_numpy()
    order = np.argsort(place, kind="stable")
    first = np.searchsorted(place[order], np.arange(len(place_of) + 1))
    columns = [
        np.round(run.motion[name].to_numpy()[order], digits)
        for name, digits in zip(PIECE_COLUMNS, DIGITS, strict=True)
    ]
    merge_s: list[float | None] = [None] * len(place_of)
    changed = run.motion.filter(pl.col("lane") == "mainline").group_by("vehicle_id")
    for name, time_s in changed.agg(pl.col("time_s").min()).iter_rows():
        merge_s[place_of[name]] = time_s
    return first.tolist(), np.column_stack(columns).ravel().tolist(), merge_s


def _lengths_m(run: RunRecords) -> list[float]:
    if "length_m" in run.vehicles.columns:
        return run.vehicles["length_m"].to_list()
    return [run.scenario.usual_length_m] * run.vehicles.height


def _types(run: RunRecords) -> list[str]:
    if "vehicle_type" in run.vehicles.columns:
        return run.vehicles["vehicle_type"].to_list()
    return [CAR] * run.vehicles.height


def _events(run: RunRecords, place_of: Mapping[str, int]) -> list[dict[str, Any]]:
    """What happened by itself, for the time axis of the replay."""
    if run.safety_events is None:
        return []
    own = run.safety_events.filter(pl.col("event").is_in(list(HAPPENED)))
    return [
        {"time": round(time_s, 3), "what": what, "vehicle": place_of[name]}
        for time_s, what, name in own.select("time_s", "event", "rear_vehicle_id").rows()
    ]


def _automated(run: RunRecords) -> list[int] | None:
    """Which vehicles are automated, None where all or none are."""
    if not run.is_mixed:
        return None
    return [int(automated) for automated in run.vehicles["automated"].to_list()]


def _decision(
    row: Row,
    run: RunRecords,
    place_of: dict[str, int],
    templates: dict[tuple[str, str, str], int],
) -> Row:
    found = []
    for quantity in quantities_in(run, row):
        key = (quantity.equation, quantity.symbol, quantity.meaning)
        found.append([templates.setdefault(key, len(templates)), quantity.text()])
    return {
        "time": round(row["time_s"], 3),
        "vehicle": place_of[row["vehicle_id"]],
        "rung": row["rung"],
        "told": told(row, run.scenario.vehicles_differ),
        "adjusted": [place_of[name] for name in row["adjusted_vehicle_ids"] or []],
        "merge_time": _finite(row["merge_time_s"]),
        "merge_station": _finite(row["merge_station_m"]),
        "required_gap": _finite(row["required_gap_m"]),
        "tried": tried_in(run, row),
        "quantities": found,
    }


def _finite(value: float | None) -> float | None:
    return None if value is None or not math.isfinite(value) else round(value, 4)
