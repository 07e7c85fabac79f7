"""The time-space diagram of a plan, before and after."""

from collections.abc import Collection, Iterator
from pathlib import Path

import numpy as np
import polars as pl
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from coramp._kernel import FloatArray
from coramp.kinematics.trajectory import station_and_speed
from coramp.report.style import (
    BLUE,
    GREY,
    VERMILION,
    YELLOW,
    grid,
    legend_below,
    new_figure,
    save_plot,
)
from coramp.runs.planning import PlannedSnapshot

RAMP_COLOUR, MOVED_COLOUR, MAINLINE_COLOUR = VERMILION, BLUE, GREY
POINTS = 400
NEAR_NAMES = 0.04
"""Names nearer to each other than this share of the height go into columns."""
NAME_WIDTH_PT = 14.0
COLUMNS = ["time_s", "station_m", "speed_mps", "accel_mps2"]


def save_plan_figure(planned: PlannedSnapshot, path: Path) -> None:
    """Writes the diagram; the file's ending says how (png, svg, pdf).

    Raises CorampError where that cannot be written.
    """
    save_plot(lambda: plan_figure(planned), path)


def plan_figure(planned: PlannedSnapshot) -> Figure:
    """Returns station over time of every vehicle, before the decisions and after them."""
    figure = new_figure(11, 5.5)
    before, after = figure.subplots(1, 2, sharex=True, sharey=True)
    until_s = end_of_interest_s(planned)
    moved = moved_vehicles(planned)
    draw_trajectories(before, planned.before, until_s, moved)
    draw_trajectories(after, planned.after, until_s, moved)
    draw_merges(after, planned)
    for axes, title in ((before, "before"), (after, f"after: {planned.strategy}")):
        draw_acceleration_lane(axes, planned)
        axes.set(title=title, xlabel="time (s)", xlim=(0.0, until_s))
        name_lines(axes)
    grid(before, after)
    before.set_ylabel("station of the front bumper (m)")
    legend_below(figure, [after], 5)
    return figure


def end_of_interest_s(planned: PlannedSnapshot) -> float:
    """Returns the time (s) up to which diagrams of a plan run: 4 s after the last merge."""
    latest = planned.decisions["merge_time_s"].max()
    return float(latest) + 4.0 if isinstance(latest, float) else 20.0


def moved_vehicles(planned: PlannedSnapshot) -> set[str]:
    """Returns the vehicles that move for another one."""
    return {name for ids in planned.decisions["adjusted_vehicle_ids"].to_list() for name in ids}


def pieces_of_each(trajectories: pl.DataFrame) -> Iterator[tuple[str, FloatArray, bool]]:
    """Yields of each vehicle: name, pieces (``kinematics.trajectory``), whether it is on a ramp."""
    for (name,), pieces in trajectories.group_by(["vehicle_id"], maintain_order=True):
        rows = np.ascontiguousarray(pieces.select(COLUMNS).to_numpy())
        yield str(name), rows, "ramp" in pieces["lane"]


def draw_acceleration_lane(axes: Axes, planned: PlannedSnapshot) -> None:
    """Shades the stations of the acceleration lane."""
    lane_m = planned.scenario.ramp.acceleration_lane_m
    axes.axhspan(0.0, lane_m, color=YELLOW, alpha=0.25, label="acceleration lane")


def draw_merges(axes: Axes, planned: PlannedSnapshot) -> None:
    """Marks when and where ramp vehicles merge."""
    merges = planned.decisions.filter(pl.col("merge_time_s").is_not_null())
    times_s, stations_m = merges["merge_time_s"], merges["merge_station_m"]
    axes.scatter(times_s, stations_m, color=RAMP_COLOUR, zorder=3, label="merge")


def draw_trajectories(
    axes: Axes, trajectories: pl.DataFrame, until_s: float, moved: set[str]
) -> None:
    """Draws station (m) over time (s) of all vehicles, one line each; its gid is their name."""
    times_s = np.linspace(0.0, until_s, POINTS)
    for name, rows, on_ramp in pieces_of_each(trajectories):
        stations_m = [station_and_speed(rows, time_s)[0] for time_s in times_s]
        if on_ramp:
            colour, label, width = RAMP_COLOUR, "ramp vehicle", 2.0
        elif name in moved:
            colour, label, width = MOVED_COLOUR, "moves aside", 1.6
        else:
            colour, label, width = MAINLINE_COLOUR, "mainline vehicle", 1.0
        axes.plot(times_s, stations_m, color=colour, linewidth=width, label=label, gid=name)


def name_lines(axes: Axes, names: Collection[str] | None = None) -> None:
    """Writes each vehicle's name beside the right edge, further out where lines are close.

    Lines that leave through the upper edge are named there. ``names`` are who is named, default:
    everyone.
    """
    edge_s, (low_m, high_m) = axes.get_xlim()[1], axes.get_ylim()
    ends = []
    for line in axes.get_lines():
        if names is not None and line.get_gid() not in names:
            continue
        times_s, stations_m = (np.asarray(data, dtype=float) for data in line.get_data())
        ends.append((float(np.interp(edge_s, times_s, stations_m)), line))
    near_m, columns_m = NEAR_NAMES * (high_m - low_m), [-np.inf]
    width_pt = max([NAME_WIDTH_PT, *(5.6 * len(str(line.get_gid())) for _, line in ends)])
    for station_m, line in sorted(ends, key=lambda end: end[0]):
        if station_m > high_m:
            _name_at_the_top(axes, line, high_m)
        if not low_m <= station_m <= high_m:
            continue
        free = [k for k, last_m in enumerate(columns_m) if station_m - last_m >= near_m]
        column = free[0] if free else len(columns_m)
        columns_m[column : column + 1] = [station_m]
        axes.annotate(
            str(line.get_gid()),
            (edge_s, station_m),
            (3.0 + width_pt * column, 0.0),
            textcoords="offset points",
            va="center",
            fontsize=7.5,
            color=line.get_color(),
            annotation_clip=False,
        )


def _name_at_the_top(axes: Axes, line: Line2D, high_m: float) -> None:
    times_s, stations_m = (np.asarray(data, dtype=float) for data in line.get_data())
    leaves_s = float(np.interp(high_m, stations_m, times_s))
    if leaves_s > axes.get_xlim()[0]:
        axes.annotate(
            str(line.get_gid()),
            (leaves_s, high_m),
            (-8.0, -3.0),
            textcoords="offset points",
            ha="right",
            va="top",
            fontsize=7.5,
            color=line.get_color(),
        )
