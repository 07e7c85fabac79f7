"""What was set beside the flows in a row of ``runs.parquet``."""

import json
from collections.abc import Mapping
from typing import Any

import polars as pl

from coramp.scenarios.loading import load_scenario


def overrides_of(run: Mapping[str, Any]) -> dict[str, Any]:
    """Returns the overrides of a run by dotted key; numbers as floats, as scenarios have them."""
    found: dict[str, Any] = json.loads(run["settings"] or "{}")
    return {key: _as_float(value) for key, value in found.items()}


def keys_set(runs: pl.DataFrame) -> list[str]:
    """Returns the dotted keys that any run of ``runs.parquet`` sets, in order."""
    return sorted({key for row in runs.iter_rows(named=True) for key in overrides_of(row)})


def _as_float(value: Any) -> Any:
    return float(value) if isinstance(value, int) and not isinstance(value, bool) else value


def scenario_value(scenario: Mapping[str, Any], key: str) -> Any:
    """Returns the value of a dotted key in the content of a scenario; None if there is none."""
    value: Any = scenario
    for part in key.split("."):
        value = value.get(part) if isinstance(value, Mapping) else None
    return value


def setting_of(run: Mapping[str, Any], key: str) -> Any:
    """Returns what a dotted key of the scenario was in a run, set or not; None if there is none."""
    found = overrides_of(run)
    if key in found:
        return found[key]
    return scenario_value(load_scenario(run["scenario"]).model_dump(), key)
