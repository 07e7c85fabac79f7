"""What a run's folder must hold to be read: files may have been edited, or be of another origin."""

import json
import math
from pathlib import Path
from typing import Any

import polars as pl
from pydantic import ValidationError

from coramp.errors import CorampError
from coramp.records.schemas import (
    ATTEMPTS,
    DECISIONS,
    HEARD,
    ON_BOARD,
    RESULT_VERSION,
    RUN_KEYS,
    RUNS,
    SAFETY_EVENTS,
    SPEEDS,
    TRAJECTORIES,
    TYPES,
    VEHICLES,
    VIOLATIONS,
    Row,
    Schema,
)
from coramp.scenarios.model import Scenario
from coramp.scenarios.plain_data import problem_with

SCHEMAS: dict[str, Schema] = {
    "vehicles": VEHICLES,
    "trajectories": TRAJECTORIES,
    "decisions": DECISIONS,
    "speeds": SPEEDS,
    "positions": TRAJECTORIES,
    "violations": VIOLATIONS,
    "types": TYPES,
    "attempts": ATTEMPTS,
    "safety_events": SAFETY_EVENTS,
    "heard": HEARD,
    "on_board": ON_BOARD,
}
"""The columns of a run's tables."""
_KINDS: dict[Any, tuple[tuple[type, ...], str]] = {
    pl.String: ((str,), "a text"),
    pl.Int64: ((int,), "a whole number"),
    pl.Float64: ((int, float), "a finite number"),
}
_NEVER_NULL = {*RUN_KEYS, "run_id"} - {"drivers"}
_LARGEST_SEED = 2**31 - 1


def checked_content(mark: Path, content: Row) -> Row:
    """Returns what ``run.json`` says; raises CorampError where it cannot be used.

    What older versions had no column for is null.
    """
    problem = problem_with(content) or _problem(content)
    if problem:
        raise CorampError(f"{mark}: {problem}; run again to write it anew")
    summary = {**dict.fromkeys(RUNS), **content["summary"]}
    return {"settings": {}, **content, "summary": summary}


def _problem(content: Row) -> str | None:
    summary, versions = content.get("summary"), content.get("versions")
    if not isinstance(summary, dict):
        return f"summary: {summary!r} is not an object; allowed is one of a run's figures"
    if not isinstance(versions, dict) or not all(isinstance(v, str) for v in versions.values()):
        return "versions: is no list of versions; allowed is an object of texts"
    keys = {**RUN_KEYS, "run_id": pl.String, "overrides": pl.String}
    asked = RUNS if content.get("result_version") == RESULT_VERSION else keys
    return (
        _missing(content, keys, "")
        or _wrong_values(content, keys, "")
        or _missing(summary, asked, "summary.")
        or _wrong_values(summary, RUNS, "summary.")
        or _wrong_settings(content, summary)
        or _wrong_specification(content.get("specification"))
    )


def _missing(values: Row, schema: Schema, within: str) -> str | None:
    lacking = next((key for key in schema if key not in values), None)
    return f"{within}{lacking}: is missing; it must be there" if lacking else None


def _wrong_values(values: Row, schema: Schema, within: str) -> str | None:
    for key, kind in schema.items():
        value, (types, allowed) = values.get(key), _KINDS[kind]
        if value is None and key not in _NEVER_NULL:
            continue
        fits = isinstance(value, types) and not isinstance(value, bool)
        if not fits or (isinstance(value, float) and not math.isfinite(value)):
            return f"{within}{key}: {value!r} cannot be; allowed is {allowed}"
        if key == "seed" and not 0 <= int(value or 0) <= _LARGEST_SEED:
            return f"{within}{key}: {value} is out of range; allowed is 0 to {_LARGEST_SEED}"
    return None


def _wrong_settings(content: Row, summary: Row) -> str | None:
    if not isinstance(content.get("settings", {}), dict):
        return f"settings: {content['settings']!r} is not an object; allowed is one of dotted keys"
    try:
        found = json.loads(summary.get("settings") or "{}")
    except (ValueError, RecursionError):
        found = None
    if not isinstance(found, dict):
        return "summary.settings: is not the JSON of an object; allowed is one of dotted keys"
    return None


def _wrong_specification(specification: Any) -> str | None:
    try:
        Scenario.model_validate(specification, strict=False)
    except (ValidationError, CorampError) as error:
        return f"specification: is no valid scenario ({first_of(error)})"
    return None


def first_of(error: Exception) -> str:
    """What a validation says first, without its heading, in one line."""
    lines = str(error).splitlines()
    return " ".join(" ".join(lines[1:3] or lines).split())


def checked_frame(path: Path, frame: pl.DataFrame, schema: Schema) -> pl.DataFrame:
    """Returns a table; raises CorampError where a column is missing or of another kind."""
    for column, kind in schema.items():
        found = frame.schema.get(column)
        if found is None:
            raise CorampError(
                f"{path}: has no column {column}: it was edited, or an older coramp wrote it; run "
                "again"
            )
        if found not in (kind, pl.Null):
            raise CorampError(f"{path}: {column} holds {found}; allowed is {kind}; run again")
    return frame
