"""The safety figures of a run, worked out anew from orders and reports."""

import math
from typing import NamedTuple

import numpy as np

from coramp._kernel import FloatArray, IntArray, kernel
from coramp.audit.neighbours import (
    DRAC,
    GAP,
    MARGIN,
    MERGE_FRONT,
    MERGE_REAR,
    SEVERITY,
    TTC,
    VIOLATION_COUNT,
    Stays,
    extremes_in_lane,
)
from coramp.audit.orders import Askers, Motion, Passages, exits_s, under_way
from coramp.checker.distances import Bounds
from coramp.checker.merging import NOT_COMMANDED

HARD_S = 0.2
STANDING_MPS = 0.1


class Derived(NamedTuple):
    """Figures by the names of ``runs.parquet``, violations, and the least gap in a lane (m).

    A violation is time (s), front and rear vehicle and margin (m).
    """

    figures: dict[str, float | None]
    violations: FloatArray
    least_gap_m: float


def derive(
    askers: Askers,
    ordered: Motion,
    driven: Motion,
    passages: Passages,
    end_s: float,
    bounds: Bounds,
    lane_end_m: float,
) -> Derived:
    """Returns the figures; ``ordered`` is what was commanded, ``driven`` what vehicles made of it.

    Braking and jerk at their largest are those of the orders, all else is as driven.
    """
    until_s = np.where(np.isnan(passages.exit_s), end_s, passages.exit_s)
    gone_s = np.where(np.isnan(passages.entry_s), -math.inf, until_s)
    lanes = [
        extremes_in_lane(driven, askers.traits, stays, bounds)
        for stays in _lanes(askers, passages, gone_s, bounds)
    ]
    least = np.min([lane.extremes for lane in lanes], axis=0)
    most = np.max([lane.extremes for lane in lanes], axis=0)
    standing_until_s = np.where(
        askers.on_ramp,
        np.fmin(passages.merge_s, until_s),
        np.minimum(until_s, exits_s(driven.first, driven.rows, lane_end_m)),
    )
    mainline = lanes[0].extremes
    merges = {15: float(mainline[MERGE_FRONT]), 16: float(mainline[MERGE_REAR])}
    margin_m, equation = _least_margin(float(least[MARGIN]), merges)
    figures = {
        "unserved": float(np.isnan(passages.exit_s).sum()),
        "safety_violations": float(sum(lane.extremes[VIOLATION_COUNT] for lane in lanes)),
        "min_margin_m": _finite(margin_m),
        "min_margin_equation": equation,
        "min_merge_margin_m": _finite(min(merges.values())),
        "min_ttc_s": _finite(least[TTC]),
        "max_drac_mps2": float(most[DRAC]),
        "max_severity": float(lanes[0].extremes[SEVERITY]),
        "max_decel_mps2": float(_hardest_mps2(ordered.first, ordered.rows, until_s)),
        "max_jerk_mps3": float(_largest_jerk_mps3(ordered.first, ordered.rows, until_s)),
        "hard_brakings_3": float(_hard_brakings(driven.first, driven.rows, until_s, 3.0)),
        "hard_brakings_4_5": float(_hard_brakings(driven.first, driven.rows, until_s, 4.5)),
        "stops": float(_stops(driven.first, driven.rows, standing_until_s)),
    }
    violations = np.concatenate([lane.violations for lane in lanes])
    if bounds.lanes > 1:
        figures["made_way"] = float((passages.change_s < gone_s).sum())
    return Derived(figures, violations[np.argsort(violations[:, 0])], float(least[GAP]))


def _least_margin(following_m: float, merges: dict[int, float]) -> tuple[float, float | None]:
    """Returns the least margin (m) over Eq. 1, or that of 15 or 16 if it is broken and less."""
    margin_m, equation = following_m, 1
    for number, at_merge_m in merges.items():
        if at_merge_m < min(0.0, margin_m):
            margin_m, equation = at_merge_m, number
    return margin_m, float(equation) if math.isfinite(margin_m) else None


