"""A new scenario whose demand is a file of counts."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import polars as pl

from coramp.counts.reading import read_counts
from coramp.counts.table import CAR, Counts, Repair
from coramp.errors import CorampError
from coramp.road.streams import STREAMS
from coramp.scenarios.listed import FLOWS, LIST
from coramp.scenarios.measured import COUNTS, DEMAND, DETECTORS, KNOWN_AS, digest_of
from coramp.scenarios.speeds_kmh import data_in_mps
from coramp.scenarios.toml_files import read
from coramp.scenarios.vehicle_types import BUILT_IN

FROM_ENTRY_M, MOST_OF_ROAD = 50.0, 0.25
"""So far behind the entry a detector is taken to be where nothing is said, on a short road less."""
BY_LANE_M = 1.0
"""So far where each of several lanes was counted."""
SIMULATION, HORIZON = "simulation", "horizon_s"
NOT_TAKEN = ("name", "description", LIST, DEMAND, COUNTS, DETECTORS, "drivers")
"""What a new scenario does not take over from the one whose road it has."""


@dataclass(frozen=True)
class CountsChoice:
    """What demand is to be: a file, its detectors, where they are, and of which types classes are.

    ``stations_m`` are stations by detector; those that are neither the mainline's nor the ramp's
    lie on the mainline.
    """

    file: Path
    mainline: str
    ramp: str
    stations_m: Mapping[str, float] = field(default_factory=dict)
    classes: Mapping[str, str] = field(default_factory=dict)
    repair: bool = False


def stations_of(texts: list[str]) -> dict[str, float]:
    """Returns stations (m) by detector, of texts ``ID=STATION``; raises CorampError for others."""
    found: dict[str, float] = {}
    for text in texts:
        name, _, station = text.rpartition("=")
        try:
            station_m = float(station)
        except ValueError:
            station_m = math.nan
        if not name or not math.isfinite(station_m):
            raise CorampError(
                f"--detector: {text}: is not ID=STATION; allowed are metres from the nose, "
                "as in M=-350"
            )
        if name in found:
            raise CorampError(f"--detector: {name} is given twice; allowed is once")
        found[name] = station_m
    return found


def classes_of(texts: list[str]) -> dict[str, str]:
    """Returns types by class, of texts ``CLASS=TYPE``; raises CorampError for others."""
    found: dict[str, str] = {}
    for text in texts:
        name, _, kind = text.partition("=")
        if not name or kind not in BUILT_IN:
            known = ", ".join(BUILT_IN)
            raise CorampError(f"--class: {text}: is not CLASS=TYPE; allowed types are {known}")
        found[name] = kind
    return found


def road_of(scenario: str) -> dict[str, Any]:
    """Returns the content of a scenario without its demand and its name, for another one."""
    label, data = read("scenarios", scenario)
    data, _ = data_in_mps(data, label)
    kept = {key: value for key, value in data.items() if key not in NOT_TAKEN}
    kept["description"] = f"the road of {scenario}"
    return kept


def with_counts_tables(
    data: Mapping[str, Any], choice: CountsChoice, beside: Path
) -> tuple[dict[str, Any], tuple[Repair, ...]]:
    """Returns the content of a scenario with tables for counts in place of flows, and all repairs.

    The file's path counts from the folder ``beside`` where it lies inside. Types of vehicles are
    those that were counted, with their shares. Raises CorampError where the counts do not add up or
    have no such detectors.
    """
    lanes = data["mainline"].get("lanes", 1)
    counts = read_counts(choice.file, choice.repair, lanes)
    for stream in STREAMS:
        option, detector = f"--{stream}-detector", getattr(choice, stream)
        if not counts.has(detector):
            known = ", ".join(counts.detectors)
            raise CorampError(
                f"{option}: {choice.file} has no detector {detector!r}; allowed are {known}"
            )
    _check_choice(data, choice, counts)
    result = {key: value for key, value in data.items() if key not in (*FLOWS, DEMAND)}
    for stream in STREAMS:
        result[stream] = {key: v for key, v in data[stream].items() if key not in FLOWS}
    simulation = {k: v for k, v in data.get(SIMULATION, {}).items() if k != HORIZON}
    result.pop(SIMULATION, None)
    if simulation:
        result[SIMULATION] = simulation
    result[COUNTS] = {
        "file": path_from(choice.file, beside),
        "sha256": digest_of(choice.file),
        **{stream: getattr(choice, stream) for stream in STREAMS},
    }
    if choice.classes:
        result[COUNTS]["classes"] = dict(choice.classes)
    if choice.repair:
        result[COUNTS]["repair"] = True
    if types := _types(counts, choice):
        result["vehicle"] = types
    result[DETECTORS] = _detectors(data, choice, counts)
    return result, counts.repairs


def _check_choice(data: Mapping[str, Any], choice: CountsChoice, counts: Counts) -> None:
    """Raises CorampError for detectors that cannot be where they are said to be, and others."""
    if choice.mainline == choice.ramp:
        raise CorampError(
            f"--ramp-detector: {choice.ramp} is the --mainline-detector; allowed is another one"
        )
    for stream in STREAMS:
        detector = getattr(choice, stream)
        station_m, start_m = choice.stations_m.get(detector), data[stream]["start_m"]
        if station_m is not None and not start_m < station_m <= 0.0:
            why = " upstream of the nose" if station_m > 0.0 else ""
            raise CorampError(
                f"--detector: {detector}={station_m:g}: is not on the {stream}{why}; "
                f"allowed is above {start_m:g} to 0 m"
            )
    if unknown := [name for name in choice.classes if name not in counts.classes]:
        raise CorampError(
            f"--class: {choice.file} has no class {unknown[0]!r}; "
            f"allowed are {', '.join(counts.classes)}"
        )


def path_from(file: Path, beside: Path) -> str:
    """Returns the path of a file from a folder where it lies inside, else the whole path."""
    whole, folder = file.absolute(), beside.absolute()
    return str(whole.relative_to(folder)) if whole.is_relative_to(folder) else str(whole)


def _types(counts: Counts, choice: CountsChoice) -> list[dict[str, Any]]:
    """The types that were counted, with their shares; none where all are cars."""
    shares: dict[str, dict[str, float]] = {}
    for stream in STREAMS:
        rows = counts.at(getattr(choice, stream))
        total = int(rows["vehicles"].sum())
        for name in rows["vehicle_class"].unique(maintain_order=True):
            kind = _type_of(name, choice)
            seen = int(rows.filter(pl.col("vehicle_class") == name)["vehicles"].sum())
            of_type = shares.setdefault(kind, dict.fromkeys(STREAMS, 0.0))
            of_type[stream] += seen / total if total else float(kind == CAR)
    if set(shares) == {CAR}:
        return []
    cars = shares.setdefault(CAR, dict.fromkeys(STREAMS, 0.0))
    for stream in STREAMS:  # whatever rounding leaves is the cars'
        others = (round(s[stream], 4) for kind, s in shares.items() if kind != CAR)
        cars[stream] = round(1.0 - sum(others), 4)
    return [
        {"name": kind, **{f"{stream}_share": round(shares[kind][stream], 4) for stream in STREAMS}}
        for kind in sorted(shares, key=list(BUILT_IN).index)
    ]


def _type_of(name: str, choice: CountsChoice) -> str:
    kind = choice.classes.get(name, name)
    kind = kind if kind in BUILT_IN else KNOWN_AS.get(kind.lower(), kind)
    if kind not in BUILT_IN:
        raise CorampError(
            f"{choice.file}: class {name!r} is no type that is built in; allowed are "
            f"{', '.join(BUILT_IN)}: say by --class {name}=TYPE which one it is of"
        )
    return kind


def _detectors(
    data: Mapping[str, Any], choice: CountsChoice, counts: Counts
) -> list[dict[str, Any]]:
    own = {choice.mainline: STREAMS[0], choice.ramp: STREAMS[1]}
    roads = {**own, **{name: STREAMS[0] for name in choice.stations_m if name not in own}}
    return [
        {
            "id": name,
            "road": road,
            "station_m": choice.stations_m.get(name, _near_entry_m(data[road], counts.at(name))),
            "period_s": counts.interval_s,
        }
        for name, road in roads.items()
    ]


def _near_entry_m(road: Mapping[str, Any], counted: pl.DataFrame) -> float:
    """Where a detector is taken to be; of several lanes, nobody is to change them before it."""
    start_m = road["start_m"]
    by_lane = counted["lane"].n_unique() > 1
    behind_m = BY_LANE_M if by_lane else min(FROM_ENTRY_M, MOST_OF_ROAD * -start_m)
    return float(round(start_m + behind_m, 3))
