"""Delay and hard braking over the share of automated vehicles, by demand."""

from collections.abc import Callable, Sequence

import polars as pl
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from coramp.report.style import (
    BLACK,
    BLUE,
    GREEN,
    GREY,
    ORANGE,
    PURPLE,
    SKY,
    VERMILION,
    Look,
    grid,
    legend_below,
    look_of,
    new_figure,
)
from coramp.studies.penetration_layout import Series, series_of
from coramp.studies.penetration_runs import AUTOMATIONS, Cell
from coramp.studies.statistics import Estimate, estimate

ALONE = {
    AUTOMATIONS["yielding"]: Look("automation alone, yielding", GREEN, "v", "-."),
    AUTOMATIONS["not-yielding"]: Look("automation alone, not yielding", GREY, "<", ":"),
    AUTOMATIONS["acc"]: Look("automation alone, ACC", PURPLE, "p", ":"),
    AUTOMATIONS["cacc"]: Look("automation alone, CACC", BLACK, "*", ":"),
}
COORDINATED = (BLUE, SKY, VERMILION)
"""Colours of strategies, in the order in which they come."""
KINDS = {
    "driver_delay_s": ("drivers among them", "--", "D"),
    "automated_delay_s": ("automated vehicles among them", ":", "s"),
}
MOST_TRAFFICS = 5
"""Of more demands and drivers those are drawn of which most shares were run."""
LINEAR_TO = (1.0, 100.0)
"""Up to here the axes of delays and of brakings are linear, and logarithmic beyond."""


def penetration_figure(runs: pl.DataFrame) -> Figure:
    """Returns delay (s) and brakings beyond 3 m/s2 over the share, a column for each traffic.

    Of each traffic the time gap with most shares is drawn, with 95 % intervals over seeds: all
    vehicles, with drivers and automated vehicles apart where they are coordinated, beside
    automation alone. The dotted line is what the same drivers lose without automated vehicles.
    """
    by_traffic = _drawn(series_of(runs.filter(status="ok")))
    columns = max(1, len(by_traffic))
    figure = new_figure(max(7.0, 2.2 * columns), 6.6)
    diagrams = figure.subplots(2, columns, sharex=True, sharey="row", squeeze=False)
    for (delays, brakings), lines in zip(diagrams.T, by_traffic, strict=False):
        _draw(delays, lines, "delay_s", kinds=True)
        _draw(brakings, lines, "hard_brakings_3", kinds=False)
        traffic = lines[0].traffic
        delays.set_title(f"{traffic.name} veh/h\n{_who(lines)}")
        brakings.set_xlabel("automated vehicles (%)")
    for row, linear_to in zip(diagrams, LINEAR_TO, strict=True):
        for axes in row:
            axes.set_yscale("symlog", linthresh=linear_to, linscale=0.5)
            axes.set_ylim(bottom=0.0)
            axes.yaxis.set_major_formatter(lambda value, _: f"{value:g}")
    diagrams[0, 0].set_ylabel("mean delay (s)")
    diagrams[1, 0].set_ylabel("brakings beyond 3 m/s²,\nper 1000 vehicles")
    grid(*diagrams.flat)
    if by_traffic:
        legend_below(figure, diagrams.flat, 3 if columns > 3 else 2)
    return figure


def _drawn(found: Sequence[Series]) -> list[list[Series]]:
    """The lines of each traffic at the gap of which there are most shares, the shortest first."""
    every = []
    for traffic in dict.fromkeys(series.traffic for series in found):
        own = [series for series in found if series.traffic == traffic]
        gaps_s = sorted({series.vehicles.time_gap_s for series in own})
        most_s = max(gaps_s, key=lambda gap_s: _points(own, gap_s))
        every.append([series for series in own if series.vehicles.time_gap_s == most_s])
    counts = sorted((sum(len(s.cells) for s in lines) for lines in every), reverse=True)
    least = counts[min(len(counts), MOST_TRAFFICS) - 1] if counts else 0
    return [lines for lines in every if sum(len(s.cells) for s in lines) >= least][:MOST_TRAFFICS]


def _points(lines: Sequence[Series], gap_s: float) -> int:
    """How many cells there are at a gap; the first of several gaps with as many is taken."""
    return sum(len(series.cells) for series in lines if series.vehicles.time_gap_s == gap_s)


def _who(lines: Sequence[Series]) -> str:
    return f"{lines[0].traffic.drivers} drivers, {lines[0].vehicles.time_gap_s:g} s"


def _look(series: Series, place: int) -> Look:
    alone = ALONE.get(series.vehicles.who)
    if alone is not None:
        return alone
    colour = COORDINATED[place % len(COORDINATED)]
    return Look(look_of(series.vehicles.who).label, colour, "o", "-", 2.4)


def _draw(axes: Axes, lines: Sequence[Series], column: str, *, kinds: bool) -> None:
    value_of = _delay if kinds else _brakings
    strategies = [series.vehicles.who for series in lines if series.vehicles.coordinated]
    for series in lines:
        coordinated = series.vehicles.coordinated
        look = _look(series, strategies.index(series.vehicles.who) if coordinated else 0)
        _line(axes, (series.without, *series.cells), value_of(column), look)
        if kinds and coordinated:
            for kind, (name, line, marker) in KINDS.items():
                mixed = [cell for cell in series.cells if cell.share < 1.0]
                own = Look(f"{look.label}: {name}", ORANGE, marker, line, 1.1)
                _line(axes, mixed, value_of(kind), own if kind.startswith("driver") else _of(own))
    nobody = value_of(column)(lines[0].without)
    axes.axhline(nobody.mean, color=GREY, linestyle=":", linewidth=1.0, label="drivers alone")


def _of(look: Look) -> Look:
    """The same look in the colour of automated vehicles."""
    return Look(look.label, SKY, look.marker, look.line, look.width_pt)


def _delay(column: str) -> Callable[[Cell], Estimate]:
    return lambda cell: cell.mean(column)


def _brakings(column: str) -> Callable[[Cell], Estimate]:
    """A count per 1000 vehicles of the run."""

    def per_thousand(cell: Cell) -> Estimate:
        return estimate(
            [
                1000.0 * run[column] / max(1, run["vehicles_mainline"] + run["vehicles_ramp"])
                for run in cell.runs.values()
            ]
        )

    return per_thousand


def _line(
    axes: Axes, cells: Sequence[Cell], value_of: Callable[[Cell], Estimate], look: Look
) -> None:
    found = [(100.0 * cell.share, value_of(cell)) for cell in cells]
    found = [(share, value) for share, value in found if value.values]
    axes.errorbar(
        [share for share, _ in found],
        [value.mean for _, value in found],
        yerr=[value.half_width if value.values > 1 else 0.0 for _, value in found],
        color=look.colour,
        marker=look.marker,
        linestyle=look.line,
        linewidth=look.width_pt,
        elinewidth=0.8,
        markersize=4.0,
        label=look.label,
    )
