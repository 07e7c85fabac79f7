"""The road of a plan from above at one time: who is on which lane, in the colours of the lanes."""

from typing import Any

import polars as pl
from matplotlib.axes import Axes
from matplotlib.patches import Polygon, Rectangle

from coramp.kinematics.trajectory import station_and_speed
from coramp.report.style import BLACK, GREY, YELLOW
from coramp.runs.planning import PlannedSnapshot

HALF_LANE, HALF_WIDTH = 0.5, 0.22
RAMP_FALL = 1.1
"""How many lanes the ramp lies further off at the left edge."""
COLUMNS = ["time_s", "station_m", "speed_mps", "accel_mps2"]
NEAR_M = 16.0
"""Vehicles nearer to each other than this have their names in two rows."""


def draw_from_above(
    axes: Axes,
    planned: PlannedSnapshot,
    trajectories: pl.DataFrame,
    time_s: float,
    colours: tuple[str, str],
) -> None:
    """Draws lanes and vehicles at a time (s); stations (m) are to scale, lanes are not.

    ``colours`` are of vehicles on the mainline, and on the ramp or the acceleration lane.
    """
    low_m, high_m = axes.get_xlim()
    slope = RAMP_FALL / -low_m if low_m < 0.0 else 0.0
    _draw_lanes(axes, (low_m, high_m), planned.scenario.ramp.acceleration_lane_m, slope)
    length_m, last_m, tier = planned.scenario.usual_length_m, low_m - NEAR_M, 0
    for name, station_m, on_ramp in sorted(_places(trajectories, time_s), key=lambda p: p[1]):
        across = -1.0 + slope * min(0.0, station_m) if on_ramp else 0.0
        axes.add_patch(
            Rectangle(
                (station_m - length_m, across - HALF_WIDTH),
                length_m,
                2.0 * HALF_WIDTH,
                facecolor=colours[on_ramp],
                edgecolor=BLACK,
                linewidth=0.5,
                gid=f"{name}-from-above",
            )
        )
        if not low_m + length_m <= station_m <= high_m:
            continue
        tier = 1 - tier if not on_ramp and station_m - last_m < NEAR_M else 0
        foot = across - HALF_LANE - 0.1 if on_ramp else HALF_LANE + 0.1 + 0.7 * tier
        last_m = last_m if on_ramp else station_m
        axes.text(
            station_m - 0.5 * length_m,
            foot,
            name,
            ha="center",
            va="top" if on_ramp else "bottom",
            fontsize=7.5,
            color=colours[on_ramp],
        )
    axes.set(ylim=(-1.0 - RAMP_FALL - 0.8, HALF_LANE + 1.9), yticks=[])


def _places(trajectories: pl.DataFrame, time_s: float) -> list[tuple[str, float, bool]]:
    """Each vehicle's name, station (m), and whether it is on the ramp or acceleration lane."""
    found = []
    for (name,), pieces in trajectories.group_by(["vehicle_id"], maintain_order=True):
        rows = pieces.select(COLUMNS).to_numpy()
        station_m = float(station_and_speed(rows, time_s)[0])
        lane = pieces.filter(pl.col("time_s") <= time_s + 1e-9)["lane"]
        found.append((str(name), station_m, bool(len(lane)) and lane[-1] != "mainline"))
    return found


def _draw_lanes(axes: Axes, shown_m: tuple[float, float], lane_m: float, slope: float) -> None:
    low_m, high_m = shown_m
    road: dict[str, Any] = {"facecolor": GREY, "alpha": 0.18, "edgecolor": "none", "zorder": 0.5}
    axes.add_patch(Rectangle((low_m, -HALF_LANE), high_m - low_m, 2.0 * HALF_LANE, **road))
    far = -1.0 + slope * low_m
    corners = [(low_m, far + HALF_LANE), (0.0, -HALF_LANE), (0.0, -1.0 - HALF_LANE)]
    axes.add_patch(Polygon([*corners, (low_m, far - HALF_LANE)], **road))
    lane: dict[str, Any] = {"facecolor": YELLOW, "alpha": 0.3, "edgecolor": "none", "zorder": 0.5}
    axes.add_patch(Rectangle((0.0, -1.0 - HALF_LANE), lane_m, 2.0 * HALF_LANE, **lane))
    axes.text(high_m, 0.0, "mainline ", ha="right", va="center", fontsize=7.0, color=BLACK)
    axes.text(lane_m, -1.0, "acceleration lane ", ha="right", va="center", fontsize=7.0)
    axes.text(low_m, far, " ramp", ha="left", va="center", fontsize=7.0)
