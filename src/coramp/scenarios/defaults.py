"""What a scenario file may leave out because it follows from the rest: all but road and flows."""

from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any, TypeGuard

from coramp.road.streams import STREAMS
from coramp.scenarios.toml_files import read

LIMIT_RATIO = {"mainline": 1.0, "ramp": 1.1}
"""A limit over the stream's speed, unless its entry speeds are higher."""
ENTRY_RATIOS = {"mainline": (0.9, 1.0), "ramp": (0.9, 1.1)}
"""Lowest and highest entry speed over the stream's speed, within its limit: as on a motorway."""
POPULATIONS_OF = "paper"
"""The built-in scenario whose populations of drivers every scenario has."""
DERIVED = frozenset(
    {"name", *(f"{s}.{k}" for s in STREAMS for k in ("limit_mps", "entry_speed_mps"))}
)
"""Keys that are chosen here where they are left out."""


def with_defaults(data: Mapping[str, Any], label: str) -> dict[str, Any]:
    """Returns the content of a scenario file with what it leaves out and follows from the rest.

    ``label`` is the file, whose name is the scenario's where it gives none. Numbers in SI; what is
    not valid is left to the scenario's checks.
    """
    result = {"name": Path(label).stem, **data}
    for stream in STREAMS:
        if isinstance(data.get(stream), dict):
            result[stream] = _with_speeds(data[stream], stream)
    return result


def with_populations(data: Mapping[str, Any]) -> dict[str, Any]:
    """Returns the content of a scenario file with the populations that every scenario has."""
    own = data.get("drivers", {})
    if not isinstance(own, dict):
        return dict(data)
    return {**data, "drivers": {**own, **{k: v for k, v in populations().items() if k not in own}}}


@cache
def populations() -> dict[str, Any]:
    """Returns the populations of drivers that every scenario has."""
    found: dict[str, Any] = read("scenarios", POPULATIONS_OF)[1]["drivers"]
    return found


def _with_speeds(table: Mapping[str, Any], stream: str) -> dict[str, Any]:
    speed, entry, limit = (table.get(k) for k in ("speed_mps", "entry_speed_mps", "limit_mps"))
    result = dict(table)
    if not _is_number(speed):
        return result
    if limit is None:
        given = entry if isinstance(entry, list | tuple) else ()
        highest = max((v for v in given if _is_number(v)), default=0.0)
        limit = result["limit_mps"] = max(LIMIT_RATIO[stream] * speed, highest)
    if entry is None and _is_number(limit):
        low, high = ENTRY_RATIOS[stream]
        result["entry_speed_mps"] = [low * speed, min(high * speed, limit)]
    return result


def _is_number(value: Any) -> TypeGuard[float]:
    return isinstance(value, int | float) and not isinstance(value, bool)
