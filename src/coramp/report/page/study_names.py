"""What strategies are called in the report of a study: as its answer and its pictures call them."""

from dataclasses import replace

import polars as pl

from coramp.report.style import look_of
from coramp.studies.tables import Table


def answered_names(good: pl.DataFrame) -> dict[str, str]:
    """Returns by what tables call a strategy, with its drivers if it has any, the answer's name."""
    found: dict[str, str] = {}
    for strategy, drivers in good.select("strategy", "drivers").unique(maintain_order=True).rows():
        label = look_of(strategy, drivers).label
        ways = (f"{strategy} ({drivers})", f"{strategy} ({drivers} drivers)")
        found |= dict.fromkeys(ways if drivers else (strategy,), label)
    return found


def names_with_options(good: pl.DataFrame) -> list[str]:
    """Returns the answer's name of each strategy, with that of the option --strategy beside it."""
    found = good.select("strategy", "drivers").unique(maintain_order=True).rows()
    pairs = [(look_of(strategy, drivers).label, strategy) for strategy, drivers in found]
    return [label if label == option else f"{label} ({option})" for label, option in pairs]


def named_as_answered(table: Table, good: pl.DataFrame) -> Table:
    """Returns a table whose strategies have the answer's names, alone or before a comma."""
    names = answered_names(good)
    rows = tuple(tuple(_renamed(cell, names) for cell in row) for row in table.rows)
    return replace(table, rows=rows)


def _renamed(cell: str, names: dict[str, str]) -> str:
    known, comma, rest = cell.partition(", ")
    return f"{names[known]}{comma}{rest}" if known in names else cell
