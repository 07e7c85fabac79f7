"""Tables as plain values, and as Markdown; the terminal's form is the command line's business."""

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace

from coramp.studies.statistics import Estimate

NUMBER = re.compile(r"[-+]?\d[\d.,]*(e[-+]?\d+)?%?|[-+]?inf")
SIGNS = frozenset("-+±%/")


@dataclass(frozen=True)
class Table:
    """A titled table of text cells, with notes below it.

    ``importance`` names columns in the order in which a narrow terminal keeps them; the others
    come after, from left to right.
    """

    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    notes: tuple[str, ...] = ()
    importance: tuple[str, ...] = ()

    @property
    def numeric(self) -> list[bool]:
        """Of each column whether all of its cells are numbers, and some are no dash."""
        columns = list(zip(*self.rows, strict=True)) or [()] * len(self.columns)
        return [
            all(map(is_number, cells)) and any(cell not in ("-", "") for cell in cells)
            for cells in columns
        ]

    def to_markdown(self) -> str:
        """Returns the table as Markdown."""
        lines = [f"## {self.title}", ""]
        lines.append("| " + " | ".join(self.columns) + " |")
        lines.append("|" + "---|" * len(self.columns))
        lines += ["| " + " | ".join(row) + " |" for row in self.rows]
        lines += [line for note in self.notes for line in ("", note)]
        return "\n".join(lines) + "\n"


def without_same(table: Table) -> Table:
    """Returns a table without columns that are the same in all rows; a note says what they are."""
    same = _same(table)
    if not same:
        return table
    told = ", ".join(f"{table.columns[k]} {table.rows[0][k]}" for k in same)
    kept = [k for k in range(len(table.columns)) if k not in same]
    return replace(columns_of(table, kept), notes=(*table.notes, f"In all rows: {told}."))


def _same(table: Table) -> list[int]:
    """Places of columns that are the same in all of several rows, unless all are."""
    if len(table.rows) < 2:
        return []
    found = [k for k in range(len(table.columns)) if len({row[k] for row in table.rows}) == 1]
    return found if len(found) < len(table.columns) else []


def columns_of(table: Table, kept: Sequence[int]) -> Table:
    """Returns a table with some of its columns, by place."""
    return replace(
        table,
        columns=tuple(table.columns[k] for k in kept),
        rows=tuple(tuple(row[k] for k in kept) for row in table.rows),
    )


def number(value: float | None, digits: int = 2) -> str:
    """Returns a number as text, a dash for none."""
    if value is None or math.isnan(value):
        return "-"
    if math.isinf(value):
        return "inf"
    text = f"{value:.{digits}f}"
    return text.lstrip("-") if float(text) == 0.0 else text


def with_interval(value: Estimate, digits: int = 2) -> str:
    """Returns mean and half width as text, the mean alone where there is no interval."""
    if math.isnan(value.half_width):
        return number(value.mean, digits)
    return f"{number(value.mean, digits)} ± {number(value.half_width, digits)}"


def is_number(cell: str) -> bool:
    """Returns whether a cell is a number, a sum or an interval, which is never broken."""
    return all(word in SIGNS or NUMBER.fullmatch(word) for word in cell.split())
