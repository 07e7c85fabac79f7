"""Figures of corridors: delay by site and strategy, and speed along the roads over time."""

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import polars as pl
from matplotlib.axes import Axes
from matplotlib.collections import QuadMesh
from matplotlib.figure import Figure

from coramp.agency.corridor_contour import RoadContour
from coramp.records.corridor_run import CorridorRecords
from coramp.report.contour_figure import MINUTE_S, SLOW_TO_FREE
from coramp.report.style import COLOURS, MARKERS, grid, legend_below, new_figure
from coramp.runs.corridor_rows import trip_figures
from coramp.studies.corridor_paired import DELAYS, WHOLE, delays_of
from coramp.studies.corridor_summary import GROUP, names_of_cells
from coramp.studies.overrides import keys_set
from coramp.studies.speed_unit import MPS, SpeedUnit
from coramp.studies.statistics import Estimate, estimate

WIDTH_IN, ROW_IN, CONTOUR_IN = 8.2, 0.42, 2.3
SPREAD = 0.6
"""How far apart (rows) what is drawn of one place lies."""


class Series(NamedTuple):
    """What one strategy loses at each place: delays (s) of mainline and ramp."""

    name: str
    by_place: Mapping[str, Sequence[Estimate]]


def study_delay_figure(
    good: pl.DataFrame, sites: pl.DataFrame, scenario: Mapping[str, Any] | None = None
) -> Figure:
    """Returns mean delays (s) by site and strategy, with 95 % intervals over seeds."""
    names, varied = names_of_cells(good, scenario), bool(keys_set(good))
    delays = delays_of(good, sites).join(good.select("run_id", *GROUP), on="run_id")
    found = []
    for key, group in good.group_by(GROUP, maintain_order=True):
        own = delays.filter(pl.col("run_id").is_in(group["run_id"].implode()))
        who, setting = names[key]
        places = {
            place: [
                estimate(own.filter(place=place)[name].drop_nulls().to_list())
                for name in DELAYS[1:]
            ]
            for place in own["place"].unique()
        }
        found.append(Series(f"{who}, {setting}" if varied else who, places))
    return delay_figure(found, sites["site"].unique(maintain_order=True).to_list())


def run_delay_figure(runs: Sequence[CorridorRecords], names: Sequence[str]) -> Figure:
    """Returns mean delays (s) by site of runs on the same arrivals."""
    found = []
    for run, name in zip(runs, names, strict=True):
        rows = {row["site"]: row for row in run.content["sites"]}
        whole = trip_figures(run.frames["trips"], list(rows))
        places = {
            place: [estimate([row[key]] if row[key] is not None else []) for key in DELAYS[1:]]
            for place, row in {**rows, WHOLE: whole}.items()
        }
        found.append(Series(name, places))
    return delay_figure(found, [row["site"] for row in runs[0].content["sites"]])


def delay_figure(series: Sequence[Series], sites: Sequence[str]) -> Figure:
    """Returns delays of mainline and ramp (s), a row a site and one of the whole corridor."""
    places = [*sites, WHOLE]
    row_in = max(ROW_IN, 0.13 * len(series) + 0.2)
    figure = new_figure(WIDTH_IN, row_in * len(places) + 0.9 + 0.2 * math.ceil(len(series) / 2))
    diagrams = figure.subplots(1, 2, sharey=True)
    for k, own in enumerate(series):
        offset = SPREAD * ((k + 0.5) / len(series) - 0.5)
        for axes, stream in zip(diagrams, range(2), strict=True):
            means = [own.by_place[place][stream] for place in places]
            axes.errorbar(
                [e.mean for e in means],
                [y + offset for y in range(len(places))],
                xerr=[0.0 if math.isnan(e.half_width) else e.half_width for e in means],
                color=COLOURS[k % len(COLOURS)],
                marker=MARKERS[k % len(MARKERS)],
                linestyle="",
                label=own.name,
            )
    for axes, title in zip(diagrams, ("mainline", "ramp"), strict=True):
        axes.set(title=title, xlabel="delay a vehicle (s)")
        axes.axvline(0.0, color="black", linewidth=0.8)
        for y in range(len(places) - 1):
            axes.axhline(y + 0.5, color="black", linewidth=0.3, alpha=0.4)
    diagrams[0].set_yticks(range(len(places)), site_names(places))
    diagrams[0].set_ylim(len(places) - 0.5, -0.5)
    grid(*diagrams)
    legend_below(figure, diagrams, 2)
    return figure


def site_names(places: Sequence[str]) -> list[str]:
    """Returns what sites are called in figures: their number, and their id below."""
    return [place if place == WHOLE else f"site {k}\n{place}" for k, place in enumerate(places, 1)]


def contour_figure(
    runs: Sequence[tuple[str, Sequence[RoadContour]]], unit: SpeedUnit = MPS
) -> Figure:
    """Returns the mean speed along each road over time (min), a row a run and road.

    All have the same colours and times. White is where nobody was.
    """
    parts = [(name, road) for name, roads in runs for road in roads]
    figure = new_figure(WIDTH_IN, 0.6 + CONTOUR_IN * len(parts))
    rows = figure.subplots(len(parts), 1, sharex=True, squeeze=False)[:, 0]
    most = max(road.free_mps for _, road in parts) * unit.per_mps
    first_sites = _first_sites(runs[0][1])
    for axes, (name, road) in zip(rows, parts, strict=True):
        mesh = _draw_road(axes, road, unit, most, first_sites[road.number])
        title = f"{name}, road {road.number}" if len(first_sites) > 1 else name
        axes.set(title=title, ylabel="from the\nupstream end (km)")
    end_s = max(road.edges_s[-1] for _, road in parts)
    rows[-1].set(xlabel="time (min)", xlim=(0.0, end_s / MINUTE_S))
    figure.colorbar(mesh, ax=list(rows), label=f"mean speed ({unit.name})")
    return figure


def _first_sites(roads: Sequence[RoadContour]) -> dict[int, int]:
    """By road the number of its first site."""
    firsts = np.cumsum([1, *(len(road.noses_m) for road in roads)])
    return {road.number: int(first) for road, first in zip(roads, firsts, strict=False)}


def _draw_road(
    axes: Axes, road: RoadContour, unit: SpeedUnit, most: float, first_site: int
) -> QuadMesh:
    mesh = axes.pcolormesh(
        road.edges_s / MINUTE_S,
        road.edges_m / 1000.0,
        np.ma.masked_invalid(road.speed_mps.T * unit.per_mps),
        cmap=SLOW_TO_FREE,
        vmin=0.0,
        vmax=most,
        rasterized=True,
    )
    for number, nose_m in enumerate(road.noses_m, first_site):
        axes.axhline(nose_m / 1000.0, color="black", linewidth=0.8)
        axes.annotate(
            f"the ramp of site {number} joins",
            (1.0, nose_m / 1000.0),
            xytext=(-3, 3),
            xycoords=("axes fraction", "data"),
            textcoords="offset points",
            ha="right",
            fontsize=7.5,
            bbox={"facecolor": "white", "alpha": 0.75, "edgecolor": "none", "pad": 1.0},
        )
    return mesh
