"""The paper's worked example: time-space diagrams (Fig. 7, 8, 10, 11) and positions (Fig. 6, 9)."""

from typing import NamedTuple

import numpy as np
import polars as pl
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from coramp._kernel import FloatArray
from coramp.equations.free_movement import acceleration_time_s, nose_time_s, ramp_trajectory
from coramp.kinematics.trajectory import station_and_speed
from coramp.report.plan_figure import (
    MAINLINE_COLOUR,
    MOVED_COLOUR,
    POINTS,
    RAMP_COLOUR,
    draw_acceleration_lane,
    draw_merges,
    draw_trajectories,
    end_of_interest_s,
    moved_vehicles,
    name_lines,
    pieces_of_each,
)
from coramp.report.style import BLACK, YELLOW, grid, legend_below, new_figure
from coramp.runs.planning import PlannedSnapshot

NEAR_S, NEAR_M = 1.6, 48.0
"""How far the enlarged diagram goes from the merge of free movement."""
AROUND_M = 75.0
"""How far the rows of positions go from the merge."""
Positions = dict[str, float]


class Free(NamedTuple):
    """A ramp vehicle's free movement, and when and where it would merge."""

    vehicle_id: str
    pieces: FloatArray
    merge_s: float
    merge_m: float


def free_movement(planned: PlannedSnapshot) -> Free:
    """Returns what the first ramp vehicle does without coordination (Eq. 11 to 14, 18)."""
    vehicle = next(v for v in planned.snapshot.vehicles if v.stream == "ramp")
    v0_mps = planned.scenario.mainline.speed_mps
    accel_mps2 = planned.scenario.motion.free_acceleration_mps2
    pieces = ramp_trajectory(0.0, vehicle.station_m, vehicle.speed_mps, v0_mps, accel_mps2)
    merge_s = nose_time_s(vehicle.station_m, vehicle.speed_mps) + acceleration_time_s(
        v0_mps, vehicle.speed_mps, accel_mps2
    )
    return Free(vehicle.id, pieces, merge_s, station_and_speed(pieces, merge_s)[0])


def time_space_figure(planned: PlannedSnapshot) -> Figure:
    """Returns station (m) over time (s) before and after a decision, whole and enlarged.

    Before is free movement, as in Fig. 7 and 8; after is what was decided, as in Fig. 10 and 11.
    Enlarged, a band as wide as the vehicle is long hangs behind each front bumper.
    """
    figure = new_figure(9.0, 7.6)
    axes = figure.subplots(2, 2)
    free, moved, until_s = (
        free_movement(planned),
        moved_vehicles(planned),
        end_of_interest_s(planned),
    )
    others = planned.before.filter(pl.col("vehicle_id") != free.vehicle_id)
    for row, near in zip(axes, (False, True), strict=True):
        before, after = row
        draw_trajectories(before, others, until_s, moved)
        _draw_free(before, free, until_s)
        draw_trajectories(after, planned.after, until_s, moved)
        draw_merges(after, planned)
        for diagram, title in ((before, "free movement"), (after, f"after: {planned.strategy}")):
            diagram.set(
                title=f"{title}{', enlarged' if near else ''}",
                xlabel="time (s)",
                ylabel="station of the front bumper (m)",
                xlim=(0.0, until_s),
            )
            grid(diagram)
            if near:
                _enlarge(diagram, planned, free)
            else:
                draw_acceleration_lane(diagram, planned)
            name_lines(diagram)
    legend_below(figure, axes.flat, 3)
    return figure


def _draw_free(axes: Axes, free: Free, until_s: float) -> None:
    times_s = np.linspace(0.0, until_s, POINTS)
    stations_m = [station_and_speed(free.pieces, time_s)[0] for time_s in times_s]
    axes.plot(
        times_s,
        stations_m,
        color=RAMP_COLOUR,
        linestyle="--",
        linewidth=2.0,
        label="ramp vehicle, free movement",
        gid=free.vehicle_id,
    )
    axes.scatter(
        [free.merge_s],
        [free.merge_m],
        color=BLACK,
        marker="x",
        s=50,
        zorder=4,
        label="meets a mainline vehicle",
    )


def _enlarge(axes: Axes, planned: PlannedSnapshot, free: Free) -> None:
    """Cuts out the surroundings of the merge, gives vehicles their lengths."""
    axes.set_xlim(free.merge_s - NEAR_S, free.merge_s + NEAR_S)
    axes.set_ylim(free.merge_m - NEAR_M, free.merge_m + NEAR_M)
    lengths_m = lengths_of(planned)
    for line in axes.get_lines():
        times_s, fronts_m = (np.asarray(data, dtype=float) for data in line.get_data())
        rears_m = fronts_m - lengths_m[str(line.get_gid())]
        axes.fill_between(times_s, rears_m, fronts_m, color=line.get_color(), alpha=0.25, lw=0)


