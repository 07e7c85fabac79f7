"""Writing every table of a run or a study as CSV, and a run's loops in SUMO's formats."""

from pathlib import Path

import polars as pl

from coramp.agency.detectors import detectors_of
from coramp.agency.motion import motion_of
from coramp.agency.sumo_detectors import definition_xml, output_xml, router_csv, router_xml
from coramp.agency.tables import agency_tables
from coramp.errors import CorampError
from coramp.metrics.queues import INTERVAL_S
from coramp.records.corridor_run import holds_corridor, read_corridor
from coramp.records.files import write_text
from coramp.records.run_folder import MARK as RUN_MARK
from coramp.records.run_folder import read_run
from coramp.records.staging import staged_folder
from coramp.studies.store import MARK as STUDY_MARK

STUDY_TABLES = ("runs", "streams", "sites")
"""A study has the second, a corridor's the third."""
LOOP_FILES = ("loops.add.xml", "loops.xml", "flowrouter.det.xml", "flowrouter.csv")
BETWEEN = " "
"""What stands between the entries of a list in a cell."""


def export(folder: Path, out: Path) -> list[Path]:
    """Writes the tables of a run or of a study into a new folder; returns the files.

    Raises CorampError where there is neither, and where the folder to write holds anything.
    """
    with staged_folder(
        out, lambda _: "holds other files; give another or an empty folder"
    ) as stage:
        texts = _texts(folder)
        for name, text in texts.items():
            write_text(stage / name, text)
    return [out / name for name in texts]


def _texts(folder: Path) -> dict[str, str]:
    if (folder / STUDY_MARK).exists():
        names = [n for n in STUDY_TABLES if n == "runs" or (folder / f"{n}.parquet").exists()]
        return {f"{name}.csv": csv_text(_study_table(folder, name)) for name in names}
    if not (folder / RUN_MARK).exists():
        raise CorampError(
            f"{folder}: holds no run and no study; give a folder that coramp run --out or coramp "
            "study has written"
        )
    if holds_corridor(folder):
        tables = read_corridor(folder).frames
        return {f"{name}.csv": csv_text(frame) for name, frame in tables.items()}
    run = read_run(folder)
    motion = motion_of(run)
    found = agency_tables(motion)
    frames = {**run.frames, **found}
    loops, detectors = detectors_of(run.scenario), found["detectors"]
    files = (
        definition_xml(loops, INTERVAL_S, LOOP_FILES[1]),
        output_xml(detectors),
        router_xml(loops),
        router_csv(detectors),
    )
    return {
        **{f"{name}.csv": csv_text(frame) for name, frame in frames.items()},
        **dict(zip(LOOP_FILES, files, strict=True)),
    }


def _study_table(folder: Path, name: str) -> pl.DataFrame:
    path = folder / f"{name}.parquet"
    try:
        return pl.read_parquet(path)
    except (OSError, pl.exceptions.PolarsError) as error:
        raise CorampError(
            f"{path}: cannot be read: {error}; run coramp study with the same --out to its end"
        ) from error


def csv_text(frame: pl.DataFrame) -> str:
    """Returns a table as CSV: nothing for null, entries of lists between blanks."""
    lists = [name for name, kind in frame.schema.items() if isinstance(kind, pl.List)]
    return frame.with_columns(pl.col(name).list.join(BETWEEN) for name in lists).write_csv()
