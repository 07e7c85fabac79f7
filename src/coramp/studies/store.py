"""The store of a study: one part file a run, written when it is done, and the tables at the end.

A part carries a checksum, so that what was interrupted or damaged is found and run again.
"""

import hashlib
import json
import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Any

import polars as pl

from coramp.errors import CorampError
from coramp.records.files import (
    made_folder,
    read_json,
    write_json,
    write_parquet,
    write_text,
)
from coramp.records.schemas import RESULT_VERSION, RUN_KEYS, RUNS, STREAM_ROWS, Row
from coramp.records.unfinished import is_unfinished
from coramp.runs.running import RunSpec, versions
from coramp.scenarios.loading import load_scenario
from coramp.studies.definition import Study
from coramp.studies.own_files import own_files

ROWS_AT_A_TIME = 1000
"""Runs that are held in memory as rows while the tables are made."""
MARK = "study.json"
PARTS = "parts"
OURS = (
    MARK,
    PARTS,
    "shown",
    "runs.parquet",
    "streams.parquet",
    "tables.md",
    "capacity.png",
    "report.html",
)
"""What a study writes into its folder."""


@dataclass(frozen=True)
class Part:
    """What one run leaves in a study."""

    run: Row
    streams: list[Row]


class Store:
    """The folder of a study."""

    def __init__(self, folder: Path, study: Study) -> None:
        """Opens or makes the folder.

        Raises CorampError where it holds another study, a run or foreign files.
        """
        self.folder = folder
        self._study = study
        self._claim(study)
        made_folder(folder / PARTS)

    def _claim(self, study: Study) -> None:
        content = {
            "kind": "study",
            "result_version": RESULT_VERSION,
            "study": study.model_dump(mode="json"),
            "versions": versions(),
        }
        mark = self.folder / MARK
        found = self._description()
        if found is not None:
            if found.get("result_version") != RESULT_VERSION:
                raise CorampError(
                    f"{self.folder}: was written by another version of coramp (results "
                    f"{found.get('result_version')}, this one writes {RESULT_VERSION}); "
                    "give another folder"
                )
            if found.get("study") != content["study"]:
                name = found.get("study", {}).get("name")
                raise CorampError(
                    f"{self.folder}: holds another study ({name!r} with another definition); "
                    "give another folder"
                )
            return
        if self.folder.exists() and not self.folder.is_dir():
            raise CorampError(f"{self.folder}: is a file; give a folder")
        if self.folder.exists() and not self._is_ours():
            raise CorampError(
                f"{self.folder}: holds other files and no study; give another or an empty folder"
            )
        made_folder(self.folder)
        write_json(mark, {**content, **_asked(study)})

    def _is_ours(self) -> bool:
        """Whether all in the folder is a study's; tables alone may be somebody else's."""
        names = {entry.name for entry in self.folder.iterdir() if not is_unfinished(entry.name)}
        return not names or (PARTS in names and names <= set(OURS))

    def _description(self) -> Row | None:
        """What the folder says of itself, None where that is missing or no JSON.

        Parts tell by themselves which runs they are of, so it can be written again.
        """
        mark = self.folder / MARK
        try:
            found = read_json(mark)
        except CorampError:
            return None
        if not isinstance(found, dict) or found.get("kind") != "study":
            raise CorampError(f"{mark}: does not describe a study; give another folder")
        return found

    def part_path(self, spec: RunSpec) -> Path:
        """Returns where the part of a run lies."""
        return self.folder / PARTS / f"{spec.run_id}.json"

    def stored(self, spec: RunSpec) -> Part | None:
        """Returns the part of a run, a failed one too, None if it is missing or damaged."""
        return _part_in(self.part_path(spec))

    def everything(self) -> Iterator[Part]:
        """Yields every part that is there and whole, whatever asked for it."""
        for path in sorted((self.folder / PARTS).glob("*.json")):
            part = _part_in(path)
            if part is not None:
                yield part

    def read(self, spec: RunSpec) -> Part | None:
        """Returns the part of a run, None if it is missing or damaged or the run had failed."""
        part = self.stored(spec)
        return part if part is not None and part.run["status"] == "ok" else None

    def is_damaged(self, spec: RunSpec) -> bool:
        """Returns whether there is a part that cannot be used."""
        return self.part_path(spec).exists() and self.stored(spec) is None

    def write(self, spec: RunSpec, part: Part) -> None:
        """Writes the part of a run."""
        run, streams = _encoded(part.run), [_encoded(row) for row in part.streams]
        content = {"run": run, "streams": streams, "sha256": _checksum(run, streams)}
        try:
            write_json(self.part_path(spec), content)
        except CorampError as error:
            raise CorampError(
                f"{error}; runs that are done are kept, start again to go on"
            ) from error

    def parts(self, specs: Iterable[RunSpec]) -> Iterator[Part]:
        """Yields what there is of the given runs, failed ones too, in their order."""
        for spec in specs:
            part = self.stored(spec)
            if part is not None:
                yield part

    def frames(self, parts: Iterable[Part]) -> tuple[pl.DataFrame, pl.DataFrame]:
        """Returns the tables of runs and of streams, in the order of the parts."""
        runs, streams = [pl.DataFrame(schema=RUNS)], [pl.DataFrame(schema=STREAM_ROWS)]
        left = iter(parts)
        while some := list(islice(left, ROWS_AT_A_TIME)):
            runs.append(pl.DataFrame([p.run for p in some], schema=RUNS, orient="row"))
            rows = [row for part in some for row in part.streams]
            streams.append(pl.DataFrame(rows, schema=STREAM_ROWS, orient="row"))
        return pl.concat(runs, rechunk=True), pl.concat(streams, rechunk=True)

    def write_tables(self, runs: pl.DataFrame, streams: pl.DataFrame, markdown: str) -> None:
        """Writes ``runs.parquet``, ``streams.parquet`` and ``tables.md``."""
        write_parquet(self.folder / "runs.parquet", runs)
        write_parquet(self.folder / "streams.parquet", streams)
        write_text(self.folder / "tables.md", markdown)
        found = self._description() or {}
        asked = {**found, **_plain(_asked(self._study))}
        if asked != found:  # the tables are of the files as they are now
            write_json(self.folder / MARK, asked)

    @property
    def scenario_changed(self) -> bool:
        """Whether the scenario is another by now than that of the tables in the folder."""
        found = self._description() or {}
        return "scenario" in found and found["scenario"] != _plain(_scenario_of(self._study))

    def count_of_others(self, specs: Iterable[RunSpec]) -> int:
        """Returns how many runs are kept that are none of the given ones."""
        asked = {spec.run_id for spec in specs}
        return sum(p.stem not in asked for p in (self.folder / PARTS).glob("*.json"))


