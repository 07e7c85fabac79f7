"""The measured demand again, with other drivers: what detectors would have told."""

import math
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cached_property

from coramp.calibration.demand import saturated
from coramp.calibration.effort import Effort
from coramp.calibration.series import Series, queued, series_of
from coramp.calibration.site import Site
from coramp.scenarios.demand_sections import DemandPart, Detector
from coramp.scenarios.model import Scenario
from coramp.scenarios.sections import DriverPopulation
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

        As many arrive in each interval as were counted where they enter; who arrives when in it
        depends on the seed alone. Raises CorampError where SUMO fails.
        """
        ahead_s = self._ahead_s
        end_s = ahead_s + self.measured.intervals * self.measured.interval_s
        found = series_of(detected(self.driven, drivers, seed)).between(ahead_s, end_s)
        return Series(
            self.measured.begin_s, self.measured.interval_s, found.vehicles, found.speed_mps
        )

    @property
    def _ahead_s(self) -> float:
        """How long before the measured series runs begin, so that the first vehicles get there."""
        ways_s = [
            (loop.station_m - getattr(self.scenario, loop.road).start_m) / free_mps
            for loop, free_mps in self._entries
        ]
        interval_s = self.measured.interval_s
        return float(interval_s * math.ceil(max(ways_s) / interval_s))

    @property
    def _entries(self) -> list[tuple[Detector, float]]:
        """The detectors that count who comes, and the free speeds (m/s) there."""
        entries = self.site.mainline_entry, self.site.ramp_entry
        return list(zip(entries, self.free_mps, strict=True))

    @cached_property
    def driven(self) -> Scenario:
        """The scenario with the measured demand and the detectors of the site."""
        interval_s, ahead_s = self.measured.interval_s, self._ahead_s
        demand = []
        for loop, free_mps in self._entries:
            slow = queued(self.measured, loop.id, free_mps)
            counts = saturated(self.measured.vehicles[loop.id], slow)
            demand += [
                DemandPart(
                    route=loop.road,
                    begin_s=ahead_s + k * interval_s,
                    end_s=ahead_s + (k + 1) * interval_s,
                    vehicles=int(count),
                    station_m=loop.station_m,
                )
                for k, count in enumerate(counts.tolist())
            ]
        loops = tuple(loop.model_copy(update={"period_s": interval_s}) for loop in self.site.loops)
        horizon_s = ahead_s + self.measured.intervals * interval_s
        simulation = self.scenario.simulation.model_copy(update={"horizon_s": horizon_s})
        changed = {"demand": tuple(demand), "detector": loops, "simulation": simulation}
        return self.scenario.model_copy(update={**changed, "arrivals": ()})


def driven_again(
    runs: Sequence[tuple[Replayed, DriverPopulation, int]], effort: Effort
) -> list[Series]:
    """Returns the series of replays by candidates, each with a seed, several at a time."""
    for replayed, drivers, _ in runs:
        build_network(replayed.driven, drivers)

    def one(run: tuple[Replayed, DriverPopulation, int]) -> Series:
        replayed, drivers, seed = run
        found = replayed.series(drivers, seed)
        effort.counter.one_more()
        return found

    with ThreadPoolExecutor(effort.jobs) as pool:
        return list(pool.map(one, runs))
