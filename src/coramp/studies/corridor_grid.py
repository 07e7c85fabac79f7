"""The runs of a study whose scenario is a corridor."""

from collections.abc import Iterator
from dataclasses import replace
from itertools import product
from typing import Any

from coramp.errors import CorampError
from coramp.runs.corridors import CorridorSpec, corridor_spec
from coramp.scenarios.corridors import is_corridor
from coramp.studies.definition import Grid, Study, check_source, horizon_of, sort_key

HORIZON = "simulation.horizon_s"


def is_of_corridor(study: Study) -> bool:
    """Returns whether a study's scenario is a corridor; one that cannot be read is none."""
    try:
        return is_corridor(study.source)
    except CorampError:
        return False


def expand_corridor(study: Study, seeds: int, label: str | None = None) -> list[CorridorSpec]:
    """Returns all runs of a corridor's study, sorted by their keys; what grids share is run once.

    Drivers are those that a grid lists, else the scenario's. Raises CorampError with a message for
    every combination that cannot be run; ``label`` is the file to name, else it is the study's
    name.
    """
    label = label or study.name
    check_source(study, seeds, label)
    specs: dict[str, CorridorSpec] = {}
    problems: dict[str, None] = dict.fromkeys(_not_for_corridors(study))
    for grid, arguments in [] if problems else _combinations(study):
        try:
            first = corridor_spec(study.source, origin="", **arguments)
        except CorampError as error:
            problems.update(dict.fromkeys(error.messages))
            continue
        told = tuple(own for own in first.overrides if own[0] != HORIZON or HORIZON in grid.set)
        for seed in range(1, 1 + seeds * grid.times_seeds):
            spec = replace(first, seed=seed, overrides=told)
            specs.setdefault(spec.run_id, spec)
    if problems:
        raise CorampError(*(f"{label}: {problem}" for problem in problems))
    return sorted(specs.values(), key=sort_key)


def _combinations(study: Study) -> Iterator[tuple[Grid, dict[str, Any]]]:
    """Every combination of strategy, settings and drivers; None for the scenario's drivers."""
    for grid in study.runs:
        keys = sorted(grid.set)
        asked = grid.drivers if "drivers" in grid.model_fields_set else (None,)
        settings = product(*(grid.set[key] for key in keys))
        for strategy, values, drivers in product(grid.strategies, list(settings), asked):
            overrides = dict(zip(keys, values, strict=True))
            horizon_s = horizon_of(study, overrides)
            if horizon_s is not None:
                overrides[HORIZON] = horizon_s
            yield grid, {"strategy": strategy, "drivers": drivers, "overrides": overrides}


def count_corridor_runs(study: Study, seeds: int) -> int:
    """Returns how many runs a corridor's study has at most."""
    return seeds * sum(grid.times_seeds for grid, _ in _combinations(study))


def _not_for_corridors(study: Study) -> Iterator[str]:
    """What a study asks for that corridors do not have, one line each."""
    if study.searches:
        yield "searches: are for one merge site; allowed is [[runs]], as the scenario is a corridor"
    if study.layout != "plain":
        yield f"layout: {study.layout} is for one merge site; allowed is plain for a corridor"
    for grid in study.runs:
        if grid.flows != ((None, None),):
            yield (
                "runs: flows are those of one merge site; allowed is set with "
                "corridor.mainline_flow_veh_h and corridor.ramp_flow_veh_h for a corridor"
            )
        if grid.engine != "sumo":
            yield f"runs: engine: {grid.engine} knows no corridors; allowed is sumo"
