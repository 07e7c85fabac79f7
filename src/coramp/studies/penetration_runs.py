"""Runs by share of automated vehicles, each beside the same drivers' run without any."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any, NamedTuple

import polars as pl

from coramp.scenarios.loading import load_scenario
from coramp.studies.breakdown import broke_down
from coramp.studies.overrides import overrides_of, scenario_value
from coramp.studies.statistics import Estimate, estimate, ratio_of_sums

SHARE, TIME_GAP, AUTOMATION = (
    "traffic.automated_share",
    "safety.time_gap_s",
    "traffic.automation",
)
ALONE = "uncontrolled"
"""The strategy of runs in which nobody coordinates automated vehicles."""
AUTOMATIONS = {
    "yielding": "alone, yielding",
    "not-yielding": "alone, not yielding",
    "acc": "alone, ACC",
    "cacc": "alone, CACC",
}
"""What automated vehicles are called that nobody coordinates, by ``traffic.automation``."""
KINDS = ("delay_s", "hard_brakings_3")
"""Figures that runs have for automated vehicles and for drivers apart."""

ALL_OF_A_KIND = {0.0: ("driver", "automated"), 1.0: ("automated", "driver")}
"""By share, of which kind all vehicles are, and of which none."""

Run = Mapping[str, Any]
BySeed = dict[int, Run]


class Traffic(NamedTuple):
    """Which drivers, and how many vehicles an hour on mainline and ramp."""

    drivers: str
    flow: tuple[float, float]

    @property
    def name(self) -> str:
        """The flow as tables have it."""
        return f"{self.flow[0]:g} + {self.flow[1]:g}"


class Vehicles(NamedTuple):
    """The time gap (s) that automated vehicles keep, and who decides for them."""

    time_gap_s: float
    who: str

    @property
    def coordinated(self) -> bool:
        """Whether a strategy coordinates them."""
        return self.who not in AUTOMATIONS.values()


@dataclass(frozen=True)
class Cell:
    """The runs of one traffic, vehicles and share, by seed, with those without automated ones."""

    traffic: Traffic
    vehicles: Vehicles
    share: float
    runs: BySeed
    without: BySeed

    @property
    def delay_share(self) -> Estimate:
        """The delay of all in % of that without automated vehicles: a ratio of sums over seeds."""
        return self._ratio("delay_s")

    @property
    def driver_brakings_share(self) -> Estimate:
        """The brakings of drivers in % of theirs without automated vehicles."""
        return self._ratio("driver_hard_brakings_3")

    @property
    def saved_s(self) -> Estimate:
        """By how much less all lose than without automated vehicles, on the same arrivals."""
        return self._saved("delay_s")

    @property
    def drivers_saved_s(self) -> Estimate:
        """By how much less a driver loses than without automated vehicles."""
        return self._saved("driver_delay_s")

    @property
    def broken(self) -> int:
        """With how many seeds a stream broke down."""
        return sum(broke_down(run) for run in self.runs.values())

    def mean(self, column: str) -> Estimate:
        """Returns the estimate of a figure over the seeds that have it."""
        return estimate([run[column] for run in self.runs.values() if run[column] is not None])

    def total(self, column: str) -> int | None:
        """Returns the sum of a figure over the seeds, None where none has it."""
        found = [run[column] for run in self.runs.values() if run[column] is not None]
        return sum(found) if found else None

    def slower_s(self, other: "Cell") -> Estimate:
        """Returns by how much more all lose here than in another cell, on the same arrivals."""
        seeds = self.runs.keys() & other.runs.keys()
        return estimate(
            [self.runs[seed]["delay_s"] - other.runs[seed]["delay_s"] for seed in sorted(seeds)]
        )

    def _pairs(self, column: str) -> list[tuple[float, float]]:
        """The figure with and without automated vehicles, of each seed that has both."""
        seeds = sorted(self.runs.keys() & self.without.keys())
        found = [(self.runs[seed][column], self.without[seed][column]) for seed in seeds]
        return [(own, other) for own, other in found if own is not None and other is not None]

    def _ratio(self, column: str) -> Estimate:
        pairs = self._pairs(column)
        ratio = ratio_of_sums([own for own, _ in pairs], [other for _, other in pairs])
        return Estimate(100.0 * ratio.mean, 100.0 * ratio.half_width, ratio.values)

    def _saved(self, column: str) -> Estimate:
        return estimate([other - own for own, other in self._pairs(column)])


def is_sure(value: Estimate) -> bool:
    """Returns whether a difference is positive, and its interval leaves out zero."""
    return not math.isnan(value.half_width) and value.mean > value.half_width


def cells_of(good: pl.DataFrame) -> list[Cell]:
    """Returns the runs by traffic, vehicles and share, in that order; those of share 0 are beside.

    Runs in which all vehicles are automated and coordinated have no drivers. They are the last
    share of every population in which the same vehicles were run, or else of all at their flow.
    """
    without: dict[Traffic, BySeed] = {}
    groups: dict[tuple[Traffic, Vehicles, float], BySeed] = {}
    rows = [_told_apart(run) for run in good.iter_rows(named=True)]
    for run in rows:
        if run["share"] == 0.0:
            without.setdefault(Traffic(run["drivers"], _flow(run)), {})[run["seed"]] = run
    some = [run for run in rows if run["share"] != 0.0]
    of_drivers = [run for run in some if run["drivers"] is not None]
    among = dict.fromkeys(
        (Traffic(run["drivers"], _flow(run)), _vehicles(run)) for run in of_drivers
    )
    for run in of_drivers:
        key = (Traffic(run["drivers"], _flow(run)), _vehicles(run), run["share"])
        groups.setdefault(key, {})[run["seed"]] = run
    for run in some:
        if run["drivers"] is None:
            flow, own = _flow(run), _vehicles(run)
            beside = [t for t, vehicles in among if t.flow == flow and vehicles == own]
            for traffic in beside or [t for t in without if t.flow == flow]:
                groups.setdefault((traffic, own, run["share"]), {})[run["seed"]] = run
    order = sorted(groups, key=_order)
    return [Cell(*key, groups[key], without.get(key[0], {})) for key in order]


def cells_without(cells: list[Cell]) -> dict[Traffic, Cell]:
    """Returns the runs without automated vehicles of each traffic, as cells of share 0."""
    nobody = Vehicles(math.nan, "")
    return {c.traffic: Cell(c.traffic, nobody, 0.0, c.without, c.without) for c in cells}


def _order(key: tuple[Traffic, Vehicles, float]) -> tuple[Any, ...]:
    """Fair drivers before others, then by flow, gap, who (coordinated first) and share."""
    traffic, vehicles, share = key
    alone = [*AUTOMATIONS.values()]
    place = alone.index(vehicles.who) if vehicles.who in alone else -1
    first = traffic.drivers != "fair"
    return first, traffic, vehicles.time_gap_s, place, vehicles.who, share


def _flow(run: Run) -> tuple[float, float]:
    return run["mainline_veh_h"], run["ramp_veh_h"]


def _vehicles(run: Run) -> Vehicles:
    who = AUTOMATIONS[run["automation"]] if run["strategy"] == ALONE else run["strategy"]
    return Vehicles(run["time_gap_s"], who)


def _told_apart(run: Run) -> dict[str, Any]:
    """A row with its share, gap and automation, and its figures by kind where all are of one."""
    said = overrides_of(run)
    share = said.get(SHARE, _of_scenario(run["scenario"], SHARE))
    if share is None:
        share = 0.0 if run["strategy"] == ALONE else 1.0
    told = {
        **run,
        "share": share,
        "time_gap_s": said.get(TIME_GAP, _of_scenario(run["scenario"], TIME_GAP)),
        "automation": said.get(AUTOMATION, _of_scenario(run["scenario"], AUTOMATION)),
    }
    if share in ALL_OF_A_KIND and run["automated_vehicles"] is None:
        there, nobody = ALL_OF_A_KIND[share]
        told.update({f"{there}_{figure}": run[figure] for figure in KINDS})
        told[f"{nobody}_hard_brakings_3"] = 0
    return told


@cache
def _of_scenario(name: str, key: str) -> Any:
    """What a scenario says where a run sets nothing."""
    return scenario_value(load_scenario(name).model_dump(), key)
