"""The on-ramps of a network, as they lie there and along their merge."""

import math
from collections.abc import Iterator, Sequence
from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from coramp.errors import CorampError
from coramp.networks.graph import Lane, Network, Point
from coramp.networks.ramps import Found, OnRamp
from coramp.networks.stations import Stations, stations_of
from coramp.report.style import (
    BLACK,
    BLUE,
    GREEN,
    GREY,
    VERMILION,
    grid,
    legend_below,
    new_figure,
    save_plot,
)
from coramp.road.lanes import ACCELERATION_LANE, MAINLINE, RAMP

LOOKS = {
    RAMP: ("ramp", VERMILION),
    MAINLINE: ("mainline", BLUE),
    ACCELERATION_LANE: ("the ramp's own lane", GREEN),
}
AROUND_M = 250.0
"""How far from the nose the road is drawn as it lies there."""
BEHIND_M, ACROSS_M, BESIDE_M = 60.0, 12.0, 3.0
"""How far upstream of the nose it is drawn enlarged, how far to its sides at least, and beside."""
BOX = {"boxstyle": "round,pad=0.1", "facecolor": "white", "edgecolor": "none", "alpha": 0.8}
MOST = 12
"""More on-ramps than these are not drawn in one figure."""


def save_ramps_figure(network: Network, found: Found, path: Path) -> None:
    """Draws every on-ramp of a network into a file; raises CorampError where that cannot be."""
    if not found.ramps:
        raise CorampError("--plot: there is no on-ramp to draw")
    if len(found.ramps) > MOST:
        raise CorampError(
            f"--plot: {len(found.ramps)} on-ramps are too many for a figure; "
            f"allowed are up to {MOST}, or one by --ramp"
        )
    save_plot(lambda: ramps_figure(network, found.ramps), path)


def ramps_figure(network: Network, ramps: tuple[OnRamp, ...]) -> Figure:
    """Returns a figure with a row for each on-ramp.

    Left as it lies in the network (x and y in m); right with the mainline from left to right, by
    station, widened across.
    """
    figure = new_figure(8.6, 0.5 + 2.7 * len(ramps))
    rows = figure.subplots(len(ramps), 2, squeeze=False, width_ratios=(1.0, 1.7))
    for (whole, near), ramp in zip(rows, ramps, strict=True):
        _draw_as_it_lies(whole, network, ramp)
        _draw_along(near, ramp)
        grid(whole, near)
    legend_below(figure, [axes for row in rows for axes in row], 3)
    return figure


def _draw_as_it_lies(axes: Axes, network: Network, ramp: OnRamp) -> None:
    x0, y0 = _nose(ramp)
    for edge in network.edges.values():
        for lane in edge.lanes:
            axes.plot(*_xy(lane.shape_m), color=GREY, linewidth=0.5, alpha=0.6)
    for lane, code in _lanes(ramp, stations_of(ramp)):
        axes.plot(*_xy(lane.shape_m), color=LOOKS[code][1], linewidth=1.2)
    axes.plot([x0], [y0], color=BLACK, marker="o", markersize=3.0)
    axes.set(
        aspect="equal",
        xlim=(x0 - AROUND_M, x0 + AROUND_M),
        ylim=(y0 - AROUND_M, y0 + AROUND_M),
        xlabel="x (m)",
        ylabel="y (m)",
    )
    axes.locator_params(nbins=5)
    axes.annotate("nose", (x0, y0), (8.0, 8.0), textcoords="offset points", bbox=BOX)


def _draw_along(axes: Axes, ramp: OnRamp) -> None:
    """Turns the road so that the mainline leaves the nose to the right."""
    for lane, code in _lanes(ramp, stations_of(ramp)):
        label, colour = LOOKS[code]
        axes.plot(*_xy(_turned(ramp, lane)), color=colour, linewidth=3.0, label=label)
    axes.axvline(0.0, color=BLACK, linewidth=0.8, linestyle=":")
    lane_m = ramp.merging.lane_m
    end_m = ramp.merge_edge.length_m if lane_m is None else lane_m
    told = ramp.merging.how if lane_m is None else f"{ramp.merging.how}, {lane_m:.1f} m"
    beside_m = [y for lane in ramp.merge_edge.lanes for _, y in _turned(ramp, lane)]
    axes.set(
        xlim=(-BEHIND_M, end_m + BEHIND_M),
        ylim=(min(-ACROSS_M, min(beside_m) - BESIDE_M), max(ACROSS_M, max(beside_m) + BESIDE_M)),
        xlabel="from the nose (m)",
        ylabel="across (m)",
        title=f"{ramp.ramp_id}: {told}",
    )


def _lanes(ramp: OnRamp, stations: Stations) -> Iterator[tuple[Lane, int]]:
    """Every lane of a merge site, those inside junctions too, with the code of what it is."""
    codes = {stretch.lane_id: stretch.code for stretch in stations.stretches}
    ways = [*ramp.ramp_ways, *ramp.mainline_ways]
    for course in (ramp.ramp, ramp.mainline, ramp.downstream):
        ways += [way for crossing in course.crossings for way in crossing.ways]
        yield from ((lane, codes[lane.lane_id]) for edge in course.edges for lane in edge.lanes)
    yield from ((lane, codes[lane.lane_id]) for way in ways for lane in way.inside)


def _nose(ramp: OnRamp) -> Point:
    """Where the lane that the ramp leads onto begins."""
    return _lane(ramp, ramp.ramp_way.to_lane).shape_m[0]


def _lane(ramp: OnRamp, index: int) -> Lane:
    return next(lane for lane in ramp.merge_edge.lanes if lane.index == index)


def _turned(ramp: OnRamp, lane: Lane) -> list[Point]:
    """A lane as seen from the nose of the mainline lane beside the ramp's, along that one."""
    start, *bends = _lane(ramp, ramp.mainline_way.to_lane).shape_m
    (x0, y0), (x1, y1) = start, next((point for point in bends if point != start), bends[0])
    away_m = math.hypot(x1 - x0, y1 - y0) or 1.0
    along, across = (x1 - x0) / away_m, (y1 - y0) / away_m
    return [
        (
            (x - x0) * along + (y - y0) * across,
            (y - y0) * along - (x - x0) * across,
        )
        for x, y in lane.shape_m
    ]


def _xy(shape_m: Sequence[Point]) -> tuple[list[float], list[float]]:
    return [x for x, _ in shape_m], [y for _, y in shape_m]
