"""Delays at equal gaps, with a plan and without, and those of drivers as they are."""

from collections.abc import Iterator, Sequence

import polars as pl

from coramp.studies.baseline_runs import (
    GAP,
    LANE,
    MARKED,
    STANDSTILL,
    Flow,
    delays,
    flows_of,
    matching,
    set_only,
)
from coramp.studies.overrides import overrides_of
from coramp.studies.tables import Table

COORDINATED = ("slots", "fifo-optimal-control", "mainline-priority", "ramp-priority")
UNCOORDINATED = ("ACC", "CACC")
YIELDING = ((1.0, "making room"), (0.0, "making no room"))
"""SUMO's lcCooperative of automated followers, in words."""
AS_THEY_ARE = ("fair", "credible", "credible-uniform")
NOTE = "Mean delay of mainline / ramp in s, with 95 % intervals over seeds."

Cases = Iterator[tuple[str, pl.DataFrame]]


def gap_tables(runs: pl.DataFrame) -> list[Table]:
    """Returns the delays at equal time gaps, at equal following distances, and of drivers."""
    drivers = runs.filter(strategy="uncontrolled")
    plans = runs.filter(pl.col("drivers").is_null())
    flows = flows_of(pl.concat([_automated(drivers), *_followers(drivers)]))
    return [
        *_equal_gaps(drivers, plans, flows),
        *_equal_distances(drivers, plans, flows),
        *_as_they_are(drivers),
    ]


def _automated(drivers: pl.DataFrame) -> pl.DataFrame:
    return drivers.filter(pl.col("drivers").str.starts_with("automated"))


def _followers(drivers: pl.DataFrame) -> list[pl.DataFrame]:
    return [matching(drivers, car_following=model) for model in UNCOORDINATED]


def _equal_gaps(drivers: pl.DataFrame, plans: pl.DataFrame, flows: list[Flow]) -> list[Table]:
    plain = matching(plans, standstill=0.0)
    gaps = {settings[GAP] for settings in plain["said"].to_list()}
    for found in (_automated(drivers), *_followers(drivers)):
        gaps |= {settings["tau_s"] for settings in found["said"].to_list()}
    rows = [
        (f"{gap:g}" if gap else "Eq. 1", name, *delays(own, flows))
        for gap in sorted(gaps)
        for name, own in (
            *_acc(drivers, gap),
            *_krauss(drivers, gap),
            *_coordinated(matching(plain, gap=gap)),
        )
        if not own.is_empty()
    ]
    return _table("The same time gaps without and with a plan", "time gap (s)", flows, rows)


def _equal_distances(drivers: pl.DataFrame, plans: pl.DataFrame, flows: list[Flow]) -> list[Table]:
    apart = [s[STANDSTILL] for s in plans["said"].to_list() if s[STANDSTILL] > 0.0]
    rows = []
    for standstill_m in sorted(set(apart)):
        kept = matching(plans, standstill=standstill_m)
        same = matching(drivers, min_gap_m=standstill_m)
        rows += [
            (f"{gap:g} s, {standstill_m:g} m", name, *delays(own, flows))
            for gap in sorted({settings[GAP] for settings in kept["said"].to_list()})
            for name, own in (*_krauss(same, gap), *_coordinated(matching(kept, gap=gap)))
            if not own.is_empty()
        ]
    title = "The same following distances without and with a plan"
    return _table(title, "time gap, standstill gap", flows, rows)


def _acc(drivers: pl.DataFrame, gap: float) -> Cases:
    for model in UNCOORDINATED:
        yield f"uncoordinated {model}", matching(drivers, car_following=model, tau_s=gap)


def _krauss(drivers: pl.DataFrame, gap: float) -> Cases:
    for cooperative, how in YIELDING:
        own = matching(_automated(drivers), tau_s=gap, lc_cooperative=cooperative)
        yield f"automated Krauss, sigma 0, {how}", own
    fair = set_only(drivers.filter(drivers="fair"), "tau_s")
    yield "drivers, Krauss, sigma 0.5", matching(fair, tau_s=gap)


def _coordinated(plans: pl.DataFrame) -> Cases:
    for name in COORDINATED:
        yield f"coordinated, {name}", _without_lanes(plans.filter(strategy=name))


def _without_lanes(plans: pl.DataFrame) -> pl.DataFrame:
    kept = [LANE not in overrides_of(run) for run in plans.iter_rows(named=True)]
    return plans.filter(pl.Series(kept, dtype=pl.Boolean))


def _as_they_are(drivers: pl.DataFrame) -> list[Table]:
    plain = drivers.filter(pl.col("overrides").is_null(), pl.col("drivers").is_in(AS_THEY_ARE))
    if plain["drivers"].n_unique() < 2:
        return []
    flows = flows_of(plain)
    rows = []
    for name in AS_THEY_ARE:
        own = plain.filter(drivers=name)
        cells = zip(delays(own, flows), flows, strict=True)
        rows.append((name, *(cell + _broke(own, flow) for cell, flow in cells)))
    note = "b: of how many seeds the merge broke down, as in the study drivers."
    columns = ("drivers", *(f"{m:g} + {r:g}" for m, r in flows))
    return [Table("Drivers as they are", columns, tuple(rows), (NOTE, MARKED, note))]


def _broke(own: pl.DataFrame, flow: Flow) -> str:
    there = own.filter(mainline_veh_h=flow[0], ramp_veh_h=flow[1])
    broken = there["breakdown_time_s"].drop_nulls().len()
    return f", b {broken} of {there.height}" if broken else ""


def _table(
    title: str, first: str, flows: list[Flow], rows: Sequence[tuple[str, ...]]
) -> list[Table]:
    if not rows or not flows:
        return []
    columns = (first, "vehicles", *(f"{m:g} + {r:g}" for m, r in flows))
    return [Table(title, columns, tuple(rows), (NOTE, MARKED))]
