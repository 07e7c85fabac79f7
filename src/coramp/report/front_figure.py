"""Delay against fuel: the strategies on the Pareto front, for both ranges of flows."""

import math
from collections.abc import Sequence

import polars as pl
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from coramp.report.style import BLACK, GREY, grid, legend_below, look_of, new_figure
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

SAME_PLACE = 0.035
"""Strategies nearer to each other than this share of the diagram are one place with their names."""
Found = dict[str, tuple[Estimate, Estimate]]


def front_figure(runs: pl.DataFrame) -> Figure:
    """Returns delay of all (s) against fuel (ml/vehicle), with 95 % intervals over seeds.

    Filled and joined: the strategies that no other beats in one without losing in the other. Every
    place is named; strategies that coincide are one ring with how many they are and their names.
    """
    known = with_derived(runs.filter(status="ok"))
    parts = ranges(known)
    figure = new_figure(5.4 * len(parts), 5.0)
    diagrams = figure.subplots(1, len(parts), squeeze=False)[0]
    for axes, (title, part) in zip(diagrams, parts, strict=True):
        axes.set_title(title)
        axes.set_xscale("symlog", linthresh=0.1, linscale=0.5)
        _draw(axes, part)
        axes.xaxis.set_major_formatter(lambda value, _: f"{value:g}")
        axes.set_xlabel("delay of all (s)")
        axes.set_ylabel("fuel (ml/vehicle)")
        grid(axes)
    legend_below(figure, diagrams, 3)
    return figure


def _draw(axes: Axes, runs: pl.DataFrame) -> None:
    names = names_of(runs)
    front = front_of(runs, names)
    found = {name: (mean_of(runs, name, DELAY), mean_of(runs, name, FUEL)) for name in names}
    on_front = sorted((found[name][0].mean, found[name][1].mean) for name in front)
    axes.plot(*zip(*on_front, strict=True), color=GREY, linestyle=":", zorder=1, label="the front")
    for name in names:
        look = look_of(name, "fair" if name == "uncontrolled" else None)
        delay_s, fuel_ml = found[name]
        axes.errorbar(
            delay_s.mean,
            fuel_ml.mean,
            xerr=_half_width(delay_s),
            yerr=_half_width(fuel_ml),
            color=look.colour,
            marker=look.marker,
            markersize=7.0,
            markerfacecolor=look.colour if name in front else "none",
            linestyle="",
            gid=name,
        )
    axes.margins(0.14, 0.12)
    axes.autoscale_view()
    for place in places_of(axes, found):
        _name(axes, place, found, front)
    axes.plot([], [], "o", color=BLACK, label="filled, or * behind the name: on the front")
    axes.plot(
        [],
        [],
        "o",
        color=BLACK,
        markersize=13.0,
        markerfacecolor="none",
        label="ring: strategies that coincide",
    )


def places_of(axes: Axes, found: Found) -> list[list[str]]:
    """Returns the strategies in groups that lie at one place of a diagram, from left to right.

    Each is within ``SAME_PLACE`` of another one of its group.
    """
    where = {name: _share(axes, *both) for name, both in found.items()}
    groups: list[list[str]] = []
    for name in sorted(found, key=lambda name: where[name]):
        near = [
            group
            for group in groups
            if any(math.dist(where[name], where[other]) < SAME_PLACE for other in group)
        ]
        groups = [group for group in groups if group not in near]
        groups.append([*(other for group in near for other in group), name])
    return groups


def _share(axes: Axes, delay_s: Estimate, fuel_ml: Estimate) -> tuple[float, float]:
    """Where a point lies, as shares of a diagram's width and height."""
    pixel = axes.transData.transform((delay_s.mean, fuel_ml.mean))
    x, y = axes.transAxes.inverted().transform(pixel)
    return float(x), float(y)


def _name(axes: Axes, place: Sequence[str], found: Found, front: Sequence[str]) -> None:
    """Writes beside a place who is there, and rings it where they are several."""
    labels = [
        look_of(name, "fair" if name == "uncontrolled" else None).label + "*" * (name in front)
        for name in place
    ]
    x, y = (sum(found[name][k].mean for name in place) / len(place) for k in range(2))
    across, up = _share(axes, found[place[-1]][0], found[place[-1]][1])
    left, several = across > 0.6, len(place) > 1
    text = f"{len(place)} coincide:\n" + "\n".join(labels) if several else labels[0]
    if several:
        axes.plot(x, y, "o", color=BLACK, markersize=19.0, markerfacecolor="none", gid="ring")
    axes.annotate(
        text,
        (x, y),
        (-14.0 if left else 14.0, (-8.0 if up > 0.5 else 8.0) if several else 9.0),
        textcoords="offset points",
        ha="right" if left else "left",
        va="top" if several and up > 0.5 else "bottom",
        fontsize=8.0,
    )


def _half_width(found: Estimate) -> float:
    return 0.0 if math.isnan(found.half_width) else found.half_width
