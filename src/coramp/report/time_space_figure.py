"""Station over time of all vehicles of a run, within a window of time."""

import math

import polars as pl
from matplotlib.figure import Figure

from coramp.errors import CorampError
from coramp.records.run import RunRecords
from coramp.report.lane_diagrams import LANE_IN, Line, draw_by_lane, lane_title
from coramp.report.lapse_marks import mark_lapses
from coramp.report.plan_figure import MAINLINE_COLOUR, MOVED_COLOUR, RAMP_COLOUR
from coramp.report.story_scene import Driven, driven_of
from coramp.report.style import GREY, YELLOW, grid, legend_below, new_figure
from coramp.vehicles.merge_state import came_by_mainline

WINDOW_S = 120.0
"""How long the window is where its end is not given."""
STEP_S = 0.25
AUTOMATED_COLOUR = "#7a2bbf"
"""As in the page's style sheet."""


def run_time_space_figure(
    run: RunRecords, from_s: float | None = None, until_s: float | None = None
) -> Figure:
    """Returns station (m) over time (s) of all vehicles of a run, a line each.

    From ``from_s`` (default: 0) until ``until_s`` (default: 120 s later). Dots are merges, those of
    drivers where they were seen on the mainline first; the gid of a line is its vehicle's id. Where
    the world fails, fallbacks, gaps in what was known and breakdowns are marked on the lines. Where
    the mainline has several lanes there is a diagram for each, the one next to the ramp, and the
    ramp itself, lowest: lines of those on other lanes are faint, and triangles are automated
    vehicles that made way there. Raises CorampError for an empty window.
    """
    from_s = 0.0 if from_s is None else from_s
    until_s = from_s + WINDOW_S if until_s is None else until_s
    if not (math.isfinite(from_s) and math.isfinite(until_s) and from_s < until_s):
        raise CorampError(f"until_s: {until_s:g} is not after from_s; allowed is above {from_s:g}")
    moved = _moved(run)
    kinds = zip(run.vehicles["vehicle_id"], run.vehicles["automated"], strict=True)
    automated = dict(kinds) if run.is_mixed else {}
    lanes = run.scenario.mainline.lanes
    figure = new_figure(10.0, 5.6 if lanes == 1 else 1.2 + LANE_IN * lanes)
    diagrams = figure.subplots(lanes, 1, sharex=True, squeeze=False)[:, 0]
    axes = diagrams[-1]
    lane_m = run.scenario.ramp.acceleration_lane_m
    axes.axhspan(0.0, lane_m, color=YELLOW, alpha=0.25, label="acceleration lane")
    driven = driven_of(run.motion, run.vehicles)
    lines = {}
    for name, way in driven.items():
        times_s, stations_m = way.line(from_s, until_s, STEP_S)
        if len(times_s):
            look = _look(way, name in moved, automated.get(name))
            lines[name] = Line(times_s, stations_m, *look)
    if lanes > 1:
        draw_by_lane(run, list(diagrams), lines)
    else:
        for name, line in lines.items():
            axes.plot(
                line.times_s,
                line.stations_m,
                color=line.colour,
                linewidth=line.width_pt,
                label=line.label,
                gid=name,
            )
    mark_lapses(axes, run, driven, from_s, until_s)
    merges = _merges(run)
    within = merges.filter(merges["merge_time_s"].is_between(from_s, until_s))
    if not within.is_empty():
        axes.plot(
            within["merge_time_s"],
            within["merge_station_m"],
            color=RAMP_COLOUR,
            marker="o",
            markersize=3.5,
            linestyle="none",
            label="merge",
            gid="merges",
        )
    diagrams[0].set_title(_title(run))
    for k, diagram in enumerate(reversed(diagrams)):
        ylabel = "station of the front bumper (m)"
        diagram.set(
            xlim=(from_s, until_s),
            ylim=(_start_m(run), run.scenario.mainline.end_m),
            ylabel=ylabel if lanes == 1 else f"{lane_title(k)}\nstation (m)",
        )
    axes.set_xlabel("time (s)")
    grid(*diagrams)
    legend_below(figure, diagrams, 5)
    return figure


def _moved(run: RunRecords) -> set[str]:
    """The vehicles that were moved aside for another."""
    if run.decisions is None:
        return set()
    return set(run.decisions["adjusted_vehicle_ids"].explode().drop_nulls())


def _merges(run: RunRecords) -> pl.DataFrame:
    """When (s) and where (m) ramp vehicles merged: as decided, or as drivers were seen to."""
    if run.decisions is not None:
        return run.decisions.drop_nulls("merge_time_s").select("merge_time_s", "merge_station_m")
    on_ramp = run.vehicles.filter(stream="ramp")["vehicle_id"].to_list()
    return (
        run.motion.filter(pl.col("vehicle_id").is_in(on_ramp), lane="mainline")
        .sort("time_s")
        .group_by("vehicle_id", maintain_order=True)
        .first()
        .select(merge_time_s="time_s", merge_station_m="station_m")
    )


def _look(driven: Driven, moved: bool, automated: bool | None) -> tuple[str, str, float]:
    """A vehicle's colour, name in the legend and width (pt), as in diagrams of plans.

    Where drivers and automated vehicles mix, by whether it is ``automated``.
    """
    if automated is not None:
        width_pt = 0.8 if came_by_mainline(driven.merge_s) else 1.3
        return (
            (AUTOMATED_COLOUR, "automated", width_pt) if automated else (GREY, "driver", width_pt)
        )
    if not came_by_mainline(driven.merge_s):
        return RAMP_COLOUR, "ramp vehicle", 1.2
    if moved:
        return MOVED_COLOUR, "moves aside", 1.0
    return MAINLINE_COLOUR, "mainline vehicle", 0.7


def _title(run: RunRecords) -> str:
    content = run.content
    flows = f"{content['mainline_veh_h']:g} + {content['ramp_veh_h']:g} veh/h"
    return f"{content['scenario']}: {content['strategy']}, {flows}, seed {content['seed']}"


def _start_m(run: RunRecords) -> float:
    return min(run.scenario.mainline.start_m, run.scenario.ramp.start_m)
