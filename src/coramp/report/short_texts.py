"""What results say of themselves in a few lines."""

from pathlib import Path

import polars as pl

from coramp.records.run import RunRecords
from coramp.runs.planning import PlannedSnapshot
from coramp.studies.tables import Table, number

NAMED = 6
"""So many of a list are named."""
LONGEST_PATH = 60


def run_text(run: RunRecords) -> str:
    """Returns what a run is and what came of it, in lines of up to 80 characters."""
    row = run.summary
    who = f"{row['strategy']} ({row['drivers']})" if row["drivers"] else str(row["strategy"])
    decided = ", plot_decision(vehicle_id)" if run.decisions is not None else ""
    return _lines(
        f"Run: {row['scenario']}, {who}, {run.flows}, seed {row['seed']}, {row['engine']}",
        f"delay {number(row['delay_s'])} s: mainline {number(row['mainline_delay_s'])} s, "
        f"ramp {number(row['ramp_delay_s'])} s; unserved: {row['unserved']}",
        f"tables: {', '.join(run.frames)}",
        f"figures: plot_time_space(), plot_speeds(){decided}",
    )


def study_text(folder: Path, runs: pl.DataFrame, tables: tuple[Table, ...]) -> str:
    """Returns what a study is and what it has, in lines of up to 80 characters."""
    failed = runs.filter(status="failed").height
    strategies = runs["strategy"].unique(maintain_order=True).to_list()
    seeds = runs["seed"].n_unique()
    flows = runs.select("mainline_veh_h", "ramp_veh_h").n_unique()
    return _lines(
        f"Study: {runs.height} runs, {failed} failed; {flows} flows, {seeds} seeds",
        f"folder: {_tail(str(folder))}",
        f"strategies: {_named(strategies)}",
        f"tables: {_named([table.title for table in tables])}",
        "frames: runs, streams; figures: plot_delay() and others",
    )


def plan_text(planned: PlannedSnapshot) -> str:
    """Returns what a plan decided, in lines of up to 80 characters."""
    rungs = [
        f"{name} {rung}" for name, rung in planned.decisions.select("vehicle_id", "rung").rows()
    ]
    return _lines(
        f"Plan: {planned.snapshot.name}, {planned.strategy}",
        f"decisions: {_named(rungs)}",
        "frames: decisions, trajectories, before; figure: plot_time_space()",
    )


def _tail(path: str) -> str:
    return path if len(path) <= LONGEST_PATH else f"...{path[-LONGEST_PATH:]}"


def _named(names: list[str]) -> str:
    more = len(names) - NAMED
    return ", ".join(names[:NAMED]) + (f" and {more} more" if more > 0 else "")


def _lines(*lines: str) -> str:
    cut = [line if len(line) <= 78 else f"{line[:75]}..." for line in lines]
    return "\n  ".join(cut)
