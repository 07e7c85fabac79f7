"""A table as lines of text: words and numbers whole, numbers to the right."""

import textwrap
from collections.abc import Iterator, Sequence

from coramp.cli.table_view import BETWEEN, MARGINS, least_widths
from coramp.studies.tables import Table

RULE = "─"


def text_lines(table: Table, width: int | None) -> list[str]:
    """Returns a table's lines: title, header, rows and notes; without a width nothing wraps."""
    widths = _widths(table, width)
    numeric = table.numeric
    lines = [table.title, "", *_row_lines(table.columns, widths, numeric)]
    lines.append(" " + RULE * (sum(widths) + BETWEEN * (len(widths) - 1)))
    for row in table.rows:
        lines += _row_lines(row, widths, numeric)
    for note in table.notes:
        lines += ["", *(textwrap.wrap(note, width) if width is not None else [note])]
    return lines


def _widths(table: Table, width: int | None) -> list[int]:
    """Characters of each column: what it takes unwrapped, or its share of what there is."""
    natural = [max(map(len, cells)) for cells in zip(table.columns, *table.rows, strict=True)]
    if width is None:
        return natural
    widths = least_widths(table)
    left = width - MARGINS - BETWEEN * (len(widths) - 1) - sum(widths)
    while left > 0:
        wanting = [k for k in range(len(widths)) if widths[k] < natural[k]]
        if not wanting:
            break
        widths[max(wanting, key=lambda k: natural[k] - widths[k])] += 1
        left -= 1
    return widths


def _row_lines(
    cells: Sequence[str], widths: Sequence[int], numeric: Sequence[bool]
) -> Iterator[str]:
    wrapped = [
        textwrap.wrap(cell, width, break_long_words=False, break_on_hyphens=False) or [""]
        for cell, width in zip(cells, widths, strict=True)
    ]
    for k in range(max(map(len, wrapped))):
        parts = [lines[k] if k < len(lines) else "" for lines in wrapped]
        placed = (
            part.rjust(width) if right else part.ljust(width)
            for part, width, right in zip(parts, widths, numeric, strict=True)
        )
        yield f" {(' ' * BETWEEN).join(placed)}".rstrip()