def lengths_of(planned: PlannedSnapshot) -> dict[str, float]:
    """Returns each vehicle's length in m."""
    usual_m = planned.scenario.usual_length_m
    return {v.id: v.length_m or usual_m for v in planned.snapshot.vehicles}


def positions_figure(mainline: PlannedSnapshot, ramp: PlannedSnapshot) -> Figure:
    """Returns where vehicles are: at first, and at the merge without and with coordination.

    The merge of free movement is the paper's Fig. 6 (a). ``mainline`` is the snapshot planned with
    mainline priority, where another gap is reached (Fig. 6 (b)), ``ramp`` that planned with ramp
    priority, where the gap is made (Fig. 9).
    """
    figure = new_figure(9.0, 5.6)
    rows = figure.subplots(4, 1)
    free = free_movement(mainline)
    unplanned = {**positions_m(mainline.before, free.merge_s), free.vehicle_id: free.merge_m}
    first = positions_m(mainline.before, 0.0)
    _draw_positions(rows[0], mainline, first, "at 0 s", merged=False)
    title = f"free movement, at its merge, {free.merge_s:.2f} s: two vehicles in one place"
    _draw_positions(rows[1], mainline, unplanned, title, merged=True)
    for axes, planned in zip(rows[2:], (mainline, ramp), strict=True):
        (decision,) = planned.decisions.filter(vehicle_id=free.vehicle_id).iter_rows(named=True)
        at_s = decision["merge_time_s"]
        title = (
            f"{planned.strategy}, at the merge, {at_s:.2f} s: {_told(planned, decision['rung'])}"
        )
        _draw_positions(axes, planned, positions_m(planned.after, at_s), title, merged=True)
    rows[0].set_xlim(min(first.values()) - 20.0, max(first.values()) + 20.0)
    for axes in rows[1:]:
        axes.set_xlim(free.merge_m - AROUND_M, free.merge_m + AROUND_M)
    rows[-1].set_xlabel("station (m)")
    return figure


def positions_m(trajectories: pl.DataFrame, time_s: float) -> Positions:
    """Returns the station (m) of each front bumper at a time."""
    return {
        name: float(station_and_speed(rows, time_s)[0])
        for name, rows, _ in pieces_of_each(trajectories)
    }


def _told(planned: PlannedSnapshot, rung: str) -> str:
    moved = ", ".join(sorted(moved_vehicles(planned)))
    return f"rung {rung}" + (f", {moved} moved ahead" if moved else ", no other vehicle moves")


def _draw_positions(
    axes: Axes, planned: PlannedSnapshot, stations_m: Positions, title: str, *, merged: bool
) -> None:
    """Draws the mainline above the ramp, and each vehicle as a box of its length."""
    lengths_m, moved = lengths_of(planned), moved_vehicles(planned)
    on_ramp = {v.id for v in planned.snapshot.vehicles if v.stream == "ramp"}
    lane_m = planned.scenario.ramp.acceleration_lane_m
    axes.axhspan(-0.5, 0.5, color=MAINLINE_COLOUR, alpha=0.12, lw=0)
    axes.add_patch(Rectangle((0.0, -1.5), lane_m, 1.0, color=YELLOW, alpha=0.3, lw=0))
    axes.add_patch(Rectangle((-1e4, -1.5), 1e4, 1.0, color=RAMP_COLOUR, alpha=0.08, lw=0))
    for name, front_m in stations_m.items():
        ramp = name in on_ramp
        colour = MOVED_COLOUR if merged and name in moved else MAINLINE_COLOUR
        middle = -1.0 if ramp and not merged else 0.0
        box = Rectangle(
            (front_m - lengths_m[name], middle - 0.3),
            lengths_m[name],
            0.6,
            facecolor=RAMP_COLOUR if ramp else colour,
            edgecolor=BLACK,
            alpha=0.75,
            gid=name,
        )
        axes.add_patch(box)
        _name_box(axes, name, front_m - 0.5 * lengths_m[name], middle, below=ramp)
    axes.set(title=title, ylim=(-2.1, 1.1), yticks=(0.0, -1.0))
    axes.set_yticklabels(("mainline", "ramp, acceleration lane"), fontsize=7.5)


def _name_box(axes: Axes, name: str, station_m: float, middle: float, *, below: bool) -> None:
    axes.annotate(
        name,
        (station_m, middle + (-0.4 if below else 0.4)),
        ha="center",
        va="top" if below else "bottom",
        fontsize=8,
        annotation_clip=True,
    )
