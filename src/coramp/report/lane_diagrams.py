"""Time-space diagrams of a mainline of several lanes, one for each."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import polars as pl
from matplotlib.axes import Axes

from coramp._kernel import BoolArray, FloatArray, IntArray
from coramp.records.run import RunRecords
from coramp.report.lane_stays import made_way_in, stays_of
from coramp.report.style import BLACK

LANE_IN = 2.4
"""How high each diagram is."""
FAINT = 0.12
RAMP = -1


class Line(NamedTuple):
    """A vehicle's line, and how it is drawn where it counts."""

    times_s: FloatArray
    stations_m: FloatArray
    colour: str
    label: str
    width_pt: float


def lane_title(lane: int) -> str:
    """Returns what a lane of the mainline is called, 0 next to the ramp, whose lane shows it."""
    return "ramp and lane 1" if lane == 0 else f"lane {lane + 1}"


def draw_by_lane(run: RunRecords, diagrams: Sequence[Axes], lines: Mapping[str, Line]) -> None:
    """Draws each line into all diagrams, faint where its vehicle is on another lane.

    The last diagram is of lane 0, the one before it of lane 1, and so on.
    """
    came = {str(name): stays for (name,), stays in stays_of(run).group_by(["vehicle_id"])}
    for name, line in lines.items():
        lane = _lane_at(came[name].sort("time_s"), line.times_s)
        for k, axes in enumerate(reversed(diagrams)):
            here = (lane == k) | ((lane == RAMP) & (k == 0))
            _draw(axes, name, line, here)
    made_way = made_way_in(run)
    if made_way is not None:
        _mark_made_way(diagrams[-1], made_way)


def _lane_at(stays: pl.DataFrame, times_s: FloatArray) -> IntArray:
    place = np.searchsorted(stays["time_s"].to_numpy(), times_s, "right") - 1
    return stays["lane"].to_numpy()[np.maximum(place, 0)].astype(np.int64)


def _draw(axes: Axes, name: str, line: Line, here: BoolArray) -> None:
    drawn: dict[str, Any] = {"color": line.colour, "linewidth": line.width_pt}
    if not here.all():
        axes.plot(line.times_s, line.stations_m, alpha=FAINT, gid=f"{name} faint", **drawn)
    if here.any():
        stations_m = np.where(here, line.stations_m, np.nan)
        axes.plot(line.times_s, stations_m, label=line.label, gid=name, **drawn)


def _mark_made_way(axes: Axes, made_way: pl.DataFrame) -> None:
    low_s, high_s = axes.get_xlim()
    within = made_way.filter(pl.col("time_s").is_between(low_s, high_s))
    if within.is_empty():
        return
    axes.plot(
        within["time_s"],
        within["station_m"],
        color=BLACK,
        marker="^",
        markersize=5.0,
        linestyle="none",
        label="made way: to lane 2",
        gid="made-way",
    )
