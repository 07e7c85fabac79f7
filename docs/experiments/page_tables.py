"""Writes a page's tables and figure from the folder of a study: what stands between markers.

``<!-- runs -->`` is followed by how many runs there were, ``<!-- table: TITLE; COLUMN = VALUE -->``
by a table with the rows in which columns have these values; both end with ``<!-- end -->``.
"""

import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from PIL import Image

import coramp
from coramp import StudyResult
from coramp.report.style import Figure
from coramp.studies.hostile_runs import is_drawn
from coramp.studies.tables import Table, without_same

DOCS = Path(__file__).parents[1]
COLOURS = 64
MARKED = re.compile(r"<!-- (runs|table: .*?) -->\n.*?<!-- end -->", re.DOTALL)


def chosen(tables: tuple[Table, ...], asked: str) -> str:
    """Returns a table by its title, with the rows in which columns have the values asked for."""
    title, *conditions = asked.split("; ")
    (table,) = [table for table in tables if table.title == title]
    for column, value in (condition.split(" = ") for condition in conditions):
        place = table.columns.index(column)
        table = replace(table, rows=tuple(row for row in table.rows if row[place] == value))
    if not table.rows:
        return "None."
    lines = without_same(table).to_markdown().splitlines()
    rows = [line for line in lines if line.startswith("|")]
    same = [line for line in lines if line.startswith("In all rows")]
    return "\n".join([*rows, *(("", *same) if same else ())])


def write_page(folder: str, page: str, figure: str, draw: Callable[[StudyResult], Figure]) -> None:
    """Rewrites what stands between the markers of a page of the docs, and its figure."""
    study = coramp.load(folder)
    good = study.runs.filter(status="ok")
    drawn = [is_drawn(run) for run in good.iter_rows(named=True)]
    rare, good = sum(drawn), good.filter([not own for own in drawn])
    seeds = good["seed"].n_unique()

    def written(found: re.Match[str]) -> str:
        asked = found[1]
        if asked == "runs":
            every = "one seed" if seeds == 1 else f"{seeds} seeds"
            text = f"The tables are those of {good.height} runs of 900 s with {every}"
            text += f", and of {rare} of 90 s for rare collisions." if rare else "."
        else:
            text = chosen(study.tables, asked.removeprefix("table: "))
        return f"<!-- {asked} -->\n{text}\n\n<!-- end -->"

    path = DOCS / page
    path.write_text(MARKED.sub(written, path.read_text(encoding="utf-8")), encoding="utf-8")
    target = DOCS / "figures" / figure
    draw(study).savefig(target, dpi=110)
    Image.open(target).convert("RGB").quantize(COLOURS).save(target, optimize=True)
