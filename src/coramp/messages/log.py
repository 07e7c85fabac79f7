"""The log of messages of a run: its columns, how it is written, and how it is read back.

One row a message, in the order in which they were told. Row 0 is the first.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import polars as pl

from coramp._kernel import BoolArray, FloatArray, IntArray
from coramp.messages.commands import Enter, SetSignal, WorldCommand
from coramp.messages.events import DetectorReading, RequestToEnter
from coramp.road.streams import STREAMS
from coramp.vehicles.merge_state import is_planned
from coramp.vehicles.traits import Traits

LOG_VERSION = 2
"""Raised whenever messages get other columns, or mean something else."""
TRAIT_COLUMNS = tuple(Traits._fields)
"""Columns of what a vehicle can do: null where only the common limits bind it."""
PIECES = ("piece_time_s", "piece_station_m", "piece_speed_mps", "piece_accel_mps2")
MESSAGES: dict[str, pl.DataType | type[pl.DataType]] = {
    "version": pl.Int64,
    "time_s": pl.Float64,
    "kind": pl.String,
    "vehicle_id": pl.String,
    "of_s": pl.Float64,
    "stream": pl.String,
    "station_m": pl.Float64,
    "speed_mps": pl.Float64,
    "length_m": pl.Float64,
    "std_m": pl.Float64,
    "accel_mps2": pl.Float64,
    "merge_time_s": pl.Float64,
    **dict.fromkeys(PIECES, pl.List(pl.Float64)),
    "mainline_occupancy": pl.Float64,
    "queue_occupancy": pl.Float64,
    "passed_veh": pl.Int64,
    "green": pl.Boolean,
    "vehicle_type": pl.String,
    **{name: pl.Float64 for name in TRAIT_COLUMNS if name != "length_m"},
}
REPORT, COMPARISON, READING, REQUEST, ENTRY, COMMAND, ACKNOWLEDGEMENT, SIGNAL, END = KINDS = (
    "report",
    "comparison",
    "reading",
    "request",
    "entry",
    "command",
    "acknowledgement",
    "signal",
    "end",
)
"""Kinds of messages.

