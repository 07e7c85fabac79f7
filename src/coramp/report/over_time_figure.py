"""Speed and delay over time of runs on the same arrivals, a line each."""

import math
from collections.abc import Callable, Sequence

import numpy as np
import polars as pl
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from coramp.metrics.motion import BIN_S
from coramp.records.run import RunRecords
from coramp.report.style import grid, legend_below, look_of, new_figure
from coramp.road.streams import STREAMS
from coramp.studies.speed_unit import MPS, SpeedUnit

MEAN_OVER_S = 60.0
"""Lines are means over so long, a tenth of a short run's horizon, but over 10 s at least."""
SHARE, LEAST_S = 0.1, 10.0
ZERO_BELOW = 0.5
"""An axis of speeds begins at 0 where the lowest is below this share of the highest."""
TICK = 5.0
Line = tuple[np.ndarray, np.ndarray]


def speeds_over_time_figure(runs: Sequence[RunRecords], unit: SpeedUnit = MPS) -> Figure:
    """Returns the mean speed of each stream over time (s), each vehicle and second counting once.

    From the first arrival until the last vehicle has left.
    """

    def speeds(run: RunRecords, stream: str) -> Line:
        times_s, speeds_mps = binned(
            run.speeds.filter(stream=stream), ("time_s", "mean_speed_mps", "vehicles"), _step_s(run)
        )
        return times_s, speeds_mps * unit.per_mps

    figure = _figure(runs, speeds, (f"mean speed of those on the road ({unit.name})", "time (s)"))
    for axes in figure.axes:
        _begin_near_the_lines(axes)
    return figure


def delays_over_time_figure(runs: Sequence[RunRecords]) -> Figure:
    """Returns the mean delay (s) of who was due at a time (s), by stream."""

    def delays(run: RunRecords, stream: str) -> Line:
        here = run.vehicles.filter(stream=stream).with_columns(count=pl.lit(1))
        return binned(here, ("scheduled_s", "delay_s", "count"), _step_s(run))

    figure = _figure(runs, delays, ("mean delay of those due then (s)", "time when due (s)"))
    for axes in figure.axes:
        axes.set_ylim(min(0.0, axes.get_ylim()[0]), None)
    return figure


def _begin_near_the_lines(axes: Axes) -> None:
    """Lets an axis of speeds begin near the lowest, and says so: from 0 all lines lie on top."""
    low, high = axes.get_ylim()
    if not axes.get_lines() or low <= ZERO_BELOW * high:
        axes.set_ylim(0.0, None)
        return
    start = TICK * math.floor(low / TICK)
    axes.set_ylim(start, None)
    axes.set_title(f"{axes.get_title()} (axis from {start:g})")


def binned(frame: pl.DataFrame, columns: tuple[str, str, str], step_s: float) -> Line:
    """Returns middles of bins (s) and the weighed mean of each; bins without anything are left out.

    ``columns`` name time, value and weight.
    """
    time, value, weight = columns
    good = frame.drop_nulls([time, value])
    if good.is_empty():
        return np.empty(0), np.empty(0)
    places = np.floor(good[time].to_numpy() / step_s).astype(np.int64)
    weights = good[weight].to_numpy().astype(np.float64)
    total = np.bincount(places, weights * good[value].to_numpy())
    counts = np.bincount(places, weights)
    there = counts > 0.0
    return (np.flatnonzero(there) + 0.5) * step_s, total[there] / counts[there]


def _step_s(run: RunRecords) -> float:
    step_s = min(MEAN_OVER_S, SHARE * run.scenario.simulation.horizon_s)
    return max(LEAST_S, BIN_S, step_s)


def _figure(
    runs: Sequence[RunRecords],
    line_of: Callable[[RunRecords, str], Line],
    names: tuple[str, str],
) -> Figure:
    """A diagram a stream and a line a run; ``names`` are those of what is shown and of its time."""
    figure = new_figure(9.0, 4.6)
    diagrams = figure.subplots(2, 1, sharex=True)
    for axes, stream in zip(diagrams, STREAMS, strict=True):
        for run in runs:
            _draw(axes, run, line_of(run, stream))
        axes.set(title=stream, xlim=(0.0, None))
    name, time = names
    figure.supylabel(name, fontsize=9)
    diagrams[-1].set_xlabel(time)
    grid(*diagrams)
    legend_below(figure, diagrams, 3)
    return figure


def _draw(axes: Axes, run: RunRecords, line: Line) -> None:
    look = look_of(run.content["strategy"], run.content["drivers"])
    axes.plot(
        *line,
        color=look.colour,
        linestyle=look.line,
        linewidth=look.width_pt,
        marker=look.marker,
        markevery=max(1, len(line[0]) // 10),
        label=look.label,
    )
