"""Where a noisy simulation comes nearest to what was measured, from few runs.

A run gives a few numbers, whose means over seeds change smoothly with the parameters, while each
run is off by chance. So means are learnt from all runs together: each number is a quadratic
function of the parameters, fitted to the runs near the best place so far, and what runs are off it
by is the number's noise. Nearest is where the sum of squares of the differences from what was
measured, each over its noise, is least; that is found by differential evolution on the fitted
functions, which cost nothing. New runs around that place refine them, round by round.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from coramp._kernel import BoolArray, FloatArray

RIDGE = 1e-2
"""Weight against steep functions, in units of one run's: it decides what runs leave open."""
MOST = 9.0
"""No number counts for more than three times its noise, so that none that cannot fit rules."""
USUAL_WITHIN = 0.35
"""The share of its range by which a parameter may well differ from its usual value."""
SHRUNK = 0.3
"""By how much correlations of noise are taken to be less than they seem: runs are few."""


@dataclass(frozen=True)
class Axis:
    """A parameter, the range in which it is looked for, and its usual value, None for any."""

    name: str
    low: float
    high: float
    usual: float | None = None

    @property
    def usual_share(self) -> float:
        """The share of the range at which the usual value lies, nan for any."""
        return math.nan if self.usual is None else (self.usual - self.low) / (self.high - self.low)

    def value(self, share: float) -> float:
        """Returns the value at a share of the range, to three digits."""
        return round(self.low + share * (self.high - self.low), 3)


@dataclass(frozen=True)
class Round:
    """So many runs within so much of the range, to both sides of the best place so far.

    Runs count by their distance from it: by 0.6 at ``reach`` (share of the range).
    """

    runs: int
    half_width: float
    reach: float


def rounds_of(runs: int, parts: Sequence[tuple[float, float, float]]) -> list[Round]:
    """Returns rounds from each one's share of all runs, its half width and its reach."""
    until = np.rint(runs * np.cumsum([share for share, _, _ in parts])).astype(int)
    counts = np.diff(until, prepend=0).tolist()
    return [Round(count, *rest) for count, (_, *rest) in zip(counts, parts, strict=True)]


@dataclass(frozen=True)
class Runs:
    """Runs made: places in the unit cube, one row each, and the numbers that they gave."""

    places: FloatArray
    numbers: FloatArray


@dataclass(frozen=True)
class Wanted:
    """The numbers that were measured, as means over so many ``times`` at which they were."""

    numbers: FloatArray
    times: int = 1


@dataclass(frozen=True)
class Surrogate:
    """Means of the numbers as functions of the place, good near a centre, and their noise.

    ``noise`` is its standard deviation, infinite for a number that no run told; ``correlation`` is
    that of the noise of any two.
    """

    centre: FloatArray
    coefficients: FloatArray
    noise: FloatArray
    correlation: FloatArray

    def means(self, places: FloatArray) -> FloatArray:
        """Returns the numbers' means at places, one row each."""
        return terms(places - self.centre) @ self.coefficients


def terms(offsets: FloatArray) -> FloatArray:
    """Returns 1, the offsets and the products of any two, one row for each row."""
    count = offsets.shape[1]
    first, second = np.triu_indices(count)
    one = np.ones((len(offsets), 1))
    return np.hstack([one, offsets, offsets[:, first] * offsets[:, second]])


def surrogate_of(runs: Runs, centre: FloatArray, reach: float, floor: FloatArray) -> Surrogate:
    """Returns quadratic functions fitted to runs near a centre, each number by itself.

    What a run did not tell (nan) counts for nothing. ``floor`` is the least noise of each number.
    """
    basis = terms(runs.places - centre)
    distance = np.linalg.norm(runs.places - centre, axis=1) / np.sqrt(len(centre))
    near = np.exp(-0.5 * (distance / reach) ** 2)
    coefficients = np.zeros((basis.shape[1], runs.numbers.shape[1]))
    noise = np.full(runs.numbers.shape[1], np.inf)
    residuals = np.full(runs.numbers.shape, np.nan)
    punished = np.full(basis.shape[1], RIDGE)
    punished[0] = 0.0
    for k in range(runs.numbers.shape[1]):
        known = ~np.isnan(runs.numbers[:, k])
        if near[known].sum() < 3.0:
            continue
        weight, values = near[known], runs.numbers[known, k]
        scale = max(float(np.std(values)), float(floor[k]))
        middle = float(np.average(values, weights=weight))
        left = (basis[known] * weight[:, None]).T @ basis[known] + np.diag(punished)
        right = (basis[known] * weight[:, None]).T @ ((values - middle) / scale)
        found = np.linalg.solve(left, right)
        off = (values - middle) / scale - basis[known] @ found
        spent = np.trace(np.linalg.solve(left, (basis[known] * weight[:, None]).T @ basis[known]))
        freedom = max(1.0, float(weight.sum()) - float(spent))
        coefficients[:, k] = found * scale
        coefficients[0, k] += middle
        noise[k] = max(float(floor[k]), scale * float(np.sqrt((weight * off**2).sum() / freedom)))
        residuals[known, k] = off
    return Surrogate(centre, coefficients, noise, _correlation(residuals, near))


