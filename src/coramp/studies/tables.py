"""Tables as plain values, and as Markdown; the terminal's form is the command line's business."""

import math
from dataclasses import dataclass

from coramp.studies.statistics import Estimate


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

    def to_markdown(self) -> str:
        """Returns the table as Markdown."""
        lines = [f"## {self.title}", ""]
        lines.append("| " + " | ".join(self.columns) + " |")
        lines.append("|" + "---|" * len(self.columns))
        lines += ["| " + " | ".join(row) + " |" for row in self.rows]
        lines += [line for note in self.notes for line in ("", note)]
        return "\n".join(lines) + "\n"


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
