"""What a study of one's own says: delay over whatever varies, and by how much on same arrivals."""

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import polars as pl
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from coramp.errors import CorampError
from coramp.report.style import BLACK, COLOURS, Look, grid, legend_below, look_of, new_figure
from coramp.studies.overrides import overrides_of, scenario_value
from coramp.studies.setting_words import key_name
from coramp.studies.statistics import estimate

DELAYS = {"all": "delay_s", "mainline": "mainline_delay_s", "ramp": "ramp_delay_s"}
FLOW, STRATEGY = "flow", "strategy"
MOST_PANELS = 6
OFFSET = 0.06
Who = tuple[str, str | None]


class Varied(NamedTuple):
    """One run as the figure takes it: by name what varies, who decided, with which seed."""

    values: dict[str, Any]
    who: Who
    seed: int
    delays_s: tuple[float | None, ...]


def varied(good: pl.DataFrame, scenario: Mapping[str, Any] | None = None) -> list[Varied]:
    """Returns the runs of a study with everything that was set or asked for in them.

    What a run does not set is the value of the ``scenario``, or "as it is" where that is not known.
    """
    every = [overrides_of(row) for row in good.iter_rows(named=True)]
    keys = sorted({key for found in every for key in found})
    own = {key: _own_value(scenario or {}, key) for key in keys}
    return [
        Varied(
            {
                FLOW: (row["mainline_veh_h"], row["ramp_veh_h"]),
                **{key: _plain(found.get(key, own[key])) for key in keys},
            },
            (row["strategy"], row["drivers"]),
            row["seed"],
            tuple(row[name] for name in DELAYS.values()),
        )
        for row, found in zip(good.iter_rows(named=True), every, strict=True)
    ]


def _own_value(scenario: Mapping[str, Any], key: str) -> Any:
    value = scenario_value(scenario, key)
    return "as it is" if value is None else value


def _plain(value: Any) -> Any:
    return tuple(value) if isinstance(value, list) else value if _is_simple(value) else str(value)


def _is_simple(value: Any) -> bool:
    return isinstance(value, int | float | str | bool)


def dimensions(runs: Sequence[Varied]) -> list[str]:
    """Returns what varies in a study: flow, dotted keys of the scenario, and strategy last."""
    names = list(runs[0].values) if runs else []
    found = [name for name in names if len({run.values[name] for run in runs}) > 1]
    return [*found, *([STRATEGY] if len({run.who for run in runs}) > 1 else [])]


def readable(good: pl.DataFrame, scenario: Mapping[str, Any] | None = None) -> str | None:
    """Returns over what the figure of a study has few enough rows, None where over nothing."""
    runs = varied(good, scenario)
    names = dimensions(runs) or [FLOW]
    return next((n for n in names if len(_panels(runs, _others(names, n))) <= MOST_PANELS), None)


def _others(names: Sequence[str], over: str) -> list[str]:
    return [name for name in names if name not in (over, STRATEGY)]


def _panels(runs: Sequence[Varied], others: Sequence[str]) -> list[tuple[Any, ...]]:
    """What else varies, in order, a row of diagrams each."""
    return sorted({tuple(run.values[n] for n in others) for run in runs}, key=_order)


def varied_figure(
    good: pl.DataFrame, over: str | None = None, scenario: Mapping[str, Any] | None = None
) -> Figure:
    """Returns mean delay (s) over what varies, with 95 % intervals over seeds.

    A column each for all, mainline and ramp; a line a strategy. ``over`` is ``flow``, ``strategy``
    or a dotted key that the study sets (default: the first that varies); what else varies gives
    rows of its own. The lowest row, where there are several strategies, is how much more each loses
    than the first that is named, seed by seed on the same arrivals. ``scenario`` is the content of
    the study's scenario, whose values stand where a run sets none. Raises CorampError for what
    does not vary, and for too many rows.
    """
    runs = varied(good, scenario)
    names = dimensions(runs)
    over = over or (names[0] if names else FLOW)
    if over not in names and over not in (FLOW, STRATEGY):
        known = ", ".join(names) or "nothing: the study is one cell"
        raise CorampError(f"over: {over} does not vary; allowed are {known}")
    others = _others(names, over)
    panels = _panels(runs, others)
    if len(panels) > MOST_PANELS:
        raise CorampError(
            f"over: {over} leaves {len(panels)} rows of {', '.join(others)}; allowed are "
            f"{MOST_PANELS}: choose another, or plot a study of fewer values"
        )
    whos = list(dict.fromkeys(run.who for run in runs))
    looks = _looks(whos)
    paired = len(whos) > 1 and over != STRATEGY
    rows = len(panels) * (2 if paired else 1)
    figure = new_figure(10.0, 2.5 * rows + 0.7)
    diagrams = figure.subplots(rows, len(DELAYS), squeeze=False, sharex=True)
    for place, panel in enumerate(panels):
        here = [run for run in runs if tuple(run.values[n] for n in others) == panel]
        title = ", ".join(f"{_axis_name(n)} {_text(v)}" for n, v in zip(others, panel, strict=True))
        row = diagrams[place * (2 if paired else 1)]
        _draw_delays(row, here, over, looks, title)
        if paired:
            _draw_differences(diagrams[2 * place + 1], here, over, looks)
    for axes in diagrams[-1]:
        axes.set_xlabel(_axis_name(over))
    grid(*diagrams.flat)
    legend_below(figure, diagrams.flat, 3)
    return figure


