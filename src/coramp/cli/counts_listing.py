"""What a file of counts holds, as rows of plain data and as a table."""

import math
from collections.abc import Sequence
from itertools import groupby

from coramp.counts.reading import Examined
from coramp.counts.table import Line
from coramp.records.schemas import Row
from coramp.studies.speed_unit import SpeedUnit
from coramp.studies.tables import Table, number

KEPT = ("detector", "class", "vehicles", "peak (veh/h)")
"""Columns that a narrow terminal keeps longest."""
HOUR_S = 3600.0


def counts_rows(found: Examined) -> list[Row]:
    """Returns a row for each detector, lane and class, in that order."""
    lines = sorted(found.lines, key=lambda line: (line.stream, line.begin_s))
    return [_row(list(own)) for _, own in groupby(lines, key=lambda line: line.stream)]


def _row(lines: Sequence[Line]) -> Row:
    known = [line for line in lines if not math.isnan(line.vehicles)]
    flows = [line.vehicles * HOUR_S / (line.end_s - line.begin_s) for line in known]
    fast = [line for line in known if line.mean_speed_mps is not None and line.vehicles > 0.0]
    seen = sum(line.vehicles for line in fast)
    speed_mps = sum(line.vehicles * (line.mean_speed_mps or 0.0) for line in fast)
    return {
        "detector": lines[0].detector,
        "lane": lines[0].lane,
        "class": lines[0].vehicle_class,
        "begin_s": min(line.begin_s for line in lines),
        "end_s": max(line.end_s for line in lines),
        "interval_s": max(line.end_s - line.begin_s for line in lines),
        "intervals": len({line.begin_s for line in lines}),
        "vehicles": sum(line.vehicles for line in known),
        "peak_veh_h": max(flows, default=0.0),
        "mean_speed_mps": speed_mps / seen if seen > 0.0 else None,
    }


def counts_data(found: Examined, rows: Sequence[Row]) -> Row:
    """Returns all that is known of a file, as plain data."""
    return {
        "file": found.source,
        "adds_up": not found.problems,
        "start": None if found.start is None else found.start.isoformat(),
        "detectors": list(rows),
        "problems": [
            {"row": problem.row or None, "what": problem.what, "allowed": problem.allowed}
            for problem in found.problems
        ],
        "repairs": [{"row": repair.row or None, "what": repair.what} for repair in found.repairs],
    }


def counts_table(found: Examined, rows: Sequence[Row], unit: SpeedUnit) -> Table:
    """Returns the rows as a table with speeds in a unit, and repairs below it."""
    columns = (
        *("detector", "lane", "class", "from (s)", "to (s)", "interval (s)"),
        *("vehicles", "peak (veh/h)", f"mean speed ({unit.name})"),
    )
    cells = tuple(
        (
            row["detector"],
            "all" if row["lane"] is None else str(row["lane"]),
            row["class"],
            number(row["begin_s"], 0),
            number(row["end_s"], 0),
            number(row["interval_s"], 0),
            number(row["vehicles"], 0),
            number(row["peak_veh_h"], 0),
            number(None if row["mean_speed_mps"] is None else unit.of(row["mean_speed_mps"]), 1),
        )
        for row in rows
    )
    notes = [f"Repaired: {repair.line(found.source)}." for repair in found.repairs]
    if found.start is not None:
        notes.insert(0, f"Second 0 is {found.start:%Y-%m-%d %H:%M:%S}.")
    count = len({row["detector"] for row in rows})
    title = f"{found.source}: {count} detector{'s' if count != 1 else ''}"
    return Table(title, columns, cells, tuple(notes), KEPT)
