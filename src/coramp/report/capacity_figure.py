"""The capacity figure: breakdown flow on the mainline over ramp flow."""

from pathlib import Path

import polars as pl
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from coramp.report.style import GREY, LINES, Look, grid, look_of, new_figure, save_figure
from coramp.studies.capacity_layout import Breakdown, breakdowns

LINE_INCHES = 0.26
"""Of the legend, for each line."""


def save_capacity_figure(runs: pl.DataFrame, path: Path) -> None:
    """Writes the figure of a capacity study; the file's ending says how."""
    save_figure(capacity_figure(runs), path, dpi=150)


def capacity_figure(runs: pl.DataFrame) -> Figure:
    """Returns one line a combination: where it breaks down, with intervals over seeds.

    Colours and markers are those of the strategies, lines tell time gaps apart. Points at the
    upper edge, with an arrow, did not break down within the range; combinations that never did are
    left out where others did. Dotted: what the lane carries,
    less the ramp flow, where that lies within the range.
    """
    every = breakdowns(runs.filter(status="ok"))
    within = {b.name for b in every if b.flows or b.below}
    found = [b for b in every if b.name in within] or every
    lines = len({b.name for b in found})
    figure = new_figure(8.6, max(4.8, LINE_INCHES * lines))
    axes = figure.subplots()
    gaps = list(dict.fromkeys(b.overrides for b in found))
    for name in dict.fromkeys(b.name for b in found):
        line = sorted((b for b in found if b.name == name), key=lambda b: b.ramp_veh_h)
        look = look_of(line[0].strategy, line[0].drivers)
        number = gaps.index(line[0].overrides)
        label = name.removeprefix(line[0].strategy) if line[0].drivers is None else ""
        _draw(axes, look, line, f"{look.label}{label}", number)
    _draw_limits(axes, found)
    axes.set(xlabel="ramp flow (veh/h)", ylabel="mainline flow at breakdown (veh/h)")
    grid(axes)
    if found:
        figure.legend(loc="outside right upper", handlelength=4.0)
    return figure


def _draw(axes: Axes, look: Look, line: list[Breakdown], label: str, number: int) -> None:
    middles = [_middle(b) for b in line]
    ramps = [b.ramp_veh_h for b in line]
    axes.errorbar(
        ramps,
        middles,
        yerr=[b.estimate.half_width if len(b.flows) > 1 else 0.0 for b in line],
        color=look.colour,
        marker=look.marker,
        linestyle=look.line if line[0].drivers else LINES[number % len(LINES)],
        linewidth=look.width_pt,
        elinewidth=1.2,
        markerfacecolor="white" if number % 2 else look.colour,
        label=label,
    )
    for breakdown, ramp, middle in zip(line, ramps, middles, strict=True):
        if breakdown.above:
            axes.annotate(
                "",
                (ramp, middle + 140.0),
                (ramp, middle),
                arrowprops={"arrowstyle": "->", "color": look.colour},
            )


def _draw_limits(axes: Axes, found: list[Breakdown]) -> None:
    """One line a lane limit, named at its end."""
    limits = sorted({b.limit_veh_h for b in found if b.limit_veh_h is not None}, reverse=True)
    for limit in limits:
        near = [b for b in found if b.limit_veh_h == limit]
        ramps = sorted({b.ramp_veh_h for b in near})
        if limit - ramps[0] > max(b.highest_veh_h for b in near):
            continue
        mainline = [limit - ramp for ramp in ramps]
        axes.plot(ramps, mainline, color=GREY, linestyle=":", linewidth=1.2)
        axes.annotate(
            f"lane: {limit:,.0f}",
            (ramps[-1], mainline[-1]),
            textcoords="offset points",
            xytext=(4, 0),
            va="center",
            color=GREY,
            fontsize="small",
        )


def _middle(found: Breakdown) -> float:
    """The mean over seeds, with seeds outside the range at its ends."""
    values = [
        *found.flows,
        *[found.highest_veh_h] * found.above,
        *[found.lowest_veh_h] * found.below,
    ]
    return sum(values) / len(values)
