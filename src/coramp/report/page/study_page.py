"""The report of a study: its answer, its tables and pictures, and what it does not know."""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import polars as pl

from coramp.errors import CorampError
from coramp.records.run import RunRecords
from coramp.records.schemas import Row
from coramp.report.baseline_figure import baseline_figure
from coramp.report.capacity_figure import capacity_figure
from coramp.report.field_figure import field_figure
from coramp.report.flow_figures import delay_figure, gain_figure, rung_figure
from coramp.report.front_figure import front_figure
from coramp.report.hostile_figure import hostile_figure
from coramp.report.page.assemble import assembled, packed
from coramp.report.page.over_time import over_time_pictures
from coramp.report.page.pages import check_same_arrivals
from coramp.report.page.shown import title_of
from coramp.report.page.study_answer import (
    Answer,
    hostile_answer,
    layout_answer,
    own_answer,
    penetration_answer,
)
from coramp.report.page.study_columns import meanings_of
from coramp.report.page.study_names import named_as_answered, names_with_options
from coramp.report.page.study_repeat import (
    another_setting,
    place_among,
    repeat_command,
    watched_text,
)
from coramp.report.page.study_sure import how_sure
from coramp.report.page.svg import picture
from coramp.report.penetration_figure import penetration_figure
from coramp.report.sensitivity_figure import sensitivity_figure
from coramp.report.study_folder import stored_runs, study_content
from coramp.report.varied_figure import readable, varied_figure
from coramp.runs.beforehand import of_automation
from coramp.studies.definition import Study, count_runs
from coramp.studies.overrides import keys_set, overrides_of, scenario_value
from coramp.studies.setting_words import GAPS, key_name
from coramp.studies.shown import (
    read_shown,
    same_delays,
    shown_rows,
)
from coramp.studies.speed_unit import MPS, SpeedUnit
from coramp.studies.summary import summary_tables
from coramp.studies.tables import Table, without_same

DRAWN = {
    "paper": (
        ("Mean delay by flow, with 95 % intervals over seeds", delay_figure),
        ("Delay saved against the paper's drivers and against fair ones", gain_figure),
        ("Which rung gave each merge, by flow", rung_figure),
    ),
    "sensitivity": (("Delay by setting", sensitivity_figure),),
    "capacity": (("Where each strategy breaks down", capacity_figure),),
    "field": (
        ("Delay against fuel, with the Pareto front", front_figure),
        ("Every strategy on the same arrivals", field_figure),
    ),
    "baseline": (("What a gain owes to its baseline, and to short gaps", baseline_figure),),
    "penetration": (("Delay and hard braking by share of automated vehicles", penetration_figure),),
    "hostile": (("Delay and conflicts by fault and share of automated vehicles", hostile_figure),),
}
MOST_VALUES = 6
"""Of a setting with more values the first and the last are told."""
OWN = "Mean delay over what varies, with 95 % intervals over seeds"
"""The figure of a study whose layout has none of its own."""


