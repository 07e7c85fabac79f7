"""Runs in which automated vehicles drive among drivers: what they may ask for and promise."""

import math
from collections.abc import Mapping
from typing import Any

from coramp.errors import CorampError
from coramp.scenarios.checks import problems_of_planning
from coramp.scenarios.model import Scenario
from coramp.scenarios.world_sections import TABLES
from coramp.strategies.base import Strategy, coordinates_meters, makes_way, steps_of_period
from coramp.strategies.registry import strategies
from coramp.worlds.sumo.engine import LARGEST_PLAN_ERROR_M
from coramp.worlds.sumo.mixed_setup import safety_law_of


def coordinates_drivers(strategy: type[Strategy]) -> bool:
    """Returns whether a strategy can coordinate automated vehicles among drivers."""
    return hasattr(strategy, "steer")


def plans_in_lanes(scenario: Scenario, strategy: type[Strategy], engine: str) -> bool:
    """Returns whether vehicles of a run on several lanes drive by plans, all of them automated.

    Raises CorampError where it would be, and the strategy or the road does not allow that.
    """
    if not strategy.cooperative or not is_plannable(scenario) or coordinates_drivers(strategy):
        return False
    if not makes_way(strategy):
        if engine != "exact":
            return False  # ``check_mixed`` tells what can run there in SUMO
        able = ", ".join(name for name, kind in strategies().items() if makes_way(kind))
        raise CorampError(
            f"strategy: {strategy.name} plans for one lane, and mainline.lanes is above 1; "
            f"allowed are {able}, or mainline.lanes 1"
        )
    if problems := problems_of_planning(scenario):
        raise CorampError(problems[0])
    return True


def is_plannable(scenario: Scenario) -> bool:
    """Returns whether all could be planned ahead: nobody drives, nothing fails, no network."""
    return scenario.network is None and not (scenario.is_mixed or scenario.has_faults)


def check_mixed(scenario: Scenario, strategy: type[Strategy], engine: str, population: str) -> None:
    """Raises CorampError if a strategy, an engine or drivers cannot be those of mixed traffic."""
    why, instead = _asked_for(scenario, strategy)
    if engine != "sumo":
        raise CorampError(f"engine: {engine} cannot run where {why}; choose sumo, or {instead}")
    if strategy.cooperative and not coordinates_drivers(strategy):
        planned = is_plannable(scenario)
        able = ", ".join(
            name
            for name, kind in strategies().items()
            if _among_drivers(kind) or (planned and makes_way(kind))
        )
        raise CorampError(
            f"strategy: {strategy.name} cannot run where {why}; allowed are {able}, or {instead}"
        )
    if coordinates_drivers(strategy) and (line := _lag_problem(scenario, strategy)):
        raise CorampError(line)
    integrator = scenario.drivers[population].integrator
    if scenario.has_automated and integrator != "euler":
        raise CorampError(
            f"drivers.{population}.integrator: {integrator} drivers are others than Euler's, and "
            "automated vehicles among them take Euler steps; allowed is euler"
        )


def _lag_problem(scenario: Scenario, strategy: type[Strategy]) -> str:
    """What is wrong with automated vehicles that react too late for this road, else nothing.

    Who passes the nose at v_R must still be able to stop before the acceleration lane ends:
    v_R t + v_R^2 / (2 b) <= the lane, with t the reaction, which is a period of commands at least,
    and the time until a command acts.
    """
    actuators, speed_mps = scenario.actuators, scenario.ramp.speed_mps
    delay_s = actuators.dead_time_s + actuators.lag_s
    law = safety_law_of(scenario, _period_s(scenario, strategy))
    left_m = law.lane_end_m - speed_mps**2 / (2.0 * law.stop_mps2)
    most_s = max(0.0, math.floor(100.0 * (left_m / speed_mps - law.reaction_s)) / 100.0)
    if delay_s == 0.0 or delay_s <= most_s:
        return ""
    key = "lag_s" if actuators.lag_s >= actuators.dead_time_s else "dead_time_s"
    return (
        f"actuators.{key}: who reacts {delay_s:g} s late and passes the nose at ramp.speed_mps "
        f"{speed_mps:g} cannot stop before ramp.acceleration_lane_m "
        f"{scenario.ramp.acceleration_lane_m:g} ends; allowed are dead_time_s and lag_s of up to "
        f"{most_s:g} s together"
    )


def _period_s(scenario: Scenario, strategy: type[Strategy]) -> float:
    """How often (s) a strategy commands vehicles among drivers, in whole steps."""
    own = scenario.strategy.get(strategy.name) or {}
    asked_s = float(own.get("decision_s", getattr(strategy, "decision_s", 0.0)))
    return steps_of_period(asked_s, scenario.control.step_s) * scenario.control.step_s


def _asked_for(scenario: Scenario, strategy: type[Strategy]) -> tuple[str, str]:
    """What is asked of a run that a strategy cannot do, and what to ask for instead."""
    if scenario.network is not None:
        return "the road lies in a network", "coramp's own road"
    imperfect = scenario.is_mixed or scenario.has_faults
    if not scenario.has_one_lane and not (makes_way(strategy) and imperfect):
        return "mainline.lanes is above 1", "mainline.lanes 1"
    if scenario.is_mixed:
        return "[traffic] leaves some vehicles to drivers", "automated shares of 1"
    tables = ", ".join(f"[{t}]" for t in TABLES if not getattr(scenario, t).is_perfect)
    return f"the world is not perfect ({tables})", "none of these tables"


def _among_drivers(strategy: type[Strategy]) -> bool:
    if coordinates_meters(strategy):
        return False  # at one merge site
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
