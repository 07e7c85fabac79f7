"""Strategies side by side: every metric, paired differences, ranks, and who is on the front."""

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import polars as pl

from coramp.studies.metric_labels import label_of
from coramp.studies.statistics import Estimate, estimate
from coramp.studies.tables import Table, number, with_interval

REFERENCE = "uncontrolled"
PAPER_FLOWS = frozenset((m, r) for m in (800.0, 1200.0, 1800.0) for r in (200.0, 300.0, 500.0))
WITHIN, BEYOND = "the paper's nine flows", "flows beyond capacity"
FLOW = ["mainline_veh_h", "ramp_veh_h"]


class Metric(NamedTuple):
    """A figure of a run: its column, what is good, its digits."""

    column: str
    high_is_good: bool = False
    digits: int = 2

    @property
    def title(self) -> str:
        """Its name, unit included."""
        return label_of(self.column)


METRICS = (
    Metric("mainline_delay_s"),
    Metric("ramp_delay_s"),
    Metric("delay_s"),
    Metric("mainline_speed_mps", True),
    Metric("ramp_speed_mps", True),
    Metric("mainline_speed_std_mps"),
    Metric("ramp_speed_std_mps"),
    Metric("fuel_ml"),
    Metric("max_decel_mps2"),
    Metric("max_jerk_mps3"),
    Metric("min_margin_m", True),
    Metric("min_ttc_s", True),
    Metric("max_drac_mps2"),
    Metric("unserved", digits=1),
    Metric("interventions", digits=1),
    Metric("planning_ms", digits=3),
)
DELAY, FUEL = "delay_s", "fuel_ml"


def with_derived(good: pl.DataFrame) -> pl.DataFrame:
    """Returns the runs with the delay and fuel of a mean vehicle, and how they are called."""
    mainline, ramp = pl.col("vehicles_mainline"), pl.col("vehicles_ramp")
    lost_s = (
        pl.col("mainline_delay_s").fill_null(0.0) * mainline
        + pl.col("ramp_delay_s").fill_null(0.0) * ramp
    )
    name = pl.format("{} ({})", "strategy", "drivers").fill_null(pl.col("strategy"))
    return good.with_columns(
        name=pl.when(pl.col("drivers") == "fair").then(pl.col("strategy")).otherwise(name),
        delay_s=lost_s / (mainline + ramp),
        fuel_ml=1000.0 * pl.col("fuel_l") / (mainline + ramp),
        planning_ms=1000.0 * pl.col("planning_median_s"),
    ).with_columns(
        pl.when(pl.col("drivers").is_null()).then(pl.col("planning_ms")).alias("planning_ms")
    )


def field_tables(good: pl.DataFrame) -> list[Table]:
    """Returns delays by flow, then for each range of flows all metrics, differences and ranks."""
    runs = with_derived(good)
    tables = [_by_flow(runs), _saved_by_flow(runs)]
    for title, part in ranges(runs):
        tables += [_metrics(title, part), _differences(title, part), _ranks(title, part)]
    return tables


def ranges(runs: pl.DataFrame) -> list[tuple[str, pl.DataFrame]]:
    """Returns the runs of the paper's flows, and those of others, as far as there are any."""
    inside = pl.Series(
        [pair in PAPER_FLOWS for pair in runs.select(FLOW).iter_rows()], dtype=pl.Boolean
    )
    parts = ((WITHIN, runs.filter(inside)), (BEYOND, runs.filter(~inside)))
    return [(title, part) for title, part in parts if part.height]


def names_of(runs: pl.DataFrame) -> list[str]:
    """Returns the strategies, the reference first."""
    names: list[str] = runs["name"].unique(maintain_order=True).to_list()
    return sorted(names, key=lambda name: (name != REFERENCE, name))


def per_seed(runs: pl.DataFrame, name: str, column: str) -> dict[int, float]:
    """Returns a strategy's mean over flows, a seed each; seeds that lack a value are left out."""
    own = runs.filter(name=name)
    flows = own.select(FLOW).unique().height
    return {
        int(seed): float(sum(group[column].to_list()) / flows)
        for (seed,), group in own.group_by(["seed"], maintain_order=True)
        if group[column].drop_nulls().len() == flows
    }


def paired_difference(runs: pl.DataFrame, name: str, column: str) -> Estimate:
    """Returns a strategy's mean less the reference's, seed by seed, with its interval."""
    own, other = per_seed(runs, name, column), per_seed(runs, REFERENCE, column)
    return estimate([own[seed] - other[seed] for seed in sorted(own.keys() & other.keys())])


