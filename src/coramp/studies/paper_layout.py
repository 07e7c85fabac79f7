"""The paper's Tables 1, 2 and 4 beside ours, with both driver populations in one table."""

import math
from collections.abc import Callable
from typing import NamedTuple

import polars as pl

from coramp.road.streams import STREAMS
from coramp.studies.paper_results import FUEL_L, MAINLINE_DELAY_S, RAMP_DELAY_S, Flows, Printed
from coramp.studies.statistics import Estimate, estimate, improvement_rate
from coramp.studies.tables import Table, number, with_interval

LEAST_BASELINE_S = 0.1
"""A baseline that loses less has no improvement rate."""
STRATEGIES = ("mainline-priority", "ramp-priority")
POPULATIONS = ("paper", "fair")
INTERVALS = "Means over seeds with 95 % intervals."


class Cell(NamedTuple):
    """Which runs a figure is taken from."""

    strategy: str
    drivers: str | None


Lookup = Callable[[Flows, Cell], Estimate]


def paper_tables(good: pl.DataFrame) -> list[Table]:
    """Returns Tables 1, 2 and 4, speeds as in Fig. 14 and 15, and the check of the baseline."""
    return [
        delay_table(good, "Table 1: mainline delay (s)", "mainline_delay_s", MAINLINE_DELAY_S),
        delay_table(good, "Table 2: ramp delay (s)", "ramp_delay_s", RAMP_DELAY_S),
        fuel_table(good),
        speed_table(good),
        baseline_table(good),
    ]


def lookup(good: pl.DataFrame, column: str) -> Lookup:
    """Returns a function that gives the estimate of a column for flows and a cell."""
    plain = good.filter(pl.col("overrides").is_null())

    def find(flows: Flows, cell: Cell) -> Estimate:
        mainline, ramp = flows
        drivers = pl.col("drivers")
        rows = plain.filter(
            (pl.col("mainline_veh_h") == mainline)
            & (pl.col("ramp_veh_h") == ramp)
            & (pl.col("strategy") == cell.strategy)
            & (drivers.is_null() if cell.drivers is None else drivers == cell.drivers)
        )
        return estimate(rows[column].drop_nulls().to_list())

    return find


def rate(controlled: float, uncontrolled: float, least: float) -> float:
    """Returns the improvement rate (share), nan where the baseline loses less than ``least``."""
    if math.isnan(controlled) or math.isnan(uncontrolled) or uncontrolled < least:
        return math.nan
    return improvement_rate(controlled, uncontrolled)


def percent(share: float, digits: int = 1) -> str:
    """Returns a share as a percentage, a dash for none."""
    return number(100.0 * share, digits)


def delay_table(
    good: pl.DataFrame, title: str, column: str, printed: dict[Flows, Printed]
) -> Table:
    """Returns a table of delays and improvement rates: the paper's, then ours.

    Rates are those of Eq. 46 and 47, against each population of drivers.
    """
    find = lookup(good, column)
    rows, reached = [], dict.fromkeys(POPULATIONS, 0)
    for flows, paper in printed.items():
        baselines = {p: find(flows, Cell("uncontrolled", p)) for p in POPULATIONS}
        ours = {s: find(flows, Cell(s, None)) for s in STRATEGIES}
        rates = {
            (s, p): rate(ours[s].mean, baselines[p].mean, LEAST_BASELINE_S)
            for s in STRATEGIES
            for p in POPULATIONS
        }
        papers = improvement_rate(paper.mainline_priority, paper.uncontrolled)
        for population in POPULATIONS:
            reached[population] += rates["mainline-priority", population] >= papers
        rows.append(
            (
                f"{flows[0]} + {flows[1]}",
                number(paper.uncontrolled),
                f"{number(paper.mainline_priority)} ({percent(papers)})",
                (
                    f"{number(paper.ramp_priority)} "
                    f"({percent(improvement_rate(paper.ramp_priority, paper.uncontrolled))})"
                ),
                *(with_interval(baselines[p]) for p in POPULATIONS),
                with_interval(ours["mainline-priority"]),
                *(percent(rates["mainline-priority", p]) for p in POPULATIONS),
                with_interval(ours["ramp-priority"]),
                *(percent(rates["ramp-priority", p]) for p in POPULATIONS),
            )
        )
    columns = (
        "flow (veh/h)",
        "paper D_k",
        "paper D_m (I_r %)",
        "paper D_r (I_p %)",
        "D_k paper's drivers",
        "D_k fair drivers",
        "D_m",
        "I_r % paper's",
        "I_r % fair",
        "D_r",
        "I_p % paper's",
        "I_p % fair",
    )
    against = " and ".join(
        f"in {reached[p]} of {len(rows)} against {name}"
        for p, name in (("paper", "the paper's drivers"), ("fair", "fair ones"))
    )
    verdict = f"Rows in which mainline priority reaches the paper's improvement rate: {against}."
    legend = (
        "D_k: no control; D_m: mainline priority; D_r: ramp priority; I_r, I_p: Eq. 46, 47. A dash "
        f"stands where the baseline loses less than {LEAST_BASELINE_S} s. {INTERVALS}"
    )
    return Table(title, columns, tuple(rows), (verdict, legend))


