"""Runs in which automated vehicles drive among drivers: what they may ask for and promise."""

from collections.abc import Mapping
from typing import Any

from coramp.errors import CorampError
from coramp.scenarios.model import Scenario
from coramp.scenarios.world_sections import TABLES
from coramp.strategies.base import Strategy
from coramp.strategies.registry import strategies
from coramp.worlds.sumo.engine import LARGEST_PLAN_ERROR_M


def coordinates_drivers(strategy: type[Strategy]) -> bool:
    """Returns whether a strategy can coordinate automated vehicles among drivers."""
    return hasattr(strategy, "steer")


def check_mixed(scenario: Scenario, strategy: type[Strategy], engine: str, population: str) -> None:
    """Raises CorampError if a strategy, an engine or drivers cannot be those of mixed traffic."""
    why, instead = _asked_for(scenario)
    if engine != "sumo":
        raise CorampError(f"engine: {engine} cannot run where {why}; choose sumo, or {instead}")
    if strategy.cooperative and not coordinates_drivers(strategy):
        able = ", ".join(name for name, kind in strategies().items() if _among_drivers(kind))
        raise CorampError(
            f"strategy: {strategy.name} cannot run where {why}; allowed are {able}, or {instead}"
        )
    integrator = scenario.drivers[population].integrator
    if scenario.has_automated and integrator != "euler":
        raise CorampError(
            f"drivers.{population}.integrator: {integrator} drivers are others than Euler's, and "
            "automated vehicles among them take Euler steps; allowed is euler"
        )


def check_messages_kept(is_mixed: bool) -> None:
    """Raises CorampError where messages are to be kept of a run that has none."""
    if is_mixed:
        raise CorampError(
            "--keep-messages: automated vehicles among drivers keep no messages yet; "
            "leave it out, or choose automated shares of 1"
        )


def _asked_for(scenario: Scenario) -> tuple[str, str]:
    """What is asked of a run that not all can do, and what to ask for instead."""
    if scenario.is_mixed:
        return "[traffic] leaves some vehicles to drivers", "automated shares of 1"
    tables = ", ".join(f"[{t}]" for t in TABLES if not getattr(scenario, t).is_perfect)
    return f"the world is not perfect ({tables})", "none of these tables"


def _among_drivers(strategy: type[Strategy]) -> bool:
    return not strategy.cooperative or coordinates_drivers(strategy)


def broken_among_drivers(row: Mapping[str, Any]) -> list[str]:
    """Returns in words what automated vehicles among drivers promised and did not keep.

    Those that nobody coordinates, and that so have no plan to be off, promise nothing.
    """
    if row.get("plan_error_m") is None:
        return []
    broken = []
    if row.get("collisions_by_automated"):
        broken.append(f"{row['collisions_by_automated']} collisions that automated vehicles caused")
    if row.get("automated_violations"):
        broken.append(f"{row['automated_violations']} pairs nearer than automated vehicles promise")
    if (row.get("plan_error_m") or 0.0) > LARGEST_PLAN_ERROR_M:
        broken.append(f"driven {row['plan_error_m']:.3f} m off plan")
    return broken
