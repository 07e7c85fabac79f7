"""Differences between runs on the same arrivals, seed by seed, with their intervals.

What two strategies lose differs much less from seed to seed than what each loses: both meet the
same vehicles. So the interval of the difference says more than those of the two means.
"""

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import combinations
from operator import attrgetter
from typing import Any, NamedTuple, Self

import polars as pl

from coramp.studies.overrides import keys_set, overrides_of
from coramp.studies.setting_words import setting_among, settings_text
from coramp.studies.statistics import Estimate, estimate
from coramp.studies.tables import Table, with_interval

DELAYS = ("delay_s", "mainline_delay_s", "ramp_delay_s")
WITHOUT_ARRIVALS = ("safety.", "motion.", "strategy.", "drivers.", "traffic.")
"""Tables of a scenario that say nothing of who arrives."""
WITHOUT_ARRIVALS_KEYS = frozenset(
    {"control.actuation_delay_s", "control.retry_s", "control.gap_position"}
    | {"control.gap_creation_start", "simulation.drain_s"}
    | {f"ramp.{key}_station_m" for key in ("decision", "stop", "detector", "signal")}
    | {"ramp.acceleration_lane_m", "ramp.merge_angle_deg"}
)
EVERY_PAIR_OF = 3
"""Of more strategies, or settings, only the pairs with the one that loses least are told."""


MEANS = (
    "Means over seeds of the difference on the same arrivals, with 95 % intervals; sure: the "
    "interval of all leaves out zero."
)
POPULATIONS = (
    "A baseline is named with its population of drivers; two populations are not compared with "
    "each other, since they differ in who drives."
)


class Cell(NamedTuple):
    """What was run with several seeds at one flow: who decides, and what was set.

    ``overrides`` are settings as the row has them, ``setting`` is the same in words.
    """

    strategy: str
    drivers: str | None
    overrides: str | None
    setting: str = ""

    @classmethod
    def of_run(cls, run: Mapping[str, Any]) -> Self:
        """Returns the cell that a row of ``runs.parquet`` belongs to."""
        setting = settings_text(overrides_of(run))
        return cls(run["strategy"], run["drivers"], run["overrides"], setting)

    @property
    def who(self) -> tuple[str, str | None]:
        """Strategy and drivers."""
        return self.strategy, self.drivers

    @property
    def name(self) -> str:
        """Strategy, drivers and settings in words."""
        return self.named(self.setting)

    def named(self, setting: str) -> str:
        """Returns strategy and drivers in words, with a setting."""
        who = f"{self.strategy} ({self.drivers} drivers)" if self.drivers else self.strategy
        return f"{who}, {setting}" if setting else who


class Difference(NamedTuple):
    """How much less (s) one cell loses than another on the same arrivals, by seed.

    ``by_s`` has the delay of all, of the mainline and of the ramp; positive where ``less`` loses
    less.
    """

    scenario: str
    flow: tuple[float, float]
    less: Cell
    more: Cell
    by_s: tuple[Estimate, Estimate, Estimate]

    @property
    def told_apart(self) -> bool:
        """Whether the interval of the difference of all leaves out zero."""
        mean, half_width, _ = self.by_s[0]
        return not math.isnan(half_width) and abs(mean) > half_width


Delays = Mapping[Cell, Mapping[int, tuple[float | None, ...]]]


def differences(good: pl.DataFrame) -> list[Difference]:
    """Returns the difference of every two cells with the same arrivals that differ in one thing.

    That is the strategy, or what is set and says nothing of arrivals. Cells of two populations of
    drivers are never compared: they differ in who drives, not in what is done. Cells that lose the
    same with every seed are left out, and so is what fewer than two seeds share.
    """
    return [
        difference
        for (scenario, flow, _), cells in _by_arrivals(good).items()
        for one, other in _pairs(cells)
        if (difference := _difference(scenario, flow, (one, other), cells)) is not None
    ]


def _pairs(cells: Delays) -> Iterator[tuple[Cell, Cell]]:
    """Cells that differ in one thing: who decides, setting by setting, then what was set."""
    for fixed in (attrgetter("overrides"), attrgetter("who")):
        groups: dict[Any, list[Cell]] = {}
        for cell in cells:
            groups.setdefault(fixed(cell), []).append(cell)
        found = (pair for group in groups.values() for pair in _pairs_of(group, cells))
        yield from dict.fromkeys(found)


