"""Tables of what the coordinator of mixed traffic knew, and of what vehicles did and why."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import polars as pl

from coramp._kernel import FloatArray
from coramp.metrics.frames import frame_of
from coramp.mixed.binding import LAWS
from coramp.records.outcome import Outcome
from coramp.records.schemas import HEARD, ON_BOARD
from coramp.road.lanes import MAINLINE, RAMP, lane_name

DIGITS = 4
"""A tenth of a millimetre is enough, and makes the files half as large."""


def heard_table(outcome: Outcome) -> pl.DataFrame | None:
    """Returns one row a vehicle and decision at which the coordinator did not know what is true.

    None where it was not to be kept.
    """
    if outcome.heard is None:
        return None
    columns = _named(outcome.heard, outcome.passages.vehicle_id)
    for name in ("report_lost", "command_lost", "fallback"):
        columns[name] = outcome.heard[name] > 0.5
    return frame_of(HEARD, **columns)


def on_board_table(outcome: Outcome) -> pl.DataFrame | None:
    """Returns one row a decision and automated vehicle, and driver on the ramp.

    None where it was not to be kept.
    """
    if outcome.on_board is None:
        return None
    names, columns = (
        outcome.passages.vehicle_id,
        _named(outcome.on_board, outcome.passages.vehicle_id),
    )
    laws = outcome.on_board["law"].astype(np.int64).tolist()
    columns["law"] = [LAWS[law] if law >= 0 else None for law in laws]
    columns["fallback"] = outcome.on_board["fallback"] > 0.5
    columns["changes_lane"] = outcome.on_board["changes"] > 0.5
    places = outcome.on_board["place"].astype(np.int64).tolist()
    columns["place"] = [place if place > 0 else None for place in places]
    for other in ("after", "leader", "front", "rear"):
        columns[f"{other}_vehicle_id"] = _names(outcome.on_board[other], names)
    return frame_of(ON_BOARD, **columns)


def _named(columns: Any, names: Sequence[str]) -> dict[str, Any]:
    """Numbers of vehicles as names, lanes as words, the rest rounded."""
    named: dict[str, Any] = {name: np.round(values, DIGITS) for name, values in columns.items()}
    named["vehicle_id"] = _names(columns["vehicle"], names)
    lanes = columns["lane"] if "lane" in columns else columns["on_mainline"] - 1.0
    named["lane"] = [None if np.isnan(lane) else _lane_name(int(lane)) for lane in lanes.tolist()]
    return named


def _lane_name(lane: int) -> str:
    """The name of a lane by its number: -1 is the ramp with its acceleration lane."""
    return lane_name(RAMP if lane < 0 else MAINLINE + lane)


def _names(numbers: FloatArray, names: Sequence[str]) -> list[str | None]:
    return [names[int(n)] if n >= 0 else None for n in numbers.tolist()]
