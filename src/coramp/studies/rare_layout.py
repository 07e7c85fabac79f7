"""Rare collisions: how often, if drivers brake for nothing as rarely as they are taken to do."""

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
import polars as pl

from coramp.studies.hostile_runs import (
    BRAKES_PER_H,
    DRIVERS_ALONE,
    HORIZON,
    PERFECT,
    is_drawn,
    line_of,
    share_of,
)
from coramp.studies.importance import (
    WeightedRate,
    effective_size,
    poisson_ratio,
    weighted_rate,
)
from coramp.studies.overrides import overrides_of
from coramp.studies.penetration_runs import Run
from coramp.studies.tables import Table, number
from coramp.worlds.faults.brakings import SECONDS_AN_HOUR, due_s

KM_PER_BRAKING = 10_000.0
"""A driver brakes for nothing once in so many vehicle km: chosen, there is no source for it."""
MILLION = 1e6
BRAKE_MPS2 = "behaviour.brake_mps2"
OF_BRAKING = (BRAKES_PER_H, BRAKE_MPS2, "behaviour.brake_s")
EVENTS = {
    "collision": "collisions",
    "collision by an automated vehicle": "collisions_by_automated",
    "automated nearer than promised": "automated_violations",
    "DRAC > 6 m/s2": "conflicts_drac_6",
    "TTC < 1 s": "conflicts_ttc_1",
}
"""What counts as an event, and the column of a run that counts it."""
NOTE = (
    "Short runs, in which drivers brake for nothing far more often than they are taken to do: once "
    f"in {KM_PER_BRAKING:,.0f} vehicle km, a number that is chosen; rates are proportional to it "
    "as long as it stays rare. Each run counts with its likelihood ratio. Events are those of runs "
    "in which somebody brakes for nothing, whatever they come from; all runs count for the "
    "distance. In brackets the 95 % interval of Fay and Feuer with a run as the unit; where none "
    "happened its one-sided limit, the rule of three for the largest weight. Effective sample "
    "size: (sum w)^2 / sum w^2 of the runs with a braking; with an event: the same of w times "
    "events."
)
COLUMNS = (
    *("fault", "vehicles", "drivers", "setting", "flow (veh/h)", "share", "event"),
    *("runs", "with a braking", "vehicle km", "events seen", "rate per million vehicle km"),
    "effective sample size",
)


class Drawn(NamedTuple):
    """The runs of one cell that count with a weight: those with a braking, and all distance."""

    runs: int
    vehicle_km: float
    braked: list[Run]
    weights: list[float]


def rare_tables(good: pl.DataFrame) -> list[Table]:
    """Returns the rates of rare events by cell, nothing where no run is drawn to be weighted."""
    groups: dict[tuple[str, ...], list[Run]] = {}
    for run in good.iter_rows(named=True):
        if is_drawn(run):
            groups.setdefault(_names(run), []).append(run)
    order = sorted(groups, key=lambda names: (names[1] == DRIVERS_ALONE, names))
    rows = [row for names in order for row in _rows(names, drawn_of(groups[names]))]
    if not rows:
        return []
    importance = ("fault", "share", "event", *COLUMNS[9:])
    title = "Rare collisions by importance sampling"
    return [Table(title, COLUMNS, tuple(rows), (NOTE,), importance)]


def _names(run: Run) -> tuple[str, ...]:
    """What the runs of a cell are called; the horizon is that of all such runs."""
    line = line_of(run, (HORIZON, *OF_BRAKING))
    brake_mps2 = overrides_of(run).get(BRAKE_MPS2)
    braking = "braking for nothing" + ("" if brake_mps2 is None else f" at {brake_mps2:g} m/s2")
    fault = braking if line.fault == PERFECT else f"{braking}, {line.fault}"
    share = f"{100.0 * share_of(run):g} %"
    return fault, line.who, line.drivers, line.setting, line.flow_name, share


def _rows(names: tuple[str, ...], drawn: Drawn) -> Iterator[tuple[str, ...]]:
    """One row an event that the runs of a cell tell of."""
    km = number(drawn.vehicle_km, 0)
    for event, column in EVENTS.items():
        counts = [run[column] for run in drawn.braked]
        if any(count is None for count in counts):
            continue
        found = weighted_rate(drawn.weights, counts, drawn.vehicle_km)
        yield (
            *(*names, event, str(drawn.runs), str(len(drawn.braked)), km, str(sum(counts))),
            *(_rate(found), _sizes(effective_size(drawn.weights), found.effective)),
        )


def _sizes(of_runs: float, with_event: float) -> str:
    """On how many runs weights and rate rest effectively."""
    return f"{number(of_runs, 1)}, {number(with_event, 1)} with an event"


def _rate(found: WeightedRate) -> str:
    """A rate a million vehicle km with its interval, or its limit; a dash where none was drawn."""
    rate, low, high = (MILLION * value for value in found[:3])
    if math.isnan(rate):
        return "-"
    if rate == 0.0:
        return f"0 (below {_rounded(high)})"
    return f"{_rounded(rate)} ({_rounded(low)} to {_rounded(high)})"


def _rounded(value: float) -> str:
    """Two significant digits, without an exponent."""
    return np.format_float_positional(value, precision=2, fractional=False, trim="-")


def drawn_of(runs: Sequence[Run]) -> Drawn:
    """Returns the runs of a cell with their weights.

    When drivers are to brake for nothing depends on rate and seed alone; the ratio is that of two
    Poisson processes for as long as vehicles arrive.
    """
    vehicle_km = math.fsum(run["vehicle_km"] for run in runs)
    nominal = vehicle_km / len(runs) / KM_PER_BRAKING
    braked, weights = [], []
    for run in runs:
        said = overrides_of(run)
        rate_per_h, horizon_s = float(said[BRAKES_PER_H]), float(said[HORIZON])
        count = len(due_s(rate_per_h, run["seed"], horizon_s))
        if count:
            braked.append(run)
            drawn = rate_per_h * horizon_s / SECONDS_AN_HOUR
            weights.append(poisson_ratio(count, nominal, drawn))
    return Drawn(len(runs), vehicle_km, braked, weights)
