"""One run, from its specification to its tables."""

import hashlib
import json
import math
import time
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from importlib import metadata
from pathlib import Path
from typing import Any

from coramp.coordination.guard import strategy_to_run
from coramp.coordination.timed import Timed
from coramp.errors import CorampError
from coramp.metrics.tables import RunTables, tables_of
from coramp.records.run import RunRecords
from coramp.records.schemas import PLANNING_TIMES, RESULT_VERSION, RUN_METRICS, Row
from coramp.runs.metering import check_metering, room_notice
from coramp.runs.mixed import (
    broken_among_drivers,
    check_mixed,
    coordinates_drivers,
    is_plannable,
    plans_in_lanes,
)
from coramp.runs.unserved import unheeded_line, unserved_line
from coramp.scenarios.loading import drivers_checked, load_scenario
from coramp.scenarios.model import Scenario
from coramp.scenarios.population_files import is_population_file, read_population
from coramp.scenarios.speeds_kmh import overrides_in_mps
from coramp.scenarios.toml_files import key_parts
from coramp.scenarios.vehicle_checks import check_vehicles_may_differ, slow_merge_warning
from coramp.strategies.base import makes_way
from coramp.strategies.registry import strategy_named
from coramp.worlds.exact.engine import run_exact
from coramp.worlds.sumo.engine import LARGEST_PLAN_ERROR_M, run_cooperative
from coramp.worlds.sumo.files import SumoOptions
from coramp.worlds.sumo.mixed import run_mixed
from coramp.worlds.sumo.uncontrolled import run_uncontrolled

ENGINES = ("sumo", "exact")
DEFAULT_DRIVERS = "fair"
UNCONTROLLED = "uncontrolled"
FLOW_KEYS = ("mainline.flow_veh_h", "ramp.flow_veh_h")
OPTIONS = {
    "mainline.flow_veh_h": "--mainline",
    "ramp.flow_veh_h": "--ramp",
    "simulation.horizon_s": "--horizon",
}
"""Options of the command line that stand for keys of a scenario."""
Overrides = Sequence[tuple[str, Any]]
"""What was set, by dotted keys of a scenario."""


@dataclass(frozen=True)
class RunSpec:
    """Everything that determines a run. ``overrides`` are what was set beside the flows."""

    scenario: Scenario
    strategy: str
    engine: str
    drivers: str | None
    seed: int
    overrides: tuple[tuple[str, Any], ...] = ()

    @cached_property
    def run_id(self) -> str:
        """A hash of the whole specification and of the version of results."""
        content = [
            RESULT_VERSION,
            metadata.version("libsumo"),
            self.scenario.model_dump(mode="json"),
            self.strategy,
            self.engine,
            self.drivers,
            self.seed,
        ]
        text = json.dumps(content, sort_keys=True, separators=(",", ":"))
        return hashlib.sha256(text.encode()).hexdigest()[:16]

    @property
    def keys(self) -> Row:
        """The columns that runs are sorted by, and the overrides."""
        return {
            "scenario": self.scenario.name,
            "drivers": self.drivers,
            "strategy": self.strategy,
            "engine": self.engine,
            "mainline_veh_h": float(self.scenario.mainline.flow_veh_h),
            "ramp_veh_h": float(self.scenario.ramp.flow_veh_h),
            "seed": self.seed,
            "overrides": overrides_text(self.overrides),
        }

    @property
    def seed_matters(self) -> bool:
        """Whether another seed is another run: not where all is listed and nobody is a driver."""
        return self.drivers is not None or not self.scenario.arrivals

    @property
    def is_mixed(self) -> bool:
        """Whether a strategy coordinates automated vehicles among drivers, or as among drivers."""
        scenario, strategy = self.scenario, strategy_named(self.strategy)
        other = scenario.is_mixed or scenario.has_faults or not scenario.has_one_lane
        planned = self.engine == "exact" or (is_plannable(scenario) and makes_way(strategy))
        return strategy.cooperative and other and scenario.has_automated and not planned

    @property
    def settings(self) -> str | None:
        """The overrides as JSON, for a row; ``studies.overrides`` reads it."""
        return overrides_json(self.overrides)

    def as_data(self) -> Row:
        """Returns the specification as plain data."""
        content = self.scenario.model_dump(mode="json")
        settings = json.loads(self.settings or "{}")
        return {
            "run_id": self.run_id,
            **self.keys,
            "settings": settings,
            "specification": content,
        }


