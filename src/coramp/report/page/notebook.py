"""How results show themselves in a notebook: a summary, and a picture that can be played with."""

import polars as pl
from matplotlib.figure import Figure

from coramp.records.run import RunRecords
from coramp.report.page.assemble import rendered
from coramp.report.page.corridor_study_page import DELAYS
from coramp.report.page.pages import answer, comparison_table, notes, replay_page
from coramp.report.page.shown import title_of
from coramp.report.page.study_page import pictures_of
from coramp.report.page.svg import picture
from coramp.report.plan_figure import plan_figure
from coramp.runs.planning import PlannedSnapshot
from coramp.studies.tables import Table, number

PLAN_COLUMNS = ("vehicle_id", "rung", "merge_time_s", "merge_station_m", "accel_mps2")


def run_html(run: RunRecords) -> str:
    """Returns a run's summary, and its replay and time-space diagram in a frame of their own."""
    return _notebook(
        title=f"Replay: {title_of(run)}",
        answer=answer(run),
        notes=notes(run),
        tables=[comparison_table([run])],
        page=replay_page([run]),
    )


def study_html(tables: tuple[Table, ...], layout: str, runs: pl.DataFrame) -> str:
    """Returns a study's tables and the figures that its layout has."""
    return _notebook(tables=tables, pictures=pictures_of(layout, runs.filter(status="ok")))


def corridor_study_html(tables: tuple[Table, ...], figure: Figure | None) -> str:
    """Returns a corridor's study: its tables, and the figure of delays by site if there is one."""
    shown = [] if figure is None else [picture(DELAYS, figure)]
    return _notebook(tables=tables, pictures=shown)


def plan_html(planned: PlannedSnapshot) -> str:
    """Returns a plan's decisions, and all trajectories before and after them."""
    rows = tuple(
        tuple(number(v) if isinstance(v, float) else str(v or "-") for v in row)
        for row in planned.decisions.select(PLAN_COLUMNS).iter_rows()
    )
    text = f"Station over time before and after the decisions of {planned.strategy}"
    return _notebook(
        tables=[Table("Decisions", PLAN_COLUMNS, rows)],
        pictures=[picture(text, plan_figure(planned))],
    )


def _notebook(**values: object) -> str:
    nothing = {"title": "", "answer": "", "notes": (), "tables": (), "pictures": (), "page": ""}
    return rendered("notebook.html", **{**nothing, **values})
