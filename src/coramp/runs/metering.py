"""Runs with ramp metering: what cannot be metered, and what room a metered ramp has."""

from coramp.errors import CorampError
from coramp.scenarios.corridors import Corridor
from coramp.scenarios.model import Scenario
from coramp.strategies.base import Strategy, coordinates_meters, is_metered
from coramp.strategies.registry import strategies, strategy_named
from coramp.worlds.sumo.metered_road import metering_problem, room_line


def check_metering(scenario: Scenario, strategy: type[Strategy], population: str) -> None:
    """Raises CorampError for a ramp without room for a signal, and for a strategy of several."""
    if not is_metered(strategy):
        return
    if coordinates_meters(strategy):
        raise CorampError(
            f"strategy: {strategy.name} coordinates the meters of several ramps; allowed is a "
            "corridor of two or more, or alinea for one ramp"
        )
    if line := metering_problem(scenario, scenario.drivers[population]):
        raise CorampError(line)


def check_metered_corridor(corridor: Corridor, strategy: type[Strategy], population: str) -> None:
    """Raises CorampError where a strategy cannot meter the ramps of a corridor.

    Coordination takes two ramps or more on one road.
    """
    if not is_metered(strategy):
        return
    if not hasattr(strategy, "meter"):
        able = ", ".join(name for name, kind in strategies().items() if hasattr(kind, "meter"))
        raise CorampError(
            f"strategy: {strategy.name} meters one ramp, not those of a corridor; allowed are "
            f"{able}"
        )
    most = max(len(road.sites) for road in corridor.roads)
    if coordinates_meters(strategy) and most < 2:
        raise CorampError(
            f"strategy: {strategy.name} coordinates ramps one behind the other, and each road here "
            "has one; allowed is a corridor with two or more on a road, or alinea"
        )
    for site, scenario in zip(corridor.sites, corridor.scenarios, strict=True):
        if line := metering_problem(scenario, scenario.drivers[population]):
            raise CorampError(f"{site.ramp_id}: {line}")


def room_lines(corridor: Corridor, strategy: str, population: str) -> list[str]:
    """Returns what room each metered ramp of a corridor has; nothing where none is metered."""
    if not is_metered(strategy_named(strategy)):
        return []
    return [
        f"{strategy}: {site.ramp_id}: {room_line(scenario, scenario.drivers[population])}"
        for site, scenario in zip(corridor.sites, corridor.scenarios, strict=True)
    ]


def room_notice(scenario: Scenario, strategy: str, population: str | None) -> str | None:
    """Returns what room a metered ramp has, on roads of several lanes and in networks; else None.

    coramp's own road of one lane has the room that its scenario says.
    """
    if population is None or scenario.has_one_lane or not is_metered(strategy_named(strategy)):
        return None
    return f"{strategy}: {room_line(scenario, scenario.drivers[population])}"
