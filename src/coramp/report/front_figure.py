"""Delay against fuel: the strategies on the Pareto front, for both ranges of flows."""

import math

import polars as pl
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from coramp.report.style import GREY, grid, legend_below, look_of, new_figure
from coramp.studies.field_layout import (
    DELAY,
    FUEL,
    front_of,
    mean_of,
    names_of,
    ranges,
    with_derived,
)
from coramp.studies.statistics import Estimate

LARGEST_PT, SMALLER_PT = 13.0, 0.8
"""Each marker is smaller than the one before, so that those at one place can all be seen."""


def front_figure(runs: pl.DataFrame) -> Figure:
    """Returns delay of all (s) against fuel (ml/vehicle), with 95 % intervals over seeds.

    Filled and joined: the strategies that no other beats in one without losing in the other.
    """
    known = with_derived(runs.filter(status="ok"))
    parts = ranges(known)
    figure = new_figure(5.0 * len(parts), 4.6)
    diagrams = figure.subplots(1, len(parts), squeeze=False)[0]
    for axes, (title, part) in zip(diagrams, parts, strict=True):
        _draw(axes, part)
        axes.set_title(title)
        axes.set_xscale("symlog", linthresh=0.1, linscale=0.5)
        axes.xaxis.set_major_formatter(lambda value, _: f"{value:g}")
        axes.set_xlabel("delay of all (s)")
        axes.set_ylabel("fuel (ml/vehicle)")
        grid(axes)
    legend_below(figure, diagrams, 5)
    return figure


def _draw(axes: Axes, runs: pl.DataFrame) -> None:
    names = names_of(runs)
    front = front_of(runs, names)
    found = {name: (mean_of(runs, name, DELAY), mean_of(runs, name, FUEL)) for name in names}
    on_front = sorted((found[name][0].mean, found[name][1].mean) for name in front)
    axes.plot(*zip(*on_front, strict=True), color=GREY, linestyle=":", zorder=1)
    for k, name in enumerate(names):
        look = look_of(name, "fair" if name == "uncontrolled" else None)
        delay_s, fuel_ml = found[name]
        axes.errorbar(
            delay_s.mean,
            fuel_ml.mean,
            xerr=_half_width(delay_s),
            yerr=_half_width(fuel_ml),
            color=look.colour,
            marker=look.marker,
            markersize=LARGEST_PT - SMALLER_PT * k,
            markerfacecolor=look.colour if name in front else "none",
            linestyle="",
            label=look.label,
        )


def _half_width(found: Estimate) -> float:
    return 0.0 if math.isnan(found.half_width) else found.half_width
