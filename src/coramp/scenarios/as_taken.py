"""A scenario of one's own as it is taken: every key, and which of them were chosen for it."""

import json
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

from coramp.scenarios.checks import decision_station_range_m
from coramp.scenarios.defaults import ENTRY_RATIOS, LIMIT_RATIO, populations
from coramp.scenarios.loading import load_scenario
from coramp.scenarios.model import Scenario
from coramp.scenarios.speeds_kmh import KMH_PER_MPS, data_in_mps
from coramp.scenarios.toml_files import override_text, read
from coramp.scenarios.world_sections import PRESETS, Section
from coramp.scenarios.world_sections import TABLES as OF_THE_WORLD

STATIONS = ("decision_station_m", "stop_station_m", "detector_station_m", "signal_station_m")
TABLES = ("mainline", "ramp", "vehicle", "safety", "motion", "control", "simulation", "traffic")
NETWORK = "network"
SHARES = ("mainline_automated_share", "ramp_automated_share")
FOLLOWS, DEFAULT = "follows from", "default"
SOURCES = {
    "ramp.decision_station_m": "start_m",
    "ramp.stop_station_m": "the speeds and the acceleration lane",
    "ramp.detector_station_m": "acceleration_lane_m",
    "ramp.signal_station_m": "start_m",
    **{f"traffic.{key}": "automated_share, 1 where that is left out" for key in SHARES},
    "motion.slow_deviation": "speed_deviation, the gaps and the mainline's speed",
    **{f"{s}.limit_mps": f"speed_mps ({ratio:g} times)" for s, ratio in LIMIT_RATIO.items()},
    **{
        f"{s}.entry_speed_mps": f"speed_mps ({low:g} to {high:g} times) and limit_mps"
        for s, (low, high) in ENTRY_RATIOS.items()
    },
}
"""Of keys that follow from others: from which."""
HEAD = (
    "# {name} as coramp takes it. A line without a comment is given in the file;",
    "# a default is a constant of coramp. A line that begins with # follows from others:",
    "# left out of a file it changes with them, written in it it stays.",
)


class Taken(NamedTuple):
    """A key of a scenario as it is taken: its value, and why where the file does not give it."""

    key: str
    value: Any
    why: str | None


def taken(name: str) -> tuple[Scenario, list[Taken]]:
    """Returns the scenario of a file, and every key of its tables that hold one value each.

    Raises CorampError where the file is not valid.
    """
    scenario = load_scenario(name)
    data, _ = data_in_mps(read("scenarios", name)[1], name)
    chosen = PRESETS[scenario.world.preset] if scenario.world.preset else {}
    return scenario, [*_keys(scenario, data), *_keys_of_world(scenario, data, chosen)]


def _keys(scenario: Scenario, data: Mapping[str, Any]) -> Iterator[Taken]:
    for table in TABLES if scenario.network is None else (NETWORK, *TABLES):
        given = data.get(table, {})
        model = getattr(scenario, table)
        for key, field in type(model).model_fields.items():
            value = getattr(model, key)
            if key in given:
                why = None
            elif table == "ramp" and key in STATIONS:
                value, why = getattr(scenario, key), _why_there(scenario, key)
            elif f"{table}.{key}" == "motion.slow_deviation":
                value, why = scenario.slow_deviation, _from(f"{table}.{key}")
            elif table == "traffic" and key in SHARES:
                value, why = scenario.traffic.share_of(key == SHARES[1]), _from(f"traffic.{key}")
            elif value is None:
                continue
            elif key == "flow_veh_h":
                why = "of the list of arrivals"
            else:
                why = _from(f"{table}.{key}") if field.is_required() else DEFAULT
            yield Taken(f"{table}.{key}", value, why)


def _keys_of_world(
    scenario: Scenario, data: Mapping[str, Any], chosen: Mapping[str, Any]
) -> Iterator[Taken]:
    """Every key of a table that is not off, and where a preset gave it, that it did."""
    preset = scenario.world.preset
    for table in OF_THE_WORLD:
        model: Section = getattr(scenario, table)
        if model.is_perfect and table not in data:
            continue
        for key, value in model.model_dump().items():
            if value is None:
                continue
            why = DEFAULT if value == type(model).model_fields[key].default else None
            if key in data.get(table, {}):
                why = None
            elif key in chosen.get(table, {}):
                why = f"{FOLLOWS} world.preset {preset}"
            yield Taken(f"{table}.{key}", value, why)


def _why_there(scenario: Scenario, key: str) -> str:
    if key != "decision_station_m" or not scenario.has_one_lane:
        return _from(f"ramp.{key}")
    first_m, last_m = decision_station_range_m(scenario)
    return f"{FOLLOWS} the range that is possible, {first_m:.1f} to {last_m:.1f}"


def _from(key: str) -> str:
    return f"{FOLLOWS} {SOURCES[key]}"


def as_toml(name: str) -> str:
    """Returns a scenario of one's own with all that was chosen for it, as TOML with comments.

    What follows from other keys stands in comments, so that it still does in a copy.
    Populations of drivers that every scenario has are named only, and so are listed arrivals.
    """
    scenario, keys = taken(name)
    lines = [
        *(line.format(name=name) for line in HEAD),
        f"name = {_text(scenario.name)}",
    ]
    if scenario.description:
        lines.append(f"description = {_text(scenario.description)}")
    table = ""
    for key, value, why in keys:
        here, _, plain = key.partition(".")
        if here != table:
            table = here
            lines += ["", f"[{table}]"]
        notes = [note for note in (_in_kmh(plain, value), why) if note]
        follows = why is not None and why.startswith(FOLLOWS)
        commented = "# " if follows or (plain == "flow_veh_h" and scenario.arrivals) else ""
        comment = f"  # {', '.join(notes)}" if notes else ""
        lines.append(f"{commented}{plain} = {_text(value)}{comment}")
    common = [n for n in scenario.drivers if n in populations()]
    own = [n for n in scenario.drivers if n not in populations()]
    lines += ["", "# Drivers that every scenario has; coramp scenarios paper shows them:"]
    lines += [f"#   {name}" for name in common]
    if own:
        lines.append(f"# drivers of its own: {', '.join(own)}")
    if scenario.arrivals:
        lines.append(f"# [[arrivals]]: {len(scenario.arrivals)} vehicles, listed in the file")
    return "\n".join(lines) + "\n"


def _in_kmh(key: str, value: Any) -> str:
    if not key.endswith("_mps"):
        return ""
    values = value if isinstance(value, tuple) else (value,)
    return f"{' to '.join(f'{v * KMH_PER_MPS:.4g}' for v in values)} km/h"


def _text(value: Any) -> str:
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False)  # quotes that override_text may leave out
    return override_text("", value).removeprefix("=")
