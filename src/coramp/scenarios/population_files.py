"""Populations of drivers in files of their own, as ``coramp calibrate`` writes them.

A file has one table ``[drivers.NAME]``, with the keys of a scenario's, and may have a table
``[provenance]``, which nobody reads.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from coramp.errors import CorampError
from coramp.scenarios.sections import DriverPopulation
from coramp.scenarios.toml_files import builtin_names, read, validated

ENDING = ".toml"
KEYS = ("drivers", "provenance")


def is_population_file(drivers: Any) -> bool:
    """Returns whether what names drivers is a file, and not a population of the scenario."""
    return isinstance(drivers, str) and drivers.endswith(ENDING)


def read_population(path: str) -> tuple[str, dict[str, Any]]:
    """Returns name and table of the population in a file.

    Raises CorampError where the file cannot be read, or holds no population or several.
    """
    if not Path(path).is_file():
        raise CorampError(
            f"drivers: {path}: no such file; allowed is a file that coramp calibrate --out has "
            "written, or a name"
        )
    label, data = read("scenarios", path)
    found = data.get("drivers")
    unknown = [key for key in data if key not in KEYS]
    if not isinstance(found, dict) or len(found) != 1 or unknown:
        raise CorampError(
            f"{label}: holds no population of drivers; allowed are one table [drivers.NAME], and "
            "[provenance]"
        )
    ((name, table),) = found.items()
    if not isinstance(table, dict):
        raise CorampError(f"{label}: drivers.{name}: is no table; allowed is [drivers.NAME]")
    validated(DriverPopulation, table, f"{label}: drivers.{name}")
    return name, table


def with_population(data: Mapping[str, Any], name: str, table: Mapping[str, Any]) -> dict[str, Any]:
    """Returns the content of a scenario with one more population, in place of one of its name."""
    own = data.get("drivers", {})
    return {**data, "drivers": {**own, name: table}} if isinstance(own, dict) else dict(data)


def with_population_of_traffic(
    data: Mapping[str, Any], scenario: str, from_option: bool
) -> dict[str, Any]:
    """Returns the content of a scenario whose ``traffic.drivers`` may be a file, with that.

    The path of a file counts from the folder of the scenario's, or from the current one if an
    option gave it.
    """
    traffic = data.get("traffic")
    if not isinstance(traffic, dict) or not is_population_file(traffic.get("drivers")):
        return dict(data)
    path = str(traffic["drivers"])
    if not from_option and scenario not in builtin_names("scenarios"):
        path = str(Path(scenario).parent / path)
    name, table = read_population(path)
    return {**with_population(data, name, table), "traffic": {**traffic, "drivers": name}}