def study_page(folder: Path, unit: SpeedUnit = MPS) -> str:
    """Returns the report of a study, of as many of its runs as are done; speeds are in a unit.

    The runs that can be watched are those of which the study has kept records. Raises CorampError
    where there is no study, or none of its runs went well.
    """
    content = study_content(folder)
    study, every = stored_runs(folder)
    good = every.filter(status="ok")
    if good.is_empty():
        reason = f": {every['error'][0]}" if every.height else ""
        raise CorampError(f"{folder}: no run went well{reason}; start its coramp study again")
    by_flow, said = _shown(folder, good)
    files = content.get("files") or {}
    cells, packs = _cells(by_flow)
    scenario, keys = content["scenario"], keys_set(good)
    tables = [
        without_same(named_as_answered(table, good))
        for table in summary_tables(study, every, unit, scenario)
    ]
    over_time = [
        row
        for runs in by_flow.values()
        for row in over_time_pictures(runs, unit, keys, place_among(good, runs))
    ]
    return assembled(
        "study.html",
        scenarios=[run.scenario for runs in by_flow.values() for run in runs],
        title=f"Report: study {study.name}",
        subtitle=study.description,
        asked=_asked(study, good, content, unit),
        answer=_answer(study, good, content["scenario"]),
        notes=[*_notes(study, every, listed=_lists_arrivals(content)), *said],
        tables=tables,
        meanings=meanings_of(tables),
        pictures=[*pictures_of(study.layout, good, content["scenario"]), *over_time],
        failed=_failed(every),
        sure=how_sure(
            good,
            _horizon_s(study, scenario),
            compared=study.layout == "plain",
            listed=_lists_arrivals(content),
        ),
        versions=Table("Versions", ("what", "version"), tuple(content["versions"].items())),
        repeat=repeat_command(study, files, good["seed"].n_unique()),
        files=files,
        watched=watched_text(by_flow, good),
        another=another_setting(study, good),
        runs=packs,
        cells=cells,
    )


def _answer(study: Study, good: pl.DataFrame, scenario: Row) -> Answer:
    """What the study says first."""
    if study.layout == "plain":
        return own_answer(good, scenario)
    own = {"penetration": penetration_answer, "hostile": hostile_answer}.get(study.layout)
    found = own(good) if own is not None else None
    return found or layout_answer(good)


def _lists_arrivals(content: Row) -> bool:
    """Whether the study's scenario lists its arrivals."""
    scenario = content.get("scenario")
    return isinstance(scenario, dict) and bool(scenario.get("arrivals"))


def _asked(study: Study, good: pl.DataFrame, content: Row, unit: SpeedUnit) -> Table:
    listed = _lists_arrivals(content)
    flows = good.select("mainline_veh_h", "ramp_veh_h").unique().sort(pl.all())
    pairs = [f"{mainline:g} + {ramp:g}" for mainline, ramp in flows.iter_rows()]
    shown = ", ".join(pairs) if len(pairs) <= 12 else f"{pairs[0]} to {pairs[-1]} ({len(pairs)})"
    rows = (
        ("study", f"{study.name}: {study.description}".rstrip(": ")),
        ("scenario", study.scenario),
        ("strategies", "; ".join(names_with_options(good))),
        ("flows, mainline + ramp (veh/h)", f"{shown}, listed one by one" if listed else shown),
        ("seeds", str(good["seed"].n_unique())),
        ("runs", str(good.height)),
        *_road(content["scenario"], unit, _horizon_s(study, content["scenario"]), good),
    )
    return Table("Study, road and gaps", ("what", "value"), rows)


def _road(
    scenario: Row, unit: SpeedUnit, horizon_s: float, good: pl.DataFrame
) -> list[tuple[str, str]]:
    """The scenario's road and gaps; of what runs set, all values that they set."""
    mainline, ramp = scenario["mainline"], scenario["ramp"]
    speeds = (unit.of(stream["speed_mps"]) for stream in (mainline, ramp))
    every = [overrides_of(row) for row in good.iter_rows(named=True)]
    keys = dict.fromkeys(key for found in every for key in found)
    told = [
        (key_name(key), _values([found.get(key, scenario_value(scenario, key)) for found in every]))
        for key in dict.fromkeys(("ramp.acceleration_lane_m", *GAPS, *keys))
    ]
    return [
        (f"speeds, mainline and ramp ({unit.name})", " and ".join(f"{v:.4g}" for v in speeds)),
        *told,
        ("horizon of a run (s)", f"{horizon_s:g}"),
    ]


def _horizon_s(study: Study, scenario: Row) -> float:
    return float(study.horizon_s or scenario["simulation"]["horizon_s"])


def _values(found: Sequence[Any]) -> str:
    texts = {f"{v:g}" if isinstance(v, float) else str(v): None for v in found}
    shown = list(texts)
    return ", ".join(shown) if len(shown) <= MOST_VALUES else f"{shown[0]} to {shown[-1]}"


