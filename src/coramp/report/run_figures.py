"""What single runs say: mean speed over time (Fig. 14, 15), and margins of decisions."""

from collections.abc import Sequence

import numpy as np
import polars as pl
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from coramp.metrics.motion import BIN_S
from coramp.records.run import RunRecords
from coramp.report.style import BLACK, grid, legend_below, look_of, new_figure

SMOOTH_S = 60
"""Over how many bins of 1 s the bold lines are means, each bin weighed by its vehicles."""


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
    for axes, stream in zip(diagrams, ("mainline", "ramp"), strict=True):
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
    A diagram a ramp flow, a line a strategy, decisions of all seeds together.
    """
    cooperative = [run for run in runs if run.decisions is not None]
    ramps = sorted({run.content["ramp_veh_h"] for run in cooperative})
    figure = new_figure(9.0, 3.5)
    diagrams = figure.subplots(1, len(ramps), sharex=True, sharey=True, squeeze=False)[0]
    for axes, ramp in zip(diagrams, ramps, strict=True):
        here = [run for run in cooperative if run.content["ramp_veh_h"] == ramp]
        for strategy in dict.fromkeys(run.content["strategy"] for run in here):
            look = look_of(strategy)
            margins_m, shares = margin_distribution(
                [r for r in here if r.content["strategy"] == strategy]
            )
            axes.step(
                margins_m,
                100.0 * shares,
                where="post",
                color=look.colour,
                linestyle=look.line,
                linewidth=look.width_pt,
                label=look.label,
            )
        axes.axvline(
            allowance_m, color=BLACK, linewidth=0.9, linestyle="--", label="what the checker asks"
        )
        axes.set(
            title=here[0].flows,
            xscale="log",
            xlabel="margin over the safe distance (m)",
            ylim=(0.0, 101.0),
        )
        axes.xaxis.set_major_formatter(lambda value, _: f"{value:g}")
    grid(*diagrams)
    diagrams[0].set_ylabel("decisions with at most this margin (%)")
    legend_below(figure, diagrams, 3)
    return figure


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
