"""The road as SUMO has it (Fig. 13)."""

import xml.etree.ElementTree as ET
from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from coramp.report.style import (
    BLACK,
    BLUE,
    GREEN,
    GREY,
    SKY,
    VERMILION,
    grid,
    legend_below,
    new_figure,
)
from coramp.scenarios.model import Scenario
from coramp.worlds.sumo.network import LANE_WIDTH_M, network_file, road_plan

LANES = {
    "mainline_0": ("mainline", BLUE),
    "ramp_0": ("ramp", VERMILION),
    "merge_0": ("acceleration lane", GREEN),
    "merge_1": ("mainline beside the acceleration lane", SKY),
    "downstream_0": ("mainline downstream", GREY),
}
Shape = list[tuple[float, float]]


def lane_shapes_m(network: Path) -> dict[str, Shape]:
    """Returns the centre line (x, y in m) of each lane of a network file, none inside nodes."""
    return {
        lane.get("id", ""): [
            (float(x), float(y))
            for x, y in (point.split(",")[:2] for point in lane.get("shape", "").split())
        ]
        for lane in ET.parse(network).getroot().iter("lane")
        if lane.get("id", "") in LANES
    }


def road_figure(scenario: Scenario) -> Figure:
    """Returns the road that netconvert built: the whole, and the acceleration lane enlarged.

    x is the mainline's station in m, y the distance across in m. Raises CorampError where the
    network cannot be built.
    """
    shapes_m = lane_shapes_m(network_file(road_plan(scenario)))
    figure = new_figure(8.6, 5.2)
    whole, near = figure.subplots(2, 1, height_ratios=(1.5, 1.0))
    for axes in (whole, near):
        for lane, (label, colour) in LANES.items():
            xs_m, ys_m = zip(*shapes_m[lane], strict=True)
            axes.plot(xs_m, ys_m, color=colour, linewidth=3.0, label=label, gid=lane)
        grid(axes)
    near.axvline(0.0, color=BLACK, linewidth=0.8, linestyle=":")
    whole.set(
        aspect="equal",
        ylim=(0.55 * scenario.ramp.start_m, -0.12 * scenario.ramp.start_m),
        xlabel="station (m)",
        ylabel="across (m)",
        title=f"{scenario.name}: the whole road, to scale",
    )
    _draw_marks(whole, scenario)
    lane_m = scenario.ramp.acceleration_lane_m
    near.set(
        xlim=(-0.35 * lane_m, 1.2 * lane_m),
        ylim=(-5.5 * LANE_WIDTH_M, 2.0 * LANE_WIDTH_M),
        xlabel="station (m)",
        ylabel="across (m)",
        title="around the acceleration lane, widened across",
    )
    near.annotate(
        f"acceleration lane, {lane_m:g} m: a dead end",
        (0.5 * lane_m, -LANE_WIDTH_M),
        (0.0, -16.0),
        textcoords="offset points",
        ha="center",
    )
    near.annotate("nose", (0.0, -5.0 * LANE_WIDTH_M), (4.0, 0.0), textcoords="offset points")
    legend_below(figure, [whole], 3)
    return figure


def _draw_marks(axes: Axes, scenario: Scenario) -> None:
    """Writes the lengths of mainline and ramp beside them."""
    mainline, ramp = scenario.mainline, scenario.ramp
    axes.annotate(
        f"{-mainline.start_m:g} m at {mainline.limit_mps:.3g} m/s",
        (0.5 * mainline.start_m, 0.0),
        (0.0, 6.0),
        textcoords="offset points",
        ha="center",
    )
    axes.annotate(
        f"{-ramp.start_m:g} m at {ramp.limit_mps:.3g} m/s, merging at {ramp.merge_angle_deg:g}°",
        (0.45 * ramp.start_m, 0.36 * ramp.start_m),
    )
