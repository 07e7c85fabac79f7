"""Delay against a perfect world and rate of conflicts, by fault, share and demand."""

from collections.abc import Callable, Sequence

import polars as pl
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from coramp.report.style import BLUE, GREEN, GREY, ORANGE, VERMILION, grid, legend_below, new_figure
from coramp.studies.hostile_layout import conflict_rates
from coramp.studies.hostile_runs import DRIVERS_ALONE, Cell, cells_of
from coramp.studies.statistics import Estimate

SHARE_COLOURS = (ORANGE, VERMILION, BLUE, GREEN)
"""From the smallest share on; of more shares the last is drawn for all others."""
MARKERS = "osD^"
CONFLICT = "conflicts_ttc_1_5"
APART = 0.16
"""How far the points of two shares of a fault lie apart."""
ROW_IN = 0.32


def hostile_figure(runs: pl.DataFrame) -> Figure:
    """Returns delay (% of that in a perfect world) and conflicts (TTC < 1.5 s), a row a fault.

    A column of diagrams a demand: delays on the left, with 95 % intervals over seeds; conflicts
    per 1,000 vehicle km on the right. A colour is a share of automated vehicles.
    """
    cells = [c for c in cells_of(runs.filter(status="ok")) if c.line.who != DRIVERS_ALONE]
    flows = sorted({cell.line.flow for cell in cells})
    faults = list(dict.fromkeys(cell.line.fault for cell in cells))
    shares = sorted({cell.share for cell in cells})
    columns = max(1, len(flows))
    figure = new_figure(2.0 + 3.6 * columns, 1.8 + ROW_IN * max(1, len(faults)))
    diagrams = figure.subplots(1, 2 * columns, sharey=True, squeeze=False)[0]
    for place, flow in enumerate(flows):
        own = [cell for cell in cells if cell.line.flow == flow]
        delays, conflicts = diagrams[2 * place : 2 * place + 2]
        for share in shares:
            at = [cell for cell in own if cell.share == share]
            _draw(delays, at, faults, shares, lambda cell: cell.delay_share)
            _draw(conflicts, at, faults, shares, _conflicts)
        delays.axvline(100.0, color=GREY, linestyle=":", linewidth=1.0)
        delays.set_xscale("log")
        delays.xaxis.set_major_formatter(lambda value, _: _short(value))
        delays.xaxis.set_minor_formatter(lambda *_: "")
        conflicts.set_xscale("symlog", linthresh=1.0)
        conflicts.set_xlim(left=-0.1)
        conflicts.xaxis.set_major_formatter(lambda value, _: f"{value:g}")
        told = {delays: "delay,\n% of perfect", conflicts: "TTC < 1.5 s,\na 1,000 km"}
        for axes, what in told.items():
            axes.set_title(f"{flow[0]:g} + {flow[1]:g}")
            axes.set_xlabel(what)
    diagrams[0].set_yticks(range(len(faults)), faults)
    diagrams[0].invert_yaxis()
    grid(*diagrams)
    if cells:
        legend_below(figure, diagrams, max(1, len(shares)))
    return figure


def _short(value: float) -> str:
    """A number with thousands as k: over several decades long ones lie on one another."""
    return f"{value / 1000.0:g}k" if value >= 1000.0 else f"{value:g}"


def _conflicts(cell: Cell) -> Estimate:
    """A rate over all seeds; its interval is left to the tables."""
    found = conflict_rates([cell])
    return Estimate(found[CONFLICT], 0.0, 1) if found else Estimate(0.0, 0.0, 0)


def _draw(
    axes: Axes,
    cells: Sequence[Cell],
    faults: Sequence[str],
    shares: Sequence[float],
    value_of: Callable[[Cell], Estimate],
) -> None:
    """The points of one share, a row each fault."""
    found = [(cell, value_of(cell)) for cell in cells]
    found = [(cell, value) for cell, value in found if value.values]
    if not found:
        return
    place = shares.index(found[0][0].share)
    offset = APART * (place - 0.5 * (len(shares) - 1))
    axes.errorbar(
        [value.mean for _, value in found],
        [faults.index(cell.line.fault) + offset for cell, _ in found],
        xerr=[value.half_width if value.values > 1 else 0.0 for _, value in found],
        color=SHARE_COLOURS[min(place, len(SHARE_COLOURS) - 1)],
        marker=MARKERS[min(place, len(MARKERS) - 1)],
        linestyle="none",
        elinewidth=0.8,
        markersize=4.0,
        label=f"{100.0 * shares[place]:g} % automated",
    )
