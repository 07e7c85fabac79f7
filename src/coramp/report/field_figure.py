"""Strategies side by side: a diagram per metric, a row per strategy, both ranges of flows."""

import math

import polars as pl
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from coramp.report.style import BLUE, VERMILION, grid, legend_below, look_of, new_figure
from coramp.studies.field_layout import (
    DELAY,
    FUEL,
    WITHIN,
    front_of,
    mean_of,
    names_of,
    ranges,
    with_derived,
)
from coramp.studies.metric_labels import label_of, typeset

SHOWN = {
    column: typeset(label_of(column))
    for column in (DELAY, FUEL, "min_ttc_s", "max_decel_mps2", "max_jerk_mps3")
}
LOGARITHMIC = {DELAY}


def field_figure(runs: pl.DataFrame) -> Figure:
    """Returns means with 95 % intervals over seeds; filled: on the front of delay against fuel."""
    known = with_derived(runs.filter(status="ok"))
    names = names_of(known)
    figure = new_figure(11.0, 0.34 * len(names) + 1.9)
    diagrams = figure.subplots(1, len(SHOWN), sharey=True)
    for k, (title, part) in enumerate(ranges(known)):
        colour, marker = (BLUE, "o") if title == WITHIN else (VERMILION, "D")
        there = [name for name in names if name in names_of(part)]
        front = front_of(part, there)
        for axes, column in zip(diagrams, SHOWN, strict=True):
            for name in there:
                found = mean_of(part, name, column)
                if not found.values:
                    continue
                axes.errorbar(
                    found.mean,
                    names.index(name) + 0.22 * (k - 0.5),
                    xerr=0.0 if math.isnan(found.half_width) else found.half_width,
                    color=colour,
                    marker=marker,
                    markerfacecolor=colour if name in front else "white",
                    linestyle="",
                    label=title,
                )
    for axes, (column, title) in zip(diagrams, SHOWN.items(), strict=True):
        _finish(axes, column, title)
    labels = [look_of(name, "fair" if name == "uncontrolled" else None).label for name in names]
    diagrams[0].set_yticks(range(len(names)), labels)
    diagrams[0].invert_yaxis()
    legend_below(figure, diagrams, 2)
    return figure


def _finish(axes: Axes, column: str, title: str) -> None:
    if column in LOGARITHMIC:
        axes.set_xscale("symlog", linthresh=0.1, linscale=0.5)
        axes.xaxis.set_major_formatter(lambda value, _: f"{value:g}")
    axes.set_xlim(left=min(0.0, axes.dataLim.x0))
    axes.set_xlabel(title)
    grid(axes)
