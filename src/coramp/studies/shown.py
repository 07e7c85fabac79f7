"""The runs of a study that its report shows: which they are, and keeping their records.

A study keeps rows, not tables. At the lowest and the highest flow that all strategies share, the
runs of the first seed are made once more and kept whole, in ``shown/``.
"""

from collections.abc import Callable
from pathlib import Path

import polars as pl

from coramp.records.files import made_folder
from coramp.records.run import RunRecords
from coramp.records.run_folder import MARK, not_replaceable, read_run, write_run
from coramp.records.schemas import Row
from coramp.records.staging import staged_folder
from coramp.runs.running import RunSpec, make_spec, recorded
from coramp.scenarios.loading import load_scenario
from coramp.studies.definition import Study, horizon_of
from coramp.studies.overrides import overrides_of

FOLDER = "shown"
SHOWN_DRIVERS = ("fair", "paper")
SAME_DELAY_S = 0.02
"""What SUMO's steps may round: a cooperative run is made again without a simulator."""


def plain(good: pl.DataFrame) -> pl.DataFrame:
    """Returns the runs without overrides, or all where every run has some."""
    found = good.filter(pl.col("overrides").is_null())
    return found if found.height else good


def shared_flows(good: pl.DataFrame) -> list[tuple[float, float]]:
    """Returns the flows (veh/h) at which there are most strategies, ordered by their sum."""
    who = pl.struct("strategy", "drivers").n_unique().alias("who")
    counted = plain(good).group_by("mainline_veh_h", "ramp_veh_h").agg(who)
    most = counted.filter(pl.col("who") == pl.col("who").max())
    return sorted(most.select("mainline_veh_h", "ramp_veh_h").rows(), key=sum)


def shown_rows(good: pl.DataFrame) -> list[Row]:
    """Returns the rows of the runs that the report shows, in the order of the table.

    They are those without overrides, or where every run has some, with those with which there are
    most strategies; of several such, those in the middle.
    """
    if good.is_empty():
        return []
    flows = shared_flows(good)
    rows: list[Row] = []
    for mainline, ramp in dict.fromkeys((flows[0], flows[-1])):
        at = plain(good).filter(mainline_veh_h=mainline, ramp_veh_h=ramp)
        at = at.filter(pl.col("seed") == pl.col("seed").min())
        at = at.filter(pl.col("overrides").eq_missing(pl.lit(_usual(at), pl.String)))
        shown = _shown_drivers(at)
        rows += [
            row
            for row in at.unique(["strategy", "drivers"], maintain_order=True).rows(named=True)
            if row["drivers"] in (None, *shown)
        ]
    return rows


def _usual(at: pl.DataFrame) -> str | None:
    """The overrides with which there are most strategies; of several such, those in the middle."""
    who = pl.struct("strategy", "drivers").n_unique().alias("who")
    counted = at.group_by("overrides", maintain_order=True).agg(who)
    most = counted.filter(pl.col("who") == pl.col("who").max())["overrides"].sort()
    found: str | None = most[(len(most) - 1) // 2]
    return found


def _shown_drivers(at: pl.DataFrame) -> tuple[str, ...]:
    """The populations that are shown: the usual ones, or whatever there is."""
    there = at["drivers"].drop_nulls().unique(maintain_order=True).to_list()
    usual = tuple(name for name in SHOWN_DRIVERS if name in there)
    return usual or tuple(there[: len(SHOWN_DRIVERS)])


def keep_shown(
    folder: Path, study: Study, good: pl.DataFrame, say: Callable[[str], None] = lambda _: None
) -> None:
    """Keeps the records of the runs that the report shows, below the folder of a study.

    What is there already is kept as it is; ``say`` is told what is made. Raises CorampError where
    a run fails or cannot be written.
    """
    missing = [row for row in shown_rows(good) if not (_place(folder, row) / MARK).exists()]
    if not missing:
        return
    say(f"keeping the records of {len(missing)} runs for the report")
    made_folder(folder / FOLDER)
    for row in missing:
        with staged_folder(_place(folder, row), not_replaceable) as stage:
            write_run(stage, recorded(_again(study, row)))


def read_shown(folder: Path, row: Row) -> RunRecords | None:
    """Returns the records that were kept of a run, None where there are none."""
    place = _place(folder, row)
    return read_run(place) if (place / MARK).exists() else None


def _place(folder: Path, row: Row) -> Path:
    return folder / FOLDER / str(row["run_id"])


def same_delays(row: Row, again: Row) -> bool:
    """Returns whether two runs have the delays of one, but for what SUMO's steps round."""
    pairs = [(row[name], again[name]) for name in ("mainline_delay_s", "ramp_delay_s")]
    return all(
        a is b or (a is not None and b is not None and abs(a - b) < SAME_DELAY_S) for a, b in pairs
    )


def _again(study: Study, row: Row) -> RunSpec:
    """A run of the study once more; cooperative ones need no simulator."""
    listed, overrides = bool(load_scenario(study.source).arrivals), overrides_of(row)
    return make_spec(
        study.source,
        row["strategy"],
        engine="sumo" if row["drivers"] else "exact",
        mainline_veh_h=None if listed else row["mainline_veh_h"],
        ramp_veh_h=None if listed else row["ramp_veh_h"],
        drivers=row["drivers"],
        overrides=overrides,
        seed=row["seed"],
        horizon_s=horizon_of(study, overrides),
        blamed="",
    )
