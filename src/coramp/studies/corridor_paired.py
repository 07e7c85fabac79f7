"""What a corridor's strategies lose less than drivers alone, seed by seed on the same arrivals."""

import json
import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import polars as pl

from coramp.records.schemas import Row
from coramp.runs.running import UNCONTROLLED
from coramp.studies.overrides import overrides_of
from coramp.studies.paired import Cell, arrivals_set
from coramp.studies.statistics import Estimate, estimate

WHOLE = "whole corridor"
"""Stands for all sites together, waiting to enter and the road between the sites included."""
DELAYS = ("delay_s", "mainline_delay_s", "ramp_delay_s")
"""Mean delays of all vehicles, of the mainline and of the ramps, as ``delays_of`` has them."""


class Gain(NamedTuple):
    """How much less (s a vehicle) a cell loses at a place than uncontrolled; below 0 for more."""

    place: str
    cell: Cell
    uncontrolled: Cell
    by_s: tuple[Estimate, Estimate, Estimate]

    @property
    def is_sure(self) -> bool:
        """Whether the interval of the gain of all leaves out zero."""
        mean, half_width, _ = self.by_s[0]
        return not math.isnan(half_width) and abs(mean) > half_width


def delays_of(runs: pl.DataFrame, sites: pl.DataFrame) -> pl.DataFrame:
    """Returns mean delays (s a vehicle) by run and place: each site, and the whole corridor.

    Those of a site are of the vehicles that left its zone; those of the whole are of all.
    """
    served = ("mainline_served", "ramp_served")
    lost_s = pl.sum_horizontal(
        pl.col(delay).fill_null(0.0) * pl.col(count)
        for delay, count in zip(DELAYS[1:], served, strict=True)
    )
    columns = ("run_id", "place", *DELAYS)
    count = pl.sum_horizontal(served)
    mean_s = pl.when(count > 0).then(lost_s / count)
    by_site = sites.select(
        "run_id", pl.col("site").alias("place"), mean_s.alias("delay_s"), *DELAYS[1:]
    )
    whole = runs.select(
        "run_id", pl.lit(WHOLE).alias("place"), pl.col("mean_delay_s").alias("delay_s"), *DELAYS[1:]
    )
    return pl.concat([by_site.select(columns), whole.select(columns)])


def gains(good: pl.DataFrame, sites: pl.DataFrame) -> list[Gain]:
    """Returns what each cell gains at each place against uncontrolled on the same arrivals.

    That is the run with the same drivers and settings, or else the one that sets nothing but what
    says who arrives. Cells without such a run are left out.
    """
    by_run: dict[str, dict[str, tuple[float | None, ...]]] = {}
    for run_id, place, *found in delays_of(good, sites).iter_rows():
        by_run.setdefault(run_id, {})[place] = tuple(found)
    pairs: dict[tuple[Cell, Cell], list[tuple[str, str]]] = {}
    alone = _alone(good)
    for row in good.iter_rows(named=True):
        other = _partner(row, alone) if row["strategy"] != UNCONTROLLED else None
        if other is not None:
            cells = Cell.of_run(row), Cell.of_run(other)
            pairs.setdefault(cells, []).append((row["run_id"], other["run_id"]))
    return [
        Gain(place, *cells, _estimates([(by_run[one], by_run[two]) for one, two in ids], place))
        for cells, ids in pairs.items()
        for place in (WHOLE, *sites["site"].unique(maintain_order=True))
    ]


def _alone(good: pl.DataFrame) -> dict[tuple[Any, ...], Row]:
    """Runs of uncontrolled traffic by what makes another the same."""
    rows = good.filter(strategy=UNCONTROLLED).rows(named=True)
    return {(*_arrivals(row), row["settings"]): row for row in rows}


def _partner(row: Row, alone: Mapping[tuple[Any, ...], Row]) -> Row | None:
    """The run of uncontrolled traffic on the same arrivals, None if there is none."""
    same = alone.get((*_arrivals(row), row["settings"]))
    if same is not None:
        return same
    plain = (
        other
        for key, other in alone.items()
        if key[:-1] == _arrivals(row) and _says_arrivals_alone(other)
    )
    return next(plain, None)


def _says_arrivals_alone(row: Row) -> bool:
    return overrides_of(row) == arrivals_set(row)


def _arrivals(row: Row) -> tuple[Any, ...]:
    return row["scenario"], row["drivers"], row["seed"], _text(arrivals_set(row))


def _text(settings: Mapping[str, Any]) -> str | None:
    return json.dumps(settings, sort_keys=True) if settings else None


def _estimates(
    pairs: Sequence[tuple[Mapping[str, Any], Mapping[str, Any]]], place: str
) -> tuple[Estimate, Estimate, Estimate]:
    found = [(alone.get(place), own.get(place)) for own, alone in pairs]
    both = [(more, less) for more, less in found if more is not None and less is not None]
    all_s, mainline_s, ramp_s = (
        estimate([m[k] - o[k] for m, o in both if m[k] is not None and o[k] is not None])
        for k in range(len(DELAYS))
    )
    return all_s, mainline_s, ramp_s
