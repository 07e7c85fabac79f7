"""Runs by fault and share of automated vehicles, each beside the same run in a perfect world."""

import math
from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import polars as pl

from coramp.runs.running import UNCONTROLLED
from coramp.scenarios.world_sections import TABLES
from coramp.studies.overrides import overrides_of
from coramp.studies.penetration_runs import SHARE, BySeed, Run
from coramp.studies.setting_words import settings_text
from coramp.studies.statistics import Estimate, estimate, ratio_of_sums

PERFECT = "perfect"
PRESET = "world.preset"
DRIVERS_ALONE, AUTOMATION_ALONE = "drivers alone", "automation alone"
HORIZON = "simulation.horizon_s"
BRAKES_PER_H = "behaviour.brakes_for_nothing_per_h"
"""Runs that set both are drawn to be weighted: what is rare happens often in them."""
NAMES: dict[str, Callable[[Any], str]] = {
    BRAKES_PER_H: lambda rate: f"braking for nothing ({rate:g}/h)",
    "behaviour.never_yields_share": lambda share: f"never yielding ({100.0 * share:g} %)",
    "behaviour.inattentive_share": lambda share: f"inattentive ({100.0 * share:g} %)",
    "behaviour.silent_share": lambda share: f"silent ({100.0 * share:g} %)",
    "behaviour.disobeys_share": lambda share: f"disobedient ({100.0 * share:g} %)",
    "behaviour.lies_share": lambda share: f"liars ({100.0 * share:g} %)",
    "incidents.breakdown_s": lambda time_s: f"breakdown at {time_s:g} s",
    "reports.burst_s": lambda burst_s: f"bursts of {burst_s:g} s",
}
"""What a fault is called, by the key that makes it; the first that is set counts."""
DETAILS = {
    "incidents.place": "on the {}",
    "behaviour.brake_mps2": "at {:g} m/s2",
    "behaviour.inattentive_s": "looking up each {:g} s",
}
"""Keys that are told beside the name."""
BY_CAUSE = ("collisions_by_automated", "collisions_by_driver", "collisions_among_drivers")


class Line(NamedTuple):
    """What a row of a table stands for: all but the share and the seed."""

    who: str
    drivers: str
    setting: str
    flow: tuple[float, float]
    fault: str

    @property
    def flow_name(self) -> str:
        """The flow as tables have it."""
        return f"{self.flow[0]:g} + {self.flow[1]:g}"


@dataclass(frozen=True)
class Cell:
    """The runs of a line and share by seed, with those of the same in a perfect world."""

    line: Line
    share: float
    runs: BySeed
    perfect: BySeed

    @property
    def delay(self) -> Estimate:
        """The mean delay of all (s)."""
        return estimate([run["delay_s"] for run in self.runs.values()])

    @property
    def delay_share(self) -> Estimate:
        """The delay of all in % of that in a perfect world: a ratio of sums over seeds."""
        ratio = ratio_of_sums(*self._pairs())
        return Estimate(100.0 * ratio.mean, 100.0 * ratio.half_width, ratio.values)

    @property
    def lost_s(self) -> Estimate:
        """By how much more all lose than in a perfect world, on the same arrivals."""
        return estimate([own - other for own, other in zip(*self._pairs(), strict=True)])

    def _pairs(self) -> tuple[list[float], list[float]]:
        """The delays (s) here and in a perfect world, of each seed that has both."""
        seeds = sorted(self.runs.keys() & self.perfect.keys())
        return (
            [self.runs[seed]["delay_s"] for seed in seeds],
            [self.perfect[seed]["delay_s"] for seed in seeds],
        )


def cells_of(good: pl.DataFrame) -> list[Cell]:
    """Returns the runs by line and share: mixed traffic first, a perfect world before faults.

    Where all are automated there are no drivers: these runs are the last share of every population
    that is run beside the same vehicles. Runs that are drawn to be weighted are left out.
    """
    groups: dict[tuple[Line, float], BySeed] = {}
    every = [run for run in good.iter_rows(named=True) if not is_drawn(run)]
    rows = [(line_of(run), share_of(run), run) for run in every]
    among = dict.fromkeys(line for line, share, _ in rows if 0.0 < share < 1.0)
    for line, share, run in rows:
        beside = [other for other in among if _same_but_drivers(line, other)]
        lines = beside if share == 1.0 and beside else [line]
        for own in dict.fromkeys(lines):
            groups.setdefault((own, share), {})[run["seed"]] = run
    faults = _faults_in_order(line.fault for line, _ in groups)
    order = sorted(groups, key=lambda key: _order(key, faults))
    return [
        Cell(line, share, groups[line, share], groups.get((_perfect(line), share), {}))
        for line, share in order
    ]


