"""The tables that sum up a study, from its runs alone."""

import math
from collections.abc import Callable, Iterable, Mapping
from typing import Any

import polars as pl

from coramp.runs.running import broken_promises
from coramp.studies.baseline_layout import baseline_tables
from coramp.studies.capacity_layout import capacity_tables
from coramp.studies.definition import Study
from coramp.studies.drivers_layout import drivers_tables
from coramp.studies.field_layout import field_tables
from coramp.studies.hostile_layout import hostile_tables
from coramp.studies.metric_labels import LABELS, SPEED, label_of
from coramp.studies.overrides import keys_set, overrides_of
from coramp.studies.paired import paired_table
from coramp.studies.paper_layout import paper_tables
from coramp.studies.penetration_layout import penetration_tables
from coramp.studies.sensitivity_layout import sensitivity_tables
from coramp.studies.setting_words import setting_among
from coramp.studies.speed_unit import MPS, SpeedUnit
from coramp.studies.statistics import Estimate, estimate
from coramp.studies.tables import Table, number, with_interval
from coramp.studies.worth_layout import worth_tables

LAYOUTS: dict[str, Callable[[pl.DataFrame], list[Table]]] = {
    "paper": paper_tables,
    "sensitivity": sensitivity_tables,
    "field": field_tables,
    "baseline": baseline_tables,
    "drivers": drivers_tables,
    "worth": worth_tables,
    "penetration": penetration_tables,
    "hostile": hostile_tables,
}
MEANS = (
    *("delay_s", "delay_bound_s", "mainline_delay_s", "ramp_delay_s"),
    *("mainline_speed_mps", "ramp_speed_mps", "fuel_l"),
)
"""What the overview has the mean over seeds of, with its interval."""
AS_GIVEN = "as in the scenario"
MEAN_NOTE = "Means over seeds with 95 % intervals; delays count waiting outside and every vehicle."
BOUND = (
    f"{LABELS['delay_bound_s'].name.capitalize()}: what equal vehicles would lose in the order of "
    "first come, first served. It is reckoned for each run: where its plans brought a vehicle out "
    "earlier than its free movement, or two closer than their gaps ask for, that is granted. So it "
    "differs by strategy."
)
IMPORTANT = (
    *("strategy", "setting", "flow (veh/h)", label_of("delay_s"), label_of("mainline_delay_s")),
    *(label_of("ramp_delay_s"), label_of("unserved"), "runs"),
)
"""Columns of the overview that a narrow terminal keeps first."""
GROUP = ["scenario", "overrides", "drivers", "strategy", "engine", "mainline_veh_h", "ramp_veh_h"]


def summary_tables(
    study: Study,
    runs: pl.DataFrame,
    unit: SpeedUnit = MPS,
    scenario: Mapping[str, Any] | None = None,
) -> list[Table]:
    """Returns a study's tables: those of its layout, every group of runs, differences, promises.

    ``scenario`` is the content of the study's scenario: where a run sets nothing, its values are
    told of what others set, in the tables of a study without a layout of its own.
    """
    good = runs.filter(status="ok")
    if study.layout == "capacity":
        own = capacity_tables(good, study.horizon_s)
    else:
        make = LAYOUTS.get(study.layout)
        own = make(good) if make is not None else []
    whole = study.layout == "plain"
    paired = paired_table(good, scenario) if whole else None
    every = overview(good, unit, scenario if whole else None)
    return [*own, every, *([paired] if paired is not None else []), promises(runs)]


