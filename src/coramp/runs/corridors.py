"""Runs of corridors, from what determines them to their tables."""

import hashlib
import json
import math
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from importlib import metadata
from pathlib import Path
from typing import Any, cast

import polars as pl

from coramp.coordination.guard import strategy_to_run
from coramp.errors import CorampError
from coramp.metrics.corridor_tables import corridor_tables, totals_of
from coramp.records.files import write_json, write_parquet
from coramp.records.run_folder import CORRIDOR, MARK
from coramp.records.schemas import RESULT_VERSION, Row
from coramp.runs.metering import check_metered_corridor
from coramp.runs.mixed import check_mixed, coordinates_drivers
from coramp.runs.running import (
    differing,
    finite_or_none,
    overrides_json,
    overrides_text,
    versions,
)
from coramp.scenarios.corridors import Corridor, load_corridor
from coramp.scenarios.loading import drivers_checked
from coramp.scenarios.vehicle_checks import check_vehicles_may_differ
from coramp.strategies.base import is_metered
from coramp.strategies.metering import MetersRamps
from coramp.strategies.registry import strategy_named
from coramp.worlds.sumo.corridor import Coordination, run_corridor
from coramp.worlds.sumo.engine import LARGEST_PLAN_ERROR_M
from coramp.worlds.sumo.files import SumoOptions

MOST_PROCESSES = 64
CONTENT = (
    "kind", "result_version", "run_id", "scenario", "strategy", "drivers", "seed",
    "specification", "versions", "summary", "sites", "processes", "wall_s", "settings",
)  # fmt: skip
"""The keys of a corridor's ``run.json``."""


