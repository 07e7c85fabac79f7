"""How well simulated detectors agree with measured ones."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from coramp._kernel import FloatArray
from coramp.calibration.moments import onset_s
from coramp.calibration.series import Series, capacity_veh_h
from coramp.calibration.site import Site

GOOD_GEH = 5.0


@dataclass(frozen=True)
class Fit:
    """Agreement over detectors and intervals of 5 min, means over runs.

    ``geh`` is the mean of GEH, ``good_geh_share`` the share below 5, ``speed_rmse_mps`` the root of
    the mean squared difference of speeds. Times (s) and flows (veh/h) come in pairs, measured and
    simulated; None where there is no breakdown. ``broke_down`` is in how many of ``runs``.
    """

    geh: float
    good_geh_share: float
    speed_rmse_mps: float
    breakdown_s: tuple[float | None, float | None]
    capacity_veh_h: tuple[float | None, float | None]
    broke_down: int
    runs: int


def geh(simulated_veh_h: FloatArray, measured_veh_h: FloatArray) -> FloatArray:
    """Returns GEH of flows (veh/h): the root of 2 (m - c)^2 / (m + c), 0 where both are 0."""
    both = simulated_veh_h + measured_veh_h
    square = 2.0 * (simulated_veh_h - measured_veh_h) ** 2
    return np.sqrt(np.divide(square, both, out=np.zeros_like(both), where=both > 0.0))


def fit_of(simulated: Sequence[Series], measured: Series, site: Site, free_mps: float) -> Fit:
    """Returns how runs of one population agree with what was measured."""
    detectors = [loop.id for loop in site.loops]
    coarse = measured.coarse()
    flows, speeds = [], []
    for run in simulated:
        own = run.coarse()
        for name in detectors:
            flows.append(geh(own.flow_veh_h(name), coarse.flow_veh_h(name)))
            speeds.append(own.speed_mps[name] - coarse.speed_mps[name])
    found, off = np.concatenate(flows), np.concatenate(speeds)
    onsets = [onset_s(run, site, free_mps) for run in simulated]
    onsets = [onset for onset in onsets if onset < measured.end_s]
    ends = site.upstream.id, site.downstream.id
    capacities = [capacity_veh_h(run, *ends, free_mps) for run in simulated]
    told = [capacity for capacity in capacities if capacity is not None]
    measured_onset_s = onset_s(measured, site, free_mps)
    return Fit(
        float(found.mean()),
        float((found < GOOD_GEH).mean()),
        float(np.sqrt(np.nanmean(off**2))),
        (
            measured_onset_s if measured_onset_s < measured.end_s else None,
            float(np.mean(onsets)) if onsets else None,
        ),
        (
            capacity_veh_h(measured, *ends, free_mps),
            float(np.mean(told)) if told else None,
        ),
        len(onsets),
        len(simulated),
    )
