"""A study's folder, read back."""

from dataclasses import dataclass
from pathlib import Path

import polars as pl
from pydantic import ValidationError

from coramp.errors import CorampError
from coramp.records.files import read_json
from coramp.records.run_folder import check_version
from coramp.records.schemas import RESULT_VERSION, RUNS, STREAM_ROWS, Row
from coramp.records.stored_checks import checked_frame, first_of
from coramp.studies.definition import Study
from coramp.studies.store import KINDS, MARK, OF_CORRIDOR, Store

DRAWN = ("paper", "sensitivity", "capacity", "field", "baseline", "penetration", "hostile")
"""The layouts of studies that there are figures of."""


@dataclass(frozen=True)
class StoredStudy:
    """The runs of a finished study that went well, how many failed, and what was asked for."""

    folder: Path
    layout: str
    horizon_s: float | None
    runs: pl.DataFrame
    failed: int


def read_study(folder: Path) -> StoredStudy:
    """Returns a study from its folder.

    Raises CorampError where there is none, where it is not finished and where no run went well.
    """
    if not (folder / MARK).exists():
        raise CorampError(
            f"{folder}: holds no study; give a folder that coramp study --out has written"
        )
    content = read_json(folder / MARK)
    if is_corridor_study(folder):
        raise CorampError(
            f"{folder}: holds the study of a corridor, of which there is no such figure; allowed "
            "are coramp report, which draws it, and studies of one merge site"
        )
    path = folder / "runs.parquet"
    if not path.exists():
        raise CorampError(f"{folder}: is not finished; start its coramp study again")
    try:
        every = checked_frame(path, pl.read_parquet(path), RUNS)
        runs = every.filter(pl.col("status") == "ok")
        asked, failed = content["study"], every.height - runs.height
        found = StoredStudy(folder, asked["layout"], asked["horizon_s"], runs, failed)
    except (OSError, KeyError, TypeError, pl.exceptions.PolarsError) as error:
        raise CorampError(f"{folder}: cannot be read: {error}; run the study again") from error
    if found.layout not in DRAWN:
        raise CorampError(
            f"{folder}: there is no figure of studies with the layout {found.layout}; "
            f"allowed are {', '.join(DRAWN)}"
        )
    if runs.is_empty():
        raise CorampError(f"{folder}: no run went well; start its coramp study again")
    return found


def checked_study(mark: Path, content: Row) -> Study:
    """Returns the study that ``study.json`` describes; raises CorampError where it does not."""
    versions = content.get("versions")
    if not isinstance(versions, dict) or not all(isinstance(v, str) for v in versions.values()):
        raise CorampError(f"{mark}: versions: is no list of versions; run the study again")
    try:
        return Study.model_validate(content.get("study"), strict=False)
    except ValidationError as error:
        raise CorampError(f"{mark}: study: {first_of(error)}; run the study again") from None


def study_content(folder: Path) -> Row:
    """Returns what ``study.json`` holds.

    Raises CorampError where it describes no study, or one of another version.
    """
    content = read_json(folder / MARK)
    kinds = [tables.kind for tables in KINDS]
    if not isinstance(content, dict) or content.get("kind") not in kinds:
        raise CorampError(f"{folder / MARK}: does not describe a study; give another folder")
    check_version(folder, content)
    if content.get("result_version") != RESULT_VERSION:
        raise CorampError(
            f"{folder}: was written by an older coramp; run its study again in another folder"
        )
    return content


def scenario_of(folder: Path) -> Row | None:
    """Returns the content of a study's scenario; None where the folder tells of none."""
    try:
        found = study_content(folder).get("scenario")
    except CorampError:
        return None
    return found if isinstance(found, dict) else None


def stored_runs(folder: Path) -> tuple[Study, pl.DataFrame]:
    """Returns a study and its runs from its folder, as many as are done.

    Raises CorampError where there is none, or it cannot be read.
    """
    study = checked_study(folder / MARK, study_content(folder))
    if _is_finished(folder):
        return study, _frame(folder / "runs.parquet", RUNS)
    store = Store(folder, study)
    return study, store.frames(store.everything())[0]


def is_corridor_study(folder: Path) -> bool:
    """Returns whether a folder holds the study of a corridor."""
    try:
        return bool(study_content(folder)["kind"] == OF_CORRIDOR.kind)
    except CorampError:
        return False


def stored_corridor(folder: Path) -> tuple[Study, pl.DataFrame, pl.DataFrame]:
    """Returns a corridor's study, its runs and its rows by site, as many as are done.

    Raises CorampError where there is none, or it cannot be read.
    """
    study = checked_study(folder / MARK, study_content(folder))
    if _is_finished(folder):
        runs = _frame(folder / "runs.parquet", OF_CORRIDOR.runs)
        return study, runs, _frame(folder / f"{OF_CORRIDOR.rows}.parquet", OF_CORRIDOR.row)
    store = Store(folder, study, OF_CORRIDOR)
    return study, *store.frames(store.everything())


def stored_streams(folder: Path, study: Study) -> pl.DataFrame:
    """Returns the table of streams of a study, as ``stored_runs`` those of its runs."""
    if _is_finished(folder):
        return _frame(folder / "streams.parquet", STREAM_ROWS)
    store = Store(folder, study)
    return store.frames(store.everything())[1]


def _is_finished(folder: Path) -> bool:
    return (folder / "runs.parquet").exists()


def _frame(path: Path, schema: dict[str, type[pl.DataType] | pl.DataType]) -> pl.DataFrame:
    try:
        return checked_frame(path, pl.read_parquet(path), schema)
    except (OSError, pl.exceptions.PolarsError) as error:
        raise CorampError(f"{path}: cannot be read: {error}; run the study again") from error
