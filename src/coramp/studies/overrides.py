"""What a row of ``runs.parquet`` says was set beside the flows."""

import ast
import re
from typing import Any

from coramp.scenarios.loading import load_scenario

PART = re.compile(r" (?=[a-z][\w.-]*=)")


def overrides_of(run: dict[str, Any]) -> dict[str, Any]:
    """Returns the overrides of a run by key: numbers, lists and names."""
    parts = PART.split(run["overrides"]) if run["overrides"] else []
    return {key: _value(text) for key, _, text in (part.partition("=") for part in parts)}


def _value(text: str) -> Any:
    try:
        value = ast.literal_eval(text)
    except (ValueError, SyntaxError):
        return text
    return float(value) if isinstance(value, int) and not isinstance(value, bool) else value


def setting_of(run: dict[str, Any], key: str) -> Any:
    """Returns what a dotted key of the scenario was in a run, set or not; None if there is none."""
    found = overrides_of(run)
    if key in found:
        return found[key]
    value: Any = load_scenario(run["scenario"]).model_dump()
    for part in key.split("."):
        value = value.get(part) if isinstance(value, dict) else None
    return value
