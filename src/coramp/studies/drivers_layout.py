"""How each population of drivers breaks down, beside what was measured on roads."""

from typing import Any

import polars as pl

from coramp.studies.overrides import setting_of
from coramp.studies.statistics import estimate
from coramp.studies.tables import Table, number, with_interval

START = "mainline.start_m"
BEFORE, AFTER = "prebreakdown_flow_veh_h", "discharge_flow_veh_h"
MERGES = (
    "17 merges in the USA, per lane, at a breakdown probability of 15 %; three, four, five lanes"
)
ROADS = (
    (MERGES, "2048, 1959, 1745", "", "Asgharzadeh and Kondyli 2019, arXiv:1907.09606"),
    ("the same with ramp metering; three, four lanes", "2248, 2132", "", "the same"),
    ("two bottlenecks near Toronto", "", "about 10", "Cassidy and Bertini 1999"),
    ("three bottlenecks", "", "3 to 18", "Chung et al. 2007, at second hand"),
    ("three bottlenecks", "", "none", "Anderson and Davis 2020, at second hand"),
)
NOTE = (
    "Means over the seeds that broke down, with 95 % intervals. Breakdown: mean speed at the "
    "loop upstream at least 25 % below v0 for 15 min; before: flow at the zone's end over the "
    "15 min until then; discharge: the same over all intervals of 5 min with a queue."
)


def drivers_tables(good: pl.DataFrame) -> list[Table]:
    """Returns flow before breakdown and discharge by population and approach, and literature's."""
    if good.is_empty():
        return []
    groups: dict[tuple[float, str], list[dict[str, Any]]] = {}
    for run in good.iter_rows(named=True):
        population = run["drivers"] or run["strategy"]
        groups.setdefault((setting_of(run, START), population), []).append(run)
    rows = tuple(_row(start_m, name, runs) for (start_m, name), runs in sorted(groups.items()))
    columns = (
        "mainline approach (m)",
        "drivers",
        "seeds that broke down",
        "flow before (veh/h)",
        "discharge (veh/h)",
        "drop (%)",
        "lowest and highest drop (%)",
        "collisions",
    )
    roads = Table("Measured roads", ("where", "flow before (pc/h)", "drop (%)", "source"), ROADS)
    return [Table("Breakdown of each population", columns, rows, (NOTE,)), roads]


def _row(start_m: float, name: str, runs: list[dict[str, Any]]) -> tuple[str, ...]:
    broke = [run for run in runs if run[AFTER] is not None]
    known = [run for run in broke if run[BEFORE] is not None]
    drops = [100.0 * (1.0 - run[AFTER] / run[BEFORE]) for run in known]
    return (
        f"{-start_m:g}",
        name,
        f"{len(broke)} of {len(runs)}",
        with_interval(estimate([run[BEFORE] for run in known]), 0),
        with_interval(estimate([run[AFTER] for run in broke]), 0),
        with_interval(estimate(drops), 1),
        f"{number(min(drops), 1)} to {number(max(drops), 1)}" if drops else "-",
        str(sum(run["collisions"] for run in runs)),
    )