def _pairs_of(group: Sequence[Cell], cells: Delays) -> Iterator[tuple[Cell, Cell]]:
    """Of each population of drivers in a group the pairs with it and without drivers."""
    populations = dict.fromkeys(cell.drivers for cell in group if cell.drivers is not None)
    for population in populations or (None,):
        alike = [cell for cell in group if cell.drivers in (None, population)]
        best = min(alike, key=lambda cell: _mean(cells[cell]))
        few = len(alike) <= EVERY_PAIR_OF
        yield from (pair for pair in combinations(alike, 2) if few or best in pair)


def _by_arrivals(
    good: pl.DataFrame,
) -> dict[tuple[str, tuple[float, float], str], dict[Cell, dict[int, tuple[float | None, ...]]]]:
    groups: dict[Any, dict[Cell, dict[int, tuple[float | None, ...]]]] = {}
    for row in good.iter_rows(named=True):
        arrivals = arrivals_set(row)
        flow = row["mainline_veh_h"], row["ramp_veh_h"]
        cell = Cell.of_run(row)
        by_seed = groups.setdefault((row["scenario"], flow, str(arrivals)), {}).setdefault(cell, {})
        by_seed[row["seed"]] = tuple(row[name] for name in DELAYS)
    return groups


def arrivals_set(run: Mapping[str, Any]) -> dict[str, Any]:
    """Returns what a row of ``runs.parquet`` sets that says who arrives."""
    return {k: v for k, v in overrides_of(run).items() if not _says_nothing_of_arrivals(k)}


def _says_nothing_of_arrivals(key: str) -> bool:
    return key.startswith(WITHOUT_ARRIVALS) or key in WITHOUT_ARRIVALS_KEYS


def _difference(
    scenario: str, flow: tuple[float, float], pair: tuple[Cell, Cell], cells: Delays
) -> Difference | None:
    one, other = pair
    seeds = sorted(cells[one].keys() & cells[other].keys())
    found = [(cells[one][seed], cells[other][seed]) for seed in seeds]
    if len(found) < 2 or all(first == second for first, second in found):
        return None
    by_s = _estimates((second, first) for first, second in found)
    if by_s[0].mean < 0.0:
        return Difference(scenario, flow, other, one, _estimates(found))
    return Difference(scenario, flow, one, other, by_s)


def _estimates(
    pairs: Iterable[tuple[tuple[float | None, ...], tuple[float | None, ...]]],
) -> tuple[Estimate, Estimate, Estimate]:
    """Estimates of the first of each pair less its second, of all, mainline and ramp."""
    given = list(pairs)
    all_s, mainline_s, ramp_s = (
        estimate(
            [
                a[k] - b[k]  # type: ignore[operator]
                for a, b in given
                if a[k] is not None and b[k] is not None
            ]
        )
        for k in range(len(DELAYS))
    )
    return all_s, mainline_s, ramp_s


def _mean(by_seed: Mapping[int, tuple[float | None, ...]]) -> float:
    return estimate([values[0] for values in by_seed.values() if values[0] is not None]).mean


def paired_table(good: pl.DataFrame, scenario: Mapping[str, Any] | None = None) -> Table | None:
    """Returns the differences as a table, None where no two cells have the same arrivals.

    What a cell does not set and others do is told by the ``scenario``, if that is known.
    """
    found, keys = differences(good), keys_set(good)
    settings = {
        row["overrides"]: setting_among(overrides_of(row), keys, scenario)
        for row in good.unique("overrides").iter_rows(named=True)
    }
    if not found:
        return None
    rows = tuple(
        (
            d.scenario,
            f"{d.flow[0]:g} + {d.flow[1]:g}",
            d.less.named(settings[d.less.overrides]),
            d.more.named(settings[d.more.overrides]),
            *map(with_interval, d.by_s),
            "yes" if d.told_apart else "no",
            str(d.by_s[0].values),
        )
        for d in found
    )
    columns = (
        "scenario",
        "flow (veh/h)",
        "loses less",
        "than",
        "by, all (s)",
        "by, mainline (s)",
        "by, ramp (s)",
        "sure",
        "seeds",
    )
    notes = (
        MEANS,
        *([POPULATIONS] if any(d.less.drivers or d.more.drivers for d in found) else []),
    )
    important = ("loses less", "than", "by, all (s)", "sure", "flow (veh/h)")
    return Table("Differences on the same arrivals", columns, rows, notes, important)