A comparison is a position that SUMO was asked for where a vehicle changes lanes or leaves.
"""
EVERY_S = 1.0
"""How often each vehicle on the road reports where it is."""


class Positions(NamedTuple):
    """What vehicles told of their positions, an entry each; ``vehicle`` is a request's number.

    ``accel_mps2`` is nan in the reports of once a second. ``comparison`` marks positions that the
    world was asked for to compare them with the plan.
    """

    vehicle: IntArray
    step: IntArray
    of_s: FloatArray
    station_m: FloatArray
    speed_mps: FloatArray
    accel_mps2: FloatArray
    comparison: BoolArray


NO_POSITIONS = Positions(
    np.empty(0, np.int64),
    np.empty(0, np.int64),
    np.empty(0),
    np.empty(0),
    np.empty(0),
    np.empty(0),
    np.empty(0, np.bool_),
)


class Told(NamedTuple):
    """All that was told in a run that ended at ``end_step``."""

    requests: Sequence[RequestToEnter]
    commands: Sequence[WorldCommand]
    positions: Positions
    readings: Sequence[DetectorReading]
    end_step: int


def report_steps(step_s: float) -> int:
    """Returns how many steps of the control clock lie between two reports of a vehicle."""
    return max(1, round(EVERY_S / step_s))


def as_frame(told: Told, step_s: float) -> pl.DataFrame:
    """Returns the log, by time.

    At one time come reports of once a second, readings, requests, commands, and then what vehicles
    tell as they obey; positions by vehicle.
    """
    obeying = told.positions.comparison | ~np.isnan(told.positions.accel_mps2)
    parts = [
        _positions(told, ~obeying, step_s),
        _rows([_reading(reading) for reading in told.readings]),
        _rows([_request(r, step_s) for r in told.requests if r.step <= told.end_step]),
        _rows([row for command in told.commands for row in _command(command, step_s)]),
        _positions(told, obeying, step_s),
        _rows([{"kind": END, "time_s": told.end_step * step_s}]),
    ]
    return (
        pl.concat(part.with_columns(order=pl.lit(k)) for k, part in enumerate(parts))
        .with_columns(who=pl.when(pl.col("kind").is_in([REPORT, COMPARISON])).then("vehicle_id"))
        .sort("time_s", "order", "who", maintain_order=True)
        .select(list(MESSAGES))
    )


def _rows(rows: Sequence[dict[str, Any]]) -> pl.DataFrame:
    frame = pl.DataFrame(rows, schema=MESSAGES)
    return frame.with_columns(version=pl.lit(LOG_VERSION, pl.Int64))


def _positions(told: Told, chosen: BoolArray, step_s: float) -> pl.DataFrame:
    within = chosen & (told.positions.step <= told.end_step)
    seen = Positions._make(column[within] for column in told.positions)
    names = np.array([request.vehicle_id for request in told.requests], object)
    columns: dict[str, Any] = {
        "time_s": seen.step * step_s,
        "kind": np.where(seen.comparison, COMPARISON, REPORT).astype(object),
        "vehicle_id": names[seen.vehicle] if len(seen.vehicle) else [],
        "of_s": seen.of_s,
        "station_m": seen.station_m,
        "speed_mps": seen.speed_mps,
        "std_m": np.zeros(len(seen.step)),
        "accel_mps2": seen.accel_mps2,
    }
    schema = {name: MESSAGES[name] for name in columns}
    frame = pl.DataFrame(columns, schema=schema).with_columns(
        pl.col("accel_mps2").fill_nan(None),
        *(pl.lit(None, MESSAGES[name]).alias(name) for name in MESSAGES if name not in schema),
    )
    return frame.with_columns(version=pl.lit(LOG_VERSION, pl.Int64)).select(list(MESSAGES))


def _reading(reading: DetectorReading) -> dict[str, Any]:
    return {
        "kind": READING,
        "time_s": reading.time_s,
        "mainline_occupancy": reading.mainline_occupancy,
        "queue_occupancy": reading.queue_occupancy,
        "passed_veh": reading.passed_veh,
    }


def _request(request: RequestToEnter, step_s: float) -> dict[str, Any]:
    return {
        "kind": REQUEST,
        "time_s": request.step * step_s,
        "vehicle_id": request.vehicle_id,
        "stream": STREAMS[request.on_ramp],
        "speed_mps": request.speed_mps,
        "length_m": request.length_m,
        "vehicle_type": request.vehicle_type,
        **_traits(request),
    }


def _traits(request: RequestToEnter) -> dict[str, Any]:
    """Returns what a vehicle can do; what does not bind it, infinity, is left out."""
    if request.traits is None:
        return {}
    known = request.traits._asdict().items()
    return {name: value for name, value in known if np.isfinite(value)}


def _command(command: WorldCommand, step_s: float) -> list[dict[str, Any]]:
    """Returns the row of a command, and of its acknowledgement where there is one."""
    time_s = command.step * step_s
    if isinstance(command, SetSignal):
        return [{"kind": SIGNAL, "time_s": time_s, "green": command.green}]
    merge_s = command.merge_time_s
    given = {
        "kind": ENTRY if isinstance(command, Enter) else COMMAND,
        "time_s": time_s,
        "vehicle_id": command.vehicle_id,
        "merge_time_s": merge_s if is_planned(merge_s) else None,
        **dict(zip(PIECES, command.pieces.T.tolist(), strict=True)),
    }
    answer = {
        "kind": ACKNOWLEDGEMENT,
        "time_s": time_s,
        "vehicle_id": command.vehicle_id,
        "of_s": time_s,
    }
    return [given, answer]
