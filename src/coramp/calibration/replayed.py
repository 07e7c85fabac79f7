"""The measured demand again, with other drivers: what detectors would have told."""

import math
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from coramp.calibration.demand import arrivals_by_counts, saturated
from coramp.calibration.effort import Effort
from coramp.calibration.series import Series, queued, series_of
from coramp.calibration.site import Site
from coramp.scenarios.demand_sections import RAMP, Detector
from coramp.scenarios.model import Scenario
from coramp.scenarios.sections import DriverPopulation, ExplicitArrival
from coramp.worlds.sumo.detected import build_network, detected


@dataclass(frozen=True)
class Replayed:
    """A measured stretch of time at a merge, to be driven again by candidates.

    ``free_mps`` are measured free speeds on mainline and ramp.
    """

    scenario: Scenario
    site: Site
    measured: Series
    free_mps: tuple[float, float]

    def series(self, drivers: DriverPopulation, seed: int) -> Series:
        """Returns what the detectors tell of candidates, in the intervals of the measured series.

        As many come in each interval as were counted; who comes when in it depends on the seed
        alone. Raises CorampError where SUMO fails.
        """
        ahead_s = self._ahead_s
        end_s = ahead_s + self.measured.intervals * self.measured.interval_s
        found = series_of(detected(self.driven(seed), drivers, seed)).between(ahead_s, end_s)
        return Series(
            self.measured.begin_s, self.measured.interval_s, found.vehicles, found.speed_mps
        )

    @property
    def _ahead_s(self) -> float:
        """How long before the measured series runs begin, so that the first vehicles get there."""
        interval_s = self.measured.interval_s
        longest_s = max(self._way_s(*entry) for entry in self._entries)
        return float(interval_s * math.ceil(longest_s / interval_s))

    def _way_s(self, loop: Detector, free_mps: float) -> float:
        """How long vehicles take from where they enter to a detector."""
        return (loop.station_m - float(getattr(self.scenario, loop.road).start_m)) / free_mps

    @property
    def _entries(self) -> list[tuple[Detector, float]]:
        """The detectors that count who comes, and the free speeds (m/s) there."""
        entries = self.site.mainline_entry, self.site.ramp_entry
        return list(zip(entries, self.free_mps, strict=True))

    def driven(self, seed: int) -> Scenario:
        """Returns the scenario with arrivals as were counted and the detectors of the site.

        Who passes the first detector of a road within an interval enters within one that is earlier
        by the way there.
        """
        interval_s = self.measured.interval_s
        arrivals: list[ExplicitArrival] = []
        for loop, free_mps in self._entries:
            slow = queued(self.measured, loop.id, free_mps)
            if loop == self.site.mainline_entry:
                # vehicles that enter behind a queue are not slow yet, but fewer than would come
                slow |= queued(self.measured, self.site.upstream.id, free_mps)
            counts = saturated(self.measured.vehicles[loop.id], slow)
            begin_s = self._ahead_s - self._way_s(loop, free_mps)
            begins_s = begin_s + interval_s * np.arange(len(counts), dtype=np.float64)
            on_ramp = loop.road == RAMP
            arrivals += arrivals_by_counts(self.scenario, on_ramp, begins_s, counts, seed)
        return self.road.model_copy(update={"arrivals": tuple(arrivals)})

    @cached_property
    def road(self) -> Scenario:
        """The scenario with the detectors of the site, as long as the measured series."""
        interval_s = self.measured.interval_s
        loops = tuple(loop.model_copy(update={"period_s": interval_s}) for loop in self.site.loops)
        horizon_s = self._ahead_s + self.measured.intervals * interval_s
        simulation = self.scenario.simulation.model_copy(update={"horizon_s": horizon_s})
        changed = {"demand": (), "detector": loops, "simulation": simulation}
        return self.scenario.model_copy(update=changed)


def driven_again(
    runs: Sequence[tuple[Replayed, DriverPopulation, int]], effort: Effort
) -> list[Series]:
    """Returns the series of replays by candidates, each with a seed, several at a time."""
    for replayed, drivers, _ in runs:
        build_network(replayed.road, drivers)

    def one(run: tuple[Replayed, DriverPopulation, int]) -> Series:
        replayed, drivers, seed = run
        found = replayed.series(drivers, seed)
        effort.counter.one_more()
        return found

    with ThreadPoolExecutor(effort.jobs) as pool:
        return list(pool.map(one, runs))