def make_spec(
    scenario: str,
    strategy: str = "mainline-priority",
    *,
    engine: str = "sumo",
    mainline_veh_h: float | None = None,
    ramp_veh_h: float | None = None,
    drivers: str | None = None,
    overrides: Mapping[str, Any] | None = None,
    seed: int = 1,
    horizon_s: float | None = None,
    blamed: str | None = None,
) -> RunSpec:
    """Returns the specification of a run; raises CorampError for what cannot be run.

    ``drivers`` is the name of a population of the scenario, or a file that holds one. Errors name
    the options of the command line, or else say ``blamed`` for all of them.
    """
    chosen = strategy_named(strategy)
    engine_checked(engine)
    if engine == "exact" and not chosen.cooperative:
        raise CorampError(
            f"engine: exact has no drivers for {strategy}; choose sumo, or a cooperative strategy"
        )
    if not isinstance(seed, int) or not 0 <= seed < 2**31:
        raise CorampError(f"seed: {seed} is out of range; allowed is 0 to {2**31 - 1}")
    others, blame_kmh = overrides_in_mps(overrides or {}, dict.fromkeys(overrides or {}, "--set"))
    values = (mainline_veh_h, ramp_veh_h, horizon_s)
    named = {key: v for key, v in zip(OPTIONS, values, strict=True) if v is not None}
    _check_given_once(
        named if drivers is None else {**named, "traffic.drivers": drivers}, others, blamed
    )
    blame = {**blame_kmh, **{key: OPTIONS[key] for key in named}}
    if blamed is not None:
        blame = dict.fromkeys(blame, blamed)
    drivers, populations = _drivers_asked(drivers)
    loaded = load_scenario(scenario, {**others, **_as_floats(named)}, blame, populations)
    among_drivers = loaded.is_mixed or loaded.has_faults or not loaded.has_one_lane
    plans_ahead = loaded.has_one_lane and not (among_drivers and coordinates_drivers(chosen))
    if among_drivers and plans_in_lanes(loaded, chosen, engine):
        among_drivers, plans_ahead = False, True
    if plans_ahead:  # elsewhere each vehicle's own limits bind it as it drives
        check_vehicles_may_differ(loaded, chosen.name)
    if engine == "sumo" and chosen.cooperative and loaded.drift_problem:
        raise CorampError(loaded.drift_problem)
    population = None
    if drivers is not None or not chosen.cooperative or among_drivers:
        population = drivers_checked(loaded, drivers or loaded.traffic.drivers)
        check_metering(loaded, chosen, population)
    if among_drivers or (loaded.gives_shares and not chosen.cooperative):
        check_mixed(loaded, chosen, engine, population or "")
    elif chosen.cooperative:
        population = None
    return RunSpec(loaded, strategy, engine, population, seed, _differing(scenario, others))


def _check_given_once(
    by_options: Collection[str], settings: Collection[str], blamed: str | None
) -> None:
    """Raises CorampError for keys that are given by an option of their own and by a setting."""
    if twice := sorted(set(by_options) & set(settings)):
        options = {**OPTIONS, "traffic.drivers": "--drivers"}
        told = ", ".join(f"{key} by {options[key]} and by --set" for key in twice)
        raise CorampError(f"{blamed or '--set'}: {told}: given twice; allowed is once")


def _drivers_asked(drivers: str | None) -> tuple[str | None, dict[str, Any]]:
    """Returns the name of drivers and, where they lie in a file, their table by that name."""
    if drivers is None or not is_population_file(drivers):
        return drivers, {}
    name, table = read_population(drivers)
    return name, {name: table}


def stored_spec(content: Row, scenario: Scenario) -> RunSpec:
    """Returns the specification of a run from what its ``run.json`` holds, and its scenario."""
    return RunSpec(
        scenario,
        content["strategy"],
        content["engine"],
        content["drivers"],
        content["seed"],
        tuple(sorted((content.get("settings") or {}).items())),
    )


def engine_checked(engine: str) -> str:
    """Returns the name of an engine; raises CorampError if there is none such."""
    if engine not in ENGINES:
        raise CorampError(f"engine: there is no {engine!r}; allowed are {', '.join(ENGINES)}")
    return engine


def _as_floats(named: Mapping[str, Any]) -> dict[str, Any]:
    """Whole numbers as floats; what is no number is left to the scenario's checks."""
    return {key: float(v) if isinstance(v, int | float) else v for key, v in named.items()}


def _differing(scenario: str, settings: Mapping[str, Any]) -> tuple[tuple[str, Any], ...]:
    """Returns what was set beside the flows and differs from the scenario as it is."""
    others = {key: value for key, value in settings.items() if key not in FLOW_KEYS}
    if not others:
        return ()
    try:
        plain = load_scenario(scenario).model_dump(mode="json")
    except CorampError:  # valid only with its overrides
        return tuple(sorted(others.items()))
    return differing(others, plain)


def differing(settings: Mapping[str, Any], plain: Row) -> tuple[tuple[str, Any], ...]:
    """Returns those of dotted settings that the content of a scenario does not have already."""
    return tuple(sorted((k, v) for k, v in settings.items() if _looked_up(plain, k) != v))


def overrides_text(overrides: Overrides) -> str | None:
    """Returns overrides as a row's text; ``studies.overrides`` reads the JSON beside it."""
    return " ".join(f"{key}={value}" for key, value in overrides) or None


def overrides_json(overrides: Overrides) -> str | None:
    """Returns overrides as JSON, None for none."""
    return json.dumps(dict(overrides), default=str) if overrides else None