def _finite(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None


def _lanes(
    askers: Askers, passages: Passages, gone_s: FloatArray, bounds: Bounds
) -> tuple[Stays, ...]:
    """Returns who used each lane of the mainline, and who the ramp with its acceleration lane.

    The mainline's begin with the one next to the ramp; who changes lanes is on both meanwhile.
    """
    everyone = np.arange(len(gone_s))
    merged_s = np.where(np.isnan(passages.merge_s), NOT_COMMANDED, passages.merge_s)
    mainline_s = np.where(askers.on_ramp, merged_s, passages.entry_s)
    ramp_s = np.where(askers.on_ramp, passages.entry_s, np.nan)
    leaves_s = np.minimum(gone_s, passages.change_s + bounds.lane_change_lasts_s)
    lanes = []
    for lane in range(bounds.lanes):
        own, comes = askers.lane == lane, askers.lane + 1 == lane
        lanes.append(
            Stays(
                np.concatenate([everyone[own], everyone[comes]]),
                np.concatenate([mainline_s[own], passages.change_s[comes]]),
                np.concatenate([leaves_s[own], gone_s[comes]]),
                np.concatenate([askers.on_ramp[own], np.zeros(int(comes.sum()), np.bool_)]),
            )
        )
    return (
        *lanes,
        Stays(everyone, ramp_s, np.minimum(merged_s, gone_s), np.zeros(len(everyone), np.bool_)),
    )


@kernel
def _hardest_mps2(first: IntArray, rows: FloatArray, until_s: FloatArray) -> float:
    hardest = 0.0
    for v in range(len(until_s)):
        for k in range(first[v], first[v + 1]):
            if rows[k, 0] < until_s[v]:
                hardest = max(hardest, -rows[k, 3])
    return hardest


@kernel
def _speed_mps(rows: FloatArray, begin: int, end: int, time_s: float) -> float:
    k = under_way(rows, begin, end, time_s)
    return float(rows[k, 2] + rows[k, 3] * (time_s - rows[k, 0]))


@kernel
def _largest_jerk_mps3(first: IntArray, rows: FloatArray, until_s: FloatArray) -> float:
    """Returns the largest ``|v(t + 1) - 2 v(t) + v(t - 1)|`` (m/s3): at a knot, or 1 s from one."""
    largest = 0.0
    for v in range(len(until_s)):
        begin, end = first[v], first[v + 1]
        for k in range(begin, end):
            for shift_s in (-1.0, 0.0, 1.0):
                now_s = rows[k, 0] + shift_s
                if rows[begin, 0] <= now_s - 1.0 and now_s + 1.0 <= until_s[v]:
                    before, after = now_s - 1.0, now_s + 1.0
                    change = _speed_mps(rows, begin, end, after)
                    change += _speed_mps(rows, begin, end, before)
                    change -= 2.0 * _speed_mps(rows, begin, end, now_s)
                    largest = max(largest, abs(change))
    return largest


@kernel
def _hard_brakings(
    first: IntArray, rows: FloatArray, until_s: FloatArray, harder_than_mps2: float
) -> int:
    """Returns how often vehicles braked harder than that for 0.2 s at a stretch."""
    found = 0
    for v in range(len(until_s)):
        lasted_s, counted = 0.0, False
        for k in range(first[v], first[v + 1]):
            stop_s = until_s[v]
            if k + 1 < first[v + 1]:
                stop_s = min(stop_s, rows[k + 1, 0])
            if stop_s <= rows[k, 0]:
                continue
            if -rows[k, 3] <= harder_than_mps2:
                lasted_s, counted = 0.0, False
                continue
            lasted_s += stop_s - rows[k, 0]
            if lasted_s >= HARD_S - 1e-6 and not counted:
                found += 1
                counted = True
    return found


@kernel
def _stops(first: IntArray, rows: FloatArray, until_s: FloatArray) -> int:
    """Returns how many vehicles were slower than 0.1 m/s before that time."""
    found = 0
    for v in range(len(until_s)):
        for k in range(first[v], first[v + 1]):
            stop_s = until_s[v]
            if k + 1 < first[v + 1]:
                stop_s = min(stop_s, rows[k + 1, 0])
            if stop_s < rows[k, 0]:
                break
            last_mps = rows[k, 2] + rows[k, 3] * (stop_s - rows[k, 0])
            if min(rows[k, 2], last_mps) < STANDING_MPS:
                found += 1
                break
    return found
