"""What can be said of runs beforehand: demand above the limit, settings without effect."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from coramp.metrics.delay_bound import lane_headway_s, lane_limit_veh_h
from coramp.runs.running import RunSpec
from coramp.scenarios.sections import Safety
from coramp.strategies.registry import strategy_named

OF_VEHICLES = ("positioning", "clock", "reports", "commands", "actuators")
"""Tables of the world that coordinated vehicles feel, but drivers do not."""
OF_AUTOMATION = ("safety.", "motion.")
"""Sections that bind coordinated vehicles, but not drivers."""


def demand_above_limit(spec: RunSpec) -> str | None:
    """Returns in a line that a cooperative run's flows are above its lane's limit, else None."""
    found = _above_limit(spec)
    return None if found is None else f"{found}: queues will grow"


def _above_limit(spec: RunSpec) -> str | None:
    """How many arrive and how many the lane carries, None where these are no fewer.

    Arrivals that are listed one by one have no flow. Of flows that change the most counts. On
    several lanes it depends on who makes way.
    """
    scenario = spec.scenario
    if spec.drivers is not None or scenario.arrivals or scenario.mainline.lanes > 1:
        return None
    streams = (scenario.mainline.flows_veh_h, scenario.ramp.flows_veh_h)
    demand_veh_h = max(map(sum, zip(*streams, strict=True)))
    if scenario.vehicles_differ:
        return None
    limit_veh_h = lane_limit_veh_h(lane_headway_s(scenario.usual_length_m, scenario.rules()))
    if demand_veh_h <= limit_veh_h:
        return None
    return (
        f"{demand_veh_h:,.0f} veh/h arrive, and the lane carries {limit_veh_h:,.0f} at most"
        f"{_gaps(scenario.safety)}"
    )


def demands_above_limit(specs: Sequence[RunSpec]) -> str | None:
    """Returns in a line how many of a study's runs have flows above their lane's limit, or None."""
    told = [line for spec in specs if (line := _above_limit(spec)) is not None]
    if not told:
        return None
    return (
        f"in {len(told)} of {len(specs)} runs more vehicles arrive than one lane can carry, so "
        f"that queues grow; in the first of them {told[0]}"
    )


def without_effect_on_drivers(specs: Sequence[RunSpec]) -> str | None:
    """Returns in a line which settings of runs with drivers bind no driver, or None."""
    of_drivers = [s for s in specs if s.drivers is not None and not s.scenario.gives_shares]
    found = of_automation([(str(spec.drivers), dict(spec.overrides)) for spec in of_drivers])
    if not found:
        return None
    keys, population = ", ".join(found), of_drivers[0].drivers
    return (
        f"{keys}: for coordinated vehicles only; drivers keep drivers.{population}.tau_s and "
        f"drivers.{population}.min_gap_m instead{_recipe(len(of_drivers))}"
    )


def faults_that_reach_nobody(specs: Sequence[RunSpec]) -> str | None:
    """Returns in a line which tables of the world bind nobody in any of some runs, or None."""
    found: dict[str, None] = {}
    for spec in specs:
        scenario = spec.scenario
        if strategy_named(spec.strategy).cooperative and scenario.has_automated:
            return None
        found |= dict.fromkeys(t for t in OF_VEHICLES if not getattr(scenario, t).is_perfect)
    if not found:
        return None
    tables = ", ".join(f"[{table}]" for table in found)
    return f"{tables}: for coordinated vehicles only; here nobody is coordinated"


def _recipe(runs: int) -> str:
    """How a study varies both, where there are several runs."""
    return "; to vary both, set both in one [[runs]] block for each value" if runs > 1 else ""


def of_automation(runs: Sequence[tuple[str, Mapping[str, Any]]]) -> list[str]:
    """Returns which settings of runs with drivers bind coordinated vehicles only.

    A run is its population of drivers and its settings. For several runs, a setting is returned
    only where runs differ in it whose drivers keep the same gaps: where a study sets both, drivers
    do change with it.
    """
    keys = {key: None for _, found in runs for key in found if key.startswith(OF_AUTOMATION)}
    if len(runs) == 1:
        population, found = runs[0]
        return [] if any(map(_sets(population), found)) else list(keys)
    values: dict[tuple[str, str, str], set[str]] = {}
    for population, found in runs:
        own = str(sorted((k, str(v)) for k, v in found.items() if _sets(population)(k)))
        for key in keys:
            values.setdefault((key, population, own), set()).add(str(found.get(key)))
    varied = {key for (key, _, _), told in values.items() if len(told) > 1}
    return [key for key in keys if key in varied]


def _sets(population: str) -> Callable[[str], bool]:
    """Whether a key is a gap that a population of drivers keeps."""
    gaps = (f"drivers.{population}.tau_s", f"drivers.{population}.min_gap_m")
    return lambda key: key in gaps


def seeds_without_effect(specs: Sequence[RunSpec]) -> str | None:
    """Returns in a line which of some runs no seed changes, or None."""
    fixed = {spec.strategy: None for spec in specs if not spec.seed_matters}
    if not fixed:
        return None
    return (
        f"arrivals are listed: no seed changes a run with {', '.join(fixed)}; each runs once, "
        "without an interval"
    )


def _gaps(safety: Safety) -> str:
    gaps = (
        ("time gap", safety.time_gap_s, "s"),
        ("standstill gap", safety.standstill_gap_m, "m"),
    )
    kept = ", ".join(f"{name} {gap:g} {unit}" for name, gap, unit in gaps if gap)
    return f" ({kept})" if kept else ""