def _asked(study: Study) -> Row:
    """The scenario, and the files of one's own that ask for it, as they are now."""
    return {"scenario": _scenario_of(study), "files": own_files(study)}


def _plain(data: Any) -> Any:
    """Data as it is read back from JSON."""
    return json.loads(json.dumps(data))


def _scenario_of(study: Study) -> Row | None:
    """The study's scenario as it is, None where it is valid only with what the study sets."""
    try:
        return load_scenario(study.source).model_dump(mode="json")
    except CorampError:
        return None


def _part_in(path: Path) -> Part | None:
    """The part in a file, None if it is missing, damaged or of another run than its name says."""
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        run, streams = content["run"], content["streams"]
        if content["sha256"] != _checksum(run, streams) or run["run_id"] != path.stem:
            return None
        if not {"status", *RUN_KEYS} <= run.keys() <= RUNS.keys():
            return None
        if any(not {"run_id", "stream"} <= row.keys() <= STREAM_ROWS.keys() for row in streams):
            return None
    except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError):
        return None
    return Part(_decoded(run), [_decoded(row) for row in streams])


def _checksum(run: Row, streams: list[Row]) -> str:
    text = json.dumps([run, streams], sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()


def _encoded(row: Row) -> Row:
    """Infinity as text: JSON has no word for it."""
    return {k: str(v) if isinstance(v, float) and math.isinf(v) else v for k, v in row.items()}


def _decoded(row: Row) -> Row:
    return {k: _number(v) if v in ("inf", "-inf") else v for k, v in row.items()}


def _number(text: Any) -> float:
    return float(text)
