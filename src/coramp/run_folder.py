"""What a run leaves in its folder, and reading it back."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from pathlib import Path

import polars as pl

from coramp.engines.sumo.engine import KEPT_FILES
from coramp.errors import CorampError
from coramp.files import read_json, write_json, write_parquet
from coramp.metrics.schemas import RESULT_VERSION
from coramp.metrics.tables import Row
from coramp.running import RunSpec, finite_or_none, versions
from coramp.scenario import Scenario
from coramp.stored_checks import SCHEMAS, checked_content, checked_frame
from coramp.unfinished import is_unfinished

MARK = "run.json"
TABLES = tuple(SCHEMAS)
REPORT, REPLAY = "report.html", "replay.html"
SUMO = "sumo"
"""The folder of SUMO's own files in that of a run."""
OURS = frozenset({MARK, REPORT, REPLAY, *(f"{name}.parquet" for name in TABLES)})
NAMED_AT_MOST = 3
"""So many foreign files are named in an error."""


@dataclass(frozen=True)
class StoredRun:
    """A run as read from its folder.

    There are trajectories and decisions only of cooperative runs, and positions of the others.
    Violations and positions are None where the run was written by a coramp that kept none.
    """

    content: Row
    vehicles: pl.DataFrame
    speeds: pl.DataFrame
    trajectories: pl.DataFrame | None
    decisions: pl.DataFrame | None
    positions: pl.DataFrame | None = None
    violations: pl.DataFrame | None = None

    @property
    def scenario(self) -> Scenario:
        """The scenario that was run."""
        return Scenario.model_validate(self.content["specification"], strict=False)

    def vehicle(self, vehicle_id: str) -> Row:
        """Returns a vehicle's row; raises CorampError where there is none such."""
        found = self.vehicles.filter(vehicle_id=vehicle_id)
        if found.is_empty():
            known = sorted(self.vehicles["vehicle_id"].to_list())
            allowed = f"allowed are {known[0]} to {known[-1]}" if known else "nobody arrived"
            raise CorampError(f"there is no vehicle {vehicle_id!r}; {allowed}")
        return found.row(0, named=True)

    def coordinated(self, what: str) -> tuple[pl.DataFrame, pl.DataFrame]:
        """Returns trajectories and decisions; ``what`` is what they are wanted for, as a verb.

        Raises CorampError for a run in which nobody was coordinated, or where one is lost.
        """
        if self.trajectories is None and self.decisions is None:
            raise CorampError(f"nobody was coordinated in this run; {what} a cooperative one")
        if self.trajectories is None or self.decisions is None:
            raise CorampError("is not complete; run again with the same --out")
        return self.trajectories, self.decisions


def run_content(spec: RunSpec, row: Row) -> Row:
    """Returns what ``run.json`` holds and ``coramp run --json`` prints."""
    content = {
        "kind": "run",
        "result_version": RESULT_VERSION,
        **spec.as_data(),
        "versions": versions(),
        "summary": row,
    }
    return {key: finite_or_none(value) for key, value in content.items()}


def write_run(folder: Path, spec: RunSpec, frames: Mapping[str, pl.DataFrame], row: Row) -> None:
    """Writes all files of a run into an existing folder; ``frames`` are named as in ``TABLES``."""
    for name, frame in frames.items():
        if name in TABLES:
            write_parquet(folder / f"{name}.parquet", frame)
    write_json(folder / MARK, run_content(spec, row))


def not_replaceable(folder: Path) -> str | None:
    """Says why a folder must not be replaced by a run, and what to do; None where it may be.

    It may be where all that it holds is one run: whatever coramp did not write stays.
    """
    content = sorted(entry.name for entry in folder.iterdir())
    if not _describes_a_run(folder / MARK):
        what = "a study" if "study.json" in content else f"other files ({content[0]})"
        return f"holds {what}; give another or an empty folder"
    foreign = [name for name in content if not _is_ours(folder / name)]
    if not foreign:
        return None
    more = len(foreign) - NAMED_AT_MOST
    names = ", ".join(foreign[:NAMED_AT_MOST]) + (f" and {more} more" if more > 0 else "")
    return (
        f"holds a run and what coramp did not write ({names}); move that away, or give another "
        "folder"
    )


def _describes_a_run(mark: Path) -> bool:
    try:
        content = read_json(mark)
    except CorampError:
        return False
    needed = {"run_id", "specification", "summary"}
    return isinstance(content, dict) and content.get("kind") == "run" and needed <= content.keys()


def _is_ours(entry: Path) -> bool:
    if is_unfinished(entry.name):
        return True
    if entry.is_symlink():
        return False
    if entry.name == SUMO and entry.is_dir():
        return all(_is_file_of(inner, KEPT_FILES) for inner in entry.iterdir())
    return _is_file_of(entry, OURS)


def _is_file_of(entry: Path, names: Collection[str]) -> bool:
    return entry.name in names and entry.is_file() and not entry.is_symlink()


def read_run(folder: Path) -> StoredRun:
    """Returns a run from its folder; raises CorampError where there is none."""
    if not (folder / MARK).exists():
        raise CorampError(
            f"{folder}: holds no run; give a folder that coramp run --out has written"
        )
    content = read_json(folder / MARK)
    if not isinstance(content, dict) or content.get("kind") != "run" or "summary" not in content:
        raise CorampError(f"{folder / MARK}: does not describe a run; run again to write it anew")
    check_version(folder, content)
    content = checked_content(folder / MARK, content)
    frames = {}
    for name in TABLES:
        path = folder / f"{name}.parquet"
        try:
            frame = pl.read_parquet(path) if path.exists() else None
        except (OSError, pl.exceptions.PolarsError) as error:
            raise CorampError(f"{path}: cannot be read: {error}; run again") from error
        frames[name] = None if frame is None else checked_frame(path, frame, SCHEMAS[name])
    vehicles, speeds = frames["vehicles"], frames["speeds"]
    if vehicles is None or speeds is None:
        raise CorampError(f"{folder}: is not complete; run again with the same --out")
    others = ("trajectories", "decisions", "positions", "violations")
    return StoredRun(content, vehicles, speeds, *(frames[name] for name in others))


def check_version(folder: Path, content: Row) -> None:
    """Raises CorampError where a folder's results are of a newer format than this coramp's."""
    version = content.get("result_version", 0)
    if not isinstance(version, int) or version > RESULT_VERSION:
        raise CorampError(
            f"{folder}: was written by a newer coramp (results {version}); this one reads up to "
            f"{RESULT_VERSION}: update coramp, or run again"
        )


def moved_for(decisions: pl.DataFrame, vehicle_id: str) -> list[Row]:
    """Returns the decisions about others that moved a vehicle aside or braked it."""
    moved = pl.col("adjusted_vehicle_ids").list.contains(vehicle_id).fill_null(value=False)
    return decisions.filter(moved).rows(named=True)
