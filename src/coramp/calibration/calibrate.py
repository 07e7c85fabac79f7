"""Fits a population of drivers to what detectors at a merge told."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from coramp._kernel import FloatArray
from coramp.calibration.fit import Fit, fit_of
from coramp.calibration.desired_speeds import free_traffic, rough_free_mps
from coramp.calibration.free_speed import FreeSpeed
from coramp.calibration.models import AXES, speed_factor, usual_population
from coramp.calibration.moments import moments_of, names_of_moments, onset_s
from coramp.calibration.replayed import Replayed
from coramp.calibration.search import Axis, Round, search
from coramp.calibration.series import Series, breakdown_of
from coramp.calibration.site import Site
from coramp.errors import CorampError
from coramp.scenarios.model import Scenario
from coramp.scenarios.sections import DriverPopulation

BEFORE_S, AFTER_S = 1800.0, 1200.0
"""How much of the data before and after a breakdown is driven again by candidates."""
QUANTILE = 0.8
"""A fifth of the intervals upstream are faster than about free."""
LEAST_BEFORE_S = 600.0
LEAST_VEHICLES = 100
"""With fewer vehicles the mean of their speeds is off by 1 % or more."""
USUAL_DEVIATION = 0.07
"""Spread of wishes over their mean where the data does not tell it: that of ``credible``."""
ROUNDS = ((2, 0.5, 0.3), (1, 0.25, 0.2), (1, 0.12, 0.1))
"""Quarters of the runs, half width and reach of each round."""
LEAST_NOISE = {"(s)": 60.0, "(veh/h)": 8.0, "(m/s)": 0.04, "discharge": 0.01}
"""Least noise of the numbers that the search compares, by what their names end in."""


@dataclass(frozen=True)
class Effort:
    """How much is simulated: ``runs`` of the search, through ``seeds`` by turns, ``jobs`` at once.

    ``speed_runs`` look at desired speeds each of three times, ``fit_runs`` at the fit of what was
    found. ``report`` is told after each run how many of how many are done.
    """

    runs: int = 96
    seeds: int = 16
    jobs: int = 2
    speed_runs: int = 4
    fit_runs: int = 8
    report: Callable[[int, int], None] = lambda _done, _total: None

    def told_to(self, report: Callable[[int, int], None]) -> "Effort":
        """Returns the same, told to somebody else."""
        return replace(self, report=report)

    @property
    def total(self) -> int:
        """How many runs a calibration takes."""
        return self.runs + 3 * self.speed_runs + self.fit_runs


@dataclass(frozen=True)
class Calibrated:
    """A population fitted to data; ``fit`` is None where the data shows no breakdown.

    ``notes`` say what the data does not tell.
    """

    drivers: DriverPopulation
    free: FreeSpeed
    fit: Fit | None
    notes: tuple[str, ...]


class Counter:
    """Counts runs, and tells of each."""

    def __init__(self, effort: Effort) -> None:
        self._effort, self._done = effort, 0

    def __call__(self) -> None:
        """One more run is done."""
        self._done += 1
        self._effort.report(self._done, self._effort.total)


def calibrate_series(
    scenario: Scenario, site: Site, data: Series, model: str, effort: Effort
) -> Calibrated:
    """Returns the population of a model that fits data of detectors best.

    Desired speeds come first, from free traffic; then all that shows in how the merge breaks down;
    then desired speeds once more. Raises CorampError where data is too little for the first.
    """
    rough_mps = rough_free_mps(data, site.upstream.id, QUANTILE)
    onset = onset_s(data, site, rough_mps)
    ramp_mps = rough_free_mps(data.between(data.begin_s, onset), site.ramp_entry.id, 0.5)
    free = free_traffic(scenario, site, data, onset, (rough_mps, ramp_mps))
    if free.told.vehicles < LEAST_VEHICLES:
        raise CorampError(
            f"free speed: only {free.told.vehicles} vehicles passed while traffic was free; "
            f"calibration needs {LEAST_VEHICLES}"
        )
    v0 = scenario.mainline.speed_mps
    told, notes = free.told, [*_notes(data, site, rough_mps, onset)]
    broke = not notes
    deviation = USUAL_DEVIATION if told.deviation_mps is None else told.deviation_mps / v0
    if told.deviation_mps is None:
        notes.append(
            f"the spread of desired speeds is not told by {told.intervals} intervals; "
            f"it is taken to be {100 * USUAL_DEVIATION:g} %"
        )
    drivers = usual_population(model, speed_factor(told.mean_mps / v0, deviation))
    done = Counter(effort)
    for _ in range(2):
        drivers = free.matched(drivers, effort.speed_runs, effort.jobs, done)
    if not broke:
        return Calibrated(drivers, told, None, tuple(notes))
    window = data.between(onset - BEFORE_S, onset + AFTER_S)
    replayed = Replayed(scenario, site, window, (told.mean_mps, ramp_mps))
    drivers = _searched(replayed, drivers, AXES[model], effort, done)
    drivers = free.matched(drivers, effort.speed_runs, effort.jobs, done, with_spread=False)
    fitted = replayed.many([(drivers, 1 + k) for k in range(effort.fit_runs)], effort.jobs, done)
    fit = fit_of(fitted, window, site, told.mean_mps)
    return Calibrated(drivers, told, fit, tuple(notes))


def _notes(data: Series, site: Site, free_mps: float, onset: float) -> Iterator[str]:
    """What keeps the data from telling a capacity; nothing where it tells one."""
    if breakdown_of(data.coarse(), site.upstream.id, free_mps) is None:
        yield (
            f"capacity is not identified: detector {site.upstream.id} shows no breakdown (15 min "
            "at least 25 % below free speed); only desired speeds are fitted"
        )
    elif onset - data.begin_s < LEAST_BEFORE_S:
        yield (
            f"capacity is not identified: the breakdown begins {onset - data.begin_s:g} s after "
            f"the data, allowed is from {LEAST_BEFORE_S:g} s on; only desired speeds are fitted"
        )


def _searched(
    replayed: Replayed,
    drivers: DriverPopulation,
    axes: Sequence[Axis],
    effort: Effort,
    done: Counter,
) -> DriverPopulation:
    """Returns drivers with parameters along the axes at which runs are nearest to the data."""
    site, free_mps = replayed.site, replayed.free_mps[0]
    made = 0

    def at(place: FloatArray) -> DriverPopulation:
        shares = zip(axes, place.tolist(), strict=True)
        values = {axis.name: axis.value(share) for axis, share in shares}
        return drivers.model_copy(update=values)

    def simulate(places: FloatArray) -> FloatArray:
        nonlocal made
        seeds = [1 + (made + k) % effort.seeds for k in range(len(places))]
        made += len(places)
        candidates = [(at(place), seed) for place, seed in zip(places, seeds, strict=True)]
        runs = replayed.many(candidates, effort.jobs, done)
        return np.array([moments_of(run, site, free_mps) for run in runs])

    floor = [LEAST_NOISE[name.rsplit(" ", 1)[-1]] for name in names_of_moments(site)]
    rounds = [Round(quarters * effort.runs // 4, *rest) for quarters, *rest in ROUNDS]
    place, _, _ = search(
        axes,
        rounds,
        simulate,
        moments_of(replayed.measured, site, free_mps),
        np.array(floor),
    )
    return at(place)