def mean_of(runs: pl.DataFrame, name: str, column: str) -> Estimate:
    """Returns a strategy's mean over flows, with its interval over seeds."""
    return estimate(list(per_seed(runs, name, column).values()))


def pareto_front(points: Iterable[tuple[str, float, float]]) -> list[str]:
    """Returns the names that no other beats in one figure without losing in the other.

    Both figures are the better the smaller they are.
    """
    listed = list(points)
    return [
        name
        for name, x, y in listed
        if not any(a <= x and b <= y and (a < x or b < y) for _, a, b in listed)
    ]


def front_of(runs: pl.DataFrame, names: Sequence[str]) -> list[str]:
    """Returns who is on the front of delay of all against fuel, as far as the tables' digits go."""
    digits = {metric.column: metric.digits for metric in METRICS}

    def figure(name: str, column: str) -> float:
        return round(mean_of(runs, name, column).mean, digits[column])

    return pareto_front((name, figure(name, DELAY), figure(name, FUEL)) for name in names)


def _by_flow(runs: pl.DataFrame) -> Table:
    flows = sorted(runs.select(FLOW).unique().iter_rows())
    rows = [
        (name, *(with_interval(mean_of(_at(runs, flow), name, DELAY)) for flow in flows))
        for name in names_of(runs)
    ]
    columns = ("strategy", *(f"{m:g} + {r:g}" for m, r in flows))
    note = "Mean over all vehicles, waiting outside and the unserved included; 95 % intervals."
    return Table("Delay by flow (s)", columns, tuple(rows), (note,))


def _saved_by_flow(runs: pl.DataFrame) -> Table:
    flows = sorted(runs.select(FLOW).unique().iter_rows())
    rows = [
        (name, *(with_interval(paired_difference(_at(runs, flow), name, DELAY)) for flow in flows))
        for name in names_of(runs)
        if name != REFERENCE
    ]
    columns = ("strategy", *(f"{m:g} + {r:g}" for m, r in flows))
    note = f"Paired by seed; below 0: less than {REFERENCE} with fair drivers."
    return Table("Delay less that of drivers, by flow (s)", columns, tuple(rows), (note,))


def _at(runs: pl.DataFrame, flow: Sequence[float]) -> pl.DataFrame:
    return runs.filter(mainline_veh_h=flow[0], ramp_veh_h=flow[1])


def _metrics(title: str, runs: pl.DataFrame) -> Table:
    rows = [
        (name, *(_cell(mean_of(runs, name, metric.column), metric) for metric in METRICS))
        for name in names_of(runs)
    ]
    note = (
        "Means over flows and seeds, with 95 % intervals over seeds; extremes are means of each "
        "run's extreme. Interventions: commands that the checker refused and the safe fallback "
        "replaced."
    )
    return Table(f"All metrics, {title}", _columns(), tuple(rows), (note,))


def _differences(title: str, runs: pl.DataFrame) -> Table:
    rows = [
        (name, *(_cell(paired_difference(runs, name, m.column), m) for m in METRICS))
        for name in names_of(runs)
        if name != REFERENCE
    ]
    note = "Paired by seed, with 95 % intervals; a dash where drivers have no such figure."
    return Table(f"Less {REFERENCE} (fair drivers), {title}", _columns(), tuple(rows), (note,))


def _ranks(title: str, runs: pl.DataFrame) -> Table:
    names = names_of(runs)
    places = [
        ranks(metric, {n: mean_of(runs, n, metric.column) for n in names}) for metric in METRICS
    ]
    front = front_of(runs, names)
    rows = [
        (name, *(str(place.get(name, "-")) for place in places), "yes" if name in front else "")
        for name in names
    ]
    note = (
        "1 is best; equal as far as the digits of the tables show is equal. The front holds those "
        "that none beats in delay of all without losing in fuel, or the other way round."
    )
    return Table(f"Ranks, {title}", (*_columns(), "on the front"), tuple(rows), (note,))


def ranks(metric: Metric, estimates: dict[str, Estimate]) -> dict[str, int]:
    """Returns the rank of each strategy that has the figure; equal rounded figures share one."""
    values = {
        name: round(found.mean, metric.digits) for name, found in estimates.items() if found.values
    }
    sign = -1.0 if metric.high_is_good else 1.0
    return {
        name: 1 + sum(sign * other < sign * value for other in values.values())
        for name, value in values.items()
    }


def _columns() -> tuple[str, ...]:
    return ("strategy", *(metric.title for metric in METRICS))


def _cell(found: Estimate, metric: Metric) -> str:
    return with_interval(found, metric.digits) if found.values else number(None)
