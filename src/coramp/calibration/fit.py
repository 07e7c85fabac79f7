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
    simulated, means over breakdowns and runs; None where there is no breakdown. ``broke_down`` is
    in how many of ``runs``.
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


def fit_of(runs: Sequence[tuple[Series, Series]], site: Site, free_mps: float) -> Fit:
    """Returns how runs of one population agree with what was measured: pairs of the two."""
    flows, speeds = [], []
    for simulated, measured in runs:
        own, other = simulated.coarse(), measured.coarse()
        for loop in site.loops:
            flows.append(geh(own.flow_veh_h(loop.id), other.flow_veh_h(loop.id)))
            speeds.append(own.speed_mps[loop.id] - other.speed_mps[loop.id])
    found, off = np.concatenate(flows), np.concatenate(speeds)
    onsets_s = [[_onset_s(one, site, free_mps) for one in pair] for pair in zip(*runs, strict=True)]
    ends = site.upstream.id, site.downstream.id
    capacities = [
        [capacity_veh_h(one, *ends, free_mps) for one in pair] for pair in zip(*runs, strict=True)
    ]
    return Fit(
        float(found.mean()),
        float((found < GOOD_GEH).mean()),
        float(np.sqrt(np.nanmean(off**2))),
        (_mean(onsets_s[1]), _mean(onsets_s[0])),
        (_mean(capacities[1]), _mean(capacities[0])),
        sum(onset is not None for onset in onsets_s[0]),
        len(runs),
    )


def _onset_s(series: Series, site: Site, free_mps: float) -> float | None:
    onset = onset_s(series, site, free_mps)
    return onset if onset < series.end_s else None


def _mean(values: Sequence[float | None]) -> float | None:
    """The mean of those that are known, None for none."""
    known = [value for value in values if value is not None]
    return float(np.mean(known)) if known else None
