"""Speeds in km/h, as scenario files and settings may give them, turned into m/s at the edge."""

from collections.abc import Iterator, Mapping
from typing import Any

from coramp.errors import CorampError
from coramp.road.streams import STREAMS

KMH_PER_MPS = 3.6
KEYS = {
    "speed_kmh": "speed_mps",
    "limit_kmh": "limit_mps",
    "entry_speed_kmh": "entry_speed_mps",
}
"""Each key in km/h with the one in m/s that it stands for."""
LIST = "arrivals"


def data_in_mps(data: Mapping[str, Any], label: str) -> tuple[dict[str, Any], dict[str, str]]:
    """Returns the content of a scenario file with all its speeds in m/s, and what to blame.

    That is by dotted key: the file and the key in km/h. Raises CorampError where both are given.
    """
    result, origins, twice = dict(data), {}, []
    if isinstance(data.get(LIST), list):
        result[LIST] = list(data[LIST])
    for place, table in _tables(data):
        replaced = dict(table)
        for kmh, mps in KEYS.items():
            if kmh not in table:
                continue
            if mps in table:
                twice.append(f"{label}: {_both(f'{place}.{kmh}', f'{place}.{mps}')}")
            value = replaced.pop(kmh)
            replaced[mps] = in_mps(value)
            origins[f"{place}.{mps}"] = f"{label}: {place}.{kmh} = {value}"
        _put(result, place, replaced)
    if twice:
        raise CorampError(*twice)
    return result, origins


def overrides_in_mps(
    overrides: Mapping[str, Any], origins: Mapping[str, str]
) -> tuple[dict[str, Any], dict[str, str]]:
    """Returns dotted keys with all speeds in m/s, and who set each, with the key in km/h if it was.

    Raises CorampError where both are given.
    """
    result: dict[str, Any] = {}
    blamed: dict[str, str] = {}
    for key, value in overrides.items():
        table, _, name = key.rpartition(".")
        if table in STREAMS and name in KEYS:
            mps, origin = f"{table}.{KEYS[name]}", origins.get(key, "")
            if mps in overrides:
                raise CorampError(f"{origin}: {_both(key, mps)}".removeprefix(": "))
            result[mps] = in_mps(value)
            blamed[mps] = f"{origin}: {key} = {value}" if origin else f"{key} = {value}"
        else:
            result[key] = value
            if key in origins:
                blamed[key] = origins[key]
    return result, blamed


def in_mps(value: Any) -> Any:
    """Returns km/h, or a list of them, as m/s; what is no number is left as it is."""
    if isinstance(value, list | tuple):
        return [in_mps(inner) for inner in value]
    number = isinstance(value, int | float) and not isinstance(value, bool)
    return value / KMH_PER_MPS if number else value


def _both(kmh: str, mps: str) -> str:
    return f"{kmh}: stands beside {mps}; allowed is one of the two"


def _tables(data: Mapping[str, Any]) -> Iterator[tuple[str, Mapping[str, Any]]]:
    """The tables that hold speeds, each with its dotted key."""
    for stream in STREAMS:
        if isinstance(data.get(stream), dict):
            yield stream, data[stream]
    listed = data.get(LIST)
    for number, arrival in enumerate(listed if isinstance(listed, list) else ()):
        if isinstance(arrival, dict):
            yield f"{LIST}.{number}", arrival


def _put(data: dict[str, Any], place: str, table: dict[str, Any]) -> None:
    name, _, number = place.partition(".")
    if number:
        data[name][int(number)] = table
    else:
        data[name] = table
