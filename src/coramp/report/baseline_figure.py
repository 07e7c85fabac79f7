"""What a gain owes to its baseline, and what to short gaps without any plan."""

from typing import Any

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
    grid,
    legend_below,
    new_figure,
)
from coramp.studies.baseline_layout import CONTROLLED, DRIVER_GAP_S
from coramp.studies.baseline_runs import GAP, LANE, STANDSTILL, settings_of
from coramp.studies.overrides import overrides_of
from coramp.studies.statistics import estimate

FLOW = ["mainline_veh_h", "ramp_veh_h"]
POPULATIONS = {"paper": (VERMILION, "s", -0.2), "fair": (ORANGE, "D", 0.2)}
AUTOMATED, UNYIELDING = "automated", "automated, no room"
KINDS = {
    "ACC": ("uncoordinated, ACC", SKY, "p", "--"),
    "CACC": ("uncoordinated, CACC", BLACK, "*", "-."),
    AUTOMATED: ("automated Krauss, making room", GREEN, "v", "-"),
    UNYIELDING: ("automated Krauss, making no room", GREY, "<", ":"),
    CONTROLLED: ("mainline priority", BLUE, "o", "-"),
    "ramp-priority": ("ramp priority", PURPLE, "^", ":"),
}


def baseline_figure(runs: pl.DataFrame) -> Figure:
    """Returns the mainline delay of each baseline by flow, and delay over the time gap by flow."""
    rows = [
        {**run, "said": settings_of(run), "kind": _kind(run), "delay_s": _delay_s(run)}
        for run in runs.filter(status="ok").iter_rows(named=True)
    ]
    flows = sorted({(row[FLOW[0]], row[FLOW[1]]) for row in rows})
    figure = new_figure(11.0, 4.6)
    diagrams = figure.subplots(1, 1 + len(flows), sharey=True)
    _draw_baselines(diagrams[0], rows, flows)
    for axes, flow in zip(diagrams[1:], flows, strict=True):
        _draw_gaps(axes, [row for row in rows if (row[FLOW[0]], row[FLOW[1]]) == flow])
        axes.set(xlabel="time gap (s)", title=f"{flow[0]:g} + {flow[1]:g} veh/h")
    for axes in diagrams:
        axes.set_yscale("symlog", linthresh=0.1, linscale=0.5)
        axes.set_ylim(bottom=0.0)
        axes.yaxis.set_major_formatter(lambda value, _: f"{value:g}")
        grid(axes)
    diagrams[0].set_ylabel("mean delay of all (s)")
    legend_below(figure, diagrams, 3)
    return figure


def _kind(run: dict[str, Any]) -> str:
    """What a run is in the diagrams over the time gap: one of ``KINDS``, or another strategy."""
    said = settings_of(run)
    if run["drivers"] is None:
        return str(run["strategy"]) if said[STANDSTILL] == 0.0 else ""
    if run["drivers"].startswith("automated"):
        return AUTOMATED if said["lc_cooperative"] == 1.0 else UNYIELDING
    return str(said["car_following"])


def _delay_s(run: dict[str, Any]) -> float:
    mainline, ramp = run["vehicles_mainline"], run["vehicles_ramp"]
    lost_s = (run["mainline_delay_s"] or 0.0) * mainline + (run["ramp_delay_s"] or 0.0) * ramp
    return float(lost_s / max(1, mainline + ramp))


def _draw_baselines(
    axes: Axes, rows: list[dict[str, Any]], flows: list[tuple[float, float]]
) -> None:
    own = [row for row in rows if row["kind"] == "Krauss" and row["said"]["tau_s"] == DRIVER_GAP_S]
    own = [row for row in own if row["drivers"] in POPULATIONS]
    places = {flow: k for k, flow in enumerate(f for f in flows if _at(own, f))}
    for population, (colour, marker, aside) in POPULATIONS.items():
        for flow, place in places.items():
            groups: dict[str, list[float]] = {}
            for row in _at(own, flow):
                if row["drivers"] == population:
                    groups.setdefault(row["overrides"] or "", []).append(row["delay_s"])
            means = [estimate(delays_s).mean for delays_s in groups.values()]
            spread = [aside * (0.4 + k / max(1, len(means))) for k in range(len(means))]
            axes.plot(
                [place + at for at in spread],
                means,
                color=colour,
                marker=marker,
                markerfacecolor="none",
                markersize=4.0,
                linestyle="",
                label=f"no control, {population} drivers, one point per baseline",
            )
    ours = [
        row
        for row in rows
        if row["kind"] == CONTROLLED and row["said"][GAP] == 0.0 and _on_own_lane(row)
    ]
    means = [estimate([row["delay_s"] for row in _at(ours, flow)]).mean for flow in places]
    axes.plot(list(places.values()), means, color=BLUE, marker="o", label="mainline priority")
    axes.set_xticks(list(places.values()), [f"{m:g}\n+ {r:g}" for m, r in places])
    axes.set(xlabel="flow (veh/h)", title="every baseline")


def _at(rows: list[dict[str, Any]], flow: tuple[float, float]) -> list[dict[str, Any]]:
    return [row for row in rows if (row[FLOW[0]], row[FLOW[1]]) == flow]


def _on_own_lane(row: dict[str, Any]) -> bool:
    return LANE not in overrides_of(row)


def _draw_gaps(axes: Axes, rows: list[dict[str, Any]]) -> None:
    for kind, (label, colour, marker, line) in KINDS.items():
        found: dict[float, list[float]] = {}
        for row in rows:
            if row["kind"] == kind and _on_own_lane(row):
                gap_s = row["said"]["tau_s" if row["drivers"] else GAP]
                found.setdefault(gap_s, []).append(row["delay_s"])
        gaps = sorted(found)
        estimates = [estimate(found[gap]) for gap in gaps]
        axes.errorbar(
            gaps,
            [e.mean for e in estimates],
            yerr=[e.half_width if e.values > 1 else 0.0 for e in estimates],
            color=colour,
            marker=marker,
            linestyle=line,
            label=label,
        )
