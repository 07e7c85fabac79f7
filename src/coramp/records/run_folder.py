"""The folder of a run: writing it, and reading it back."""

from pathlib import Path

import polars as pl

from coramp.errors import CorampError
from coramp.records.files import read_json, write_json, write_parquet
from coramp.records.run import TABLES, RunRecords
from coramp.records.schemas import RESULT_VERSION, Row

MARK = "run.json"


def write_run(folder: Path, records: RunRecords) -> None:
    """Writes all files of a run into an existing folder."""
    for name, frame in records.frames.items():
        write_parquet(folder / f"{name}.parquet", frame)
    write_json(folder / MARK, records.content)


def read_run(folder: Path) -> RunRecords:
    """Returns a run from its folder; raises CorampError where there is none."""
    if not (folder / MARK).exists():
        raise CorampError(
            f"{folder}: holds no run; give a folder that coramp run --out has written"
        )
    content = read_json(folder / MARK)
    if not isinstance(content, dict) or content.get("kind") != "run" or "summary" not in content:
        raise CorampError(f"{folder / MARK}: does not describe a run; run again to write it anew")
    check_version(folder, content)
    frames = {}
    for name in TABLES:
        path = folder / f"{name}.parquet"
        try:
            frames[name] = pl.read_parquet(path) if path.exists() else None
        except (OSError, pl.exceptions.PolarsError) as error:
            raise CorampError(f"{path}: cannot be read: {error}; run again") from error
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
