"""A corridor's run as rows of its study: one of the run, and one of each site."""

import polars as pl

from coramp.records.corridor_outcome import CORRIDOR_RUNS, TOTALS
from coramp.records.schemas import Row
from coramp.runs.corridors import CorridorResult, CorridorSpec

SHARES = {"travel_p50_s": 0.5, "travel_p95_s": 0.95}
"""Percentiles of the time from when a vehicle is due until it leaves."""


def corridor_row(spec: CorridorSpec, result: CorridorResult) -> Row:
    """Returns the row of ``runs.parquet`` of a run: its totals, and figures of its trips."""
    found = {
        **_keys(spec, "ok", None),
        **{name: result.summary[name] for name in TOTALS},
        **trip_figures(result.frames["trips"], result.sites["site"].to_list()),
        "fallbacks": _sum(result.sites["fallbacks"]),
        "wall_s": result.content["wall_s"],
    }
    return {name: found[name] for name in CORRIDOR_RUNS}


def failed_corridor_row(spec: CorridorSpec, error: str, wall_s: float) -> Row:
    """Returns the row of a run that failed."""
    found = {**_keys(spec, "failed", error), "wall_s": wall_s}
    return {name: found.get(name) for name in CORRIDOR_RUNS}


def site_rows(spec: CorridorSpec, result: CorridorResult) -> list[Row]:
    """Returns the rows of ``sites.parquet`` of a run."""
    return [{"run_id": spec.run_id, **row} for row in result.sites.to_dicts()]


def trip_figures(trips: pl.DataFrame, sites: list[str]) -> Row:
    """Returns the mean delay (s) of those from upstream ends and from ramps, and travel times (s).

    Delays are of all vehicles, travel times of those that left; None where there are none.
    """
    from_ramp = trips["origin"].is_in(sites)
    left = trips.filter(pl.col("left_s").is_not_null())
    travel_s = left["left_s"] - left["scheduled_s"]
    return {
        "mainline_delay_s": trips.filter(~from_ramp)["delay_s"].mean(),
        "ramp_delay_s": trips.filter(from_ramp)["delay_s"].mean(),
        **{name: travel_s.quantile(share, "linear") for name, share in SHARES.items()},
    }


def _keys(spec: CorridorSpec, status: str, error: str | None) -> Row:
    named = {"run_id": spec.run_id, **spec.keys, "settings": spec.settings}
    return {**named, "status": status, "error": error}


def _sum(values: pl.Series) -> int | None:
    """The sum of what is known; None where nothing is."""
    known = values.drop_nulls()
    return int(known.sum()) if len(known) else None
