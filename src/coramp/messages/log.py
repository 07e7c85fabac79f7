"""All that was told in a run, and how it is written as a log of messages.

One row a message, in the order in which they were told. Row 0 is the first. ``messages.kinds`` has
the kinds and their columns, ``messages.log_reader`` reads a log back.
"""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import polars as pl

from coramp._kernel import BoolArray, FloatArray, IntArray
from coramp.messages.commands import Enter, Follow, SetSignal, WorldCommand
from coramp.messages.events import DetectorReading, RequestToEnter
from coramp.messages.kinds import (
    ACKNOWLEDGEMENT,
    COLUMNS,
    COMMAND,
    COMPARISON,
    END,
    ENTRY,
    KINDS,
    LOG_VERSION,
    PIECES,
    READING,
    REPORT,
    REQUEST,
    SIGNAL,
    name_in_order,
    place_of_each,
)
from coramp.road.streams import STREAMS
from coramp.vehicles.merge_state import is_planned

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
    """Returns the log: by time, then by the places of the kinds; positions by vehicle."""
    requests = [request for request in told.requests if request.step <= told.end_step]
    rows = [
        *(_reading(reading) for reading in told.readings),
        *(_request(request, step_s) for request in requests),
        *(row for command in told.commands for row in _command(command, step_s)),
        _row(END, told.end_step * step_s),
    ]
    frame = pl.concat([_positions(told, step_s), pl.DataFrame(rows, schema=COLUMNS)])
    return frame.with_columns(version=pl.lit(LOG_VERSION, pl.Int64)).sort(
        "time_s", place_of_each(), name_in_order(), maintain_order=True
    )


def _row(kind: str, time_s: float, **columns: Any) -> dict[str, Any]:
    return {"kind": kind, "time_s": time_s, **_checked(kind, columns)}


def _checked(kind: str, columns: dict[str, Any]) -> dict[str, Any]:
    """Returns columns as they are; raises ValueError where this kind has others."""
    if not KINDS[kind].fits(columns):
        needs, may_have = KINDS[kind].needs, KINDS[kind].may_have
        raise ValueError(f"{kind}: has {[*columns]}; needs {needs}, may have {may_have}")
    return columns


def _positions(told: Told, step_s: float) -> pl.DataFrame:
    within = told.positions.step <= told.end_step
    seen = Positions._make(column[within] for column in told.positions)
    names = np.array([request.vehicle_id for request in told.requests], object)
    position: dict[str, Any] = {
        "vehicle_id": names[seen.vehicle] if len(seen.vehicle) else [],
        "of_s": seen.of_s,
        "station_m": seen.station_m,
        "speed_mps": seen.speed_mps,
        "std_m": np.zeros(len(seen.step)),
        "accel_mps2": seen.accel_mps2,
    }
    columns = {
        "time_s": seen.step * step_s,
        "kind": np.where(seen.comparison, COMPARISON, REPORT).astype(object),
        **_checked(COMPARISON, _checked(REPORT, position)),
    }
    schema = {name: COLUMNS[name] for name in columns}
    frame = pl.DataFrame(columns, schema=schema).with_columns(
        pl.col("accel_mps2").fill_nan(None),
        *(pl.lit(None, COLUMNS[name]).alias(name) for name in COLUMNS if name not in schema),
    )
    return frame.select(list(COLUMNS))


def _reading(reading: DetectorReading) -> dict[str, Any]:
    return _row(
        READING,
        reading.time_s,
        mainline_occupancy=reading.mainline_occupancy,
        queue_occupancy=reading.queue_occupancy,
        passed_veh=reading.passed_veh,
    )


def _request(request: RequestToEnter, step_s: float) -> dict[str, Any]:
    return _row(
        REQUEST,
        request.step * step_s,
        vehicle_id=request.vehicle_id,
        stream=STREAMS[request.on_ramp],
        speed_mps=request.speed_mps,
        vehicle_type=request.vehicle_type,
        **{"length_m": request.length_m, **_traits(request)},
        **({"lane": request.lane} if request.lane else {}),
    )


def _lane_change(command: Enter | Follow) -> dict[str, float]:
    """Returns when a vehicle is to begin to change lanes, if it is to."""
    if isinstance(command, Enter) or math.isinf(command.lane_change_s):
        return {}
    return {"lane_change_s": command.lane_change_s}


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
        return [_row(SIGNAL, time_s, green=command.green)]
    merge_s = command.merge_time_s
    given = _row(
        ENTRY if isinstance(command, Enter) else COMMAND,
        time_s,
        vehicle_id=command.vehicle_id,
        merge_time_s=merge_s if is_planned(merge_s) else None,
        **dict(zip(PIECES, command.pieces.T.tolist(), strict=True)),
        **_lane_change(command),
    )
    answer = _row(ACKNOWLEDGEMENT, time_s, vehicle_id=command.vehicle_id, of_s=time_s)
    return [given, answer]
