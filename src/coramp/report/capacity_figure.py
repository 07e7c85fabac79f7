"""The capacity figure: breakdown flow on the mainline over ramp flow."""

import math
from collections.abc import Sequence
from pathlib import Path

import polars as pl
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from coramp.report.style import (
    BLACK,
    GREY,
    LINES,
    Look,
    grid,
    legend_below,
    look_of,
    new_figure,
    save_figure,
)
from coramp.studies.capacity_layout import Breakdown, breakdowns, gaps_in_words

LINES_TOGETHER = 8
"""More lines than this are drawn in a diagram per following distance."""
COLUMNS = 4
DRIVERS = "drivers and automation, without a plan"
LIMITS = {
    "above": ("^", "search ended here without breakdown: the flow is higher"),
    "below": ("v", "broke down at the lowest flow searched: the flow is lower"),
}


def save_capacity_figure(runs: pl.DataFrame, path: Path) -> None:
    """Writes the figure of a capacity study; the file's ending says how."""
    save_figure(capacity_figure(runs), path, dpi=150)


def capacity_figure(runs: pl.DataFrame) -> Figure:
    """Returns one line a combination: where it breaks down, with intervals over seeds.

    Many lines are a diagram per following distance, and one for drivers. Hollow triangles that no
    line joins are limits of the search, not results. Combinations that broke down nowhere in it
    are named below the figure. Dotted: what the lane carries, less the ramp flow.
    """
    every = breakdowns(runs.filter(status="ok"))
    within = {b.name for b in every if b.flows or b.below}
    found = [b for b in every if b.name in within] or every
    groups = _groups(found)
    columns = min(COLUMNS, len(groups))
    rows = math.ceil(len(groups) / columns)
    figure = new_figure(max(7.0, 2.8 * columns), 3.9 * rows + 1.3 if rows > 1 else 5.6)
    diagrams = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
    gaps = list(dict.fromkeys(b.overrides for b in found))
    for axes, (title, group) in zip(diagrams.flat, groups.items(), strict=False):
        _draw_group(axes, group, [] if title else gaps)
        axes.set_title(title)
    for k, axes in enumerate(diagrams.flat[len(groups) :], len(groups)):
        axes.set_axis_off()
        if k >= columns:
            diagrams.flat[k - columns].tick_params(labelbottom=True)
    for axes in diagrams[-1]:
        axes.set_xlabel("ramp flow (veh/h)")
    for axes in diagrams[:, 0]:
        axes.set_ylabel("mainline flow at breakdown (veh/h)")
    drawn = list(diagrams.flat[: len(groups)])
    grid(*drawn)
    if found:
        legend_below(figure, drawn, 3 if rows > 1 else 2)
    _name_unbroken(
        figure, sorted({_words(b) for b in every if b.name not in {f.name for f in found}})
    )
    return figure


def _groups(found: Sequence[Breakdown]) -> dict[str, list[Breakdown]]:
    """The combinations of each diagram by its title; one without a title where they are few."""
    if len({b.name for b in found}) <= LINES_TOGETHER:
        return {"": list(found)}
    groups: dict[str, list[Breakdown]] = {}
    for b in found:
        title = DRIVERS if b.drivers else f"at {gaps_in_words(b.settings) or 'Eq. 1'}"
        groups.setdefault(title, []).append(b)
    order = sorted(groups, key=lambda title: (title == DRIVERS, title))
    return {title: groups[title] for title in order}


def _draw_group(axes: Axes, group: list[Breakdown], gaps: list[str | None]) -> None:
    """Draws the combinations of a diagram; ``gaps`` are those that its lines tell apart."""
    for name in dict.fromkeys(b.name for b in group):
        line = sorted((b for b in group if b.name == name), key=lambda b: b.ramp_veh_h)
        look = look_of(line[0].strategy, line[0].drivers)
        gap = name.removeprefix(line[0].strategy) if line[0].drivers is None and gaps else ""
        number = gaps.index(line[0].overrides) if gaps else None
        _draw(axes, look, line, f"{look.label}{gap}", number)
        _draw_search_limits(axes, look, line)
    _draw_lane_limits(axes, group)


def _draw(axes: Axes, look: Look, line: list[Breakdown], label: str, number: int | None) -> None:
    known = [b if not (b.above or b.below) else None for b in line]
    axes.errorbar(
        [b.ramp_veh_h for b in line],
        [math.nan if b is None else b.estimate.mean for b in known],
        yerr=[b.estimate.half_width if b and len(b.flows) > 1 else 0.0 for b in known],
        color=look.colour,
        marker=look.marker,
        linestyle=look.line if line[0].drivers or number is None else LINES[number % len(LINES)],
        linewidth=look.width_pt,
        elinewidth=1.2,
        markerfacecolor="white" if (number or 0) % 2 else look.colour,
        label=label,
    )


def _draw_search_limits(axes: Axes, look: Look, line: list[Breakdown]) -> None:
    """Draws hollow triangles where the search ended before, or began after, the breakdown."""
    for kind, (marker, words) in LIMITS.items():
        there = [b for b in line if getattr(b, kind)]
        if not there:
            continue
        axes.plot([], [], marker, color=BLACK, markerfacecolor="none", markersize=9, label=words)
        axes.plot(
            [b.ramp_veh_h for b in there],
            [b.highest_veh_h if kind == "above" else b.lowest_veh_h for b in there],
            marker,
            color=look.colour,
            markerfacecolor="none",
            markersize=9,
            gid=f"search limit {kind}",
        )


def _draw_lane_limits(axes: Axes, found: list[Breakdown]) -> None:
    """One line a lane limit, named at its end."""
    limits = sorted({b.limit_veh_h for b in found if b.limit_veh_h is not None}, reverse=True)
    for limit in limits:
        near = [b for b in found if b.limit_veh_h == limit]
        ramps = sorted({b.ramp_veh_h for b in near})
        if limit - ramps[0] > max(b.highest_veh_h for b in near):
            continue
        mainline = [limit - ramp for ramp in ramps]
        axes.plot(ramps, mainline, color=GREY, linestyle=":", linewidth=1.4)
        axes.annotate(
            f"lane: {limit:,.0f}",
            (ramps[0], mainline[0]),
            textcoords="offset points",
            xytext=(14, 6),
            ha="left",
            color=GREY,
            fontsize="small",
        )


def _words(b: Breakdown) -> str:
    """A combination with its strategy as the legend calls it."""
    return look_of(b.strategy, b.drivers).label + b.name.removeprefix(b.strategy) * (not b.drivers)


def _name_unbroken(figure: Figure, names: list[str]) -> None:
    if names:
        figure.suptitle(
            f"Without breakdown in the whole search, not drawn: {'; '.join(names)}",
            fontsize=8.5,
            wrap=True,
        )
