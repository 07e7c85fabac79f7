"""What coordination is worth: coordinated vehicles beside drivers and beside automation alone."""

from typing import Any

import polars as pl

from coramp.studies.capacity_layout import gaps_in_words
from coramp.studies.metric_labels import label_of
from coramp.studies.overrides import overrides_of, setting_of
from coramp.studies.statistics import estimate
from coramp.studies.tables import Table, number, with_interval

GAPS = ("safety.time_gap_s", "safety.standstill_gap_m")
DELAYS_NOTE = (
    "Mean delay of all vehicles in s, waiting outside included, with 95 % intervals over seeds. In "
    "brackets: vehicles that had not left at the end (u), pairs that collided in SUMO (c)."
)
FLOW_NOTE = (
    "Delays and fuel are means over seeds, the rest are sums over seeds but for the smallest TTC. "
    "Brakings: 0.2 s or more beyond 3 and 4.5 m/s2. Stopped: below 0.1 m/s from entry to merge."
)


def worth_tables(good: pl.DataFrame) -> list[Table]:
    """Returns the mean delay of all by flow, then everything else, one table a flow."""
    if good.is_empty():
        return []
    rows = good.to_dicts()
    flows = sorted({(run["mainline_veh_h"], run["ramp_veh_h"]) for run in rows})
    names = sorted({_order(run): name_of(run) for run in rows}.items())
    found = {
        (name, flow): [
            run
            for run in rows
            if name_of(run) == name and (run["mainline_veh_h"], run["ramp_veh_h"]) == flow
        ]
        for _, name in names
        for flow in flows
    }
    columns = ("vehicles, gaps", *(f"{m:g} + {r:g}" for m, r in flows))
    delays = tuple((name, *(_delay(found[name, flow]) for flow in flows)) for _, name in names)
    tables = [Table("Mean delay of all vehicles (s)", columns, delays, (DELAYS_NOTE,))]
    for flow in flows:
        there = [(name, found[name, flow]) for _, name in names if found[name, flow]]
        body = tuple((name, *_figures(runs)) for name, runs in there)
        title = f"At {flow[0]:g} + {flow[1]:g} veh/h"
        tables.append(Table(title, ("vehicles, gaps", *FIGURES), body, (FLOW_NOTE,)))
    return tables


FIGURES = (
    *(label_of(column) for column in ("mainline_delay_s", "ramp_delay_s", "fuel_l")),
    "brakings beyond 3, 4.5 m/s2",
    "stopped",
    label_of("min_ttc_s"),
    "collisions",
    "unserved",
)


def name_of(run: dict[str, Any]) -> str:
    """Returns the strategy or drivers and their gaps, in words."""
    gaps = gaps_in_words(overrides_of(run))
    if run["drivers"] is None:
        kept = gaps_in_words({key: setting_of(run, key) for key in GAPS})
        others = [part for part in gaps.split(", ") if part and part not in kept]
        return ", ".join([run["strategy"], kept or "Eq. 1", *others])
    own = gaps.replace(f"drivers.{run['drivers']}.", "")
    return f"{run['drivers']} drivers{', ' + own if own else ''}"


def _order(run: dict[str, Any]) -> tuple[Any, ...]:
    """Coordinated first, then drivers by name."""
    return (run["drivers"] is not None, run["drivers"] or run["strategy"], run["overrides"] or "")


def _delay(runs: list[dict[str, Any]]) -> str:
    if not runs:
        return "-"
    marks = [
        f"{mark} {count}"
        for mark, count in (
            ("u", sum(run["unserved"] for run in runs)),
            ("c", sum(run["collisions"] for run in runs)),
        )
        if count
    ]
    text = with_interval(estimate([run["delay_s"] for run in runs]))
    return f"{text} ({', '.join(marks)})" if marks else text


def _figures(runs: list[dict[str, Any]]) -> tuple[str, ...]:
    def mean(column: str) -> str:
        return with_interval(estimate([run[column] for run in runs if run[column] is not None]))

    closest = [run["min_ttc_s"] for run in runs if run["min_ttc_s"] is not None]
    return (
        mean("mainline_delay_s"),
        mean("ramp_delay_s"),
        mean("fuel_l"),
        ", ".join(str(sum(r[c] for r in runs)) for c in ("hard_brakings_3", "hard_brakings_4_5")),
        str(sum(run["stops"] for run in runs)),
        number(min(closest)) if closest else "-",
        str(sum(run["collisions"] for run in runs)),
        str(sum(run["unserved"] for run in runs)),
    )
