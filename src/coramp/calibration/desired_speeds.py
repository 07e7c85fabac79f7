"""Desired speeds: those with which free traffic is simulated as it was measured."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from coramp._kernel import BoolArray
from coramp.calibration.free_speed import FreeSpeed, free_intervals, free_speed
from coramp.calibration.models import speed_factor
from coramp.calibration.replayed import Replayed
from coramp.calibration.series import Series
from coramp.calibration.site import Site
from coramp.errors import CorampError
from coramp.metrics.queues import LOOP_M
from coramp.scenarios.demand_sections import Detector
from coramp.scenarios.model import Scenario
from coramp.scenarios.sections import DriverPopulation

FREE_S = 3600.0
"""How much of the data before a breakdown is driven again for desired speeds."""
LEAST_RATIO, MOST_RATIO = 0.25, 2.0
"""By how much at most the spread of desired speeds is moved at a time."""


@dataclass(frozen=True)
class FreeTraffic:
    """Traffic before a breakdown: what detectors told while it was free, to be driven again.

    ``when`` says which intervals of ``replayed`` are free, ``detectors`` at which speeds count.
    """

    told: FreeSpeed
    replayed: Replayed
    when: BoolArray
    detectors: tuple[str, ...]

    def matched(
        self,
        drivers: DriverPopulation,
        runs: int,
        jobs: int,
        done: Callable[[], None],
        with_spread: bool = True,
    ) -> DriverPopulation:
        """Returns drivers whose simulated free speeds are nearer to those measured.

        On one lane nobody overtakes, and so measured speeds are lower than desired ones, and differ
        by platoons. The simulation shows by how much: desired speeds are moved by what it is off.
        """
        wanted = free_speed(self.replayed.measured, self.detectors, self.when)
        made = self.replayed.many([(drivers, 1 + k) for k in range(runs)], jobs, done)
        found = [free_speed(run, self.detectors, self.when) for run in made]
        factor = drivers.speed_factor or speed_factor(1.0, 0.0)
        mean = factor.mean * wanted.mean_mps / float(np.mean([one.mean_mps for one in found]))
        deviation = factor.deviation
        spreads = [one.deviation_mps for one in found if one.deviation_mps is not None]
        if with_spread and wanted.deviation_mps is not None and spreads:
            ratio = wanted.deviation_mps / max(1e-6, float(np.mean(spreads)))
            deviation *= min(MOST_RATIO, max(LEAST_RATIO, ratio))
        return drivers.model_copy(update={"speed_factor": speed_factor(mean, deviation)})


def free_traffic(
    scenario: Scenario, site: Site, data: Series, onset_s: float, rough_mps: tuple[float, float]
) -> FreeTraffic:
    """Returns the traffic before a queue began, or all where none did.

    ``rough_mps`` are rough free speeds on mainline and ramp.
    """
    when = free_intervals(data, site.upstream.id, site.downstream.id, rough_mps[0], onset_s)
    names = tuple(loop.id for loop in speed_loops(site, scenario.mainline.start_m))
    told = free_speed(data, names, when)
    before = data.between(onset_s - FREE_S, onset_s)
    first = round((before.begin_s - data.begin_s) / data.interval_s)
    replayed = Replayed(scenario, site, before, (told.mean_mps, rough_mps[1]))
    return FreeTraffic(told, replayed, when[first : first + before.intervals], names)


def rough_free_mps(data: Series, detector: str, quantile: float) -> float:
    """Returns a free speed to tell queues by: a quantile of the intervals' speeds.

    Raises CorampError where the detector has no speeds.
    """
    speeds = data.speed_mps[detector]
    if np.isnan(speeds).all():
        raise CorampError(f"detector {detector}: has no speeds; calibration needs them")
    return float(np.nanquantile(speeds, quantile))


def speed_loops(site: Site, start_m: float) -> list[Detector]:
    """Returns the mainline's detectors before the nose at which drivers go as they wish.

    Who has just entered may still be speeding up: of detectors within half the way to the loop at
    which queues are seen, the furthest counts alone, and only where there is no other.
    """
    before = [loop for loop in site.loops if loop.road == "mainline" and loop.station_m <= 0.0]
    least_m = 0.5 * (start_m + max(LOOP_M, 0.5 * start_m))
    settled = [loop for loop in before if loop.station_m >= least_m]
    return settled or [max(before, key=lambda loop: loop.station_m)]
