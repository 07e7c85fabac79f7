"""A study's folder, read back."""

from dataclasses import dataclass
from pathlib import Path

import polars as pl

from coramp.errors import CorampError
from coramp.files import read_json
from coramp.studies.store import MARK


@dataclass(frozen=True)
class StoredStudy:
    """The runs of a finished study that went well, and what the study asked for."""

    folder: Path
    layout: str
    horizon_s: float | None
    runs: pl.DataFrame


def read_study(folder: Path) -> StoredStudy:
    """Returns a study from its folder.

    Raises CorampError where there is none, where it is not finished and where no run went well.
    """
    if not (folder / MARK).exists():
        raise CorampError(
            f"{folder}: holds no study; give a folder that coramp study --out has written"
        )
    content = read_json(folder / MARK)
    path = folder / "runs.parquet"
    if not path.exists():
        raise CorampError(f"{folder}: is not finished; start its coramp study again")
    try:
        runs = pl.read_parquet(path).filter(pl.col("status") == "ok")
        asked = content["study"]
        found = StoredStudy(folder, asked["layout"], asked["horizon_s"], runs)
    except (OSError, KeyError, TypeError, pl.exceptions.PolarsError) as error:
        raise CorampError(f"{folder}: cannot be read: {error}; run the study again") from error
    if runs.is_empty():
        raise CorampError(f"{folder}: no run went well; start its coramp study again")
    return found
