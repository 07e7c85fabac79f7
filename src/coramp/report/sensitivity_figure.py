"""What delay owes to errors, roads and time gaps, one at a time."""

import math
from collections.abc import Sequence
from typing import Any

import polars as pl
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from coramp.report.style import BLACK, COLOURS, LINES, MARKERS, grid, legend_below, new_figure
from coramp.scenarios.loading import load_scenario
from coramp.studies.overrides import overrides_of
from coramp.studies.sensitivity_layout import BREAKDOWN_DELAY_S
from coramp.studies.statistics import estimate

STREAMS = ("mainline", "ramp")
KEYS = {
    "safety.positioning_error_m": "positioning error L₁ (m)",
    "safety.clock_error_s": "clock error ε (s)",
    "safety.adhesion": "adhesion φ (no unit)",
    "safety.time_gap_s": "time gap (s)",
    "safety.standstill_gap_m": "standstill gap (m)",
}
"""What the keys of the built-in study are called; others keep their names."""
Settings = list[tuple[float, str | None]]


def sensitivity_figure(runs: pl.DataFrame) -> Figure:
    """Returns mean delay (s) over each setting that varies, with 95 % intervals over seeds.

    A column of diagrams a setting, a row a stream, a line a flow; the broken line is the 5 s
    beyond which a merge counts as broken down.
    """
    settings = settings_of(runs)
    figure = new_figure(max(4.0, 2.6 * len(settings) + 0.6), 5.6)
    diagrams = figure.subplots(2, len(settings), sharex="col", sharey=True, squeeze=False)
    flows = sorted(runs.select("mainline_veh_h", "ramp_veh_h").unique().iter_rows())
    for row, stream in zip(diagrams, STREAMS, strict=True):
        for axes, values in zip(row, settings.values(), strict=True):
            for k, pair in enumerate(flows):
                _draw_line(axes, runs, values, (f"{stream}_delay_s", pair), k)
            axes.axhline(BREAKDOWN_DELAY_S, color=BLACK, linestyle=(0, (6, 4)), linewidth=0.8)
            axes.set_yscale("symlog", linthresh=0.1, linscale=0.5)
            axes.set_xticks(range(len(values)), [f"{value:g}" for value, _ in values], fontsize=8)
            grid(axes)
        row[0].set_ylabel(f"mean {stream} delay (s)")
    for axes, key in zip(diagrams[-1], settings, strict=True):
        axes.set_xlabel(KEYS.get(key, key))
    diagrams[0, 0].set_ylim(bottom=0.0)
    diagrams[0, 0].yaxis.set_major_formatter(lambda value, _: f"{value:g}")
    legend_below(figure, diagrams.flat, 5)
    return figure


def settings_of(runs: pl.DataFrame) -> dict[str, Settings]:
    """Returns the values of each key that varies, in their order, with the runs' overrides.

    The scenario's own value stands among them where there are runs without an override.
    """
    found: dict[str, Settings] = {}
    for run in runs.unique("overrides", keep="first", maintain_order=True).iter_rows(named=True):
        overrides = overrides_of(run)
        if len(overrides) == 1:
            ((key, value),) = overrides.items()
            found.setdefault(key, []).append((float(value), run["overrides"]))
    plain = runs.filter(pl.col("overrides").is_null())
    if not plain.is_empty():
        scenario = load_scenario(plain["scenario"][0]).model_dump()
        for key, values in found.items():
            values.append((_looked_up(scenario, key), None))
    order = sorted(found, key=lambda key: list(KEYS).index(key) if key in KEYS else len(KEYS))
    return {key: sorted(found[key], key=lambda v: v[0]) for key in order}


def _looked_up(data: Any, dotted: str) -> float:
    for part in dotted.split("."):
        data = data[part]
    return float(data)


def _draw_line(
    axes: Axes,
    runs: pl.DataFrame,
    values: Settings,
    which: tuple[str, Sequence[float]],
    k: int,
) -> None:
    column, (mainline, ramp) = which
    at_flow = runs.filter(mainline_veh_h=mainline, ramp_veh_h=ramp)
    overrides = pl.col("overrides")
    found = [
        estimate(
            at_flow.filter(overrides.is_null() if text is None else overrides == text)[column]
            .drop_nulls()
            .to_list()
        )
        for _, text in values
    ]
    axes.errorbar(
        range(len(values)),
        [e.mean for e in found],
        yerr=[0.0 if math.isnan(e.half_width) else e.half_width for e in found],
        color=COLOURS[k % len(COLOURS)],
        marker=MARKERS[k % len(MARKERS)],
        linestyle=LINES[k % len(LINES)],
        label=f"{mainline:g} + {ramp:g} veh/h",
    )