def fuel_table(good: pl.DataFrame) -> Table:
    """Returns Table 4: fuel, against each population with Krauss' noise and without."""
    find = lookup(good, "fuel_l")
    populations = [f"{p}{noise}" for p in POPULATIONS for noise in ("", "-sigma0")]
    rows, reached = [], dict.fromkeys(populations, 0)
    for flows, paper in FUEL_L.items():
        ours = {s: find(flows, Cell(s, None)) for s in STRATEGIES}
        papers = improvement_rate(paper.mainline_priority, paper.uncontrolled)
        cells = []
        for population in populations:
            baseline = find(flows, Cell("uncontrolled", population)).mean
            rates = [rate(ours[s].mean, baseline, 0.01) for s in STRATEGIES]
            reached[population] += rates[0] >= papers
            cells.append(f"{number(baseline, 1)} ({percent(rates[0])} / {percent(rates[1])})")
        rows.append(
            (
                f"{flows[0]} + {flows[1]}",
                number(paper.uncontrolled),
                f"{number(paper.mainline_priority)} ({percent(papers)})",
                (
                    f"{number(paper.ramp_priority)} "
                    f"({percent(improvement_rate(paper.ramp_priority, paper.uncontrolled))})"
                ),
                *(with_interval(ours[s], 1) for s in STRATEGIES),
                *cells,
            )
        )
    columns = (
        "flow (veh/h)",
        "paper, no control",
        "paper, mainline (%)",
        "paper, ramp (%)",
        "mainline priority",
        "ramp priority",
        "paper's drivers (%)",
        "paper's, sigma 0 (%)",
        "fair drivers (%)",
        "fair, sigma 0 (%)",
    )
    counts = ", ".join(f"{name} {reached[name]}" for name in populations)
    verdict = (
        f"Rows (of {len(rows)}) in which mainline priority saves at least what the paper prints: "
        f"{counts}."
    )
    legend = (
        "In brackets: savings of mainline / ramp priority. sigma is Krauss' noise, which alone "
        "nearly doubles the fuel; without it (sigma 0) the comparison is about merging."
    )
    return Table("Table 4: total fuel (l)", columns, tuple(rows), (verdict, legend))


def speed_table(good: pl.DataFrame) -> Table:
    """Returns mean speeds and their fluctuation over 1 s bins, as in Fig. 14 and 15."""
    cells = [Cell("mainline-priority", None), Cell("ramp-priority", None)]
    cells += [Cell("uncontrolled", p) for p in POPULATIONS]
    rows = []
    for flows in MAINLINE_DELAY_S:
        row = [f"{flows[0]} + {flows[1]}"]
        for stream in STREAMS:
            means = lookup(good, f"{stream}_speed_mps")
            spreads = lookup(good, f"{stream}_speed_std_mps")
            row += [
                f"{number(means(flows, cell).mean)} ({number(spreads(flows, cell).mean)})"
                for cell in cells
            ]
        rows.append(tuple(row))
    names = ("mainline prio", "ramp prio", "paper's drivers", "fair drivers")
    columns = (
        "flow (veh/h)",
        *(f"mainline: {name}" for name in names),
        *(f"ramp: {name}" for name in names),
    )
    note = "In brackets: standard deviation over 1 s bins of the stream's mean speed."
    return Table("Mean speed (m/s)", columns, tuple(rows), (note,))


def baseline_table(good: pl.DataFrame) -> Table:
    """Returns what drivers lose with no ramp, or no mainline, at all."""
    mainline, ramp = lookup(good, "mainline_delay_s"), lookup(good, "ramp_delay_s")
    alone = good.filter((pl.col("mainline_veh_h") == 0) != (pl.col("ramp_veh_h") == 0))
    flows = (
        alone.select("mainline_veh_h", "ramp_veh_h").unique().sort("ramp_veh_h", "mainline_veh_h")
    )
    rows = []
    for mainline_veh_h, ramp_veh_h in flows.iter_rows():
        find = mainline if ramp_veh_h == 0 else ramp
        rows.append(
            (
                f"{mainline_veh_h:g} + {ramp_veh_h:g}",
                *(
                    with_interval(find((mainline_veh_h, ramp_veh_h), Cell("uncontrolled", p)))
                    for p in POPULATIONS
                ),
            )
        )
    columns = ("flow (veh/h)", "paper's drivers (s)", "fair drivers (s)")
    note = "The delay of one stream alone: what the baseline loses without any merging."
    return Table("Baseline check: one stream alone", columns, tuple(rows), (note,))
