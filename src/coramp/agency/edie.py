"""Flow, density and speed as Edie defines them, exactly, from pieces of constant acceleration.

In a rectangle of time and road, t is the time that all vehicles spend in it and d the way that they
drive in it. Over its area A: flow q = d / A, density k = t / A, speed v = d / t = q / k (Edie,
Discussion of traffic stream measurements and definitions, 1963).
"""

from typing import NamedTuple

import numpy as np

from coramp._kernel import BoolArray, FloatArray, IntArray
from coramp.agency.motion import Motion, time_over_s
from coramp.kinematics.trajectory import ACCEL, SPEED, STATION, TIME


class Spent(NamedTuple):
    """Time (vehicle seconds) and way (vehicle metres) in cells, by interval and stretch."""

    time_s: FloatArray
    way_m: FloatArray


class _Parts(NamedTuple):
    """Parts of spans, each within one bin: of which span, in which bin, from where to where."""

    span: IntArray
    bin: IntArray
    low: FloatArray
    high: FloatArray


def spent_in_cells(
    motion: Motion,
    pieces: BoolArray,
    edges_s: FloatArray,
    edges_m: FloatArray,
    weights: FloatArray | None = None,
) -> Spent:
    """Returns what vehicles spend in each cell between edges of time (s) and station (m).

    ``pieces`` says which rows count, such as those of one lane; ``weights`` has one entry a
    vehicle, such as passenger cars that it stands for. What lies outside of the edges is left out.
    A vehicle that rolls back, by the centimetres of a fit, counts where that began.
    """
    chosen = np.flatnonzero(pieces & (motion.duration_s > 0.0))
    rows = motion.rows[chosen]
    in_time = _parts(rows[:, TIME], rows[:, TIME] + motion.duration_s[chosen], edges_s)
    own = rows[in_time.span]
    since_s, lasts_s = in_time.low - own[:, TIME], in_time.high - in_time.low
    speed_mps = own[:, SPEED] + own[:, ACCEL] * since_s
    from_m = own[:, STATION] + (own[:, SPEED] + 0.5 * own[:, ACCEL] * since_s) * since_s
    to_m = from_m + (speed_mps + 0.5 * own[:, ACCEL] * lasts_s) * lasts_s
    weight = np.ones(len(motion)) if weights is None else weights
    weight = weight[motion.vehicle[chosen]][in_time.span]
    shape = (len(edges_s) - 1, len(edges_m) - 1)
    time_s, way_m = np.zeros(shape), np.zeros(shape)

    stands = np.flatnonzero(to_m <= from_m)
    place = np.searchsorted(edges_m, from_m[stands], "right") - 1
    inside = (place >= 0) & (place < shape[1])
    stands, cell = stands[inside], (in_time.bin[stands[inside]], place[inside])
    np.add.at(time_s, cell, weight[stands] * lasts_s[stands])
    np.add.at(way_m, cell, weight[stands] * (to_m - from_m)[stands])

    on_road = _parts(from_m, to_m, edges_m)
    span = on_road.span
    moving = (speed_mps[span], own[span, ACCEL])
    enters_s = time_over_s(*moving, on_road.low - from_m[span])
    leaves_s = np.minimum(time_over_s(*moving, on_road.high - from_m[span]), lasts_s[span])
    leaves_s = np.where(on_road.high >= to_m[span], lasts_s[span], leaves_s)
    cell = (in_time.bin[span], on_road.bin)
    np.add.at(time_s, cell, weight[span] * np.maximum(0.0, leaves_s - enters_s))
    np.add.at(way_m, cell, weight[span] * (on_road.high - on_road.low))
    return Spent(time_s, way_m)


def _parts(low: FloatArray, high: FloatArray, edges: FloatArray) -> _Parts:
    """Cuts spans at edges; spans without length, and what is outside of all edges, are left out."""
    first = np.maximum(0, np.searchsorted(edges, low, "right") - 1)
    last = np.minimum(len(edges) - 2, np.searchsorted(edges, high, "left") - 1)
    counts = np.where(high > low, np.maximum(0, last - first + 1), 0)
    span = np.repeat(np.arange(len(low)), counts)
    offset = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
    bins = first[span] + offset
    return _Parts(
        span,
        bins,
        np.maximum(low[span], edges[bins]),
        np.minimum(high[span], edges[bins + 1]),
    )


def overlap_s(from_s: FloatArray, until_s: FloatArray, edges_s: FloatArray) -> FloatArray:
    """Returns how long (s) each span lasts within each interval, one row a span."""
    low = np.maximum(from_s[:, None], edges_s[None, :-1])
    high = np.minimum(until_s[:, None], edges_s[None, 1:])
    overlap: FloatArray = np.maximum(0.0, high - low)
    return overlap


def ratio(
    above: FloatArray | IntArray, below: FloatArray | IntArray, where_none: float = np.nan
) -> FloatArray:
    """Returns quotients; ``where_none`` where the divisor is 0."""
    found = np.full(np.shape(above), where_none)
    np.divide(above, below, out=found, where=np.asarray(below) > 0.0)
    return found
