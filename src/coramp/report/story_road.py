"""The road from above at one decision: the vehicles, the gap, and the place that it leaves."""

from typing import Any

from matplotlib.axes import Axes
from matplotlib.patches import Polygon, Rectangle

from coramp.report.story_scene import (
    AHEAD,
    BEHIND,
    BRAKED,
    CONFLICT,
    FRONT,
    MOVED,
    REAR,
    SUBJECT,
    Scene,
)
from coramp.report.style import BLACK, BLUE, GREEN, GREY, ORANGE, PURPLE, VERMILION, YELLOW
from coramp.vehicles.merge_state import came_by_mainline, is_on_mainline

MOVED_LINE = (0, (6, 1, 1, 1, 1, 1))
LOOKS = {
    SUBJECT: (VERMILION, "-", 2.6),
    FRONT: (GREEN, "--", 1.8),
    REAR: (PURPLE, "-.", 1.8),
    AHEAD: (GREEN, "--", 1.8),
    BEHIND: (PURPLE, "-.", 1.8),
    MOVED: (BLUE, MOVED_LINE, 1.8),
    BRAKED: (BLUE, MOVED_LINE, 1.8),
    CONFLICT: (BLACK, ":", 1.8),
}
"""Colour, line and width (pt) of each role; of a vehicle with several the first counts."""
OTHERS = {True: ("other mainline vehicle", GREY), False: ("other ramp vehicle", ORANGE)}
HALF_LANE, HALF_WIDTH = 0.5, 0.27
RAMP_RISE = 2.0
"""How many lanes the ramp lies further off at the left edge."""
LOWEST, HIGHEST = -6.2, 4.0
NAME_PT, NAME_SHARE, TIER = 7.5, 0.0095, 1.7
"""Size of names, how much of the width one takes, and how far apart rows of names lie (lanes)."""


def look_in(scene: Scene, name: str) -> tuple[str, object, float]:
    """Returns colour, line and width (pt) of a vehicle."""
    if name in scene.roles:
        return LOOKS[scene.roles[name][0]]
    return OTHERS[came_by_mainline(scene.driven[name].merge_s)][1], "-", 0.8


def label_in(scene: Scene, name: str) -> str:
    """Returns what the legend calls a vehicle."""
    if name not in scene.roles:
        return OTHERS[came_by_mainline(scene.driven[name].merge_s)][0]
    roles = scene.roles[name]
    return roles[0] if roles in ((MOVED,), (BRAKED,)) else f"{name}, {', '.join(roles)}"


def draw_road(axes: Axes, scene: Scene) -> None:
    """Draws the road from above at the time of a scene's decision; stations (m) are to scale."""
    decision = scene.decision or {}
    now_s, lane_m = decision["time_s"], scene.scenario.ramp.acceleration_lane_m
    low_m, high_m = _shown_m(scene, now_s)
    slope = RAMP_RISE / -low_m if low_m < 0.0 else 0.0
    _draw_lanes(axes, low_m, high_m, lane_m, slope)
    axes.set(
        xlim=(low_m, high_m),
        ylim=(LOWEST, HIGHEST),
        yticks=[],
        xlabel=f"station at {now_s:.1f} s (m), to scale along the road only",
    )
    _draw_gap(axes, scene)
    there = [name for name, driven in scene.driven.items() if driven.present(now_s)]
    named_m: dict[tuple[bool, int], list[float]] = {}
    for name in sorted(there, key=lambda name: name not in scene.roles):
        on_mainline = is_on_mainline(scene.driven[name].merge_s, now_s)
        station_m = scene.driven[name].station_m(now_s)
        if low_m + 5.0 <= station_m <= high_m - 5.0:
            across = 0.0 if on_mainline else -1.0 + slope * min(0.0, station_m)
            _draw_vehicle(axes, scene, name, (station_m, across))
            tier = _free_tier(named_m, on_mainline, station_m, NAME_SHARE * (high_m - low_m))
            _name(axes, scene, name, (station_m, across), 1.0 if on_mainline else -1.0, tier)
    if scene.merges:
        _mark_merge(axes, scene)


def _free_tier(
    named_m: dict[tuple[bool, int], list[float]], above: bool, station_m: float, apart_m: float
) -> int:
    """Returns the first row of names with room at a station, and takes it."""
    tier = 0
    while any(abs(station_m - other_m) < apart_m for other_m in named_m.get((above, tier), ())):
        tier += 1
    named_m.setdefault((above, tier), []).append(station_m)
    return tier


def _mark_merge(axes: Axes, scene: Scene) -> None:
    decision = scene.decision or {}
    merge_m = decision["merge_station_m"]
    axes.plot(
        [merge_m, merge_m],
        [LOWEST + 1.1, HALF_LANE],
        color=VERMILION,
        linestyle=":",
        gid="merge-station",
    )
    axes.annotate(
        f"merge at {decision['merge_time_s']:.2f} s,\nstation {merge_m:.1f} m",
        (merge_m, LOWEST + 1.05),
        ha="center",
        va="top",
        fontsize=NAME_PT + 0.5,
        color=VERMILION,
    )


