"""What single runs say: mean speed over time (Fig. 14, 15), and margins of decisions."""

from collections.abc import Sequence

import numpy as np
import polars as pl
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from coramp.metrics.motion import BIN_S
from coramp.records.run import RunRecords
from coramp.report.style import BLACK, COLOURS, LINES, grid, legend_below, look_of, new_figure
from coramp.road.streams import STREAMS

SMOOTH_S = 60
"""Over how many bins of 1 s the bold lines are means, each bin weighed by its vehicles."""
SAME_SHARE = 0.02
"""Distributions that are nowhere further apart are drawn as one."""


def speed_figure(runs: Sequence[RunRecords], stream: str) -> Figure:
    """Returns a stream's mean speed (m/s) over time (s), a diagram a ramp flow (Fig. 14, 15).

    Faint lines are bins of 1 s, bold ones means over a minute; the runs of the first seed are
    drawn.
    """
    first = [run for run in runs if run.content["seed"] == min(r.content["seed"] for r in runs)]
    ramps = sorted({run.content["ramp_veh_h"] for run in first})
    figure = new_figure(9.0, 2.0 * len(ramps) + 0.6)
    diagrams = figure.subplots(len(ramps), 1, sharex=True, sharey=True, squeeze=False)[:, 0]
    for axes, ramp in zip(diagrams, ramps, strict=True):
        here = [run for run in first if run.content["ramp_veh_h"] == ramp]
        for run in here:
            _draw_speed(axes, run, stream)
        axes.set(
            title=here[0].flows,
            ylabel=f"{stream} speed (m/s)",
            xlim=(0.0, max(run.scenario.simulation.horizon_s for run in here)),
        )
    grid(*diagrams)
    diagrams[-1].set_xlabel("time (s)")
    legend_below(figure, diagrams, 4)
    return figure


def both_speeds_figure(run: RunRecords) -> Figure:
    """Returns the mean speed (m/s) of mainline and ramp over time (s) in one run.

    Faint lines are bins of 1 s, bold ones means over a minute.
    """
    figure = new_figure(9.0, 4.6)
    diagrams = figure.subplots(2, 1, sharex=True)
    for axes, stream in zip(diagrams, STREAMS, strict=True):
        _draw_speed(axes, run, stream)
        axes.set(ylabel=f"{stream} speed (m/s)", xlim=(0.0, run.scenario.simulation.horizon_s))
    who = look_of(run.content["strategy"], run.content["drivers"]).label
    diagrams[0].set_title(f"{who}, {run.flows}, seed {run.content['seed']}")
    diagrams[1].set_xlabel("time (s)")
    grid(*diagrams)
    return figure


def _draw_speed(axes: Axes, run: RunRecords, stream: str) -> None:
    look = look_of(run.content["strategy"], run.content["drivers"])
    bins = pl.DataFrame({"time_s": np.arange(0.0, run.scenario.simulation.horizon_s, BIN_S)}).join(
        run.speeds.filter(stream=stream), on="time_s", how="left", maintain_order="left"
    )
    times_s, speeds_mps = bins["time_s"].to_numpy(), bins["mean_speed_mps"].to_numpy()
    axes.plot(times_s, speeds_mps, color=look.colour, alpha=0.3, linewidth=0.6)
    total, vehicles = (
        values.rolling_sum(SMOOTH_S, min_samples=1, center=True)
        for values in (bins["mean_speed_mps"] * bins["vehicles"], bins["vehicles"])
    )
    smooth_mps = (total / vehicles).to_numpy()
    apart = max(1, len(times_s) // 10)
    axes.plot(
        times_s,
        smooth_mps,
        color=look.colour,
        linestyle=look.line,
        linewidth=look.width_pt,
        marker=look.marker,
        markevery=(apart // 2 if look.line == ":" else 0, apart),
        label=look.label,
    )


def margin_figure(runs: Sequence[RunRecords], allowance_m: float) -> Figure:
    """Returns how many decisions (%) have at most a margin (m) over the safe distance.

    The margin of a decision is the least of all vehicles that it changes to all others, as the
    checker computed it before the plan was committed; it asks for ``allowance_m`` of every plan.
    A line a ramp flow and strategy, decisions of all seeds together; strategies whose lines are
    nowhere further than ``SAME_SHARE`` apart are one line, which says so.
    """
    cooperative = [run for run in runs if run.decisions is not None]
    ramps = sorted({run.content["ramp_veh_h"] for run in cooperative})
    figure = new_figure(8.4, 4.6)
    axes = figure.subplots()
    for k, ramp in enumerate(ramps):
        here = [run for run in cooperative if run.content["ramp_veh_h"] == ramp]
        for number, (label, together) in enumerate(_coinciding(here)):
            margins_m, shares = margin_distribution(together)
            axes.step(
                margins_m,
                100.0 * shares,
                where="post",
                color=COLOURS[k % len(COLOURS)],
                linestyle=LINES[(k + 2 * number) % len(LINES)],
                linewidth=1.8,
                label=f"{here[0].flows}: {label}",
            )
    axes.axvline(allowance_m, color=BLACK, linewidth=1.0, linestyle="--")
    axes.text(
        allowance_m,
        99.0,
        f" {allowance_m:g} m, the least that\n the checker lets pass",
        va="top",
        fontsize=8.5,
    )
    axes.set(
        xscale="log",
        xlabel="margin over the safe distance (m)",
        ylabel="decisions with at most this margin (%)",
        ylim=(0.0, 101.0),
    )
    axes.xaxis.set_major_formatter(lambda value, _: f"{value:g}")
    grid(axes)
    legend_below(figure, [axes], 1)
    return figure


def _coinciding(runs: Sequence[RunRecords]) -> list[tuple[str, list[RunRecords]]]:
    """Groups of runs whose strategies' lines lie on each other, with what the group is called."""
    groups: list[tuple[list[str], list[RunRecords]]] = []
    for strategy in dict.fromkeys(run.content["strategy"] for run in runs):
        own = [run for run in runs if run.content["strategy"] == strategy]
        for names, known in groups:
            if _apart(margin_distribution(own), margin_distribution(known)) <= SAME_SHARE:
                names.append(look_of(strategy).label)
                known.extend(own)
                break
        else:
            groups.append(([look_of(strategy).label], own))
    return [
        (" and ".join(names) + (" coincide" if len(names) > 1 else ""), together)
        for names, together in groups
    ]


def _apart(one: tuple[np.ndarray, np.ndarray], other: tuple[np.ndarray, np.ndarray]) -> float:
    """The largest difference of two shares at one margin; margins count in whole millimetres."""
    margins_m = np.round(np.concatenate((one[0], other[0])), 3)
    shares = [
        np.concatenate(([0.0], share))[np.searchsorted(np.round(m, 3), margins_m, side="right")]
        for m, share in (one, other)
    ]
    return float(np.abs(shares[0] - shares[1]).max(initial=0.0))


def margin_distribution(runs: Sequence[RunRecords]) -> tuple[np.ndarray, np.ndarray]:
    """Returns the margins (m) of all decisions that change something, ascending, and shares.

    A share is that of decisions with at most that margin; vehicles that are alone have no margin
    and count as larger than all.
    """
    frames = [run.decisions for run in runs if run.decisions is not None]
    margins_m = pl.concat(frame["min_margin_m"] for frame in frames).drop_nulls().sort().to_numpy()
    shares = np.arange(1, len(margins_m) + 1) / max(1, len(margins_m))
    finite = np.isfinite(margins_m)
    return margins_m[finite], shares[finite]
