"""Demand as measured: from a file of counts to the demand of a scenario."""

import hashlib
from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any

import polars as pl

from coramp.counts.reading import read_counts
from coramp.counts.table import CAR, TRUCK, Counts
from coramp.errors import CorampError
from coramp.road.streams import STREAMS
from coramp.scenarios.demand_sections import CountsFile, Table
from coramp.scenarios.toml_files import validated

COUNTS, DEMAND, DETECTORS = "counts", "demand", "detector"
FILE = "counts.file"
KNOWN_AS = {
    "passenger": CAR,
    "pkw": CAR,
    "lkw": TRUCK,
    "hgv": TRUCK,
    "heavy": TRUCK,
    "trailer": TRUCK,
}
"""Classes of detectors by another name, and the built-in type that they are of."""


class _OnlyCounts(Table):
    """The table of counts alone, for errors that name its keys in full."""

    counts: CountsFile


def gives_counts(data: Mapping[str, Any]) -> bool:
    """Returns whether the content of a scenario file refers to counts."""
    return COUNTS in data


def with_counts(data: Mapping[str, Any], label: str, origins: Mapping[str, str]) -> dict[str, Any]:
    """Returns the data with the demand that its file of counts amounts to, and the file's hash.

    ``label`` is the scenario's file; ``origins`` says who set a dotted key. Raises CorampError
    where the counts cannot be read, do not add up or are not those of the hash.
    """
    if not gives_counts(data):
        return dict(data)
    blamed = origins.get(FILE, label)
    if data.get(DEMAND):
        raise CorampError(f"{blamed}: demand: beside [counts]; allowed is one of the two")
    source = validated(_OnlyCounts, {COUNTS: data[COUNTS]}, label, origins).counts
    path = Path(source.file) if FILE in origins else Path(label).parent / source.file
    digest = digest_of(path)
    if source.sha256 not in (None, digest):
        raise CorampError(
            f"{blamed}: counts.sha256: {path} has changed since: its hash is {digest}; "
            f"allowed is {source.sha256}, or a new scenario by coramp new-scenario"
        )
    counts = _read(path, digest, source, _lanes_of(data))
    parts = demand_of(counts, source, _types_of(data), _stations(data), _lanes_of(data), blamed)
    return {**data, COUNTS: {**data[COUNTS], "sha256": digest}, DEMAND: parts}


def digest_of(path: Path) -> str:
    """Returns the hash of a file; raises CorampError where it cannot be read."""
    try:
        return hashlib.sha256(path.read_bytes()).hexdigest()
    except OSError as error:
        raise CorampError(
            f"{path}: cannot be read: {error.strerror}; allowed is a file of counts"
        ) from error


def _lanes_of(data: Mapping[str, Any]) -> int:
    """How many lanes the mainline has; what is not valid is told later."""
    mainline = data.get("mainline")
    lanes = mainline.get("lanes", 1) if isinstance(mainline, Mapping) else 1
    return lanes if isinstance(lanes, int) else 1


def _read(path: Path, digest: str, source: CountsFile, lanes: int) -> Counts:
    upstream = (source.mainline, source.ramp)
    return _read_once(str(path), digest, source.repair, upstream, source.downstream, lanes)


@lru_cache(maxsize=8)
def _read_once(
    path: str,
    _digest: str,
    repair: bool,
    upstream: tuple[str, str],
    downstream: str | None,
    lanes: int,
) -> Counts:
    """Reads a file once, however many runs of a study refer to it."""
    return read_counts(path, repair, lanes, upstream=upstream, downstream=downstream)