def _shown_m(scene: Scene, now_s: float) -> tuple[float, float]:
    """The stations between which the road is shown: all of interest, and the acceleration lane."""
    here = [d.station_m(now_s) for n, d in scene.driven.items() if n in scene.roles]
    decision = scene.decision or {}
    keys = ("front_station_m", "rear_station_m", "conflict_station_m", "merge_station_m")
    more = [decision[key] for key in keys if decision[key] is not None]
    lane_m = scene.scenario.ramp.acceleration_lane_m
    return min([*here, *more, 0.0]) - 40.0, max([*here, *more, lane_m]) + 25.0


def _draw_lanes(axes: Axes, low_m: float, high_m: float, lane_m: float, slope: float) -> None:
    """Draws the lanes' surfaces; the ramp comes from below."""
    road: dict[str, Any] = {"facecolor": GREY, "alpha": 0.16, "edgecolor": "none", "zorder": 0.5}
    axes.add_patch(Rectangle((low_m, -HALF_LANE), high_m - low_m, 2 * HALF_LANE, **road))
    far = -1.0 + slope * low_m
    ramp = [
        (low_m, far + HALF_LANE),
        (0.0, -HALF_LANE),
        (0.0, -1.0 - HALF_LANE),
        (low_m, far - HALF_LANE),
    ]
    axes.add_patch(Polygon(ramp, **road))
    lane: dict[str, Any] = {"facecolor": YELLOW, "alpha": 0.3, "edgecolor": "none", "zorder": 0.5}
    axes.add_patch(
        Rectangle((0.0, -1.0 - HALF_LANE), lane_m, 1.0, label="acceleration lane", **lane)
    )


def _draw_gap(axes: Axes, scene: Scene) -> None:
    """Draws the gap, the required one within it, and the subject's own place in that."""
    if not scene.merges:
        return
    decision = scene.decision or {}
    low_m, high_m = axes.get_xlim()
    rear_m, front_m = (min(max(edge_m, low_m), high_m) for edge_m in scene.gap_m)
    size_m, required_m = decision["gap_m"], decision["required_gap_m"]
    ends = [decision[key] is not None for key in ("front_vehicle_id", "rear_vehicle_id")]
    where = {
        (True, True): f"gap between X and Y, {size_m:.2f} m",
        (True, False): "gap behind X, with no vehicle after it",
        (False, True): "gap ahead of Y, with no vehicle before it",
    }.get((ends[0], ends[1]), "empty mainline")
    axes.add_patch(
        Rectangle(
            (rear_m, -HALF_LANE),
            front_m - rear_m,
            2 * HALF_LANE,
            facecolor=GREEN,
            alpha=0.25,
            zorder=0.8,
            gid="gap",
            label=where,
        )
    )
    from_m, to_m = scene.required_gap_m
    axes.plot(
        [from_m, to_m],
        [-HALF_LANE - 0.15] * 2,
        color=VERMILION,
        marker="|",
        markersize=7.0,
        linewidth=2.2,
        gid="required-gap",
        label=f"required gap, {required_m:.2f} m",
    )
    length_m = scene.scenario.usual_length_m
    axes.add_patch(
        Rectangle(
            (scene.place_m - length_m, -HALF_WIDTH),
            length_m,
            2 * HALF_WIDTH,
            facecolor="none",
            edgecolor=VERMILION,
            linestyle="--",
            zorder=3.5,
            gid="place",
            label=f"place of {scene.subject} in it",
        )
    )


def _draw_vehicle(axes: Axes, scene: Scene, name: str, at: tuple[float, float]) -> None:
    """Draws a vehicle as a box that ends at its front bumper."""
    station_m, across = at
    length_m, roles = scene.scenario.usual_length_m, scene.roles.get(name, ())
    colour, _, _ = look_in(scene, name)
    axes.add_patch(
        Rectangle(
            (station_m - length_m, across - HALF_WIDTH),
            length_m,
            2 * HALF_WIDTH,
            facecolor=colour,
            edgecolor=BLACK if CONFLICT in roles else colour,
            linewidth=1.6 if CONFLICT in roles else 0.5,
            zorder=3.0 if roles else 2.0,
            gid=f"{name}-on-the-road",
        )
    )


def _name(
    axes: Axes, scene: Scene, name: str, at: tuple[float, float], side: float, tier: int
) -> None:
    """Writes a vehicle's name above the mainline, or below the ramp, and whether it is X or Y."""
    station_m, across = at
    roles, colour = scene.roles.get(name, ()), look_in(scene, name)[0]
    middle_m = station_m - 0.5 * scene.scenario.usual_length_m
    foot = across + side * (HALF_LANE + 0.1 + TIER * tier)
    if tier:
        axes.plot([middle_m] * 2, [across + side * HALF_LANE, foot], color=colour, linewidth=0.5)
    axes.annotate(
        " ".join((name, *(role for role in roles if role in (FRONT, REAR)))),
        (middle_m, foot),
        rotation=90,
        ha="center",
        va="bottom" if side > 0.0 else "top",
        fontsize=NAME_PT if roles else NAME_PT - 1.0,
        fontweight="bold" if roles else "normal",
        color=colour,
        clip_on=True,
    )
