"""What a gain owes to its baseline, and what to short gaps rather than to coordination."""

from typing import Any

import polars as pl

from coramp.studies.baseline_gaps import gap_tables
from coramp.studies.baseline_runs import (
    LANE,
    MARKED,
    Flow,
    estimates,
    flows_of,
    marks,
    matching,
    with_settings,
)
from coramp.studies.paper_layout import LEAST_BASELINE_S, percent, rate
from coramp.studies.statistics import estimate
from coramp.studies.tables import Table, with_interval

CONTROLLED = "mainline-priority"
POPULATIONS = ("paper", "fair")
DRIVER_GAP_S = 1.0


def baseline_tables(good: pl.DataFrame) -> list[Table]:
    """Returns the rate of improvement against each baseline, and delays at equal gaps."""
    if good.is_empty():
        return []
    runs = with_settings(good)
    return [*_rates(runs), *gap_tables(runs)]


def _rates(runs: pl.DataFrame) -> list[Table]:
    drivers = _baselines(runs)
    changed = drivers.filter(pl.col("overrides").is_not_null())
    flows = flows_of(drivers if changed.is_empty() else changed)
    rows = []
    for text in drivers["overrides"].fill_null("").unique(maintain_order=True):
        for population in POPULATIONS:
            own = drivers.filter(pl.col("overrides").fill_null("") == text, drivers=population)
            if own.is_empty():
                continue
            said = own["said"][0]
            controlled = matching(
                runs.filter(strategy=CONTROLLED), lane=said[LANE], gap=0.0, standstill=0.0
            )
            rows.append((said, _rate_row(population, said, own, controlled, flows)))
    rows.sort(key=lambda row: (row[1][0], row[0][LANE], row[1]))
    if not rows:
        return []
    columns = ("drivers", "lane (m)", "integrator", "sigma", "lcCooperative")
    per_flow = (f"{m:g} + {r:g}: {what}" for m, r in flows for what in ("D_k (s)", "I_r (%)"))
    notes = (
        (
            "D_k: mean mainline delay of the drivers, with its 95 % interval; I_r: Eq. 46 for "
            f"{CONTROLLED} on the same lane. A dash where the drivers lose less than "
            f"{LEAST_BASELINE_S:g} s."
        ),
        MARKED,
    )
    table_rows = tuple(row for _, row in rows)
    return [Table("Improvement against each baseline", (*columns, *per_flow), table_rows, notes)]


def _baselines(runs: pl.DataFrame) -> pl.DataFrame:
    """The runs of the paper's and of fair drivers who keep the time gap that SUMO's drivers do."""
    drivers = runs.filter(pl.col("drivers").is_in(POPULATIONS), strategy="uncontrolled")
    return matching(drivers, car_following="Krauss", tau_s=DRIVER_GAP_S)


def _rate_row(
    population: str,
    said: dict[str, Any],
    own: pl.DataFrame,
    controlled: pl.DataFrame,
    flows: list[Flow],
) -> tuple[str, ...]:
    drivers, ours = estimates(own, "mainline_delay_s"), estimates(controlled, "mainline_delay_s")
    cells = [population, f"{said[LANE]:g}", str(said["integrator"]), f"{said['sigma']:g}"]
    cells.append(f"{said['lc_cooperative']:g}")
    for flow in flows:
        nothing = estimate([])
        baseline, plan = drivers.get(flow, nothing), ours.get(flow, nothing)
        cells.append(with_interval(baseline) + marks(own, flow))
        cells.append(percent(rate(plan.mean, baseline.mean, LEAST_BASELINE_S)))
    return tuple(cells)