def demand_of(
    counts: Counts,
    source: CountsFile,
    types: list[str],
    stations_m: Mapping[str, float],
    lanes: int,
    blamed: str,
) -> list[dict[str, Any]]:
    """Returns the parts of demand that counts amount to, as tables of a scenario file.

    ``types`` are the names of the scenario's types, ``stations_m`` the detectors' places, ``lanes``
    those of the mainline. Raises CorampError for detectors that are not there, for lanes that are
    missing, and for classes that no type is known for.
    """
    first_s, last_s = _window(counts, source, blamed)
    parts: list[dict[str, Any]] = []
    for route in STREAMS:
        detector = getattr(source, route)
        if not counts.has(detector):
            known = ", ".join(counts.detectors)
            raise CorampError(
                f"{blamed}: counts.{route}: {source.file} has no detector {detector!r}; "
                f"allowed are {known}"
            )
        if route == STREAMS[0]:
            _check_lanes(counts.at(detector), source, lanes, blamed)
        rows = counts.at(detector).filter(
            pl.col("begin_s") >= first_s, pl.col("begin_s") < last_s, pl.col("vehicles") > 0
        )
        place = {"station_m": stations_m[detector]} if detector in stations_m else {}
        for row in rows.iter_rows(named=True):
            part = {
                "route": route,
                "begin_s": row["begin_s"] - first_s,
                "end_s": row["end_s"] - first_s,
                "vehicles": row["vehicles"],
                "type": _type_of(row["vehicle_class"], source, types, blamed),
                **place,
            }
            parts.append(part if row["lane"] is None else {**part, "lane": row["lane"]})
    if not parts:
        raise CorampError(
            f"{blamed}: counts: no vehicle was counted at {source.mainline} and {source.ramp}; "
            "allowed is one at least"
        )
    return parts


def _check_lanes(rows: pl.DataFrame, source: CountsFile, lanes: int, blamed: str) -> None:
    """Raises CorampError where some lanes of the mainline were counted and others were not."""
    seen = sorted(rows["lane"].drop_nulls().unique().to_list())
    if not seen or len(seen) >= lanes:
        return
    raise CorampError(
        f"{blamed}: counts.mainline: {source.file} has lane {', '.join(map(str, seen))} at "
        f"{source.mainline}, and the mainline has {lanes} lanes; allowed are counts of each lane, "
        "or of all together"
    )


def _window(counts: Counts, source: CountsFile, blamed: str) -> tuple[float, float]:
    """Which part of the file counts, from and to (s)."""
    first_s = counts.begin_s if source.begin_s is None else source.begin_s
    last_s = counts.end_s if source.end_s is None else source.end_s
    begins, ends = set(counts.frame["begin_s"]), set(counts.frame["end_s"])
    for key, value, known in (("begin_s", first_s, begins), ("end_s", last_s, ends)):
        if value not in known:
            raise CorampError(
                f"{blamed}: counts.{key}: {value:g} is no interval's in {source.file}; allowed are "
                f"{min(known):g} to {max(known):g} s in steps of {counts.interval_s:g} s"
            )
    if last_s <= first_s:
        raise CorampError(
            f"{blamed}: counts.end_s: {last_s:g} is not after counts.begin_s; "
            f"allowed is above {first_s:g} s"
        )
    return first_s, last_s


def _type_of(kind: str, source: CountsFile, types: list[str], blamed: str) -> str:
    name = source.classes.get(kind, kind)
    if name not in types:
        name = KNOWN_AS.get(name.lower(), name)
    if name not in types:
        raise CorampError(
            f"{blamed}: counts.classes: class {kind!r} is no type of the scenario's; "
            f"allowed are {', '.join(types)}: add a [[vehicle]], or say which one it is of"
        )
    return name


def _types_of(data: Mapping[str, Any]) -> list[str]:
    """The names of a scenario's types; those that are not valid are told later."""
    given = data.get("vehicle")
    if not isinstance(given, list | tuple):
        return [CAR]
    return [str(kind.get("name")) for kind in given if isinstance(kind, Mapping)]


def _stations(data: Mapping[str, Any]) -> dict[str, float]:
    """Where a scenario's detectors are; those that are not valid are told later."""
    given = data.get(DETECTORS, ())
    return {
        str(found.get("id")): found.get("station_m", 0.0)
        for found in (given if isinstance(given, list | tuple) else ())
        if isinstance(found, Mapping)
    }
