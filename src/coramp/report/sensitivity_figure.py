"""What delay owes to errors, roads and time gaps, one at a time."""

import math
from collections.abc import Sequence
from typing import Any

import polars as pl
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from coramp.report.style import BLACK, COLOURS, LINES, MARKERS, grid, legend_below, new_figure
from coramp.road.streams import STREAMS
from coramp.scenarios.loading import load_scenario
from coramp.studies.overrides import overrides_of
from coramp.studies.sensitivity_layout import BREAKDOWN_DELAY_S
from coramp.studies.setting_words import NAMES, key_name
from coramp.studies.statistics import Estimate, estimate

FLAT_S = 0.5
"""By so much at most the mean delays of a setting differ that shares its diagram with others."""
Settings = list[tuple[float, str | None]]


def sensitivity_figure(runs: pl.DataFrame) -> Figure:
    """Returns mean delay (s) over each setting that varies, with 95 % intervals over seeds.

    A column of diagrams a setting, a row a stream, a line a flow. Settings over which no delay
    changes by more than ``FLAT_S`` share the first column: there a line goes from the least to the
    largest delay over all values of the setting. The broken line, named in the diagrams, is the
    delay beyond which a merge counts as broken down.
    """
    settings = settings_of(runs)
    flat = [key for key, values in settings.items() if _is_flat(runs, values)]
    flat = flat if len(flat) > 1 else []
    others = [key for key in settings if key not in flat]
    columns = len(others) + bool(flat)
    widths = [1.3] * bool(flat) + [1.0] * len(others)
    figure = new_figure(max(5.0, 3.4 * sum(widths) + 0.8), 6.2)
    diagrams = figure.subplots(
        2, columns, sharex="col", sharey=True, squeeze=False, width_ratios=widths
    )
    for row, stream in zip(diagrams, STREAMS, strict=True):
        if flat:
            _draw_flat(row[0], runs, {key: settings[key] for key in flat}, stream)
        for axes, key in zip(row[bool(flat) :], others, strict=True):
            _draw_setting(axes, runs, settings[key], stream)
        for axes in row:
            _finish(axes)
        row[0].set_ylabel(f"mean {stream} delay (s)")
    for axes, key in zip(diagrams[-1][bool(flat) :], others, strict=True):
        axes.set_xlabel(key_name(key))
    diagrams[0, 0].set_ylim(bottom=0.0)
    diagrams[0, 0].yaxis.set_major_formatter(lambda value, _: f"{value:g}")
    legend_below(figure, diagrams.flat, 3 if columns < 3 else 5)
    return figure


def _flows_of(runs: pl.DataFrame) -> list[tuple[float, float]]:
    return sorted(runs.select("mainline_veh_h", "ramp_veh_h").unique().iter_rows())


def _is_flat(runs: pl.DataFrame, values: Settings) -> bool:
    """Whether no mean delay changes by more than ``FLAT_S`` over a setting."""
    for pair in _flows_of(runs):
        for stream in STREAMS:
            means = [e.mean for e in _estimates(runs, values, (f"{stream}_delay_s", pair))]
            known = [mean for mean in means if not math.isnan(mean)]
            if known and max(known) - min(known) > FLAT_S:
                return False
    return True


def _draw_setting(axes: Axes, runs: pl.DataFrame, values: Settings, stream: str) -> None:
    for k, pair in enumerate(_flows_of(runs)):
        _draw_line(axes, runs, values, (f"{stream}_delay_s", pair), k)
    axes.set_xticks(range(len(values)), [f"{value:g}" for value, _ in values], fontsize=8)


def _draw_flat(axes: Axes, runs: pl.DataFrame, settings: dict[str, Settings], stream: str) -> None:
    """Draws a bar a setting and flow, from the least to the largest mean delay, with the middle."""
    flows = _flows_of(runs)
    for k, pair in enumerate(flows):
        ranges = []
        for values in settings.values():
            means = [e.mean for e in _estimates(runs, values, (f"{stream}_delay_s", pair))]
            ranges.append((min(means), max(means)))
        middles = [0.5 * (low + high) for low, high in ranges]
        axes.errorbar(
            [place + 0.13 * (k - 0.5 * (len(flows) - 1)) for place in range(len(settings))],
            middles,
            yerr=[0.5 * (high - low) for low, high in ranges],
            color=COLOURS[k % len(COLOURS)],
            marker=MARKERS[k % len(MARKERS)],
            linestyle="",
            label=f"{pair[0]:g} + {pair[1]:g} veh/h",
        )
    names = []
    for key, values in settings.items():
        word, _, unit = key_name(key).partition(" (")
        unit = "" if unit in ("", "no unit)") else f" {unit.removesuffix(')')}"
        names.append(f"{word},\n{values[0][0]:g} to {values[-1][0]:g}{unit}")
    axes.set_xticks(range(len(settings)), names, fontsize=8)
    axes.set_xlim(-0.5, len(settings) - 0.5)
    axes.set_title(f"{stream}: no delay changes by more than {FLAT_S:g} s", fontsize=8.5)


def _finish(axes: Axes) -> None:
    """The scale, the grid, and the named line of breakdown."""
    axes.axhline(BREAKDOWN_DELAY_S, color=BLACK, linestyle=(0, (6, 4)), linewidth=0.8)
    axes.annotate(
        f"{BREAKDOWN_DELAY_S:g} s: broken down above",
        (0.0, BREAKDOWN_DELAY_S),
        (4.0, 2.0),
        xycoords=("axes fraction", "data"),
        textcoords="offset points",
        fontsize=7.5,
    )
    axes.set_yscale("symlog", linthresh=0.1, linscale=0.5)
    grid(axes)


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
    order = sorted(found, key=lambda key: list(NAMES).index(key) if key in NAMES else len(NAMES))
    return {key: sorted(found[key], key=lambda v: v[0]) for key in order}


def _looked_up(data: Any, dotted: str) -> float:
    for part in dotted.split("."):
        data = data[part]
    return float(data)


def _estimates(
    runs: pl.DataFrame, values: Settings, which: tuple[str, Sequence[float]]
) -> list[Estimate]:
    """The mean over seeds of a column at a flow, for each value of a setting."""
    column, (mainline, ramp) = which
    at_flow = runs.filter(mainline_veh_h=mainline, ramp_veh_h=ramp)
    overrides = pl.col("overrides")
    return [
        estimate(
            at_flow.filter(overrides.is_null() if text is None else overrides == text)[column]
            .drop_nulls()
            .to_list()
        )
        for _, text in values
    ]


def _draw_line(
    axes: Axes,
    runs: pl.DataFrame,
    values: Settings,
    which: tuple[str, Sequence[float]],
    k: int,
) -> None:
    mainline, ramp = which[1]
    found = _estimates(runs, values, which)
    axes.errorbar(
        range(len(values)),
        [e.mean for e in found],
        yerr=[0.0 if math.isnan(e.half_width) else e.half_width for e in found],
        color=COLOURS[k % len(COLOURS)],
        marker=MARKERS[k % len(MARKERS)],
        linestyle=LINES[k % len(LINES)],
        label=f"{mainline:g} + {ramp:g} veh/h",
    )
