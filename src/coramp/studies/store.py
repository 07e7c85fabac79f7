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
from typing import Any, NamedTuple, Protocol

import polars as pl

from coramp.errors import CorampError
from coramp.records.corridor_outcome import CORRIDOR_RUNS, CORRIDOR_SITES
from coramp.records.files import (
    made_folder,
    read_json,
    write_json,
    write_parquet,
    write_text,
)
from coramp.records.schemas import RESULT_VERSION, RUN_KEYS, RUNS, STREAM_ROWS, Row, Schema
from coramp.records.unfinished import is_unfinished
from coramp.runs.running import versions
from coramp.scenarios.corridors import is_corridor, load_corridor
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
    "sites.parquet",
    "tables.md",
    "capacity.png",
    "report.html",
)
"""What a study writes into its folder."""


class Spec(Protocol):
    """What a store needs of a run: its hash, and the columns that runs are sorted by."""

    @property
    def run_id(self) -> str:
        """A hash of all that determines it."""
        ...

    @property
    def keys(self) -> Row:
        """The columns that runs are sorted by."""
        ...


class Tables(NamedTuple):
    """What a study is called in its folder, and the columns of its two tables.

    ``rows`` is the name of the table that has several rows a run, ``by`` the column that tells them
    apart.
    """

    kind: str
    runs: Schema
    rows: str
    row: Schema
    by: str


OF_ONE_SITE = Tables("study", RUNS, "streams", STREAM_ROWS, "stream")
OF_CORRIDOR = Tables("corridor study", CORRIDOR_RUNS, "sites", CORRIDOR_SITES, "site")
KINDS = (OF_ONE_SITE, OF_CORRIDOR)


@dataclass(frozen=True)
class Part:
    """What one run leaves in a study: its row, and one of each stream, or site of a corridor."""

    run: Row
    rows: list[Row]


class Store:
    """The folder of a study."""

    def __init__(self, folder: Path, study: Study, tables: Tables = OF_ONE_SITE) -> None:
        """Opens or makes the folder.

        Raises CorampError where it holds another study, a run or foreign files.
        """
        self.folder = folder
        self._study = study
        self._tables = tables
        self._claim(study)
        made_folder(folder / PARTS)

    def _claim(self, study: Study) -> None:
        content = {
            "kind": self._tables.kind,
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
            if any(found.get(key) != content[key] for key in ("study", "kind")):
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
        if not isinstance(found, dict) or found.get("kind") not in [k.kind for k in KINDS]:
            raise CorampError(f"{mark}: does not describe a study; give another folder")
        return found

    def part_path(self, spec: Spec) -> Path:
        """Returns where the part of a run lies."""
        return self.folder / PARTS / f"{spec.run_id}.json"

    def stored(self, spec: Spec) -> Part | None:
        """Returns the part of a run, a failed one too, None if it is missing or damaged."""
        return _part_in(self.part_path(spec), self._tables)

    def everything(self) -> Iterator[Part]:
        """Yields every part that is there and whole, whatever asked for it."""
        for path in sorted((self.folder / PARTS).glob("*.json")):
            part = _part_in(path, self._tables)
            if part is not None:
                yield part

    def read(self, spec: Spec) -> Part | None:
        """Returns the part of a run, None if it is missing or damaged or the run had failed."""
        part = self.stored(spec)
        return part if part is not None and part.run["status"] == "ok" else None

    def is_damaged(self, spec: Spec) -> bool:
        """Returns whether there is a part that cannot be used."""
        return self.part_path(spec).exists() and self.stored(spec) is None

    def write(self, spec: Spec, part: Part) -> None:
        """Writes the part of a run."""
        run, rows = _encoded(part.run), [_encoded(row) for row in part.rows]
        content = {"run": run, self._tables.rows: rows, "sha256": _checksum(run, rows)}
        try:
            write_json(self.part_path(spec), content)
        except CorampError as error:
            raise CorampError(
                f"{error}; runs that are done are kept, start again to go on"
            ) from error

    def parts(self, specs: Iterable[Spec]) -> Iterator[Part]:
        """Yields what there is of the given runs, failed ones too, in their order."""
        for spec in specs:
            part = self.stored(spec)
            if part is not None:
                yield part

    def frames(self, parts: Iterable[Part]) -> tuple[pl.DataFrame, pl.DataFrame]:
        """Returns the tables of runs and of streams or sites, in the order of the parts."""
        of_run, of_row = self._tables.runs, self._tables.row
        runs, rows = [pl.DataFrame(schema=of_run)], [pl.DataFrame(schema=of_row)]
        left = iter(parts)
        while some := list(islice(left, ROWS_AT_A_TIME)):
            runs.append(pl.DataFrame([p.run for p in some], schema=of_run, orient="row"))
            several = [row for part in some for row in part.rows]
            rows.append(pl.DataFrame(several, schema=of_row, orient="row"))
        return pl.concat(runs, rechunk=True), pl.concat(rows, rechunk=True)

    def write_tables(self, runs: pl.DataFrame, rows: pl.DataFrame, markdown: str) -> None:
        """Writes ``runs.parquet``, ``streams.parquet`` or ``sites.parquet``, and ``tables.md``."""
        write_parquet(self.folder / "runs.parquet", runs)
        write_parquet(self.folder / f"{self._tables.rows}.parquet", rows)
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

    def count_of_others(self, specs: Iterable[Spec]) -> int:
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
        if is_corridor(study.source):
            return load_corridor(study.source).as_data()
        return load_scenario(study.source).model_dump(mode="json")
    except CorampError:
        return None


def _part_in(path: Path, tables: Tables) -> Part | None:
    """The part in a file, None if it is missing, damaged or of another run than its name says."""
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        run, rows = content["run"], content[tables.rows]
        if content["sha256"] != _checksum(run, rows) or run["run_id"] != path.stem:
            return None
        if not {"status", *RUN_KEYS} <= run.keys() <= tables.runs.keys():
            return None
        if any(not {"run_id", tables.by} <= row.keys() <= tables.row.keys() for row in rows):
            return None
    except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError):
        return None
    return Part(_decoded(run), [_decoded(row) for row in rows])


def _checksum(run: Row, rows: list[Row]) -> str:
    text = json.dumps([run, rows], sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()


def _encoded(row: Row) -> Row:
    """Infinity as text: JSON has no word for it."""
    return {k: str(v) if isinstance(v, float) and math.isinf(v) else v for k, v in row.items()}


def _decoded(row: Row) -> Row:
    return {k: _number(v) if v in ("inf", "-inf") else v for k, v in row.items()}


def _number(text: Any) -> float:
    return float(text)
