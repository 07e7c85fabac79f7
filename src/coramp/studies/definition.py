"""Studies: a grid of runs, as validated TOML."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import product
from typing import Annotated, Any, Literal, Self

from pydantic import Field, PrivateAttr, field_validator, model_validator

from coramp.errors import CorampError
from coramp.runs.corridors import CorridorSpec
from coramp.runs.mixed import coordinates_drivers
from coramp.runs.running import DEFAULT_DRIVERS, RunSpec, make_spec
from coramp.scenarios.sections import Flow, Model
from coramp.scenarios.toml_files import beside, read, validated
from coramp.strategies.base import Strategy
from coramp.strategies.registry import strategy_named

Flows = Annotated[tuple[Flow, ...], Field(strict=False)]
FlowPair = Annotated[tuple[Flow, Flow], Field(strict=False)]
Names = Annotated[tuple[str, ...], Field(strict=False, min_length=1)]


class Grid(Model):
    """Runs of every combination of what is listed, with every seed.

    Flows are those of ``mainline_veh_h`` by those of ``ramp_veh_h``, or the pairs of
    ``flows_veh_h``; left out, they are the scenario's own, or its listed arrivals.
    ``set`` gives lists of values for dotted keys of the scenario. ``drivers`` count only for
    strategies that leave vehicles to their drivers, whose engine is always sumo, and for those that
    coordinate automated vehicles among drivers. ``times_seeds`` is how many times as many seeds as
    the study's these runs have.
    """

    strategies: Names
    mainline_veh_h: Flows = ()
    ramp_veh_h: Flows = ()
    flows_veh_h: Annotated[tuple[FlowPair, ...], Field(strict=False)] = ()
    drivers: Names = (DEFAULT_DRIVERS,)
    engine: str = "sumo"
    times_seeds: Annotated[int, Field(ge=1, le=1000)] = 1
    set: dict[str, Annotated[tuple[Any, ...], Field(strict=False, min_length=1)]] = Field(
        default={}
    )

    @model_validator(mode="after")
    def _has_flows(self) -> Self:
        keys = ("flows_veh_h", "mainline_veh_h", "ramp_veh_h")
        named = {key for key in keys if getattr(self, key)}
        if named not in (set(), {"flows_veh_h"}, {"mainline_veh_h", "ramp_veh_h"}):
            raise ValueError(
                "runs: flows are missing or given twice; allowed is either mainline_veh_h with "
                "ramp_veh_h, or flows_veh_h, or neither for the scenario's own"
            )
        return self

    @property
    def flows(self) -> tuple[tuple[float | None, float | None], ...]:
        """All pairs of mainline and ramp flow; None stands for the scenario's own."""
        crossed = tuple(product(self.mainline_veh_h, self.ramp_veh_h))
        return self.flows_veh_h or crossed or ((None, None),)


class Search(Model):
    """Searches for the mainline flow at which each combination breaks down, seed by seed.

    By bisection between two flows, in steps of the resolution, at each ramp flow.
    """

    strategies: Names
    ramp_veh_h: Annotated[tuple[Flow, ...], Field(strict=False, min_length=1)]
    mainline_from_veh_h: Flow
    mainline_to_veh_h: Flow
    resolution_veh_h: Annotated[float, Field(gt=0.0)]
    drivers: Names = (DEFAULT_DRIVERS,)
    engine: str = "sumo"
    set: dict[str, Annotated[tuple[Any, ...], Field(strict=False, min_length=1)]] = Field(
        default={}
    )

    @model_validator(mode="after")
    def _has_a_range(self) -> Self:
        if self.mainline_from_veh_h >= self.mainline_to_veh_h:
            raise ValueError(
                f"searches: mainline_to_veh_h: {self.mainline_to_veh_h:g} is not above "
                f"mainline_from_veh_h; allowed is above {self.mainline_from_veh_h:g} veh/h"
            )
        return self

    @property
    def steps(self) -> int:
        """How many steps of the resolution lie between the two flows."""
        return math.ceil(
            (self.mainline_to_veh_h - self.mainline_from_veh_h) / self.resolution_veh_h
        )

    @property
    def runs_at_most(self) -> int:
        """How many runs a search takes at most: halves of all flows, both ends included."""
        return (self.steps + 1).bit_length()

    def flow_veh_h(self, step: int) -> float:
        """Returns the mainline flow of a step; the last is the upper end."""
        flow = self.mainline_from_veh_h + step * self.resolution_veh_h
        return min(self.mainline_to_veh_h, flow)