def _looked_up(data: Any, dotted: str) -> Any:
    for part in key_parts(data, dotted):
        data = data.get(part) if isinstance(data, dict) else None
    return data


def execute(spec: RunSpec, options: SumoOptions | None = None) -> tuple[RunTables, Row]:
    """Returns the tables of a run and its row of ``runs.parquet``.

    Raises CorampError where the run fails.
    """
    options = options or SumoOptions()
    started = time.perf_counter()
    name = spec.strategy
    strategy = Timed(strategy_to_run(*_strategy_of(spec)))
    if spec.engine == "exact":
        outcome = run_exact(spec.scenario, strategy, spec.seed, options.keep_messages)
    elif spec.is_mixed:
        population = spec.drivers or spec.scenario.traffic.drivers
        outcome = run_mixed(spec.scenario, strategy, population, spec.seed, options)
    elif strategy_named(name).cooperative and spec.drivers is None:
        outcome = run_cooperative(spec.scenario, strategy, spec.seed, options)
    else:
        drivers = spec.drivers or spec.scenario.traffic.drivers
        outcome = run_uncontrolled(spec.scenario, strategy, drivers, spec.seed, options)
    tables = tables_of(outcome, spec.scenario)
    row = {
        "run_id": spec.run_id,
        **spec.keys,
        "status": "ok",
        "error": None,
        **tables.metrics,
        "wall_s": time.perf_counter() - started,
        **dict(zip(PLANNING_TIMES, strategy.planning_times_s(), strict=True)),
        "settings": spec.settings,
    }
    return tables, row


def _strategy_of(spec: RunSpec) -> tuple[str, Mapping[str, Any] | None]:
    """The strategy of a run and its parameters; none coordinates where nobody is automated."""
    coordinates = strategy_named(spec.strategy).cooperative
    name = UNCONTROLLED if coordinates and spec.drivers and not spec.is_mixed else spec.strategy
    return name, spec.scenario.strategy.get(name)


def recorded(
    spec: RunSpec,
    options: SumoOptions | None = None,
    notice: Callable[[str], None] = lambda _: None,
) -> RunRecords:
    """Returns the records of a run, made now; raises CorampError where it fails.

    ``notice`` is told of types that merge slower than they cruise, and of vehicles left unserved.
    """
    if strategy_named(spec.strategy).cooperative:
        warning = slow_merge_warning(spec.scenario)
        if warning is not None:
            notice(warning)
    if (line := room_notice(spec.scenario, spec.strategy, spec.drivers)) is not None:
        notice(line)
    tables, row = execute(spec, replace(options or SumoOptions(), keep_heard=True))
    if (line := unserved_line(tables.outcome)) is not None:
        notice(line)
    if (line := unheeded_line(tables.outcome)) is not None:
        notice(line)
    return RunRecords(run_content(spec, row), row, **tables.frames())


def failed_row(spec: RunSpec, error: str, wall_s: float) -> Row:
    """Returns the row of a run that failed."""
    nothing = dict.fromkeys(RUN_METRICS)
    return {
        "run_id": spec.run_id,
        **spec.keys,
        "status": "failed",
        "error": error,
        **nothing,
        "wall_s": wall_s,
        **dict.fromkeys(PLANNING_TIMES),
        "settings": spec.settings,
    }


def broken_promises(row: Mapping[str, Any]) -> list[str]:
    """Returns in words what a cooperative run promised and did not keep; nothing for others."""
    if row["status"] != "ok":
        return []
    if row["drivers"] is not None:
        return broken_among_drivers(row)
    broken = []
    if row["collisions"]:
        broken.append(f"{row['collisions']} collisions in SUMO")
    if row["safety_violations"]:
        broken.append(f"{row['safety_violations']} pairs nearer than the safe distance")
    if row["plan_error_m"] is not None and row["plan_error_m"] > LARGEST_PLAN_ERROR_M:
        broken.append(f"driven {row['plan_error_m']:.3f} m off plan")
    return broken


def run_content(spec: RunSpec, row: Row) -> Row:
    """Returns what ``run.json`` holds and ``coramp run --json`` prints."""
    content = {
        "kind": "run",
        "result_version": RESULT_VERSION,
        **spec.as_data(),
        "versions": versions(),
        "summary": row,
    }
    return {key: finite_or_none(value) for key, value in content.items()}


def versions() -> dict[str, str]:
    """Returns the versions that a result depends on."""
    import platform

    names = ("coramp", "libsumo", "eclipse-sumo", "numpy", "numba", "polars")
    return {**{name: metadata.version(name) for name in names}, "python": platform.python_version()}


def finite_or_none(value: Any) -> Any:
    """Returns plain data in which numbers that JSON has no word for are None."""
    if isinstance(value, float) and not math.isfinite(value):
        return None
    if isinstance(value, dict):
        return {key: finite_or_none(inner) for key, inner in value.items()}
    if isinstance(value, list | tuple):
        return [finite_or_none(inner) for inner in value]
    if isinstance(value, Path):
        return str(value)
    return value
