"""Desired speeds: those with which free traffic is simulated as it was measured."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from coramp._kernel import BoolArray, FloatArray
from coramp.calibration.effort import Effort
from coramp.calibration.free_speed import FreeSpeed, free_speed
from coramp.calibration.models import speed_factor
from coramp.calibration.replayed import Replayed, driven_again
from coramp.calibration.search import Axis, Round, Wanted, search
from coramp.calibration.series import Series, queued
from coramp.calibration.site import Site
from coramp.errors import CorampError
from coramp.metrics.queues import LOOP_M, QUEUE_SPEED
from coramp.scenarios.demand_sections import Detector
from coramp.scenarios.model import Scenario
from coramp.scenarios.sections import DriverPopulation

FREE_S = 3600.0
"""How much of the data before a breakdown is driven again for desired speeds."""
FREE_SHARE = 0.85
LEAST_VEHICLES, ENOUGH_VEHICLES = 50, 100
"""If desired speeds differ by 7 %, the mean of 50 drivers has a standard error of 1 %."""
USUAL_DEVIATION, DEVIATIONS = 0.07, (0.002, 0.15)
"""Spread of desired speeds over v0: that of ``credible``, which is near by if the data does not
tell, and in which range it is looked for."""
AROUND, NEAR = (0.97, 1.2), (0.92, 1.12)
"""The range of the mean of desired speeds, over that of measured speeds, and over one found."""
MEAN, DEVIATION = "mean of desired speeds", "deviation of desired speeds"
FEW = 10
"""The mean speed of fewer vehicles may be that of fast ones by chance."""
LEAST_NOISE = (0.02, 0.02, 0.05)


@dataclass(frozen=True)
class FreeTraffic:
    """Traffic before a breakdown: what detectors told while it was free, to be driven again.

    ``little`` and ``more`` are intervals of ``replayed`` without a queue, those of lower and those
    of higher flows; at ``detectors`` speeds count.
    """

    told: FreeSpeed
    replayed: Replayed
    little: BoolArray
    more: BoolArray
    detectors: tuple[str, ...]

    def fitted(self, drivers: DriverPopulation, effort: Effort) -> DriverPopulation:
        """Returns drivers whose simulated free speeds are nearest to those measured.

        On one lane nobody overtakes: measured speeds are lower than desired ones, the more so the
        denser traffic is and the more desired speeds differ, and they differ by platoons. So mean
        and spread of desired speeds are looked for together.
        """
        v0 = self.replayed.scenario.mainline.speed_mps
        axes = speed_axes(self.told.mean_mps / v0, AROUND)
        made = 0

        def simulate(places: FloatArray) -> FloatArray:
            nonlocal made
            runs = []
            for place in places.tolist():
                seed = 1 + made % effort.seeds
                runs.append((self.replayed, at_place(drivers, axes, place), seed))
                made += 1
            return np.array([self._numbers(run) for run in driven_again(runs, effort)])

        count = effort.speed_runs
        rounds = (Round(count, 0.5, 1.0), Round(count, 0.25, 0.3))
        measured = Wanted(self._numbers(self.replayed.measured))
        place, _, _ = search(axes, rounds, simulate, measured, np.array(LEAST_NOISE))
        return at_place(drivers, axes, place.tolist())

    def _numbers(self, series: Series) -> FloatArray:
        """Mean speeds (m/s) with little and with more traffic, and the logarithm of the spread."""
        low, high, both = (
            free_speed(series, self.detectors, when)
            for when in (self.little, self.more, self.little | self.more)
        )
        spread = np.nan if not both.deviation_mps else np.log(both.deviation_mps)
        return np.array([low.mean_mps, high.mean_mps, spread])


def speed_axes(factor: float, around: tuple[float, float]) -> tuple[Axis, Axis]:
    """Returns mean and spread of desired speeds over v0 as axes, the mean ``around`` a factor."""
    low, high = around
    return (
        Axis(MEAN, factor * low, factor * high),
        Axis(DEVIATION, *DEVIATIONS, usual=USUAL_DEVIATION),
    )


def at_place(
    drivers: DriverPopulation, axes: Sequence[Axis], place: Sequence[float]
) -> DriverPopulation:
    """Returns drivers with the parameters of a place in the unit cube; others are kept."""
    values = {axis.name: axis.value(share) for axis, share in zip(axes, place, strict=True)}
    factor = speed_factor(values.pop(MEAN), values.pop(DEVIATION))
    return drivers.model_copy(update={**values, "speed_factor": factor})


def free_traffic(
    scenario: Scenario, site: Site, data: Series, onset_s: float, rough_mps: tuple[float, float]
) -> FreeTraffic:
    """Returns the traffic before a queue began, or all where none did.

    Where few vehicles come in light traffic, those in dense traffic count as well. ``rough_mps``
    are rough free speeds on mainline and ramp.
    """
    names = tuple(loop.id for loop in speed_loops(site, scenario.mainline.start_m))
    before = data.between(onset_s - FREE_S, onset_s)
    free = free_intervals(before, site, rough_mps[0], onset_s < data.end_s)
    if free_speed(before, names, free).vehicles < ENOUGH_VEHICLES:
        free = ~queued(before, site.upstream.id, rough_mps[0])
    flows = before.vehicles[site.mainline_entry.id]
    little = free & (flows <= np.median(flows[free])) if free.any() else free
    told = free_speed(before, names, free)
    replayed = Replayed(scenario, site, before, (told.mean_mps, rough_mps[1]))
    return FreeTraffic(told, replayed, little, free & ~little, names)


def free_intervals(series: Series, site: Site, free_mps: float, broke: bool) -> BoolArray:
    """Returns which intervals are free: without a queue upstream, and without much traffic.

    Much is more than 85 % of the highest flow of 5 min that leaves, or than the median where that
    is more, if traffic ``broke`` down at the series' end; else the road could carry more.
    """
    coarse = series.coarse()
    flows = coarse.flow_veh_h(site.downstream.id)
    most = np.inf
    if broke and len(flows):
        most = max(FREE_SHARE * float(flows.max()), float(np.median(flows)))
    little = np.repeat(flows <= most, round(coarse.interval_s / series.interval_s))
    free = np.zeros(series.intervals, np.bool_)
    free[: len(little)] = little
    return free & ~queued(series, site.upstream.id, free_mps)


def rough_free_mps(data: Series, detector: str) -> float:
    """Returns a free speed to tell queues by: the median of the intervals that have none.

    That are those at least 75 % as fast as the fastest 5 min, however long queues stand in the
    data; 5 min of few vehicles count only where there are no others. Raises CorampError where the
    detector has no speeds.
    """
    speeds, coarse = data.speed_mps[detector], data.coarse()
    if np.isnan(speeds).all():
        raise CorampError(f"detector {detector}: has no speeds; calibration needs them")
    means = coarse.speed_mps[detector]
    many = (coarse.vehicles[detector] >= FEW) & ~np.isnan(means)
    known = means[many] if many.any() else speeds[~np.isnan(speeds)]
    return float(np.median(speeds[speeds >= QUEUE_SPEED * known.max()]))


def speed_loops(site: Site, start_m: float) -> list[Detector]:
    """Returns the mainline's detectors before the nose at which drivers go as they wish.

    Who has just entered may still be speeding up: of detectors within half the way to the loop at
    which queues are seen, the furthest counts alone, and only where there is no other.
    """
    before = [loop for loop in site.loops if loop.road == "mainline" and loop.station_m <= 0.0]
    least_m = 0.5 * (start_m + max(LOOP_M, 0.5 * start_m))
    settled = [loop for loop in before if loop.station_m >= least_m]
    return settled or [max(before, key=lambda loop: loop.station_m)]
