"""Studies: a grid of runs, as validated TOML."""

from collections.abc import Iterator
from dataclasses import replace
from itertools import product
from typing import Annotated, Any, Literal, Self

from pydantic import Field, model_validator

from coramp.errors import CorampError
from coramp.running import DEFAULT_DRIVERS, RunSpec, make_spec
from coramp.scenario import Flow, Model
from coramp.strategies.registry import strategy_named
from coramp.toml_files import read, validated

Flows = Annotated[tuple[Flow, ...], Field(strict=False)]
FlowPair = Annotated[tuple[Flow, Flow], Field(strict=False)]
Names = Annotated[tuple[str, ...], Field(strict=False, min_length=1)]


class Grid(Model):
    """Runs of every combination of what is listed, with every seed.

    Flows are those of ``mainline_veh_h`` by those of ``ramp_veh_h``, or the pairs of
    ``flows_veh_h``.
    ``set`` gives lists of values for dotted keys of the scenario. ``drivers`` count only for
    strategies that leave vehicles to their drivers.
    """

    strategies: Names
    mainline_veh_h: Flows = ()
    ramp_veh_h: Flows = ()
    flows_veh_h: Annotated[tuple[FlowPair, ...], Field(strict=False)] = ()
    drivers: Names = (DEFAULT_DRIVERS,)
    engine: str = "sumo"
    set: dict[str, Annotated[tuple[Any, ...], Field(strict=False, min_length=1)]] = Field(
        default={}
    )

    @model_validator(mode="after")
    def _has_flows(self) -> Self:
        if bool(self.flows_veh_h) == bool(self.mainline_veh_h and self.ramp_veh_h):
            raise ValueError(
                "runs: flows are missing or given twice; allowed is either mainline_veh_h with "
                "ramp_veh_h, or flows_veh_h"
            )
        return self

    @property
    def flows(self) -> tuple[tuple[float, float], ...]:
        """All pairs of mainline and ramp flow."""
        return self.flows_veh_h or tuple(product(self.mainline_veh_h, self.ramp_veh_h))


class Study(Model):
    """A named set of grids on one scenario; ``layout`` says which tables sum it up."""

    name: Annotated[str, Field(min_length=1)]
    description: str = ""
    scenario: str
    seeds: Annotated[int, Field(ge=1, le=100000)] = 3
    layout: Literal["plain", "paper", "sensitivity"] = "plain"
    horizon_s: Annotated[float, Field(gt=0.0, le=86400.0)] | None = None
    runs: Annotated[tuple[Grid, ...], Field(strict=False, min_length=1)]


def load_study(name: str) -> Study:
    """Returns the built-in study of that name, or that of a file."""
    label, data = read("studies", name)
    return validated(Study, data, label)


def expand(study: Study, seeds: int, label: str | None = None) -> list[RunSpec]:
    """Returns all runs of a study, sorted by their keys; what two grids share is run once.

    Raises CorampError with a message for every combination that cannot be run; ``label`` is the
    file to name, else it is the study's name.
    """
    if seeds < 1:
        raise CorampError(f"--seeds: {seeds} is too small; allowed is at least 1")
    label = label or study.name
    try:
        read("scenarios", study.scenario)
    except CorampError as error:
        raise CorampError(*(f"{label}: scenario: {line}" for line in error.messages)) from None
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
                first = make_spec(study.scenario, horizon_s=study.horizon_s, blamed="", **arguments)
            except CorampError as error:
                problems.update(dict.fromkeys(error.messages))
                continue
            for seed in range(1, seeds + 1):
                spec = replace(first, seed=seed)
                specs.setdefault(spec.run_id, spec)
    if problems:
        raise CorampError(*(f"{label}: {problem}" for problem in problems))
    return sorted(specs.values(), key=sort_key)


def _combinations(grid: Grid) -> Iterator[dict[str, Any]]:
    keys = sorted(grid.set)
    for strategy in grid.strategies:
        cooperative = strategy_named(strategy).cooperative
        for drivers, (mainline, ramp), *values in product(
            (None,) if cooperative else grid.drivers,
            grid.flows,
            *(grid.set[key] for key in keys),
        ):
            yield {
                "strategy": strategy,
                "engine": grid.engine,
                "drivers": drivers,
                "mainline_veh_h": mainline,
                "ramp_veh_h": ramp,
                "overrides": dict(zip(keys, values, strict=True)),
            }


def sort_key(spec: RunSpec) -> tuple[Any, ...]:
    """Returns what runs are sorted by; null drivers come first."""
    keys = spec.keys
    return tuple((value is not None, value) for value in (*keys.values(), spec.run_id))
