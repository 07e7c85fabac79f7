"""Reading counts: CSV and Parquet with named columns, and SUMO's own formats."""

import io
import math
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import date, datetime, timedelta
from pathlib import Path
from typing import Any

import polars as pl

from coramp.counts.checks import check_balance, that_add_up
from coramp.counts.sumo_xml import lines_of_xml
from coramp.counts.table import (
    Counts,
    Findings,
    Line,
    Problem,
    Repair,
    counts_of,
    in_row,
    told_briefly,
)
from coramp.counts.tabular import Read, lines_of_table
from coramp.counts.text import Words, content_of, text_of, words_of
from coramp.errors import CorampError

PARQUET = b"PAR1"
XML = b"<"
BEFORE_XML = b"\xef\xbb\xbf\xff\xfe\0 \t\r\n"
"""Marks of encodings, and what is left blank."""
ROOM = 50.0
"""So many vehicles may be on the way between detectors."""


@dataclass(frozen=True)
class Examined:
    """What a file of counts holds, whether it adds up or not.

    ``lines`` are its counts, after repairs; ``problems`` is what does not add up, by row.
    """

    source: str
    lines: list[Line]
    start: datetime | None
    problems: list[Problem]
    repairs: list[Repair]

    @property
    def told(self) -> list[str]:
        """What does not add up, a line each, brief where there is much."""
        return told_briefly([problem.line(self.source) for problem in self.problems])


def examined(
    path: Path | str,
    repair: bool = False,
    lanes: int | None = None,
    *,
    upstream: Sequence[str] = (),
    downstream: str | None = None,
) -> Examined:
    """Returns what a file of counts holds and what does not add up; see ``read_counts``.

    Raises CorampError for a file that cannot be read as counts at all.
    """
    findings = Findings(repair)
    path = Path(path)
    content = content_of(path)
    try:
        lines, start = _lines_of(content, findings)
    except CorampError as error:
        earlier = [problem.line(str(path)) for problem in findings.problems]
        messages = [*earlier, *(f"{path}: {line}" for line in error.messages)]
        raise CorampError(*told_briefly(messages)) from error
    if not lines and not findings.problems:
        raise CorampError(f"{path}: has no rows; allowed is a count in each row after the first")
    lines = that_add_up(lines, findings, lanes)
    if downstream is not None:
        known = {line.detector for line in lines}
        upstream = [one for name in upstream for one in in_row(name, known)]
        _check_known([*upstream, downstream], lines, path)
        if not findings.problems:
            lines = check_balance(lines, upstream, downstream, findings, ROOM)
    problems = list(dict.fromkeys(sorted(findings.problems, key=lambda found: found.row)))
    return Examined(str(path), lines, start, problems, findings.repairs)


def read_counts(
    path: Path | str,
    repair: bool = False,
    lanes: int | None = None,
    *,
    upstream: Sequence[str] = (),
    downstream: str | None = None,
) -> Counts:
    """Returns the counts of a file; with ``repair``, what can be mended is mended and listed.

    Formats: CSV or Parquet with a row for each interval, detector, lane and class (columns ``time``
    or ``begin_s``, ``end_s``, ``detector`` or ``edge``, ``lane``, ``class``, ``vehicles`` or
    ``flow_veh_h``, ``mean_speed_mps`` or ``mean_speed_kmh``); the CSV of dfrouter and flowrouter;
    SUMO's output of induction loops, its routes and its flows. ``lanes`` is how many lanes a
    detector has whose counts name none, else up to 6. With ``downstream`` it is checked that this
    detector counted no less than those ``upstream``.

    Raises CorampError with a line for each of the first 10 things that do not add up.
    """
    found = examined(path, repair, lanes, upstream=upstream, downstream=downstream)
    if found.problems:
        raise CorampError(*found.told)
    return counts_of(found.lines, found.source, found.start, found.repairs)


def _check_known(names: Sequence[str], lines: Sequence[Line], path: Path) -> None:
    known = sorted({line.detector for line in lines})
    for name in names:
        if name not in known:
            raise CorampError(
                f"{path}: there is no detector {name!r}; allowed are {', '.join(known)}"
            )


def _lines_of(content: bytes, findings: Findings) -> Read:
    if content.startswith(PARQUET):
        return lines_of_table(_words_of_parquet(content), findings)
    if content.lstrip(BEFORE_XML).startswith(XML):
        return lines_of_xml(content, findings), None
    words = words_of(text_of(content, findings))
    return lines_of_table(words, findings)


def _words_of_parquet(content: bytes) -> Words:
    """The rows of a table as words; row 1 is the first of them, its head row 0."""
    try:
        frame = pl.read_parquet(io.BytesIO(content))
    except (OSError, pl.exceptions.PolarsError) as error:
        raise CorampError(f"cannot be read: {error}; allowed is a whole Parquet file") from error
    for name, kind in frame.schema.items():
        if kind.is_nested() or kind in (pl.Binary, pl.Object, pl.Boolean):
            raise CorampError(
                f"column {name} is of type {kind}; allowed are numbers, text, dates and times"
            )
    rows = [[_word(value) for value in row] for row in frame.iter_rows()]
    return [(0, frame.columns), *enumerate(rows, 1)]


def _word(value: Any) -> str:
    if value is None:
        return ""
    if isinstance(value, datetime | date):
        return value.isoformat()
    if isinstance(value, timedelta):
        value = value.total_seconds()
    if isinstance(value, float) and math.isfinite(value) and value == int(value):
        return str(int(value))
    return str(value)
