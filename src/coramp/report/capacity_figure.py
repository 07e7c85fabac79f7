"""The capacity figure: breakdown flow on the mainline over ramp flow."""

from pathlib import Path

import matplotlib as mpl
import polars as pl
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from coramp.studies.capacity_layout import Breakdown, breakdowns

COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#56b4e9", "#e69f00", "#000000", "#999999")
"""The Okabe-Ito palette, which colour-blind readers can tell apart."""
MARKERS = "osD^vPX*"


def save_capacity_figure(runs: pl.DataFrame, path: Path) -> None:
    """Writes the figure of a capacity study; the file's ending says how."""
    capacity_figure(runs).savefig(path, dpi=150)


def capacity_figure(runs: pl.DataFrame) -> Figure:
    """Returns one line a combination: where it breaks down, with intervals over seeds.

    Points at the upper edge, with an arrow, did not break down within the range.
    """
    mpl.rcParams["svg.fonttype"] = "none"
    found = breakdowns(runs.filter(status="ok"))
    figure = Figure(figsize=(9, 5.5), layout="constrained")
    axes = figure.subplots()
    for k, name in enumerate(dict.fromkeys(b.name for b in found)):
        line = sorted((b for b in found if b.name == name), key=lambda b: b.ramp_veh_h)
        _draw(axes, name, line, COLOURS[k % len(COLOURS)], MARKERS[k % len(MARKERS)])
    axes.set(xlabel="ramp flow (veh/h)", ylabel="mainline flow at breakdown (veh/h)")
    axes.grid(alpha=0.3)
    figure.legend(loc="outside right upper", fontsize=8)
    return figure


def _draw(axes: Axes, name: str, line: list[Breakdown], colour: str, marker: str) -> None:
    middles = [_middle(b) for b in line]
    spreads = [b.estimate.half_width if len(b.flows) > 1 else 0.0 for b in line]
    ramps = [b.ramp_veh_h for b in line]
    axes.errorbar(
        ramps, middles, yerr=spreads, color=colour, marker=marker, capsize=3, label=name, lw=1.4
    )
    for breakdown, ramp, middle in zip(line, ramps, middles, strict=True):
        if breakdown.above:
            axes.annotate(
                "",
                (ramp, middle + 140.0),
                (ramp, middle),
                arrowprops={"arrowstyle": "->", "color": colour},
            )


def _middle(found: Breakdown) -> float:
    """The mean over seeds, with seeds outside the range at its ends."""
    values = [
        *found.flows,
        *[found.highest_veh_h] * found.above,
        *[found.lowest_veh_h] * found.below,
    ]
    return sum(values) / len(values)
