"""How to repeat a study, which of its runs can be watched, and how to watch another."""

import shlex
import tomllib
from collections.abc import Mapping, Sequence
from typing import Any

import polars as pl

from coramp.records.run import RunRecords
from coramp.records.schemas import Row
from coramp.report.page.over_time import setting_of_run
from coramp.scenarios.toml_files import builtin_names, override_text
from coramp.studies.definition import Grid, Search, Study, load_study
from coramp.studies.overrides import keys_set, overrides_of
from coramp.studies.setting_words import settings_text
from coramp.studies.shown import plain, shared_flows


def repeat_command(study: Study, files: Mapping[str, str], seeds: int) -> str:
    """Returns the command that runs a study again, in the folder of its own file if it has one.

    ``files`` are the texts that the study has kept, its own file first. One of which no file is
    kept is taken to lie in NAME.toml.
    """
    words = ["coramp", "study", _file_of(study, files), "--seeds", str(seeds)]
    asked, ran = _engines_in_file(study, files), [part.engine for part in _parts(study)]
    if asked is not None and asked != ran and len(set(ran)) == 1:
        words += ["--engine", ran[0]]
    return shlex.join(words)


def _parts(study: Study) -> tuple[Grid | Search, ...]:
    return *study.runs, *study.searches


def _engines_in_file(study: Study, files: Mapping[str, str]) -> list[str] | None:
    """The engines that the study's file asks for, which an option may have changed."""
    name = _file_of(study, files)
    if name in files:
        own = tomllib.loads(files[name])
        parts = [*own.get("runs", ()), *own.get("searches", ())]
        return [part.get("engine", Grid.model_fields["engine"].default) for part in parts]
    if name in builtin_names("studies"):
        return [part.engine for part in _parts(load_study(name))]
    return None


def _file_of(study: Study, files: Mapping[str, str]) -> str:
    if study.name in builtin_names("studies"):
        return study.name
    own = [name for name in files if name != study.scenario]
    return own[0] if own else f"{study.name}.toml"


def watched_text(by_flow: Mapping[str, Sequence[RunRecords]], good: pl.DataFrame) -> str:
    """Returns which runs the curves over time and the replay are of, of all that were computed."""
    keys = keys_set(good)
    shown = [setting_of_run(runs[0], keys) for runs in by_flow.values()]
    if not shown:
        return ""
    found = place_among(good, [run for runs in by_flow.values() for run in runs])
    others = f", {found}" if found else ""
    return (
        f"The curves of speed and delay over time, and the replay, are of {'; and of '.join(shown)}"
        f"{others}."
    )


def place_among(good: pl.DataFrame, runs: Sequence[RunRecords]) -> str:
    """Returns which of a study's settings runs have: ``the first of 2 settings``.

    Empty where there is one only.
    """
    settings = good["overrides"].unique(maintain_order=True).to_list()
    if len(settings) < 2:
        return ""
    ids = {run.content["run_id"] for run in runs}
    shown = good.filter(pl.col("run_id").is_in(ids))["overrides"].unique().to_list()
    place = settings.index(shown[0]) if len(shown) == 1 else -1
    which = {0: "the first", len(settings) - 1: "the last"}.get(place, "one")
    return f"{which} of {len(settings)} settings"


def another_setting(study: Study, good: pl.DataFrame) -> str:
    """Returns the commands that show a run that the page does not, beside another strategy.

    It is of the last setting, or where there is one only of the next seed; empty without either.
    """
    mainline, ramp = shared_flows(good)[-1]
    shown = plain(good)["overrides"][0]
    at = good.filter(mainline_veh_h=mainline, ramp_veh_h=ramp)
    other = at.filter(~pl.col("overrides").eq_missing(pl.lit(shown, pl.String)))
    rows = (other if other.height else at.filter(pl.col("seed") > 1)).rows(named=True)
    if not rows:
        return ""
    chosen = _first_and_drivers(
        [row for row in rows if (row["overrides"], row["seed"]) == _key(rows[-1], rows)]
    )
    folders = [f"out/{letter}" for letter in "abc"[: len(chosen)]]
    lines = [_run_command(study, row, out) for row, out in zip(chosen, folders, strict=True)]
    reports = [f"coramp report {folders[0]} --against {other}" for other in folders[1:]]
    return "\n".join(
        [f"# another: {_words(chosen[0])}", *lines, *(reports or [f"coramp report {folders[0]}"])]
    )


def _first_and_drivers(rows: Sequence[Row]) -> list[Row]:
    """The first two runs, and the first of drivers where these are none."""
    first = list(rows[:2])
    drivers = [row for row in rows[2:] if row["drivers"]]
    return first if any(row["drivers"] for row in first) else [*first, *drivers[:1]]


def _key(last: Row, rows: Sequence[Row]) -> tuple[Any, int]:
    same = [row["seed"] for row in rows if row["overrides"] == last["overrides"]]
    return last["overrides"], min(same)


def _words(row: Row) -> str:
    settings = settings_text(overrides_of(row))
    return f"{settings}, seed {row['seed']}" if settings else f"seed {row['seed']}"


def _run_command(study: Study, row: Row, out: str) -> str:
    words = ["coramp", "run", study.scenario, "--strategy", row["strategy"]]
    words += ["--engine", row["engine"]]
    words += ["--mainline", f"{row['mainline_veh_h']:g}", "--ramp", f"{row['ramp_veh_h']:g}"]
    words += ["--seed", str(row["seed"])]
    if study.horizon_s is not None:
        words += ["--horizon", f"{study.horizon_s:g}"]
    if row["drivers"]:
        words += ["--drivers", row["drivers"]]
    for key, value in overrides_of(row).items():
        words += ["--set", override_text(key, value)]
    return shlex.join([*words, "--out", out])