class Study(Model):
    """A named set of grids on one scenario; ``layout`` says which tables sum it up.

    Its name is that of its folder below ``out/``. ``scenario`` is a built-in one, or a file whose
    path counts from the study's own file.
    """

    _file: str | None = PrivateAttr(default=None)

    name: Annotated[str, Field(min_length=1, max_length=100)]
    description: str = ""
    scenario: str
    seeds: Annotated[int, Field(ge=1, le=100000)] = 3
    layout: Literal[
        "plain",
        "paper",
        "sensitivity",
        "capacity",
        "field",
        "baseline",
        "drivers",
        "worth",
        "penetration",
        "hostile",
    ] = "plain"
    horizon_s: Annotated[float, Field(gt=0.0, le=86400.0)] | None = None
    runs: Annotated[tuple[Grid, ...], Field(strict=False)] = ()
    searches: Annotated[tuple[Search, ...], Field(strict=False)] = ()

    @field_validator("name")
    @classmethod
    def _names_a_folder(cls, name: str) -> str:
        if name.strip(" .") != name or not name.isprintable() or set(name) & set("/\\"):
            raise ValueError(
                f"name: {name!r} cannot be the name of a folder; allowed are letters, digits, "
                "dashes, and spaces and dots inside"
            )
        return name

    @model_validator(mode="after")
    def _asks_something(self) -> Self:
        if not self.runs and not self.searches:
            raise ValueError("runs: there are none; allowed is at least one of runs and searches")
        return self

    @property
    def file(self) -> str | None:
        """The built-in name or the file that it was read from, None where there is none."""
        return self._file

    @property
    def source(self) -> str:
        """The scenario as ``load_scenario`` takes it, from whatever folder."""
        return self.scenario if self._file is None else beside(self._file, self.scenario)

    def read_from(self, file: str) -> Self:
        """Returns the study as one that was read from a file."""
        self._file = file
        return self

    def on_engine(self, engine: str) -> "Study":
        """Returns the study with its cooperative runs on another engine."""
        return self.model_copy(
            update={
                "runs": tuple(g.model_copy(update={"engine": engine}) for g in self.runs),
                "searches": tuple(s.model_copy(update={"engine": engine}) for s in self.searches),
            }
        )


def load_study(name: str) -> Study:
    """Returns the built-in study of that name, or that of a file."""
    label, data = read("studies", name)
    return validated(Study, data, label).read_from(name)


def expand(study: Study, seeds: int, label: str | None = None) -> list[RunSpec]:
    """Returns all runs of a study, sorted by their keys; what two grids share is run once.

    So is, with the first seed, what no seed changes: cooperative runs of listed arrivals.
    Raises CorampError with a message for every combination that cannot be run; ``label`` is the
    file to name, else it is the study's name.
    """
    label = label or study.name
    check_source(study, seeds, label)
    specs: dict[str, RunSpec] = {}
    problems: dict[str, None] = {}
    for grid in study.runs:
        try:
            combinations = list(_combinations(grid))
        except CorampError as error:
            problems.update(dict.fromkeys(error.messages))
            continue
        for arguments in combinations:
            try:
                first = spec_of(study, arguments)
            except CorampError as error:
                problems.update(dict.fromkeys(error.messages))
                continue
            for seed in range(1, 1 + (seeds * grid.times_seeds if first.seed_matters else 1)):
                spec = replace(first, seed=seed)
                specs.setdefault(spec.run_id, spec)
    if problems:
        raise CorampError(*(f"{label}: {problem}" for problem in problems))
    return sorted(specs.values(), key=sort_key)


def check_source(study: Study, seeds: int, label: str) -> None:
    """Raises CorampError where there are no seeds, or the scenario cannot be read."""
    if seeds < 1:
        raise CorampError(f"--seeds: {seeds} is too small; allowed is at least 1")
    try:
        read("scenarios", study.source)
    except CorampError as error:
        raise CorampError(*(f"{label}: scenario: {line}" for line in error.messages)) from None


def spec_of(study: Study, arguments: dict[str, Any]) -> RunSpec:
    """Returns the specification of one run of a study, with the first seed."""
    horizon_s = horizon_of(study, arguments["overrides"])
    return make_spec(study.source, horizon_s=horizon_s, blamed="", **arguments)


def horizon_of(study: Study, overrides: Mapping[str, Any]) -> float | None:
    """Returns a study's horizon (s), None where it has none or a run sets its own."""
    return None if "simulation.horizon_s" in overrides else study.horizon_s


def _combinations(grid: Grid) -> Iterator[dict[str, Any]]:
    for variant in variants(grid):
        for mainline, ramp in grid.flows:
            yield {**variant, "mainline_veh_h": mainline, "ramp_veh_h": ramp}


def variants(asked: Grid | Search) -> Iterator[dict[str, Any]]:
    """Yields every combination of strategy, drivers and settings, flows left out.

    What drivers are to drive runs in SUMO, whatever the engine for the others.
    """
    keys = sorted(asked.set)
    for strategy in asked.strategies:
        chosen = strategy_named(strategy)
        for values in product(*(asked.set[key] for key in keys)):
            overrides = dict(zip(keys, values, strict=True))
            for drivers in _populations(chosen, asked.drivers, overrides):
                yield {
                    "strategy": strategy,
                    "engine": asked.engine if chosen.cooperative else "sumo",
                    "drivers": drivers,
                    "overrides": overrides,
                }


def _populations(
    strategy: type[Strategy], drivers: Sequence[str], overrides: Mapping[str, Any]
) -> Sequence[str | None]:
    """The populations that are on the road beside a strategy's own vehicles: None for nobody."""
    if not strategy.cooperative:
        return drivers
    shares = [value for key, value in overrides.items() if key.endswith("automated_share")]
    some = any(share != 1.0 for share in shares)
    return drivers if some and coordinates_drivers(strategy) else (None,)


def count_runs(study: Study, seeds: int) -> int:
    """Returns how many runs a study has at most; what no seed changes counts with every seed."""
    grids = sum(
        len(grid.flows) * sum(1 for _ in variants(grid)) * grid.times_seeds for grid in study.runs
    )
    searches = sum(
        len(search.ramp_veh_h) * sum(1 for _ in variants(search)) * search.runs_at_most
        for search in study.searches
    )
    return (grids + searches) * seeds


def sort_key(spec: RunSpec | CorridorSpec) -> tuple[Any, ...]:
    """Returns what runs are sorted by; null drivers come first."""
    keys = spec.keys
    return tuple((value is not None, value) for value in (*keys.values(), spec.run_id))
