"""Studies small enough for tests, and rows of runs made by hand."""

import json
import re

import polars as pl

from coramp.records.schemas import MEASURED, RUN_METRICS, RUNS
from coramp.scenarios.toml_files import parse_overrides

GRID = """
name = "grid"
description = "Small."
scenario = "paper"
seeds = 2
horizon_s = 20.0

[[runs]]
strategies = ["mainline-priority", "uncontrolled"]
drivers = ["paper", "fair"]
mainline_veh_h = [800.0]
ramp_veh_h = [500.0]
"""


def written(folder, text=GRID, name="s.toml"):
    """Writes a study and returns its path as text."""
    path = folder / name
    path.write_text(text)
    return str(path)


def run_row(
    strategy="mainline-priority", mainline=800.0, ramp=200.0, seed=1, drivers=None, **figures
):
    """Returns a whole row of ``runs.parquet`` with some figures given and the others null."""
    metrics = dict.fromkeys(RUN_METRICS)
    for name, kind in RUN_METRICS.items():
        if kind == pl.Int64:
            metrics[name] = 0
    if strategy == "uncontrolled" and drivers is None:
        drivers = "fair"
    return {
        "run_id": f"{strategy}-{drivers}-{mainline}-{ramp}-{seed}",
        "scenario": "paper",
        "drivers": drivers,
        "strategy": strategy,
        "engine": "sumo",
        "mainline_veh_h": mainline,
        "ramp_veh_h": ramp,
        "seed": seed,
        "overrides": None,
        "status": "ok",
        "error": None,
        **metrics,
        "wall_s": 1.0,
        "settings": settings_of(figures.get("overrides")),
        **figures,
    }


def settings_of(overrides):
    """Returns the column ``settings`` of a row whose column ``overrides`` is this text."""
    if overrides is None:
        return None
    pairs = (part.split("=", 1) for part in re.split(r" (?=[a-z][\w.-]*=)", overrides))
    return json.dumps(dict(parse_overrides([f"{key}={value}"]).popitem() for key, value in pairs))


def overridden(row, overrides):
    """Returns a row in which this was set."""
    return {**row, "overrides": overrides, "settings": settings_of(overrides)}


def runs_of(*rows):
    """Returns rows as the table of a study."""
    return pl.DataFrame(list(rows), schema=RUNS, orient="row")


def apart_from_time(frame):
    """Returns a table of runs without the time that they took."""
    return frame.drop(MEASURED)