def _notes(study: Study, runs: pl.DataFrame, *, listed: bool) -> Iterator[str]:
    seeds = int(runs["seed"].max())  # type: ignore[arg-type]
    asked = count_runs(study, seeds)
    if listed:  # no seed changes what nobody drives, so each runs once
        once = runs.filter(pl.col("drivers").is_null()).height
        asked -= once * (seeds - 1)
    if runs.height < asked:
        most = "at most " if study.searches else ""
        yield f"{runs.height} of {most}{asked} runs with {seeds} seeds are done and reported here."
    keys = _without_effect(runs)
    if keys:
        population = runs["drivers"].drop_nulls()[0]
        yield (
            f"{', '.join(map(key_name, keys))}: for coordinated vehicles only. Drivers drive the "
            "same with every value; they keep the gaps of their population (tau_s, min_gap_m). To "
            "vary both, give each value a [[runs]] block of its own, which sets "
            f"{' and '.join(keys)} and drivers.{population}.tau_s or "
            f"drivers.{population}.min_gap_m."
        )
    failed = runs.filter(status="failed").height
    if failed:
        yield f"{failed} of {runs.height} runs failed; they are listed below and count nowhere."


def _without_effect(runs: pl.DataFrame) -> list[str]:
    """The settings of runs with drivers that bind coordinated vehicles only."""
    among_drivers = pl.col("drivers").is_not_null() & pl.col("automated_vehicles").is_null()
    rows = runs.filter(among_drivers).iter_rows(named=True)
    return of_automation([(row["drivers"], overrides_of(row)) for row in rows])


def _failed(runs: pl.DataFrame) -> Table | None:
    failed = runs.filter(status="failed")
    if failed.is_empty():
        return None
    columns = ("strategy", "drivers", "mainline_veh_h", "ramp_veh_h", "seed", "overrides", "error")
    rows = tuple(tuple(map(_cell, row)) for row in failed.select(columns).iter_rows())
    return Table("Failed runs", columns, rows)


def _cell(value: object) -> str:
    if value is None:
        return "-"
    return f"{value:g}" if isinstance(value, float) else str(value)


def pictures_of(
    layout: str, good: pl.DataFrame, scenario: Mapping[str, Any] | None = None
) -> list[Row]:
    """Returns the figures of a study's layout, of the runs that went well, as parts of a page."""
    if good.is_empty():
        return []
    if layout in DRAWN:
        return [picture(text, draw(good)) for text, draw in DRAWN[layout]]
    over = readable(good, scenario)
    return [picture(OWN, varied_figure(good, over, scenario))] if over is not None else []


def _shown(folder: Path, good: pl.DataFrame) -> tuple[dict[str, list[RunRecords]], list[str]]:
    """Returns the runs to watch by flow, and what is said of them and of those that are not."""
    found: dict[str, list[RunRecords]] = {}
    said: list[str] = []
    for row in shown_rows(good):
        run = read_shown(folder, row)
        if run is None:
            continue
        if same_delays(row, run.summary):
            found.setdefault(run.flows, []).append(run)
        else:
            said.append(
                f"{title_of(run)} at {run.flows} is not shown: its records have other delays than "
                "the study"
            )
    if not found and not said:
        said.append("The study has kept no runs to watch; start its coramp study again for them.")
    return found, said


def _cells(by_flow: Mapping[str, Sequence[RunRecords]]) -> tuple[list[Row], dict[str, str]]:
    """Returns the runs to watch by flow and title, each packed by its key."""
    cells: list[Row] = []
    packs: dict[str, str] = {}
    for where, runs in by_flow.items():
        check_same_arrivals(runs)
        found: dict[str, str] = {}
        for run in runs:
            key = f"run-{len(packs)}"
            packs[key], found[title_of(run)] = packed(run), key
        cells.append({"flow": where, "runs": found})
    return cells, packs
