"""From a name or a file, with overrides, to a validated scenario."""

from collections.abc import Mapping
from typing import Any

from coramp.errors import CorampError
from coramp.scenarios.defaults import with_defaults, with_populations
from coramp.scenarios.demand_flows import with_demand_flows
from coramp.scenarios.listed import with_listed_flows, without_replaced_flows
from coramp.scenarios.measured import with_counts
from coramp.scenarios.model import Scenario
from coramp.scenarios.network_section import check_network, with_path
from coramp.scenarios.population_files import with_population, with_population_of_traffic
from coramp.scenarios.speeds_kmh import data_in_mps, overrides_in_mps
from coramp.scenarios.toml_files import builtin_names, read, validated, with_overrides
from coramp.scenarios.world_sections import with_preset


def load_scenario(
    name: str,
    overrides: Mapping[str, Any] | None = None,
    origins: Mapping[str, str] | None = None,
    populations: Mapping[str, Mapping[str, Any]] | None = None,
) -> Scenario:
    """Returns the built-in scenario of that name, or that of a file, with dotted keys overridden.

    ``origins`` says what to blame for an overridden key, else it is ``--set``. ``populations`` are
    drivers that it is to have beside its own, by name. Raises CorampError with a message for each
    thing that is wrong.
    """
    label, data = read("scenarios", name)
    if "corridor" in data:
        raise CorampError(
            f"{label}: [corridor]: has several merge sites, and this is for one; allowed is "
            "coramp run, or coramp.corridor in Python"
        )
    data = with_path(data, label)
    data, in_kmh = data_in_mps(data, label)
    overrides = overrides or {}
    blamed = {key: (origins or {}).get(key, "--set") for key in overrides}
    overrides, blamed = overrides_in_mps(overrides, blamed)
    data = with_populations(data)
    data = with_overrides(without_replaced_flows(data, overrides), overrides, blamed)
    data = with_population_of_traffic(data, name, "traffic.drivers" in overrides)
    for own, table in (populations or {}).items():
        data = with_population(data, own, table)
    data = with_counts(with_preset(data), label, blamed)
    data = with_demand_flows(data, label, blamed)
    data = with_defaults(with_listed_flows(data, label, blamed), label)
    scenario = validated(Scenario, data, label, {**in_kmh, **blamed})
    check_network(scenario, label)
    return scenario


def builtin_scenarios() -> list[Scenario]:
    """Returns the scenarios that come with coramp."""
    return [load_scenario(name) for name in builtin_names("scenarios")]


def drivers_checked(scenario: Scenario, drivers: str) -> str:
    """Returns the name of a driver population; raises CorampError if the scenario has none such."""
    if drivers not in scenario.drivers:
        known = ", ".join(scenario.drivers) or "none: the scenario has no [drivers.NAME] table"
        raise CorampError(
            f"drivers: there is no {drivers!r} in {scenario.name}; allowed are {known}"
        )
    return drivers


def check_one_lane(scenario: Scenario, who: str, instead: str) -> None:
    """Raises CorampError for a road in a network, or of several lanes; ``instead`` drives there."""
    if scenario.has_one_lane:
        return
    where = "mainline.lanes" if scenario.network is None else "network"
    raise CorampError(
        f"{where}: {who} for coramp's own road of one mainline lane; allowed is such a scenario, "
        f"or {instead}"
    )
