"""What must fit together in the tables of a world that fails."""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from coramp.scenarios.model import Scenario

EXPIRES = {
    "reports": ("stale_s", "every report is stale"),
    "commands": ("valid_s", "every command has expired"),
}
"""By table: for how long a message counts, and what becomes of one that takes as long."""


def world_problems(scenario: "Scenario") -> list[str]:
    """Returns a line ``key: what is wrong; what is allowed`` for all that contradicts itself."""
    return [*_late_messages(scenario), *_incident_problems(scenario)]


def _late_messages(scenario: "Scenario") -> list[str]:
    """Latency that is the same for all messages must be less than what makes them worthless."""
    problems = []
    for table, (key, becomes) in EXPIRES.items():
        link = getattr(scenario, table)
        counts_s = getattr(link, key)
        if link.delay_shape is None and link.delay_s >= counts_s:
            problems.append(
                f"{table}.delay_s: {link.delay_s:g} is not below {table}.{key}, so that {becomes} "
                f"when it arrives; allowed is below {counts_s:g} s"
            )
    return problems


def _incident_problems(scenario: "Scenario") -> list[str]:
    """A vehicle can break down only where the road is."""
    incidents, mainline, ramp = scenario.incidents, scenario.mainline, scenario.ramp
    if incidents.breakdown_s is None:
        return []
    first_m, last_m = ramp.start_m, ramp.acceleration_lane_m
    if incidents.place == "mainline":
        first_m, last_m = mainline.start_m, mainline.end_m
    if first_m < incidents.station_m < last_m:
        return []
    where = "ramp and acceleration lane" if incidents.place == "ramp" else "mainline"
    line = f"incidents.station_m: {incidents.station_m:g} is not on the {where}; allowed is between"
    return [f"{line} {first_m:g} and {last_m:g} m"]