def _correlation(residuals: FloatArray, weight: FloatArray) -> FloatArray:
    """Returns correlations of residuals over the runs that tell both numbers, shrunk towards 0."""
    count = residuals.shape[1]
    found = np.eye(count)
    for i in range(count):
        for j in range(i):
            both = ~np.isnan(residuals[:, i]) & ~np.isnan(residuals[:, j])
            first, second, own = residuals[both, i], residuals[both, j], weight[both]
            squares = float((own * first**2).sum() * (own * second**2).sum())
            if squares > 0.0:
                product = float((own * first * second).sum()) / squares**0.5
                found[i, j] = found[j, i] = (1.0 - SHRUNK) * product
    return found


def costs(
    surrogate: Surrogate, wanted: Wanted, usual: FloatArray, places: FloatArray
) -> FloatArray:
    """Returns at places how far the numbers are from those measured, in squares of their noise.

    ``usual`` is the usual place, nan for each parameter that has none.
    """
    measured = wanted.numbers
    counted = counted_of(surrogate, measured)
    off = (surrogate.means(places) - measured)[:, counted] / surrogate.noise[counted]
    values, vectors = np.linalg.eigh(surrogate.correlation[np.ix_(counted, counted)])
    squares = (off @ vectors) ** 2 / np.maximum(values, 0.5 * SHRUNK)
    aside = np.nansum(((places - usual) / USUAL_WITHIN) ** 2, 1)
    return np.asarray(wanted.times * np.minimum(MOST, squares).sum(1) + aside)


def counted_of(surrogate: Surrogate, measured: FloatArray) -> BoolArray:
    """Returns which numbers were measured and are known to the surrogate."""
    return np.asarray(~np.isnan(measured) & np.isfinite(surrogate.noise))


def search(
    axes: Sequence[Axis],
    rounds: Sequence[Round],
    simulate: Callable[[FloatArray], FloatArray],
    wanted: Wanted,
    floor: FloatArray,
) -> tuple[FloatArray, Surrogate, Runs]:
    """Returns the place in the unit cube whose runs are nearest to what is wanted.

    ``simulate`` gives one row of numbers for each row of places. The surrogate and all runs come
    with it.
    """
    from scipy.stats import qmc  # takes a second, and most commands do not search

    dimensions, usual = len(axes), np.array([axis.usual_share for axis in axes])
    centre = np.full(dimensions, 0.5)
    places, numbers = np.empty((0, dimensions)), np.empty((0, len(wanted.numbers)))
    for k, part in enumerate(rounds):
        drawn = qmc.LatinHypercube(dimensions, seed=k).random(part.runs)
        low = np.clip(centre - part.half_width, 0.0, 1.0)
        high = np.clip(centre + part.half_width, 0.0, 1.0)
        new = low + drawn * (high - low)
        places = np.vstack([places, new])
        numbers = np.vstack([numbers, simulate(new)])
        runs = Runs(places, numbers)
        if k == 0:
            centre = _nearest_runs(runs, wanted.numbers, floor)
        surrogate = surrogate_of(runs, centre, part.reach, floor)
        centre = _least(surrogate, wanted, usual, part.half_width if k else part.reach)
    return centre, surrogate, runs


def _nearest_runs(runs: Runs, measured: FloatArray, floor: FloatArray) -> FloatArray:
    """Returns the middle of the runs that are nearest to what was measured, number by number."""
    told = ~np.isnan(runs.numbers)
    counts = np.maximum(1, told.sum(0))
    off = np.where(told, runs.numbers, 0.0)
    off = np.where(told, off - off.sum(0) / counts, 0.0)
    spread = np.maximum(np.sqrt((off**2).sum(0) / counts), floor)
    off = np.abs((runs.numbers - measured) / spread)
    known = ~np.isnan(measured)
    distance = np.where(np.isnan(off), 2.0, np.minimum(off, 2.0))[:, known].mean(1)
    best = np.argsort(distance)[: max(3, len(distance) // 10)]
    return np.asarray(np.average(runs.places[best], axis=0, weights=1.0 / (0.05 + distance[best])))


def _least(
    surrogate: Surrogate, wanted: Wanted, usual: FloatArray, half_width: float
) -> FloatArray:
    import scipy.optimize as untyped_optimize

    optimize: Any = untyped_optimize
    low = np.clip(surrogate.centre - half_width, 0.0, 1.0)
    high = np.clip(surrogate.centre + half_width, 0.0, 1.0)
    found = optimize.differential_evolution(
        lambda columns: costs(surrogate, wanted, usual, np.atleast_2d(columns.T)),
        list(zip(low, high, strict=True)),
        seed=0,
        tol=1e-6,
        polish=False,
        vectorized=True,
        updating="deferred",
    )
    return np.asarray(found.x)
