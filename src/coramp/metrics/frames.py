"""Tables of what was driven and decided, from arrays and records."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import polars as pl

from coramp._kernel import FloatArray, IntArray
from coramp.coordination.decision_log import DecisionRecord
from coramp.records.schemas import DECISIONS, TRAJECTORIES, Row, Schema
from coramp.road.lanes import lane_name


def frame_of(schema: Schema, **columns: Any) -> pl.DataFrame:
    """Returns a table of these columns by a schema; nan becomes null."""
    frame = pl.DataFrame({name: columns[name] for name in schema}, schema=schema)
    return frame.with_columns(pl.col(pl.Float64).fill_nan(None))


def trajectories_table(
    names: Sequence[str], first: IntArray, rows: FloatArray, lane: IntArray
) -> pl.DataFrame:
    """Returns one row a piece; vehicle i's are ``rows[first[i] : first[i + 1]]``."""
    counts = np.diff(first)
    return frame_of(
        TRAJECTORIES,
        vehicle_id=[name for name, n in zip(names, counts, strict=True) for _ in range(n)],
        lane=[lane_name(code) for code in lane.tolist()],
        time_s=rows[:, 0],
        station_m=rows[:, 1],
        speed_mps=rows[:, 2],
        accel_mps2=rows[:, 3],
    )


NAMED_ROWS = {
    "vehicle_id": "row",
    "conflict_vehicle_id": "conflict_row",
    "front_vehicle_id": "front_row",
    "rear_vehicle_id": "rear_row",
}


def decisions_table(
    decisions: Sequence[DecisionRecord], vehicle_ids: Sequence[str], vehicle_of_row: IntArray
) -> pl.DataFrame:
    """Returns one row a decision; what a decision has not is null."""

    def name(row: int) -> str | None:
        return vehicle_ids[vehicle_of_row[row]] if row >= 0 else None

    rows = []
    for decision in decisions:
        why = decision.explanation
        row: Row = {key: getattr(why, key, None) for key in DECISIONS}
        row.update({key: name(getattr(why, field)) for key, field in NAMED_ROWS.items()})
        row["time_s"] = decision.time_s
        row["scenario"] = why.scenario or None
        row["adjusted_vehicle_ids"] = [name(adjusted) for adjusted in decision.adjusted_rows]
        row["min_margin_m"] = decision.min_margin_m
        rows.append(row)
    frame = pl.DataFrame(rows, schema=DECISIONS, orient="row")
    return frame.with_columns(pl.col(pl.Float64).fill_nan(None))
