"""A stretch of detector data in a few numbers, in which a population of drivers shows."""

from typing import NamedTuple

import numpy as np

from coramp._kernel import BoolArray, FloatArray
from coramp.calibration.free_speed import free_speed
from coramp.calibration.series import Series, breakdown_of, queued
from coramp.calibration.site import Site

LONGER_S = 600.0
"""Flows over 5 min are off by chance more than those over so long."""
OBJECTIVE = (
    "sum of squares of measured minus simulated over the simulation's noise: breakdown time, "
    "highest 5-minute and 10-minute flow before, flow that comes in the 10 minutes before, "
    "discharge and the ramp's share of it; at each detector but the first of each road mean speed "
    "with little and with more free traffic, spread of free speeds, and mean speed in the queue"
)


class Free(NamedTuple):
    """Intervals of free traffic before a breakdown: those of lower, and those of higher flows."""

    little: BoolArray
    more: BoolArray


def free_halves(measured: Series, site: Site, free_mps: float) -> Free:
    """Returns the measured intervals before a breakdown in which traffic was free, by flow."""
    free = ~queued(measured, site.upstream.id, free_mps)
    onset = onset_s(measured, site, free_mps)
    free[round((onset - measured.begin_s) / measured.interval_s) :] = False
    flows = measured.vehicles[site.mainline_entry.id]
    little = free & (flows <= np.median(flows[free])) if free.any() else free
    return Free(little, free & ~little)


def names_of_moments(site: Site) -> list[str]:
    """Returns what each number of ``moments_of`` is."""
    return [
        "breakdown time (s)",
        "highest flow before (veh/h)",
        "highest flow of 10 min before (veh/h)",
        "flow that comes in the 10 min before (veh/h)",
        "discharge (veh/h)",
        "ramp's share of the discharge",
        *(f"speed at {loop.id} with little traffic (m/s)" for loop in site.settled),
        *(f"speed at {loop.id} with more traffic (m/s)" for loop in site.settled),
        *(f"at {loop.id}: logarithm of the spread" for loop in site.settled),
        *(f"speed at {loop.id} after (m/s)" for loop in site.settled),
    ]


def moments_of(series: Series, site: Site, free_mps: float, free: Free) -> FloatArray:
    """Returns numbers of what detectors told, nan for each that it does not tell.

    When the merge broke down, the end where it did not; the highest flow of 5 min before, that of
    any 10 min before, and the flow that came to the merge in the last 10 min before; the mean flow
    from the first full interval of the queue on, and the share of it that came by the ramp. Then at
    each detector but the first of each road: mean speeds in the intervals that are ``free`` and the
    logarithm of their spread among drivers (m/s), without intervals in which the series has a
    queue; and the mean speed from the breakdown on.
    """
    coarse = series.coarse()
    start = breakdown_of(coarse, site.upstream.id, free_mps)
    flow_veh_h = coarse.flow_veh_h(site.downstream.id)
    before = np.ones(coarse.intervals, np.bool_)
    if start is not None:
        before[start:] = False
    after = queued(coarse, site.upstream.id, free_mps) & ~before
    if start is not None:
        after[start] = False
    ramp = coarse.vehicles[site.ramp_entry.id]
    both = ramp + coarse.vehicles[site.mainline_entry.id]
    onset = onset_s(series, site, free_mps)
    return np.array(
        [
            onset,
            flow_veh_h[before].max() if before.any() else np.nan,
            *_flows_before(series.between(series.begin_s, onset), site),
            flow_veh_h[after].mean() if after.any() else np.nan,
            ramp[after].sum() / both[after].sum() if after.any() and both[after].sum() else np.nan,
            *_free_speeds(series, site, free_mps, free),
            *(_speed_mps(coarse, loop.id, after) for loop in site.settled),
        ]
    )


def _free_speeds(series: Series, site: Site, free_mps: float, free: Free) -> list[float]:
    """Mean speeds with little and with more traffic, and logarithms of the spread, by detector."""
    flowing = ~queued(series, site.upstream.id, free_mps)
    parts = free.little, free.more, free.little | free.more
    low, high, both = (
        [free_speed(series, (loop.id,), part & flowing) for loop in site.settled] for part in parts
    )
    spreads = [np.log(one.deviation_mps) if one.deviation_mps else np.nan for one in both]
    return [*(one.mean_mps for one in (*low, *high)), *spreads]


def _flows_before(series: Series, site: Site) -> tuple[float, float]:
    """The highest flow of 10 min that left, and that of the last 10 min that came (veh/h)."""
    together = max(1, round(LONGER_S / series.interval_s))
    if series.intervals < together:
        return np.nan, np.nan
    left = series.flow_veh_h(site.downstream.id)
    came = series.flow_veh_h(site.upstream.id) + series.flow_veh_h(site.ramp_entry.id)
    means = np.convolve(left, np.full(together, 1.0 / together), "valid")
    return float(means.max()), float(came[-together:].mean())


def onset_s(series: Series, site: Site, free_mps: float) -> float:
    """Returns when the queue of a breakdown began, in the data's own intervals; the end for none.

    That is the end of the last interval without a queue in the breakdown's first 5 min or the 5 min
    before.
    """
    coarse = series.coarse()
    start = breakdown_of(coarse, site.upstream.id, free_mps)
    if start is None:
        return series.end_s
    parts = round(coarse.interval_s / series.interval_s)
    first, last = max(0, (start - 1) * parts), (start + 1) * parts
    free = np.flatnonzero(~queued(series, site.upstream.id, free_mps)[first:last])
    begin = first + int(free[-1]) + 1 if len(free) else first
    return series.begin_s + begin * series.interval_s


def _speed_mps(series: Series, detector: str, when: BoolArray) -> float:
    counts, speeds = series.vehicles[detector][when], series.speed_mps[detector][when]
    known = ~np.isnan(speeds)
    total = counts[known].sum()
    return float((counts[known] * speeds[known]).sum() / total) if total else float("nan")