def _same_but_drivers(line: Line, other: Line) -> bool:
    return line._replace(drivers="") == other._replace(drivers="")


def _perfect(line: Line) -> Line:
    return line._replace(fault=PERFECT)


def _order(key: tuple[Line, float], faults: list[str]) -> tuple[Any, ...]:
    line, share = key
    alone = line.who in (DRIVERS_ALONE, AUTOMATION_ALONE)
    rest = (alone, line.who, line.setting, line.drivers)
    return (*rest, faults.index(line.fault), line.flow, share)


def _faults_in_order(names: Iterable[str]) -> list[str]:
    """A perfect world, presets, then the others by name."""
    presets = ("mild", "hard", "rtk-5g", "gnss-its-g5", "urban-canyon", "winter")
    first = (PERFECT, *presets)
    return sorted(set(names), key=lambda name: (_place(name, first), name))


def _place(name: str, first: tuple[str, ...]) -> int:
    return first.index(name) if name in first else len(first)


def is_drawn(run: Run) -> bool:
    """Returns whether drivers brake for nothing more often in a run than they are taken to do.

    Such runs are short, with a horizon of their own: they count with a weight, or not at all.
    """
    return {HORIZON, BRAKES_PER_H} <= overrides_of(run).keys()


def line_of(run: Run, but: Collection[str] = ()) -> Line:
    """Returns the line that a run belongs to, as if it did not set the keys in ``but``."""
    said = {key: value for key, value in overrides_of(run).items() if key not in but}
    share = share_of(run)
    faults = {key: value for key, value in said.items() if key.partition(".")[0] in TABLES}
    others = {key: v for key, v in said.items() if key not in faults and key != SHARE}
    who = str(run["strategy"])
    if who == UNCONTROLLED:
        who = DRIVERS_ALONE if share == 0.0 else AUTOMATION_ALONE
    flow = (run["mainline_veh_h"], run["ramp_veh_h"])
    setting = settings_text(others) or "-"
    return Line(who, run["drivers"] or "none", setting, flow, fault_name(faults))


def share_of(run: Run) -> float:
    """Returns the share of vehicles that are automated in a run, as it was set."""
    share = overrides_of(run).get(SHARE)
    if share is None:
        return 0.0 if run["strategy"] == UNCONTROLLED else 1.0
    return float(share)


def fault_name(faults: Mapping[str, Any]) -> str:
    """Returns what a set of faults is called: a preset, a name, or the keys that are set."""
    if not faults:
        return PERFECT
    if set(faults) == {PRESET}:
        return str(faults[PRESET])
    named = [name(faults[key]) for key, name in NAMES.items() if key in faults]
    details = [text.format(faults[key]) for key, text in DETAILS.items() if key in faults]
    if len(named) == 1:
        return " ".join([*named, *details])
    return ", ".join(f"{key} {value}" for key, value in sorted(faults.items()))


class Counted(NamedTuple):
    """What several runs add up to."""

    runs: int
    vehicle_km: float
    by_cause: tuple[int, int, int]


def counted(cells: Iterable[Cell]) -> Counted:
    """Returns how far the runs of cells drove, and collisions by cause.

    Runs without a distance, of which nobody is a driver, do not count. Where nobody is automated
    all collisions are among drivers.
    """
    runs = [run for cell in cells for run in cell.runs.values() if run["vehicle_km"] is not None]
    causes = [_causes(run) for run in runs]
    by_cause = tuple(sum(found) for found in zip(*causes, strict=True)) or (0, 0, 0)
    return Counted(len(runs), math.fsum(run["vehicle_km"] for run in runs), by_cause)


def _causes(run: Run) -> tuple[int, int, int]:
    if run["automated_vehicles"] is None:
        return 0, 0, int(run["collisions"])
    own, driver, among = (int(run[column] or 0) for column in BY_CAUSE)
    return own, driver, among


def total(cells: Iterable[Cell], column: str) -> int | None:
    """Returns the sum of a figure over the runs of cells, None where none has it."""
    every = (run[column] for cell in cells for run in cell.runs.values())
    found = [value for value in every if value is not None]
    return sum(found) if found else None