@dataclass(frozen=True)
class CorridorSpec:
    """All that determines a corridor's run; how many processes it takes changes nothing.

    ``overrides`` are what was set and differs from the scenario's file.
    """

    corridor: Corridor
    strategy: str
    drivers: str
    seed: int
    overrides: tuple[tuple[str, Any], ...] = ()

    @cached_property
    def run_id(self) -> str:
        """A hash of the whole specification and of the version of results."""
        versioned = [RESULT_VERSION, metadata.version("libsumo"), self.corridor.as_data()]
        text = json.dumps([*versioned, self.strategy, self.drivers, self.seed], sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()[:16]

    @property
    def keys(self) -> Row:
        """The columns that runs are sorted by; flows are those of all roads, and of all ramps."""
        return {
            "scenario": self.corridor.name,
            "drivers": self.drivers,
            "strategy": self.strategy,
            "engine": "sumo",
            "mainline_veh_h": math.fsum(s.mainline.flow_veh_h for s in self.corridor.scenarios),
            "ramp_veh_h": math.fsum(s.ramp.flow_veh_h for s in self.corridor.scenarios),
            "seed": self.seed,
            "overrides": overrides_text(self.overrides),
        }

    @property
    def settings(self) -> str | None:
        """The overrides as JSON, for a row; ``studies.overrides`` reads it."""
        return overrides_json(self.overrides)


@dataclass(frozen=True)
class CorridorResult:
    """The run of a corridor: what ``run.json`` holds, and its tables by their names."""

    content: Row
    frames: Mapping[str, pl.DataFrame]

    @property
    def summary(self) -> Row:
        """The corridor's totals."""
        return dict(self.content["summary"])

    @property
    def sites(self) -> pl.DataFrame:
        """One row a site."""
        return self.frames["sites"]

    @property
    def broken_promises(self) -> list[str]:
        """What automated vehicles promised and did not keep, in words."""
        return broken_on_corridor(self.summary)


def broken_on_corridor(row: Mapping[str, Any]) -> list[str]:
    """Returns in words what automated vehicles did not keep, by the totals of a run."""
    broken = []
    if row["collisions_by_automated"]:
        broken.append(f"{row['collisions_by_automated']} collisions that automated vehicles caused")
    if (row["plan_error_m"] or 0.0) > LARGEST_PLAN_ERROR_M:
        broken.append(f"driven {row['plan_error_m']:.3f} m off plan")
    return broken


def corridor_spec(
    scenario: str,
    strategy: str,
    *,
    drivers: str | None = None,
    overrides: Mapping[str, Any] | None = None,
    seed: int = 1,
    origin: str = "--set",
) -> CorridorSpec:
    """Returns the specification of a corridor's run; raises CorampError for what cannot be run.

    ``origin`` is what overrides are blamed on.
    """
    chosen = strategy_named(strategy)
    if not isinstance(seed, int) or not 0 <= seed < 2**31:
        raise CorampError(f"seed: {seed} is out of range; allowed is 0 to {2**31 - 1}")
    corridor = load_corridor(scenario, overrides, origin)
    population = drivers_checked(corridor.common, drivers or corridor.common.traffic.drivers)
    for own in corridor.scenarios:
        if not (own.is_mixed and coordinates_drivers(chosen)):
            check_vehicles_may_differ(own, strategy)
        if chosen.cooperative and own.drift_problem:
            raise CorampError(own.drift_problem)
        check_mixed(own, chosen, "sumo", population)
    check_metered_corridor(corridor, chosen, population)
    return CorridorSpec(corridor, strategy, population, seed, _differing(scenario, overrides or {}))


def _differing(scenario: str, settings: Mapping[str, Any]) -> tuple[tuple[str, Any], ...]:
    """What was set and differs from the scenario's file."""
    if not settings:
        return ()
    try:
        plain = load_corridor(scenario).as_data()
    except CorampError:  # valid only with its overrides
        return tuple(sorted(settings.items()))
    return differing(settings, plain)


def processes_checked(processes: int) -> int:
    """Returns how many processes coordinators run in; raises CorampError if it cannot be."""
    if not isinstance(processes, int) or not 1 <= processes <= MOST_PROCESSES:
        raise CorampError(
            f"--processes: {processes} cannot be; allowed is 1, for this process alone, to "
            f"{MOST_PROCESSES}"
        )
    return processes


def execute_corridor(
    spec: CorridorSpec, processes: int = 1, options: SumoOptions | None = None
) -> CorridorResult:
    """Returns the tables of a corridor's run; raises CorampError where it fails."""
    started = time.perf_counter()
    corridor, coordination, metering = spec.corridor, None, None
    if is_metered(strategy_named(spec.strategy)):
        metering = strategy_to_run(spec.strategy, corridor.common.strategy.get(spec.strategy))
    elif strategy_named(spec.strategy).cooperative and corridor.common.has_automated:
        made: Any = strategy_to_run(spec.strategy, corridor.common.strategy.get(spec.strategy))
        coordination = Coordination(
            spec.strategy, float(made.decision_s), processes_checked(processes)
        )
    outcome = run_corridor(
        corridor,
        coordination,
        spec.drivers,
        spec.seed,
        options or SumoOptions(),
        cast("MetersRamps | None", metering),
    )
    frames = corridor_tables(outcome)
    totals = totals_of(outcome, frames["sites"])
    content: Row = {
        "kind": CORRIDOR,
        "result_version": RESULT_VERSION,
        "run_id": spec.run_id,
        "scenario": corridor.name,
        "strategy": spec.strategy,
        "drivers": spec.drivers,
        "seed": spec.seed,
        "specification": corridor.as_data(),
        "versions": versions(),
        "summary": totals,
        "sites": frames["sites"].to_dicts(),
        "processes": processes,
        "wall_s": time.perf_counter() - started,
        "settings": dict(spec.overrides),
    }
    return CorridorResult({key: finite_or_none(content[key]) for key in CONTENT}, frames)


def write_corridor(folder: Path, result: CorridorResult) -> None:
    """Writes all files of a corridor's run into an existing folder."""
    for name, frame in result.frames.items():
        write_parquet(folder / f"{name}.parquet", frame)
    write_json(folder / MARK, result.content)


def unserved_notice(result: CorridorResult, notice: Callable[[str], None]) -> None:
    """Tells how many vehicles had not left when the run was cut off."""
    row = result.summary
    if row["unserved"]:
        notice(
            f"{row['unserved']} of {row['vehicles']} vehicles had not left the corridor at "
            f"{row['until_s']:.0f} s, when the run was cut off; their time up to then counts"
        )
