"""Fits a population of drivers to what detectors at a merge told."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from coramp._kernel import FloatArray
from coramp.calibration.breakdowns import LEAST_BEFORE_S, windows_of
from coramp.calibration.desired_speeds import (
    LEAST_VEHICLES,
    NEAR,
    USUAL_DEVIATION,
    at_place,
    free_traffic,
    rough_free_mps,
    speed_axes,
)
from coramp.calibration.effort import Effort
from coramp.calibration.fit import Fit, fit_of
from coramp.calibration.free_speed import FreeSpeed
from coramp.calibration.models import AXES, speed_factor, usual_population
from coramp.calibration.moments import Free, free_halves, moments_of, names_of_moments, onset_s
from coramp.calibration.replayed import Replayed, driven_again
from coramp.calibration.search import Axis, Wanted, rounds_of, search
from coramp.calibration.series import Series, breakdown_of
from coramp.calibration.site import Site
from coramp.errors import CorampError
from coramp.scenarios.model import Scenario
from coramp.scenarios.sections import DriverPopulation

ROUNDS = (
    (0.37, 0.5, 0.3),
    (0.21, 0.3, 0.25),
    (0.16, 0.22, 0.2),
    (0.13, 0.17, 0.17),
    (0.13, 0.13, 0.15),
)
"""Share of the runs, half width and reach of each round: each comes nearer."""
LEAST_NOISE = {"(s)": 60.0, "(veh/h)": 8.0, "(m/s)": 0.04, "discharge": 0.01, "spread": 0.05}
"""Least noise of the numbers that the search compares, by what their names end in."""


@dataclass(frozen=True)
class Calibrated:
    """A population fitted to data; ``fit`` is None where the data shows no breakdown.

    ``notes`` say what the data does not tell.
    """

    drivers: DriverPopulation
    free: FreeSpeed
    fit: Fit | None
    notes: tuple[str, ...]


def calibrate_series(
    scenario: Scenario, site: Site, data: Series, model: str, effort: Effort
) -> Calibrated:
    """Returns the population of a model that fits data of detectors best.

    Desired speeds of usual drivers come first, from free traffic; then all parameters together,
    from free traffic and from how the merge breaks down: where nobody is alone, speeds depend on
    desired ones as much as on how drivers follow. Raises CorampError where data is too little for
    the first.
    """
    rough_mps = rough_free_mps(data, site.upstream.id)
    onset = onset_s(data, site, rough_mps)
    if onset <= data.begin_s:
        raise CorampError(
            f"detector {site.upstream.id}: stands in a queue when the data begins; allowed is data "
            "that begins with free traffic"
        )
    ramp_mps = rough_free_mps(data.between(data.begin_s, onset), site.ramp_entry.id)
    free = free_traffic(scenario, site, data, onset, (rough_mps, ramp_mps))
    if free.told.vehicles < LEAST_VEHICLES:
        raise CorampError(
            f"free speed: only {free.told.vehicles} vehicles passed while traffic was free; "
            f"calibration needs {LEAST_VEHICLES}"
        )
    windows = windows_of(data, site, free.told.mean_mps)
    told, notes = free.told, [] if windows else [_unidentified(data, site, rough_mps, onset)]
    if told.deviation_mps is None:
        notes.append(
            f"the spread of desired speeds is not told by {told.intervals} intervals; "
            f"it is taken to be about {100 * USUAL_DEVIATION:g} %"
        )
    usual = speed_factor(told.mean_mps / scenario.mainline.speed_mps, USUAL_DEVIATION)
    drivers = free.fitted(usual_population(model, usual), effort)
    if not windows:
        return Calibrated(drivers, told, None, tuple(notes))
    replays = [Replayed(scenario, site, w, (told.mean_mps, ramp_mps)) for w in windows]
    factor = drivers.speed_factor or usual
    drivers = _searched(replays, drivers, (*AXES[model], *speed_axes(factor.mean, NEAR)), effort)
    turns = [replays[k % len(replays)] for k in range(effort.fit_runs)]
    made = driven_again([(turn, drivers, 1 + k) for k, turn in enumerate(turns)], effort)
    measured = [turn.measured for turn in turns]
    fit = fit_of(list(zip(made, measured, strict=True)), site, told.mean_mps)
    return Calibrated(drivers, told, fit, tuple(notes))


def _unidentified(data: Series, site: Site, free_mps: float, onset: float) -> str:
    """What keeps the data from telling a capacity."""
    if breakdown_of(data.coarse(), site.upstream.id, free_mps) is None:
        return (
            f"capacity is not identified: detector {site.upstream.id} shows no breakdown (15 min "
            "at least 25 % below free speed); only desired speeds are fitted"
        )
    return (
        f"capacity is not identified: the breakdown begins {onset - data.begin_s:g} s after the "
        f"data, allowed is from {LEAST_BEFORE_S:g} s on; only desired speeds are fitted"
    )


@dataclass(frozen=True)
class _Breakdown:
    """A measured breakdown that is driven again, and its intervals of free traffic."""

    replayed: Replayed
    free: Free

    def off(self, run: Series) -> FloatArray:
        """Returns by how much a run's numbers are more than those measured."""
        return self._numbers(run) - self._numbers(self.replayed.measured)

    def _numbers(self, series: Series) -> FloatArray:
        return moments_of(series, self.replayed.site, self.replayed.free_mps[0], self.free)


def _searched(
    replays: Sequence[Replayed],
    drivers: DriverPopulation,
    axes: Sequence[Axis],
    effort: Effort,
) -> DriverPopulation:
    """Returns drivers with parameters along the axes at which runs are nearest to the data.

    Runs go through the breakdowns by turns; what counts is how far they are off the measured one.
    """
    site, free_mps = replays[0].site, replays[0].free_mps[0]
    breakdowns = [_Breakdown(one, free_halves(one.measured, site, free_mps)) for one in replays]
    made = 0

    def simulate(places: FloatArray) -> FloatArray:
        nonlocal made
        turns = [divmod(made + k, len(breakdowns)) for k in range(len(places))]
        made += len(places)
        runs = [
            (replays[turn], at_place(drivers, axes, place), 1 + number % effort.seeds)
            for (number, turn), place in zip(turns, places.tolist(), strict=True)
        ]
        found = zip(turns, driven_again(runs, effort), strict=True)
        return np.array([breakdowns[turn].off(run) for (_, turn), run in found])

    floor = [LEAST_NOISE[name.rsplit(" ", 1)[-1]] for name in names_of_moments(site)]
    place, _, _ = search(
        axes,
        rounds_of(effort.runs, ROUNDS),
        simulate,
        Wanted(np.zeros(len(floor)), len(replays)),
        np.array(floor),
    )
    return at_place(drivers, axes, place.tolist())
