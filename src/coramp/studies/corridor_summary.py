"""The tables that sum up a corridor's study: the whole, its sites, gains, and promises."""

from collections.abc import Mapping, Sequence
from typing import Any

import polars as pl

from coramp.runs.corridors import broken_on_corridor
from coramp.studies.corridor_paired import gains
from coramp.studies.overrides import keys_set, overrides_of
from coramp.studies.paired import MEANS
from coramp.studies.setting_words import setting_among
from coramp.studies.statistics import Estimate, estimate
from coramp.studies.summary import AS_GIVEN, largest
from coramp.studies.tables import Table, number, with_interval

GROUP = ["overrides", "drivers", "strategy"]
DELAY_NOTE = (
    "Means over seeds with 95 % intervals. Delays are means over all vehicles, waiting to enter "
    "included: of those from the upstream ends, and of those from ramps."
)
SITE_NOTE = (
    "Means over seeds with 95 % intervals. Delays are those in the zone of the site, of the "
    "vehicles that left it; below 0 for drivers who are faster than the limit."
)
GAIN_NOTE = "Positive where uncontrolled loses more. By site it is the delay in the site's zone."


def corridor_study_tables(
    runs: pl.DataFrame, sites: pl.DataFrame, scenario: Mapping[str, Any] | None = None
) -> list[Table]:
    """Returns the tables of a corridor's study, of its runs and of its rows by site."""
    good = runs.filter(status="ok")
    names = names_of_cells(good, scenario)
    own = [_whole(good, names), _by_site(good, sites, names)]
    gained = gain_table(good, sites, names)
    return [*own, *([gained] if gained is not None else []), _promises(runs)]


Names = Mapping[Any, tuple[str, str]]
"""By overrides, drivers and strategy: what a group of runs is called, and its setting."""


def names_of_cells(good: pl.DataFrame, scenario: Mapping[str, Any] | None) -> Names:
    """Returns by overrides, drivers and strategy what a group of runs is called, and its setting.

    Drivers are told where the study has several populations.
    """
    keys, several = keys_set(good), good["drivers"].n_unique() > 1
    found = {}
    for row in good.unique(GROUP, maintain_order=True).iter_rows(named=True):
        who = f"{row['strategy']} ({row['drivers']})" if several else str(row["strategy"])
        setting = setting_among(overrides_of(row), keys, scenario) or AS_GIVEN
        found[tuple(row[key] for key in GROUP)] = (who, setting)
    return found


def _whole(good: pl.DataFrame, names: Names) -> Table:
    rows = []
    for key, group in good.group_by(GROUP, maintain_order=True):
        rows.append(
            (
                *names[key],
                *(
                    with_interval(_of(group, name))
                    for name in ("mean_delay_s", "mainline_delay_s", "ramp_delay_s")
                ),
                with_interval(_of(group, "time_spent_s", 1.0 / 3600.0)),
                *(with_interval(_of(group, f"travel_{p}_s"), 1) for p in ("p50", "p95")),
                *(_sum(group, name) for name in ("unserved", "collisions")),
                _sum(group, "collisions_by_automated"),
                *(_mean(group, name) for name in ("hand_overs", "fallbacks")),
                str(group.height),
            )
        )
    columns = (
        *("strategy", "setting", "delay (s)", "mainline delay (s)", "ramp delay (s)"),
        *("time spent (h)", "travel time, median (s)", "travel time, 95 % (s)", "unserved"),
        *("collisions", "by automated vehicles", "hand-overs", "fallbacks", "runs"),
    )
    kept = ("strategy", "setting", *columns[2:5], "unserved", "runs")
    return Table("The corridor", columns, tuple(rows), (DELAY_NOTE,), kept)


def _by_site(good: pl.DataFrame, sites: pl.DataFrame, names: Names) -> Table:
    both = good.select("run_id", *GROUP).join(sites, on="run_id", maintain_order="left")
    rows = []
    for site in sites["site"].unique(maintain_order=True):
        of_site = both.filter(site=site)
        for key, group in of_site.group_by(GROUP, maintain_order=True):
            rows.append(
                (
                    site,
                    *names[key],
                    *(with_interval(_of(group, f"{s}_delay_s")) for s in ("mainline", "ramp")),
                    f"{_mean(group, 'mainline_served')} + {_mean(group, 'ramp_served')}",
                    *(_mean(group, name) for name in ("merges", "made_way", "hard_brakings_3")),
                    *(_mean(group, name) for name in ("stopped_vehicles", "taken_over")),
                    _mean(group, "fallbacks"),
                )
            )
    columns = (
        *("site", "strategy", "setting", "mainline delay (s)", "ramp delay (s)", "served"),
        *("merges", "made way", "hard brakings", "stopped", "handed over", "fallbacks"),
    )
    kept = ("site", "strategy", "setting", "mainline delay (s)", "ramp delay (s)")
    return Table("By site", columns, tuple(rows), (SITE_NOTE,), kept)


def gain_table(good: pl.DataFrame, sites: pl.DataFrame, names: Names) -> Table | None:
    """Returns the gains against uncontrolled; None where nothing can be compared."""
    rows = tuple(
        (
            gain.place,
            *names[gain.cell.overrides, gain.cell.drivers, gain.cell.strategy],
            *map(with_interval, gain.by_s),
            "yes" if gain.is_sure else "no",
            str(gain.by_s[0].values),
        )
        for gain in gains(good, sites)
    )
    if not rows:
        return None
    columns = (
        *("place", "strategy", "setting", "loses less by, all (s)", "mainline (s)", "ramp (s)"),
        *("sure", "seeds"),
    )
    kept = ("place", "strategy", "loses less by, all (s)", "sure", "setting")
    title = "Against uncontrolled on the same arrivals"
    return Table(title, columns, rows, (MEANS, GAIN_NOTE), kept)


def _promises(runs: pl.DataFrame) -> Table:
    good = runs.filter(status="ok")
    rows = good.to_dicts()
    told: Sequence[tuple[str, str]] = (
        ("runs", str(good.height)),
        ("runs that broke a promise", str(sum(bool(broken_on_corridor(row)) for row in rows))),
        ("collisions", _sum(good, "collisions")),
        ("collisions by automated vehicles", _sum(good, "collisions_by_automated")),
        ("largest difference between plan and SUMO (m)", number(largest(good["plan_error_m"]), 4)),
        ("vehicles unserved", _sum(good, "unserved")),
        ("failed runs", str(runs.filter(status="failed").height)),
    )
    return Table("Promises", ("what", "value"), tuple(told))


def _of(group: pl.DataFrame, column: str, scale: float = 1.0) -> Estimate:
    return estimate([scale * value for value in group[column].drop_nulls()])


def _sum(group: pl.DataFrame, column: str) -> str:
    return str(int(group[column].sum()))


def _mean(group: pl.DataFrame, column: str) -> str:
    """The mean of a count; a dash where no run has it."""
    known = group[column].drop_nulls()
    return number(estimate(known.to_list()).mean, 0 if group.height == 1 else 1)
