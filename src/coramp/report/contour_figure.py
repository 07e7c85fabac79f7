"""Speed over time and road, and queues over time, as agencies draw them."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import QuadMesh
from matplotlib.figure import Figure, SubFigure

from coramp.agency.before_after import Measured
from coramp.agency.contour import MAINLINE_ROAD, RAMP_ROAD, cells_of
from coramp.report.style import BLUE, ORANGE, grid, legend_below, new_figure
from coramp.studies.speed_unit import MPS, SpeedUnit

WIDTH_IN, ROW_IN, QUEUES_IN = 7.2, 2.0, 4.4
SLOW_TO_FREE = "RdYlBu"
"""Red where it is slow, blue where it is free: colour-blind readers can tell these apart."""
MINUTE_S = 60.0
BELOW_ZERO = 0.04
"""Share of its height by which an axis goes on below 0, so that lines at 0 are seen."""
LOOKS = ((ORANGE, "--"), (BLUE, "-"))


def contour_figure(runs: Sequence[Measured], names: Sequence[str], unit: SpeedUnit = MPS) -> Figure:
    """Returns the mean speed on the mainline over time (min) and station (m), a row a run.

    All have the same colours and times. White is where nobody was.
    """
    figure = new_figure(WIDTH_IN, _speeds_in(runs))
    _draw_contours(figure, runs, names, unit)
    return figure


def _speeds_in(runs: Sequence[Measured]) -> float:
    return 0.6 + ROW_IN * len(runs)


def _draw_contours(
    figure: Figure | SubFigure, runs: Sequence[Measured], names: Sequence[str], unit: SpeedUnit
) -> None:
    rows = figure.subplots(len(runs), 1, sharex=True, squeeze=False)[:, 0]
    most = max(run.motion.scenario.mainline.speed_mps for run in runs) * unit.per_mps
    end_min = max(run.motion.end_s for run in runs) / MINUTE_S
    for axes, run, name in zip(rows, runs, names, strict=True):
        mesh = _draw_speeds(axes, run, unit, most)
        axes.set(title=name, ylabel="from the ramp (m)", xlim=(0.0, end_min or 1.0))
    rows[-1].set_xlabel("time (min)")
    figure.colorbar(mesh, ax=list(rows), label=f"mean speed ({unit.name})")


def _draw_speeds(axes: Axes, run: Measured, unit: SpeedUnit, most: float) -> QuadMesh:
    cells = cells_of(run.motion, MAINLINE_ROAD)
    mesh = axes.pcolormesh(
        cells.edges_s / MINUTE_S,
        cells.edges_m,
        np.ma.masked_invalid(cells.speed_mps.T * unit.per_mps),
        cmap=SLOW_TO_FREE,
        vmin=0.0,
        vmax=most,
        rasterized=True,
    )
    axes.axhline(0.0, color="black", linewidth=0.8)
    axes.annotate(
        "the ramp joins",
        (1.0, 0.0),
        xytext=(-3, 3),
        xycoords=("axes fraction", "data"),
        textcoords="offset points",
        ha="right",
        fontsize=7.5,
    )
    return mesh


def queue_figure(runs: Sequence[Measured], names: Sequence[str]) -> Figure:
    """Returns queue on the ramp, congestion on the mainline (m) and waiting over time (min).

    A line a run. Waiting are those who are due and not on the road yet, of both streams.
    """
    figure = new_figure(WIDTH_IN, QUEUES_IN)
    _draw_queues(figure, runs, names)
    return figure


def both_figure(runs: Sequence[Measured], names: Sequence[str], unit: SpeedUnit = MPS) -> Figure:
    """Returns both figures in one, speeds above queues."""
    heights_in = (_speeds_in(runs), QUEUES_IN)
    figure = new_figure(WIDTH_IN, sum(heights_in))
    parts = figure.subfigures(2, 1, squeeze=False, height_ratios=heights_in)
    _draw_contours(parts[0, 0], runs, names, unit)
    _draw_queues(parts[1, 0], runs, names)
    return figure


def _draw_queues(
    figure: Figure | SubFigure, runs: Sequence[Measured], names: Sequence[str]
) -> None:
    diagrams = figure.subplots(3, 1, sharex=True)
    end_min = max(cells_of(run.motion, RAMP_ROAD).edges_s[-1] for run in runs) / MINUTE_S
    for run, name, (colour, line) in zip(runs, names, LOOKS[-len(runs) :], strict=True):
        table = run.tables["queues"]
        ramp, mainline = table.filter(road=RAMP_ROAD), table.filter(road=MAINLINE_ROAD)
        time_min = cells_of(run.motion, RAMP_ROAD).edges_s / MINUTE_S
        waiting = ramp["waiting"].to_numpy() + mainline["waiting"].to_numpy()
        drawn = (ramp["queue_m"].to_numpy(), mainline["congested_m"].to_numpy(), waiting)
        for axes, values in zip(diagrams, drawn, strict=True):
            axes.stairs(values, time_min, color=colour, linestyle=line, linewidth=1.6, label=name)
    titles = ("queue on the ramp (m)", "congested mainline (m)", "waiting upstream (vehicles)")
    for axes, title in zip(diagrams, titles, strict=True):
        most = max(1.0, axes.get_ylim()[1])
        axes.set(title=title, xlim=(0.0, end_min), ylim=(-BELOW_ZERO * most, most))
    diagrams[-1].set_xlabel("time (min)")
    grid(*diagrams)
    legend_below(figure, diagrams, 2)