def overview(
    good: pl.DataFrame, unit: SpeedUnit = MPS, scenario: Mapping[str, Any] | None = None
) -> Table:
    """Returns one row a group of runs that differ only by their seed; speeds in a unit.

    What a run does not set and others do is told by the ``scenario``, if that is known.
    """
    rows = []
    keys = keys_set(good)
    for key, group in good.group_by(GROUP, maintain_order=True):
        named, _, drivers, strategy, engine, mainline, ramp = key
        means = (
            with_interval(_in(unit if LABELS[column].unit == SPEED else MPS, of(group, column)))
            for column in MEANS
        )
        rows.append(
            (
                f"{strategy} ({drivers})" if drivers else str(strategy),
                setting_among(overrides_of(group.row(0, named=True)), keys, scenario) or AS_GIVEN,
                f"{mainline:g} + {ramp:g}",
                *means,
                str(group["unserved"].sum()),
                number(smallest(group["min_ttc_s"])),
                number(largest(group["max_decel_mps2"])),
                str(group.height),
                str(engine),
                str(named),
            )
        )
    columns = (
        *("strategy", "setting", "flow (veh/h)"),
        *(label_of(column, unit) for column in MEANS),
        *(label_of(column) for column in ("unserved", "min_ttc_s", "max_decel_mps2")),
        *("runs", "engine", "scenario"),
    )
    bound = [BOUND] if good["delay_bound_s"].drop_nulls().len() else []
    return Table("All runs", columns, tuple(rows), (MEAN_NOTE, *bound), IMPORTANT)


def promises(runs: pl.DataFrame) -> Table:
    """Returns what the cooperative runs promised, and kept or not, and how many runs failed.

    Runs among drivers are told apart, where there are any.
    """
    good = runs.filter(status="ok")
    cooperative = good.filter(pl.col("drivers").is_null())
    broken = sum(bool(broken_promises(row)) for row in cooperative.iter_rows(named=True))
    margin_m = smallest(cooperative["min_margin_m"])
    error_m = largest(cooperative["plan_error_m"])
    rows = (
        ("cooperative runs", str(cooperative.height)),
        ("runs that broke a promise", str(broken)),
        ("collisions in SUMO", str(cooperative["collisions"].sum())),
        (label_of("safety_violations"), str(cooperative["safety_violations"].sum())),
        (label_of("min_margin_m"), number(margin_m, 3)),
        (label_of("plan_error_m"), number(error_m, 4)),
        ("vehicles unserved", str(cooperative["unserved"].sum())),
        *_among_drivers(good),
        ("failed runs", str(runs.filter(status="failed").height)),
    )
    return Table("Promises", ("what", "value"), rows)


def _among_drivers(good: pl.DataFrame) -> list[tuple[str, str]]:
    """What automated vehicles promised that a strategy coordinates among drivers."""
    mixed = good.filter(pl.col("drivers").is_not_null() & pl.col("plan_error_m").is_not_null())
    if mixed.is_empty():
        return []
    broken = sum(bool(broken_promises(row)) for row in mixed.iter_rows(named=True))
    return [
        ("runs coordinated among drivers", str(mixed.height)),
        ("of these, runs that broke a promise", str(broken)),
        ("collisions by automated vehicles", str(mixed["collisions_by_automated"].sum())),
        ("collisions by drivers", str(mixed["collisions_by_driver"].sum())),
        ("collisions among drivers", str(mixed["collisions_among_drivers"].sum())),
    ]


def of(group: pl.DataFrame, column: str) -> Estimate:
    """Returns the estimate of a column over the runs that have it."""
    return estimate(group[column].drop_nulls().to_list())


def _in(unit: SpeedUnit, speed_mps: Estimate) -> Estimate:
    mean, half_width, values = speed_mps
    return Estimate(mean * unit.per_mps, half_width * unit.per_mps, values)


def smallest(values: pl.Series) -> float:
    """Returns the smallest value, nan for none."""
    return min(values.drop_nulls(), default=math.nan)


def largest(values: pl.Series) -> float:
    """Returns the largest value, nan for none."""
    return max(values.drop_nulls(), default=math.nan)


def to_markdown(study: Study, tables: Iterable[Table]) -> str:
    """Returns the text of ``tables.md``."""
    head = (
        f"# Study {study.name}\n\n{study.description}\n"
        if study.description
        else f"# Study {study.name}\n"
    )
    return "\n".join([head, *(table.to_markdown() for table in tables)])
