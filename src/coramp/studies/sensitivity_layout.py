"""What errors, roads and time gaps do to delay, and to the flow that still merges."""

import math

import polars as pl

from coramp.studies.statistics import estimate
from coramp.studies.tables import Table, number, with_interval

DELAYS = ("mainline_delay_s", "ramp_delay_s")
BREAKDOWN_DELAY_S = 5.0
"""A stream that loses more than this on average, or leaves anyone behind, no longer merges."""


def sensitivity_tables(good: pl.DataFrame) -> list[Table]:
    """Returns for each strategy one row a setting: delays by flow, and the flow that merges."""
    tables = []
    for (strategy,), group in good.group_by(["strategy"], maintain_order=True):
        tables.append(_table(str(strategy), group))
    return tables


def _table(strategy: str, group: pl.DataFrame) -> Table:
    flows = (
        group.select("mainline_veh_h", "ramp_veh_h").unique().sort("mainline_veh_h", "ramp_veh_h")
    )
    pairs = list(flows.iter_rows())
    rows = []
    for (overrides,), setting in group.group_by(["overrides"], maintain_order=True):
        cells, merging = [], -math.inf
        for mainline, ramp in pairs:
            runs = setting.filter(mainline_veh_h=mainline, ramp_veh_h=ramp)
            cells.append(_delays(runs))
            if runs.height and still_merges(runs):
                merging = max(merging, mainline + ramp)
        largest = number(merging, 0) if math.isfinite(merging) else "-"
        rows.append((str(overrides or "as in the scenario"), *cells, largest))
    columns = ("setting", *(f"{m:g} + {r:g}" for m, r in pairs), "flow that still merges (veh/h)")
    legend = "Mean delay of mainline / ramp in s, with 95 % intervals over seeds; u: unserved."
    meaning = (
        "The flow that still merges is the largest here (mainline and ramp together) at which "
        f"neither stream loses more than {BREAKDOWN_DELAY_S:g} s on average and no vehicle is left."
    )
    return Table(f"Sensitivity: {strategy}", columns, tuple(rows), (legend, meaning))


def still_merges(runs: pl.DataFrame) -> bool:
    """Returns whether no stream loses more than 5 s on average and nobody is left behind."""
    delays = [
        estimate(runs[c].drop_nulls().to_list()) for c in ("mainline_delay_s", "ramp_delay_s")
    ]
    worst_s = max((delay.mean for delay in delays if delay.values), default=0.0)
    return worst_s <= BREAKDOWN_DELAY_S and not runs["unserved"].sum()


def _delays(runs: pl.DataFrame) -> str:
    if not runs.height:
        return "-"
    text = " / ".join(
        with_interval(estimate(runs[column].drop_nulls().to_list())) for column in DELAYS
    )
    unserved = int(runs["unserved"].sum())
    return f"{text}, u {unserved}" if unserved else text
