"""A picture of one vehicle's decision: the road at that moment, and all trajectories after it."""

import math
from pathlib import Path
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from coramp.records.run import RunRecords
from coramp.report.plan_figure import name_lines
from coramp.report.story_road import draw_road, label_in, look_in
from coramp.report.story_scene import Scene, scene_of
from coramp.report.style import (
    BLACK,
    VERMILION,
    YELLOW,
    grid,
    legend_below,
    new_figure,
    save_plot,
)

STEP_S = 0.1

RAMP_NAMES = "r"
"""How names of ramp vehicles begin."""


def save_story_figure(run: RunRecords, vehicle_id: str, path: Path) -> None:
    """Writes the figure of a vehicle of a run; the file's ending says how (png, svg, pdf).

    Raises CorampError where that cannot be written, and as ``story_figure`` does.
    """
    save_plot(lambda: story_figure(run, vehicle_id), path)


def story_figure(run: RunRecords, vehicle_id: str) -> Figure:
    """Returns the road (stations in m) at a vehicle's decision, and station over time around it.

    The decision is the last that gave the vehicle a merge, else its last, else the last that moved
    it for another; without any, its own passage is drawn alone. Raises CorampError where there is
    no such vehicle, where it never entered, and where no vehicle was coordinated.
    """
    scene = scene_of(run, vehicle_id)
    if scene.decision is None:
        figure = new_figure(10.0, 5.5)
        below = figure.subplots()
        below.set_title(f"{vehicle_id}: no decision was about it; its own passage")
    else:
        figure = new_figure(10.0, 8.4)
        above, below = figure.subplots(2, 1, height_ratios=(1.0, 1.5))
        draw_road(above, scene)
        above.set_title(_title(scene))
    _draw_lines(below, scene)
    legend_below(figure, figure.axes, 4)
    return figure


def _title(scene: Scene) -> str:
    decision = scene.decision or {}
    front, rear = decision["front_vehicle_id"], decision["rear_vehicle_id"]
    gap = [f"behind X = {front}"] * (front is not None) + [f"ahead of Y = {rear}"] * bool(rear)
    where = ", ".join(gap) or "alone on the mainline"
    if not scene.merges:
        where = "no merge is safe yet"
    whose = f"{scene.subject}, decision at {decision['time_s']:.1f} s, rung {decision['rung']}"
    on_ramp = scene.asked.startswith(RAMP_NAMES)
    does = "brakes" if on_ramp and decision["rung"] != "create" else "moves"
    whom = "" if scene.asked == scene.subject else f"{scene.asked} {does} for "
    return f"{whom}{whose}: {where}"


def _draw_lines(axes: Axes, scene: Scene) -> None:
    lane_m = scene.scenario.ramp.acceleration_lane_m
    axes.axhspan(0.0, lane_m, color=YELLOW, alpha=0.25, label="acceleration lane")
    low_m, high_m = math.inf, -math.inf
    for name in sorted(scene.driven, key=lambda n: n in scene.roles):
        times_s, stations_m = scene.driven[name].line(scene.from_s, scene.until_s, STEP_S)
        if not len(times_s):
            continue
        colour, line, width_pt = look_in(scene, name)
        axes.plot(
            times_s,
            stations_m,
            color=colour,
            linestyle=line,
            linewidth=width_pt,
            alpha=1.0 if name in scene.roles else 0.6,
            label=label_in(scene, name),
            gid=name,
            zorder=2.5 if name in scene.roles else 1.5,
        )
        if name in scene.roles:
            low_m, high_m = min(low_m, stations_m[0]), max(high_m, stations_m[-1])
    axes.set(
        xlim=(scene.from_s, scene.until_s),
        ylim=(low_m - 15.0, high_m + 15.0),
        xlabel="time (s)",
        ylabel="station of the front bumper (m)",
    )
    grid(axes)
    name_lines(axes, scene.roles)
    _mark(axes, scene)


def _mark(axes: Axes, scene: Scene) -> None:
    """Marks the decision and the merge."""
    decision = scene.decision
    if decision is None:
        return
    now_s, subject = decision["time_s"], scene.driven[scene.subject]
    style: dict[str, Any] = {
        "color": VERMILION,
        "markeredgecolor": BLACK,
        "linestyle": "none",
        "zorder": 4.0,
    }
    axes.axvline(now_s, color=BLACK, linewidth=0.8, linestyle=(0, (6, 4)), gid="decision-time")
    axes.plot(
        [now_s], [subject.station_m(now_s)], marker="D", label="decision", gid="decision", **style
    )
    if scene.merges:
        merge = [decision["merge_time_s"]], [decision["merge_station_m"]]
        axes.plot(*merge, marker="o", markersize=7.0, label="merge", gid="merge", **style)
