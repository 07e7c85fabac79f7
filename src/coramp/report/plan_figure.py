"""The time-space diagram of a plan, before and after."""

from pathlib import Path

import matplotlib as mpl
import numpy as np
import polars as pl
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from coramp.core.trajectory import station_and_speed
from coramp.errors import CorampError
from coramp.planning import PlannedSnapshot

RAMP_COLOUR, MOVED_COLOUR, MAINLINE_COLOUR = "#d55e00", "#0072b2", "#7f7f7f"
"""From the Okabe-Ito palette, which colour-blind readers can tell apart."""
POINTS = 400


def save_plan_figure(planned: PlannedSnapshot, path: Path) -> None:
    """Writes the diagram; the file's ending says how (png, svg, pdf).

    Raises CorampError where that cannot be written.
    """
    allowed = "allowed are png, svg and pdf files"
    if path.suffix.lower() not in (".png", ".svg", ".pdf"):
        raise CorampError(f"--plot: {path}: the ending says no format; {allowed}")
    try:
        plan_figure(planned).savefig(path, dpi=150)
    except OSError as error:
        raise CorampError(
            f"--plot: {path}: cannot be written: {error.strerror}; {allowed}"
        ) from error


def plan_figure(planned: PlannedSnapshot) -> Figure:
    """Returns station over time of every vehicle, before the decisions and after them."""
    mpl.rcParams["svg.fonttype"] = "none"
    figure = Figure(figsize=(11, 5.5), layout="constrained")
    before, after = figure.subplots(1, 2, sharex=True, sharey=True)
    moved = {name for ids in planned.decisions["adjusted_vehicle_ids"].to_list() for name in ids}
    merges = planned.decisions.filter(pl.col("merge_time_s").is_not_null())
    latest = merges["merge_time_s"].max()
    until_s = float(latest) + 4.0 if isinstance(latest, float) else 20.0
    _draw(before, planned.before, until_s, moved)
    _draw(after, planned.after, until_s, moved)
    after.scatter(
        merges["merge_time_s"],
        merges["merge_station_m"],
        color=RAMP_COLOUR,
        zorder=3,
        label="merge",
    )
    lane_m = planned.scenario.ramp.acceleration_lane_m
    for axes, title in ((before, "before"), (after, f"after: {planned.strategy}")):
        axes.axhspan(0.0, lane_m, color="#f0e442", alpha=0.25, label="acceleration lane")
        axes.set(title=title, xlabel="time (s)", xlim=(0.0, until_s))
        axes.grid(alpha=0.3)
    before.set_ylabel("station of the front bumper (m)")
    handles, labels = after.get_legend_handles_labels()
    unique = dict(zip(labels, handles, strict=True))
    figure.legend(unique.values(), unique.keys(), loc="outside lower center", ncols=len(unique))
    return figure


def _draw(axes: Axes, trajectories: pl.DataFrame, until_s: float, moved: set[str]) -> None:
    times_s = np.linspace(0.0, until_s, POINTS)
    columns = ["time_s", "station_m", "speed_mps", "accel_mps2"]
    for (name,), pieces in trajectories.group_by(["vehicle_id"], maintain_order=True):
        rows = np.ascontiguousarray(pieces.select(columns).to_numpy())
        stations_m = [station_and_speed(rows, time_s)[0] for time_s in times_s]
        if "ramp" in pieces["lane"]:
            colour, label, width = RAMP_COLOUR, "ramp vehicle", 2.0
        elif name in moved:
            colour, label, width = MOVED_COLOUR, "moves aside", 1.6
        else:
            colour, label, width = MAINLINE_COLOUR, "mainline vehicle", 1.0
        axes.plot(times_s, stations_m, color=colour, linewidth=width, label=label)
        axes.annotate(str(name), (times_s[0], stations_m[0]), fontsize=7, color=colour)
