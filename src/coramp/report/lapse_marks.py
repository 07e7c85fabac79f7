"""What failed, in a time-space diagram: fallbacks, vehicles that were not known, breakdowns."""

from collections.abc import Mapping

from matplotlib.axes import Axes

from coramp.records.lapses import FALLBACK, lapses_in
from coramp.records.run import RunRecords
from coramp.report.story_scene import Driven

BREAKS_DOWN = "vehicle breaks down"
FALLBACK_COLOUR, BROKEN_COLOUR = "#b35c00", "#d4001a"
"""As in the page's style sheet."""
STEP_S = 0.25
MOVES_M = 0.1
"""A vehicle that goes less than this in a step stands."""


def mark_lapses(
    axes: Axes, run: RunRecords, driven: Mapping[str, Driven], from_s: float, until_s: float
) -> None:
    """Draws over the lines of vehicles, within a window of time, what failed when."""
    for lapse in lapses_in(run.heard):
        low_s, high_s = max(from_s, lapse.from_s), min(until_s, lapse.until_s)
        if lapse.vehicle_id not in driven or low_s >= high_s:
            continue
        times_s, stations_m = driven[lapse.vehicle_id].line(low_s, high_s, STEP_S)
        if not len(times_s):
            continue
        if lapse.what == FALLBACK:
            label = "in fallback"
            axes.plot(
                times_s, stations_m, color=FALLBACK_COLOUR, linewidth=4.0, alpha=0.5, label=label
            )
        else:
            axes.plot(times_s, stations_m, color="white", linewidth=1.6, linestyle=":")
            axes.plot([], [], color="black", linestyle=":", label="gaps: not known")
    for name, start_s in _breakdowns(run):
        end_s = _drives_on_s(driven[name], start_s)
        times_s, stations_m = driven[name].line(max(from_s, start_s), min(until_s, end_s), STEP_S)
        if len(times_s):
            axes.plot(times_s, stations_m, color=BROKEN_COLOUR, linewidth=3.0, label="broken down")


def _breakdowns(run: RunRecords) -> list[tuple[str, float]]:
    """Who broke down, and when (s)."""
    if run.safety_events is None:
        return []
    broken = run.safety_events.filter(event=BREAKS_DOWN)
    return list(broken.select("rear_vehicle_id", "time_s").iter_rows())


def _drives_on_s(driven: Driven, start_s: float) -> float:
    """When (s) a vehicle that broke down moves again after its stand, or leaves."""
    times_s, stations_m = driven.line(start_s, driven.until_s, STEP_S)
    stood = False
    for k in range(1, len(times_s)):
        moves = stations_m[k] - stations_m[k - 1] > MOVES_M
        if stood and moves:
            return float(times_s[k - 1])
        stood = stood or not moves
    return driven.until_s