def _draw_delays(
    row: Sequence[Axes], runs: Sequence[Varied], over: str, looks: dict[Who, Look], title: str
) -> None:
    places = _places(runs, over)
    for k, (axes, stream) in enumerate(zip(row, DELAYS, strict=True)):
        for (who, look), offset in zip(looks.items(), _offsets(looks), strict=True):
            mine = [run for run in runs if run.who == who]
            found = {
                place: [
                    run.delays_s[k]
                    for run in mine
                    if _value(run, over) == place and run.delays_s[k] is not None
                ]
                for place in places
            }
            _draw_line(axes, places, found, (look, offset))
        name = "all vehicles" if stream == "all" else stream
        axes.set_title(f"{name}\n{title}" if title else name)
        _label(axes, places, over)
    row[0].set_ylabel("mean delay (s)")


def _draw_differences(
    row: Sequence[Axes], runs: Sequence[Varied], over: str, looks: dict[Who, Look]
) -> None:
    """How much more (s) each strategy loses than the first, by seed on the same arrivals."""
    places, (first, *others) = _places(runs, over), list(looks)
    offsets = dict(zip(looks, _offsets(looks), strict=True))
    base = {(_value(run, over), run.seed): run.delays_s for run in runs if run.who == first}
    for k, axes in enumerate(row):
        axes.axhline(0.0, color=BLACK, linewidth=0.9)
        for who in others:
            found: dict[Any, list[Any]] = {place: [] for place in places}
            for run in runs:
                there = base.get((_value(run, over), run.seed))
                if run.who == who and there is not None:
                    mine, its = run.delays_s[k], there[k]
                    if mine is not None and its is not None:
                        found[_value(run, over)].append(mine - its)
            _draw_line(axes, places, found, (looks[who], offsets[who]))
        _label(axes, places, over)
    row[0].set_ylabel(f"more than with\n{looks[first].label} (s),\nsame arrivals")


def _offsets(looks: Mapping[Who, Look]) -> list[float]:
    """How far beside a place each strategy is drawn, so that intervals can be told apart."""
    return [OFFSET * (k - 0.5 * (len(looks) - 1)) for k in range(len(looks))]


def _draw_line(
    axes: Axes, places: Sequence[Any], found: Mapping[Any, list[Any]], how: tuple[Look, float]
) -> None:
    look, offset = how
    estimates = [(k, estimate(found[place])) for k, place in enumerate(places) if found[place]]
    if not estimates:
        return
    axes.errorbar(
        [k + offset for k, _ in estimates],
        [e.mean for _, e in estimates],
        yerr=[0.0 if math.isnan(e.half_width) else e.half_width for _, e in estimates],
        color=look.colour,
        marker=look.marker,
        linestyle=look.line,
        linewidth=look.width_pt,
        elinewidth=1.2,
        label=look.label,
    )


def _looks(whos: Sequence[Who]) -> dict[Who, Look]:
    """The look of each; unknown strategies get a colour of their own."""
    found: dict[Who, Look] = {}
    free = iter(reversed(COLOURS))
    for who in whos:
        look = look_of(*who)
        if look.colour in {other.colour for other in found.values()}:
            taken = {other.colour for other in found.values()}
            colour = next((c for c in free if c not in taken), look.colour)
            look = Look(look.label, colour, look.marker, look.line, look.width_pt)
        found[who] = look
    return found


def _value(run: Varied, over: str) -> Any:
    return look_of(*run.who).label if over == STRATEGY else run.values[over]


def _places(runs: Sequence[Varied], over: str) -> list[Any]:
    values = {_value(run, over): None for run in runs}
    return list(values) if over == STRATEGY else sorted(values, key=lambda v: _order((v,)))


def _order(values: Sequence[Any]) -> tuple[Any, ...]:
    """Numbers before words, so that what is not set can stand beside what is."""
    return tuple((isinstance(v, str), str(v) if isinstance(v, str) else v) for v in values)


def _text(value: Any) -> str:
    if isinstance(value, tuple):
        return " + ".join(_text(v) for v in value)
    return f"{value:g}" if isinstance(value, float) else str(value)


def _label(axes: Axes, places: Sequence[Any], over: str) -> None:
    long = over in (FLOW, STRATEGY)
    axes.set_xticks(
        range(len(places)),
        [_text(place) for place in places],
        rotation=25 if long else 0,
        ha="right" if long else "center",
        fontsize=8,
    )
    axes.set_xlim(-0.4, len(places) - 0.6)


def _axis_name(over: str) -> str:
    return {FLOW: "flow, mainline + ramp (veh/h)", STRATEGY: "strategy"}.get(over) or key_name(over)
