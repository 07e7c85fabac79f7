"""The measured demand again, with other drivers: what detectors would have told."""

import math
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

from coramp.calibration.demand import arrivals_of_counts, saturated
from coramp.calibration.series import Series, queued, series_of
from coramp.calibration.site import Site
from coramp.metrics.queues import LOOP_M
from coramp.scenarios.model import Scenario
from coramp.scenarios.sections import DriverPopulation
from coramp.worlds.sumo.detected import Loop, Observed, detected
from coramp.worlds.sumo.network import driver_road_plan, network_file


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

        As many arrive in each interval as were counted where they enter; who arrives when in it
        depends on the seed alone. Raises CorampError where SUMO fails.
        """
        interval_s, site = self.measured.interval_s, self.site
        streams = (self.scenario.mainline, self.scenario.ramp)
        entries = (site.mainline_entry, site.ramp_entry)
        ways_s = [
            (loop.station_m - stream.start_m) / free_mps
            for loop, stream, free_mps in zip(entries, streams, self.free_mps, strict=True)
        ]
        ahead_s = interval_s * math.ceil(max(ways_s) / interval_s)
        counts = [
            saturated(self.measured.vehicles[loop.id], queued(self.measured, loop.id, free_mps))
            for loop, free_mps in zip(entries, self.free_mps, strict=True)
        ]
        lead_s = (ahead_s - ways_s[0], ahead_s - ways_s[1])
        arrivals = arrivals_of_counts(
            self.scenario, (counts[0], counts[1]), interval_s, lead_s, seed
        )
        end_s = ahead_s + self.measured.intervals * interval_s
        told = detected(
            self.scenario, drivers, Observed(arrivals, site.loops, interval_s, end_s), seed
        )
        found = series_of(told).between(ahead_s, end_s)
        return Series(self.measured.begin_s, interval_s, found.vehicles, found.speed_mps)

    def many(
        self,
        candidates: Sequence[tuple[DriverPopulation, int]],
        jobs: int,
        done: Callable[[], None],
    ) -> list[Series]:
        """Returns the series of many candidates with their seeds; ``jobs`` run at a time.

        ``done`` is called after each.
        """
        for drivers, _ in candidates:
            network_file(driver_road_plan(self.scenario, drivers))  # built once, before threads do

        def one(candidate: tuple[DriverPopulation, int]) -> Series:
            found = self.series(*candidate)
            done()
            return found

        with ThreadPoolExecutor(jobs) as pool:
            return list(pool.map(one, candidates))


def speed_loops(site: Site, start_m: float) -> list[Loop]:
    """Returns the mainline's detectors before the nose at which drivers go as they wish.

    Who has just entered may still be speeding up: of detectors within half the way to the loop at
    which queues are seen, the furthest counts alone, and only where there is no other.
    """
    before = [loop for loop in site.loops if loop.road == "mainline" and loop.station_m <= 0.0]
    least_m = 0.5 * (start_m + max(LOOP_M, 0.5 * start_m))
    settled = [loop for loop in before if loop.station_m >= least_m]
    return settled or [max(before, key=lambda loop: loop.station_m)]
