"""The folder of a run: writing it, and reading it back."""

from collections.abc import Collection
from pathlib import Path

import polars as pl

from coramp.errors import CorampError
from coramp.records.corridor_outcome import CORRIDOR_FILES
from coramp.records.files import read_json, write_json, write_parquet
from coramp.records.run import MESSAGES, TABLES, RunRecords
from coramp.records.schemas import RESULT_VERSION, Row
from coramp.records.stored_checks import SCHEMAS, checked_content, checked_frame
from coramp.records.unfinished import is_unfinished

MARK = "run.json"
CORRIDOR = "corridor"
"""The kind of a corridor's run in ``run.json``."""
REPORT, REPLAY = "report.html", "replay.html"
SUMO = "sumo"
"""The folder of SUMO's own files in that of a run."""
SUMO_COPIES = ("routes.rou.xml", "fcd.parquet", "tripinfo.xml", "collisions.xml")
SUMO_NETWORK, SUMO_COMMAND, SUMO_LOOPS = "net.net.xml", "command.txt", "loops.add.xml"
SUMO_DETECTORS, SUMO_DETECTED, DETECTED = "detectors.add.xml", "detectors.xml", "detectors.csv"
"""The scenario's detectors, what SUMO wrote of them, and the same as counts."""
SUMO_FILES = (
    *SUMO_COPIES,
    *(SUMO_NETWORK, f"{SUMO_NETWORK}.gz", SUMO_COMMAND, SUMO_LOOPS),
    *(SUMO_DETECTORS, SUMO_DETECTED, DETECTED),
)
"""What it may hold."""
OURS = frozenset(
    {
        *(MARK, REPORT, REPLAY),
        *(f"{name}.parquet" for name in (*TABLES, MESSAGES, *CORRIDOR_FILES)),
    }
)
NAMED_AT_MOST = 3
"""So many foreign files are named in an error."""


def write_run(folder: Path, records: RunRecords) -> None:
    """Writes all files of a run into an existing folder."""
    for name, frame in records.frames.items():
        write_parquet(folder / f"{name}.parquet", frame)
    write_json(folder / MARK, records.content)


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
    kinds = ("run", CORRIDOR)
    return isinstance(content, dict) and content.get("kind") in kinds and needed <= content.keys()


def _is_ours(entry: Path) -> bool:
    if is_unfinished(entry.name):
        return True
    if entry.is_symlink():
        return False
    if entry.name == SUMO and entry.is_dir():
        return all(_is_file_of(inner, SUMO_FILES) for inner in entry.iterdir())
    return _is_file_of(entry, OURS)


def _is_file_of(entry: Path, names: Collection[str]) -> bool:
    return entry.name in names and entry.is_file() and not entry.is_symlink()


def read_run(folder: Path) -> RunRecords:
    """Returns a run from its folder; raises CorampError where there is none."""
    if not (folder / MARK).exists():
        raise CorampError(
            f"{folder}: holds no run; give a folder that coramp run --out has written"
        )
    content = read_json(folder / MARK)
    if isinstance(content, dict) and content.get("kind") == CORRIDOR:
        raise CorampError(
            f"{folder}: holds the run of a corridor; this reads runs of one merge site; allowed "
            "are coramp report, replay and export, and its tables, such as sites.parquet"
        )
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
    vehicles, speeds = frames.pop("vehicles"), frames.pop("speeds")
    if vehicles is None or speeds is None:
        raise CorampError(f"{folder}: is not complete; run again with the same --out")
    return RunRecords(content, content["summary"], vehicles, speeds, **frames)


def check_version(folder: Path, content: Row) -> None:
    """Raises CorampError where a folder's results are of a newer format than this coramp's."""
    version = content.get("result_version", 0)
    if not isinstance(version, int) or version > RESULT_VERSION:
        raise CorampError(
            f"{folder}: was written by a newer coramp (results {version}); this one reads up to "
            f"{RESULT_VERSION}: update coramp, or run again"
        )
