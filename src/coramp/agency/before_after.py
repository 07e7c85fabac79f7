"""Before and after on the same arrivals, seed by seed, with intervals."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import NamedTuple

import polars as pl

from coramp.agency.figures import FIGURES, agency_figures, breakdown_min, letter_of
from coramp.agency.motion import Motion, motion_of
from coramp.agency.tables import agency_tables
from coramp.errors import CorampError
from coramp.records.run import RunRecords
from coramp.records.run_folder import MARK, read_run
from coramp.records.schemas import Row
from coramp.studies.statistics import Estimate, estimate

ARRIVALS = ["vehicle_id", "scheduled_s"]


@dataclass(frozen=True)
class Measured:
    """A run and what agencies read of it, computed when it is asked for."""

    run: RunRecords

    @cached_property
    def motion(self) -> Motion:
        """Where everybody was."""
        return motion_of(self.run)

    @cached_property
    def tables(self) -> dict[str, pl.DataFrame]:
        """The tables by name."""
        return agency_tables(self.motion)

    @cached_property
    def figures(self) -> dict[str, float | None]:
        """The figures by key."""
        return agency_figures(self.run, self.motion, self.tables)

    @property
    def letter(self) -> str:
        """The level of service of the merge in its densest 15 min."""
        return letter_of(self.figures)

    @property
    def breakdown_min(self) -> float:
        """After how many minutes the merge broke down, nan where it did not."""
        return breakdown_min(self.tables["intervals"])


class Change(NamedTuple):
    """A figure before and after, and the difference; intervals are over seeds."""

    key: str
    before: Estimate
    after: Estimate
    change: Estimate

    @property
    def is_sure(self) -> bool:
        """Whether the interval of the difference leaves out zero."""
        return abs(self.change.mean) > self.change.half_width


Pairs = Sequence[tuple[Measured, Measured]]
"""Runs before and after on the same arrivals, one pair a seed."""


def paired(before: Path, after: Path) -> list[tuple[Measured, Measured]]:
    """Returns the runs of two folders in pairs that have the same arrivals, by seed.

    A folder is that of a run, or holds folders of runs. Raises CorampError where one holds none,
    two runs of one have the same seed, seeds differ, or arrivals of a seed do.
    """
    first, second = _by_seed(before), _by_seed(after)
    if first.keys() != second.keys():
        raise CorampError(
            f"{after}: has the seeds {_listed(second)}, and {before} has {_listed(first)}; allowed "
            "are runs with the same seeds"
        )
    for seed, run in first.items():
        if not run.vehicles.select(ARRIVALS).equals(second[seed].vehicles.select(ARRIVALS)):
            raise CorampError(
                f"{after}: other vehicles arrive there with seed {seed} than in {before}; allowed "
                "are runs of the same flows and horizon, or of the same list"
            )
    return [(Measured(first[seed]), Measured(second[seed])) for seed in sorted(first)]


def _by_seed(folder: Path) -> dict[int, RunRecords]:
    places = (
        [folder] if (folder / MARK).exists() else sorted(p.parent for p in folder.glob(f"*/{MARK}"))
    )
    if not places:
        raise CorampError(
            f"{folder}: holds no run, and no folders of runs; give one that coramp run --out has "
            "written, or the folder above several"
        )
    found: dict[int, RunRecords] = {}
    for place in places:
        run = read_run(place)
        seed = run.summary["seed"]
        if seed in found:
            raise CorampError(
                f"{place}: is a second run with seed {seed} in {folder}; allowed is one a seed"
            )
        found[seed] = run
    return found


def _listed(runs: dict[int, RunRecords]) -> str:
    return ", ".join(map(str, sorted(runs)))


def changes(pairs: Pairs) -> list[Change]:
    """Returns every figure before and after, with the differences seed by seed.

    Figures that some run does not have are left out.
    """
    found = []
    for key in FIGURES:
        values = [(one.figures[key], other.figures[key]) for one, other in pairs]
        known = [(a, b) for a, b in values if a is not None and b is not None]
        if not known:
            continue
        found.append(
            Change(
                key,
                estimate([a for a, _ in known]),
                estimate([b for _, b in known]),
                estimate([b - a for a, b in known]),
            )
        )
    return found


def changes_json(pairs: Pairs) -> list[Row]:
    """Returns the same as plain data; half widths are None with a single seed."""

    def known(value: float) -> float | None:
        return None if math.isnan(value) else value  # JSON has no word for nan

    return [
        {
            "figure": c.key,
            "unit": FIGURES[c.key].unit,
            "before": c.before.mean,
            "after": c.after.mean,
            "change": c.change.mean,
            "half_width": known(c.change.half_width),
            "seeds": c.change.values,
        }
        for c in changes(pairs)
    ]
