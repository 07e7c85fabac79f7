"""How much of a table 80 columns hold, in whole words and numbers."""

from collections.abc import Sequence
from dataclasses import replace

from coramp.studies.tables import Table, columns_of, is_number, without_same

NARROW = 80
"""Characters that a terminal is sure to have."""
BETWEEN, MARGINS = 2, 2
"""Characters between columns, and beside the first and last."""


def _is_quantity(cell: str) -> bool:
    """Whether a cell is a number with one word behind it, such as a unit."""
    *amount, unit = cell.split() or [""]
    return bool(amount) and is_number(" ".join(amount)) and len(unit) < len("vehicles ")


def least_widths(table: Table) -> list[int]:
    """Returns the characters that each column needs, words and numbers unbroken."""
    return [
        max(_longest_word(header), *(_unbroken(row[k]) for row in table.rows), 0)
        for k, header in enumerate(table.columns)
    ]


def _unbroken(cell: str) -> int:
    return len(cell) if is_number(cell) or _is_quantity(cell) else _longest_word(cell)


def _longest_word(text: str) -> int:
    return max(map(len, text.split()), default=0)


def fitted(table: Table, width: int = NARROW) -> Table:
    """Returns as many columns of a table as a width holds, and a note that says what is left out.

    Columns that are the same in all rows go first, into a note; then those that count least.
    """
    if _needed(least_widths(table)) <= width:
        return table
    slim = without_same(table)
    widths = least_widths(slim)
    kept: list[int] = []
    for place in _by_importance(slim):
        if not kept or _needed([widths[k] for k in (*kept, place)]) <= width:
            kept.append(place)
    left_out = [name for k, name in enumerate(slim.columns) if k not in kept]
    notes = list(slim.notes)
    if left_out:
        notes.append(f"With --wide also: {', '.join(left_out)}.")
    return replace(columns_of(slim, sorted(kept)), notes=tuple(notes))


def _needed(widths: Sequence[int]) -> int:
    return sum(widths) + BETWEEN * max(0, len(widths) - 1) + MARGINS


def _by_importance(table: Table) -> list[int]:
    rank = {name: place for place, name in enumerate(table.importance)}
    return sorted(
        range(len(table.columns)), key=lambda k: (rank.get(table.columns[k], len(rank)), k)
    )
