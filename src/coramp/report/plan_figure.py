"""The time-space diagram of a plan, before and after."""

from collections.abc import Collection, Iterator, Sequence
from pathlib import Path

import numpy as np
import polars as pl
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from coramp._kernel import FloatArray
from coramp.kinematics.trajectory import station_and_speed
from coramp.report.plan_road import draw_from_above
from coramp.report.style import (
    BLACK,
    BLUE,
    GREY,
    VERMILION,
    YELLOW,
    grid,
    legend_below,
    look_of,
    new_figure,
    save_plot,
)
from coramp.runs.planning import PlannedSnapshot

RAMP_COLOUR, MOVED_COLOUR, MAINLINE_COLOUR = VERMILION, BLUE, GREY
POINTS = 400
AFTER_MERGE_S, LOOKED_AT_S = 4.0, 4.0
"""How long after the last merge diagrams run, and how long before it the road is looked at."""
NEAR_NAMES = 0.04
"""Names nearer to each other than this share of the height go into columns."""
NAME_WIDTH_PT = 14.0
SEEN_GID = "seen from above"
COLUMNS = ["time_s", "station_m", "speed_mps", "accel_mps2"]


def save_plan_figure(planned: PlannedSnapshot, path: Path) -> None:
    """Writes the diagram; the file's ending says how (png, svg, pdf).

    Raises CorampError where that cannot be written.
    """
    save_plot(lambda: plan_figure(planned), path)


def plan_figure(planned: PlannedSnapshot) -> Figure:
    """Returns station over time of every vehicle, before the decisions and after them.

    Colours are lanes: a ramp vehicle's line takes the mainline's colour at its merge. Below, the
    road from above some seconds before the last merge, while lines of the two lanes cross.
    """
    figure = new_figure(11, 6.9)
    (before, after), roads = figure.subplots(2, 2, height_ratios=(3.6, 1.0), sharey="row")
    until_s = end_of_interest_s(planned)
    seen_s = max(0.0, until_s - AFTER_MERGE_S - LOOKED_AT_S)
    moved = moved_vehicles(planned)
    drawn = (
        (before, planned.before, "before the decision"),
        (after, planned.after, f"after the decision: {look_of(planned.strategy).label}"),
    )
    for axes, trajectories, title in drawn:
        draw_trajectories(axes, trajectories, until_s, moved)
        draw_acceleration_lane(axes, planned)
        axes.axvline(seen_s, color=BLACK, linestyle=":", linewidth=1.0, gid=SEEN_GID)
        axes.set(title=title, xlabel="time (s)", xlim=(0.0, until_s))
    draw_merges(after, planned)
    for axes, (diagram, trajectories, _) in zip(roads, drawn, strict=True):
        name_lines(diagram)
        axes.set_xlim(*_seen_m(trajectories, seen_s, planned))
        draw_from_above(axes, planned, trajectories, seen_s, (MAINLINE_COLOUR, RAMP_COLOUR))
        axes.set_xlabel(f"the road from above at {seen_s:.1f} s (dotted line): station (m)")
    grid(before, after)
    before.set_ylabel("station of the front bumper (m)")
    legend_below(figure, [after], 5)
    return figure


def _seen_m(
    trajectories: pl.DataFrame, time_s: float, planned: PlannedSnapshot
) -> tuple[float, float]:
    """The stations (m) that the view from above shows: acceleration lane and ramp vehicles."""
    ramps = [rows for _, rows, on_ramp in pieces_of_each(trajectories) if on_ramp]
    stations_m = [float(station_and_speed(rows, time_s)[0]) for rows in ramps]
    lane_m = planned.scenario.ramp.acceleration_lane_m
    return min([0.0, *stations_m]) - 60.0, max([lane_m, *stations_m]) + 30.0


def end_of_interest_s(planned: PlannedSnapshot) -> float:
    """Returns the time (s) up to which diagrams of a plan run: 4 s after the last merge."""
    latest = planned.decisions["merge_time_s"].max()
    return float(latest) + AFTER_MERGE_S if isinstance(latest, float) else 20.0


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
    """Draws station (m) over time (s) of all vehicles, one line each; its gid is their name.

    Colours are lanes: lines of different colours may cross.
    """
    times_s = np.linspace(0.0, until_s, POINTS)
    for name, rows, on_ramp in pieces_of_each(trajectories):
        stations_m = [station_and_speed(rows, time_s)[0] for time_s in times_s]
        if on_ramp:
            colour, label, width = RAMP_COLOUR, "on the ramp or acceleration lane", 2.0
        elif name in moved:
            colour, label, width = MOVED_COLOUR, "on the mainline, moves aside", 1.6
        else:
            colour, label, width = MAINLINE_COLOUR, "on the mainline", 1.0
        axes.plot(times_s, stations_m, color=colour, linewidth=width, label=label, gid=name)
        if on_ramp:
            _recolour_merged(axes, trajectories.filter(vehicle_id=name), times_s, stations_m)


def _recolour_merged(
    axes: Axes, pieces: pl.DataFrame, times_s: FloatArray, stations_m: Sequence[float]
) -> None:
    """Draws a ramp vehicle's line in the mainline's colour from its merge on."""
    merge_s = pieces.filter(lane="mainline")["time_s"].min()
    if not isinstance(merge_s, float):
        return
    points = np.column_stack((times_s, stations_m))
    merged = points[points[:, 0] >= merge_s]
    part = LineCollection([merged], colors=MAINLINE_COLOUR, linewidths=2.2, zorder=2.5)
    part.set_gid("merged")
    axes.add_collection(part)


def name_lines(axes: Axes, names: Collection[str] | None = None) -> None:
    """Writes each vehicle's name beside the right edge, further out where lines are close.

    Lines that leave through the upper edge are named there. ``names`` are who is named, default:
    everyone.
    """
    edge_s, (low_m, high_m) = axes.get_xlim()[1], axes.get_ylim()
    ends = []
    for line in axes.get_lines():
        if line.get_gid() == SEEN_GID:
            continue
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
