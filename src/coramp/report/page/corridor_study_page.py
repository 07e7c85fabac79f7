"""The report of a corridor's study: its answer, its tables and its picture."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import polars as pl

from coramp.errors import CorampError
from coramp.records.schemas import Row
from coramp.report.corridor_figures import study_delay_figure
from coramp.report.page.assemble import plain
from coramp.report.page.study_answer import Answer
from coramp.report.page.study_repeat import repeat_command
from coramp.report.page.svg import picture
from coramp.report.study_folder import stored_corridor, study_content
from coramp.studies.corridor_paired import WHOLE, Gain, gains
from coramp.studies.corridor_summary import (
    GROUP,
    Names,
    corridor_study_tables,
    names_of_cells,
)
from coramp.studies.paired import Cell
from coramp.studies.statistics import estimate
from coramp.studies.tables import Table, number, with_interval, without_same

DELAYS = "Mean delay by site and of the whole corridor, with 95 % intervals over seeds"


def corridor_study_page(folder: Path) -> str:
    """Returns the report of a corridor's study, as much of it as is done.

    Raises CorampError where it cannot be read, and where no run went well.
    """
    study, runs, sites = stored_corridor(folder)
    content, good = study_content(folder), runs.filter(status="ok")
    if good.is_empty():
        raise CorampError(f"{folder}: no run went well; start its coramp study again")
    scenario = content["scenario"] or {}
    files = content.get("files") or {}
    whole, by_site, *rest = corridor_study_tables(runs, sites, scenario)
    names = names_of_cells(good, scenario)
    return plain(
        "corridor.html",
        runs={},
        title=f"Report: study {study.name}",
        subtitle=study.description,
        answer=_answer(good, gains(good, sites), names),
        notes=_notes(runs),
        tables=[without_same(whole)],
        shown=[
            ("Site by site", [without_same(by_site)]),
            *(("Compared", [without_same(found)]) for found in rest[:-1]),
            ("What automated vehicles promised", rest[-1:]),
        ],
        asked=_asked(study.scenario, good, scenario, study.horizon_s),
        pictures=[picture(DELAYS, study_delay_figure(good, sites, scenario))],
        failed=_failed(runs),
        sure=_sure(good),
        versions=Table("Versions", ("what", "version"), tuple(content["versions"].items())),
        repeat="\n".join(
            [
                repeat_command(study, files, good["seed"].n_unique()),
                *_watching(study.scenario, good),
            ]
        ),
        files=files,
    )


def _answer(good: pl.DataFrame, gained: list[Gain], names: Names) -> Answer:
    """Who loses how much, and how much less than uncontrolled on the same arrivals."""
    of_whole = {_key_of(g.cell): g for g in gained if g.place == WHOLE}
    items = []
    for key, group in good.group_by(GROUP, maintain_order=True):
        who, setting = names[key]
        delay_s = estimate(group["mean_delay_s"].drop_nulls().to_list())
        text = f"a vehicle loses {with_interval(delay_s)} s on average"
        own = of_whole.get(key)
        items.append((f"{who}, {setting}", f"{text}{_gained(own, gained)}."))
    seeds = good["seed"].n_unique()
    lead = (
        f"On the whole corridor, over {seeds} draws of arrivals:"
        if seeds > 1
        else "On the whole corridor, with one draw of arrivals:"
    )
    rest = "" if gained else "The study has no uncontrolled runs on the same arrivals to compare."
    return Answer(lead, tuple(items), rest)


def _key_of(cell: Cell) -> tuple[Any, ...]:
    return cell.overrides, cell.drivers, cell.strategy


def _gained(own: Gain | None, gained: list[Gain]) -> str:
    if own is None:
        return ""
    mean_s = own.by_s[0].mean
    word = "less" if mean_s >= 0.0 else "more"
    sure = "this is sure" if own.is_sure else "this may be chance"
    sites = [g for g in gained if g.cell == own.cell and g.place != WHOLE and g.by_s[0].values]
    text = f", {number(abs(mean_s))} s {word} than uncontrolled; {sure}"
    if not sites:
        return text
    best = max(sites, key=lambda g: abs(g.by_s[0].mean))
    by_s = best.by_s[0].mean
    return (
        f"{text}. The difference is largest at {best.place}: {number(abs(by_s))} s "
        f"{'less' if by_s >= 0.0 else 'more'} in its zone"
    )


def _notes(runs: pl.DataFrame) -> list[str]:
    failed = runs.filter(status="failed").height
    return (
        [f"{failed} of {runs.height} runs failed; they are listed below and count nowhere."]
        if failed
        else []
    )


def _asked(
    source: str, good: pl.DataFrame, scenario: Mapping[str, Any], horizon_s: float | None
) -> Table:
    section = scenario.get("corridor", {})
    horizon = horizon_s or scenario.get("simulation", {}).get("horizon_s")
    flows = good.select("mainline_veh_h", "ramp_veh_h").unique().sort(pl.all()).rows()
    rows = (
        ("scenario", source),
        ("network", str(section.get("file", "-"))),
        ("sites", ", ".join(section.get("sites", ()))),
        (
            "flows, all upstream ends + all ramps (veh/h)",
            ", ".join(f"{mainline:g} + {ramp:g}" for mainline, ramp in flows),
        ),
        ("strategies", ", ".join(good["strategy"].unique(maintain_order=True))),
        ("drivers", ", ".join(good["drivers"].unique(maintain_order=True))),
        ("arrivals of a run (s)", number(horizon, 0)),
        ("seeds", str(good["seed"].n_unique())),
        ("runs", str(good.height)),
    )
    return Table("Study, road and traffic", ("what", "value"), rows)


def _sure(good: pl.DataFrame) -> list[str]:
    seeds = good["seed"].n_unique()
    alone = " One seed has none; run more (--seeds 10)." if seeds == 1 else ""
    few = " With so few seeds intervals are wide; ten or more are usual." if 1 < seeds < 5 else ""
    return [
        (
            f"Means are over {seeds} seeds, each one draw of arrivals, the same for every "
            f"strategy; ± is a 95 % interval of the mean by Student's t.{alone}{few}"
        ),
        "A difference is sure where the interval of the difference, seed by seed, leaves out zero.",
    ]


def _failed(runs: pl.DataFrame) -> Table | None:
    failed = runs.filter(status="failed")
    if failed.is_empty():
        return None
    columns = ("strategy", "drivers", "seed", "overrides", "error")
    rows = tuple(
        tuple("-" if value is None else str(value) for value in row)
        for row in failed.select(columns).iter_rows()
    )
    return Table("Failed runs", columns, rows)


def _watching(source: str, good: pl.DataFrame) -> list[str]:
    """The commands that show one of the runs from above."""
    row: Row = good.row(0, named=True)
    words = f"coramp run {source} --strategy {row['strategy']} --drivers {row['drivers']}"
    return [
        "# to watch one of the runs:",
        f"{words} --seed {row['seed']} --keep-sumo --out out/watched",
        "coramp replay out/watched",
    ]
