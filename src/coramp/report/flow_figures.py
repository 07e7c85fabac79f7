"""What a study of flows says: delay, gain over both populations of drivers, rungs."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import polars as pl
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from coramp.report.style import (
    BLACK,
    BLUE,
    GREEN,
    HATCHES,
    ORANGE,
    SKY,
    legend_below,
    look_of,
    new_figure,
)
from coramp.road.streams import STREAMS
from coramp.strategies.situation import RUNGS_OF_ONE_LANE
from coramp.studies.metric_labels import RUNG_COLUMNS
from coramp.studies.paper_layout import (
    LEAST_BASELINE_S,
    POPULATIONS,
    STRATEGIES,
    Cell,
    lookup,
    rate,
)
from coramp.studies.paper_results import MAINLINE_DELAY_S, RAMP_DELAY_S
from coramp.studies.statistics import improvement_rate

PRINTED = {"mainline": MAINLINE_DELAY_S, "ramp": RAMP_DELAY_S}
CELLS = [Cell(s, None) for s in STRATEGIES] + [Cell("uncontrolled", p) for p in POPULATIONS]
LINEAR_TO_S = 0.1
"""Up to here the axis of delays is linear, beyond it logarithmic."""
*MERGING, HOLD = RUNGS_OF_ONE_LANE
RUNG_COLOURS = dict(zip(MERGING, (SKY, BLUE, ORANGE, GREEN), strict=True))
RUNG_WORDS = {
    "free": "free: as it is",
    "reach": "reach: speeds up or slows down into a gap",
    "create": "create: others make a gap",
    "delay": "delay: a later gap",
}
LEAST_NAMED = 4.0
"""The least share (%) that has its number in its bar."""
Flows = tuple[int, int]


def flows_of(runs: pl.DataFrame) -> list[Flows]:
    """Returns the flows (veh/h) of mainline and ramp at which there are cooperative runs."""
    found = runs.filter(pl.col("strategy").is_in(STRATEGIES)).select("mainline_veh_h", "ramp_veh_h")
    return sorted((round(m), round(r)) for m, r in found.unique().iter_rows())


def delay_figure(runs: pl.DataFrame) -> Figure:
    """Returns mean delay (s) by flow with 95 % intervals over seeds, a diagram a stream."""
    figure = new_figure(9.0, 4.2)
    diagrams = figure.subplots(1, 2, sharey=True)
    flows = flows_of(runs)
    places = np.arange(len(flows))
    for axes, stream in zip(diagrams, STREAMS, strict=True):
        find = lookup(runs, f"{stream}_delay_s")
        for k, cell in enumerate(CELLS):
            look, found = look_of(*cell), [find(pair, cell) for pair in flows]
            axes.errorbar(
                places + 0.09 * (k - 1.5),
                [e.mean for e in found],
                yerr=[0.0 if math.isnan(e.half_width) else e.half_width for e in found],
                color=look.colour,
                marker=look.marker,
                linestyle=look.line,
                linewidth=look.width_pt,
                elinewidth=1.2,
                label=look.label,
            )
        axes.set_yscale("symlog", linthresh=LINEAR_TO_S, linscale=0.6)
        axes.set(title=stream, ylim=(-0.02, None))
        _label_flows(axes, flows)
    ticks = (0.0, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0)
    low, high = diagrams[0].get_ylim()
    diagrams[0].set_yticks([t for t in ticks if low <= t <= high])
    diagrams[0].yaxis.set_major_formatter(lambda value, _: f"{value:g}")
    diagrams[0].set_ylabel("mean delay (s)")
    legend_below(figure, diagrams, 4)
    return figure


def gain_figure(runs: pl.DataFrame) -> Figure:
    """Returns delay saved (%) against the paper's and the fair drivers, side by side.

    Rates are Eq. 46 and 47 of means over seeds; there is no bar where the baseline loses less than
    0.1 s. Dashes are what the paper prints in its Tables 1 and 2.
    """
    figure = new_figure(9.0, 5.6)
    diagrams = figure.subplots(2, 2, sharex=True, sharey=True)
    flows = flows_of(runs)
    for row, strategy in zip(diagrams, STRATEGIES, strict=True):
        for axes, stream in zip(row, STREAMS, strict=True):
            for k, population in enumerate(POPULATIONS):
                _draw_gain(axes, runs, flows, (stream, strategy, population), 0.4 * (k - 0.5))
            _draw_printed(axes, stream, strategy, flows)
            axes.set(title=f"{look_of(strategy).label}, {stream}", ylim=(0.0, 105.0))
            _label_flows(axes, flows)
        row[0].set_ylabel("delay saved (%)")
    for axes in diagrams[0]:
        axes.set_xlabel("")
    legend_below(figure, diagrams.flat, 3)
    return figure


def _draw_gain(
    axes: Axes,
    runs: pl.DataFrame,
    flows: Sequence[Flows],
    which: tuple[str, str, str],
    offset: float,
) -> None:
    stream, strategy, population = which
    find = lookup(runs, f"{stream}_delay_s")
    shares = [
        rate(
            find(pair, Cell(strategy, None)).mean,
            find(pair, Cell("uncontrolled", population)).mean,
            LEAST_BASELINE_S,
        )
        for pair in flows
    ]
    axes.bar(
        np.arange(len(flows)) + offset,
        [0.0 if math.isnan(share) else 100.0 * share for share in shares],
        width=0.38,
        color=look_of("uncontrolled", population).colour,
        hatch=HATCHES[POPULATIONS.index(population)],
        edgecolor="white",
        label=f"against {look_of('uncontrolled', population).label.removeprefix('no control, ')}",
    )


def _draw_printed(axes: Axes, stream: str, strategy: str, flows: Sequence[Flows]) -> None:
    printed = PRINTED[stream]
    known = [k for k, pair in enumerate(flows) if pair in printed]
    column = STRATEGIES.index(strategy) + 1
    axes.plot(
        known,
        [
            100.0 * improvement_rate(printed[flows[k]][column], printed[flows[k]].uncontrolled)
            for k in known
        ],
        color=BLACK,
        linestyle="none",
        marker="_",
        markersize=16,
        markeredgewidth=1.8,
        label="printed in the paper",
    )


def rung_figure(runs: pl.DataFrame) -> Figure:
    """Returns the share (%) of merges that each rung gave, by flow, in a diagram per strategy.

    Each share from 4 % on has its number. Diamonds are the share of ramp vehicles that had to wait
    for a merge at least once (hold); where nobody had to, the title says so.
    """
    figure = new_figure(10.0, 5.2)
    diagrams = figure.subplots(2, 1, sharex=True)
    flows = flows_of(runs)
    for axes, strategy in zip(diagrams, STRATEGIES, strict=True):
        shares, held = rung_shares(runs, strategy, flows)
        bottom = np.zeros(len(flows))
        for (rung, colour), hatch in zip(RUNG_COLOURS.items(), HATCHES, strict=False):
            if shares[rung].any():
                _draw_rung(axes, rung, shares[rung], bottom, (colour, hatch))
            bottom += shares[rung]
        if held.any():
            axes.plot(held, color=BLACK, linestyle="none", marker="D", label="had to wait (hold)")
        waited = "" if held.any() else ": no vehicle had to wait (hold)"
        axes.set(title=f"{look_of(strategy).label}{waited}", ylim=(0.0, 100.0))
        axes.set_ylabel("share of ramp vehicles (%)")
        _label_flows(axes, flows, upright=True)
    diagrams[0].set_xlabel("")
    legend_below(figure, diagrams, 5)
    return figure


def _draw_rung(
    axes: Axes, rung: str, shares: np.ndarray, bottom: np.ndarray, look: tuple[str, str]
) -> None:
    colour, hatch = look
    bars = axes.bar(
        np.arange(len(shares)),
        shares,
        bottom=bottom,
        width=0.8,
        color=colour,
        hatch=hatch,
        edgecolor="white",
        label=RUNG_WORDS[rung],
    )
    texts = axes.bar_label(
        bars,
        [f"{share:.0f} %" if share >= LEAST_NAMED else "" for share in shares],
        label_type="center",
        fontsize=9.0,
    )
    for text in texts:
        text.set_bbox({"facecolor": "white", "alpha": 0.85, "edgecolor": "none", "pad": 1.0})


def rung_shares(
    runs: pl.DataFrame, strategy: str, flows: Sequence[Flows]
) -> tuple[dict[str, np.ndarray], np.ndarray]:
    """Returns each rung's share (%) of all merges at each flow, and of vehicles that waited."""
    plain = runs.filter(pl.col("overrides").is_null() & (pl.col("strategy") == strategy))
    counts = np.zeros((len(RUNGS_OF_ONE_LANE), len(flows)))
    for k, (mainline, ramp) in enumerate(flows):
        at = plain.filter(mainline_veh_h=float(mainline), ramp_veh_h=float(ramp))
        counts[:, k] = [at[RUNG_COLUMNS[rung]].sum() for rung in (*MERGING, HOLD)]
    merges = np.maximum(1.0, counts[:-1].sum(axis=0))
    shares = 100.0 * counts / merges
    return dict(zip(MERGING, shares, strict=False)), shares[-1]


def _label_flows(axes: Axes, flows: Sequence[Flows], upright: bool = False) -> None:
    """Writes flows below an axis, slanted or in one line each where there is room."""
    slant: dict[str, Any] = {} if upright else {"rotation": 40, "ha": "right"}
    axes.set_xticks(range(len(flows)), [f"{m} + {r}" for m, r in flows], fontsize=8, **slant)
    axes.set_xlabel("flow, mainline + ramp (veh/h)")
    axes.grid(axis="y", alpha=0.3)
    axes.set_axisbelow(True)
