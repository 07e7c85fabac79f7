"""Writes figure and tables of from-which-share-it-pays.md from a study: give its folder."""

import re
import sys
from dataclasses import replace
from pathlib import Path

from PIL import Image

import coramp
from coramp.studies.tables import Table, without_same

DOCS = Path(__file__).parents[1]
PAGE = DOCS / "from-which-share-it-pays.md"
FIGURE = DOCS / "figures" / "penetration.png"
COLOURS = 64
MARKED = re.compile(r"<!-- (runs|table: .*?) -->\n.*?<!-- end -->", re.DOTALL)


def chosen(tables: tuple[Table, ...], asked: str) -> str:
    """Returns a table by its title, with the rows in which columns have the values asked for."""
    title, *conditions = asked.split("; ")
    (table,) = [table for table in tables if table.title == title]
    for column, value in (condition.split(" = ") for condition in conditions):
        place = table.columns.index(column)
        table = replace(table, rows=tuple(row for row in table.rows if row[place] == value))
    lines = without_same(table).to_markdown().splitlines()
    return "\n".join(line for line in lines if line.startswith("|"))


def main(folder: str) -> None:
    """Rewrites what stands between the page's markers, and the figure."""
    study = coramp.load(folder)
    good = study.runs.filter(status="ok")
    seeds = good["seed"].n_unique()

    def written(found: re.Match[str]) -> str:
        asked = found[1]
        if asked == "runs":
            every = "one seed" if seeds == 1 else f"{seeds} seeds"
            text = f"The tables are those of {good.height} runs of 900 s with {every}."
        else:
            text = chosen(study.tables, asked.removeprefix("table: "))
        return f"<!-- {asked} -->\n{text}\n\n<!-- end -->"

    PAGE.write_text(MARKED.sub(written, PAGE.read_text(encoding="utf-8")), encoding="utf-8")
    study.plot_penetration().savefig(FIGURE, dpi=110)
    Image.open(FIGURE).convert("RGB").quantize(COLOURS).save(FIGURE, optimize=True)


if __name__ == "__main__":
    main(sys.argv[1])
