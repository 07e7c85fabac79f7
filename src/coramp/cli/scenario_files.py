"""Writing a scenario of a merge site in a SUMO network, and networks of OpenStreetMap's files."""

import os
import shutil
import subprocess
import tempfile
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import sumo
import tomli_w

from coramp.demand.arrivals import arrivals_of
from coramp.errors import CorampError
from coramp.networks.net_file import read_network
from coramp.networks.ramps import on_ramps
from coramp.records.files import write_text
from coramp.scenarios.counted import path_from
from coramp.scenarios.defaults import with_defaults, with_populations
from coramp.scenarios.demand_flows import with_demand_flows
from coramp.scenarios.measured import COUNTS, with_counts
from coramp.scenarios.model import Scenario
from coramp.scenarios.network_section import sha256_of
from coramp.scenarios.new_corridor import new_corridor_text
from coramp.scenarios.of_ramp import reason_against, scenario_data
from coramp.scenarios.toml_files import validated

Changed = Callable[[dict[str, Any]], dict[str, Any]]
"""What makes another content of a scenario's."""
MODERATE_LANE_VEH_H, MODERATE_RAMP_VEH_H = 1000.0, 300.0
"""Moderate traffic, with which a new scenario begins."""
OSM_OPTIONS = (
    "--geometry.remove",
    *("--ramps.guess", "--junctions.join"),
    *("--roundabouts.guess", "--tls.guess-signals", "--tls.discard-simple", "--tls.join"),
    *("--remove-edges.isolated", "--no-turnarounds"),
)
"""What SUMO's documentation recommends for networks of OpenStreetMap with motorways."""


def new_scenario_data(
    network: Path, lies_in: Path, ramp_id: str | None, beside: Path
) -> dict[str, Any]:
    """Returns the content of a scenario of an on-ramp; paths count from the folder ``beside``.

    ``network`` is read, and is to be where ``lies_in`` says. Raises CorampError where there is no
    such ramp, or coramp cannot drive there.
    """
    found = on_ramps(read_network(network))
    try:
        site = found.only() if ramp_id is None else found.named(ramp_id)
    except CorampError as error:
        raise CorampError(f"{lies_in}: {error}") from error
    if reason := reason_against(site):
        raise CorampError(f"{lies_in}: {site.ramp_id} cannot be coordinated: {reason}")
    data: dict[str, Any] = scenario_data(site)
    data["network"] = {
        "file": path_from(lies_in, beside),
        "sha256": sha256_of(network),
        "ramp": site.ramp_id,
    }
    lanes = data["mainline"]["lanes"]
    data["mainline"]["flow_veh_h"] = MODERATE_LANE_VEH_H * lanes
    data["ramp"]["flow_veh_h"] = MODERATE_RAMP_VEH_H
    return data


FIRST_SEED = 1
"""With it is tried whether vehicles can come as they were counted."""
HEAD = "Lengths, lanes and limits are those of the network; set the flows and what else you need."
COUNTED = "The demand is that of the counts; detectors and shares of types follow from them."
FIRST = ("name", "description", "network", "mainline", "ramp")


def new_scenario_text(data: Mapping[str, Any], target: Path) -> str:
    """Returns the TOML text of a scenario's content, for a file; what it leaves out is as usual.

    Raises CorampError where it is no valid scenario.
    """
    data = {"name": target.stem, **data}
    label = str(target)
    complete = with_demand_flows(with_counts(with_populations(data), label, {}), label, {})
    scenario = validated(Scenario, with_defaults(complete, label), label)
    if COUNTS in data:
        try:
            arrivals_of(scenario, FIRST_SEED)
        except CorampError as error:
            raise CorampError(*(f"{label}: {line}" for line in error.messages)) from error
    keys = [*(key for key in FIRST if key in data), *(key for key in data if key not in FIRST)]
    heads = [HEAD] if "network" in data else []
    heads += [COUNTED] if COUNTS in data else []
    comments = "".join(f"# {head}\n" for head in heads)
    return f"{comments}{tomli_w.dumps({key: data[key] for key in keys})}"


def _text(
    target: Path, network: Path, lies_in: Path, ramp_ids: Sequence[str], changed: Changed
) -> str:
    """The text of a scenario of an on-ramp, the only one where no id is given; or of a corridor."""
    if len(ramp_ids) < 2:
        ramp_id = ramp_ids[0] if ramp_ids else None
        data = new_scenario_data(network, lies_in, ramp_id, target.parent)
        return new_scenario_text(changed(data), target)
    place = path_from(lies_in, target.parent)
    flows_veh_h = MODERATE_LANE_VEH_H, MODERATE_RAMP_VEH_H
    return new_corridor_text(target.stem, network, place, ramp_ids, flows_veh_h)


def write_new_scenario(
    target: Path, network: Path, ramp_ids: Sequence[str], changed: Changed = dict
) -> None:
    """Writes the scenario of an on-ramp of a network, the only one where no id is given.

    Several ids, in the order of driving, are a corridor. ``changed`` may give a single one another
    demand.
    """
    write_text(target, _text(target, network, network, ramp_ids, changed))


def write_new_scenario_of_osm(
    target: Path, osm: Path, ramp_ids: Sequence[str], changed: Changed = dict
) -> None:
    """Writes a scenario, and beside it the network that netconvert makes of an OSM file.

    The command is kept as well. Raises CorampError where netconvert fails, or there is no such
    on-ramp; then nothing is written.
    """
    network = target.with_name(f"{target.stem}.net.xml")
    if network.exists():
        raise CorampError(f"{network}: is there already; use it by --net, or give another name")
    if not osm.is_file():
        raise CorampError(f"--osm: {osm}: no such file; allowed is an extract of OpenStreetMap")
    command = ["netconvert", "--osm-files", str(osm), *OSM_OPTIONS, "--output-file"]
    with tempfile.TemporaryDirectory(prefix="coramp-osm-") as folder:
        built = Path(folder) / network.name
        _convert([*command, str(built)], osm, built)
        text = _text(target, built, network, ramp_ids, changed)
        shutil.move(built, network)
    told = target.with_name(f"{target.stem}.netconvert.txt")
    write_text(told, " ".join([*command, str(network)]) + "\n")
    write_text(target, text)


def _convert(command: list[str], osm: Path, built: Path) -> None:
    program = str(Path(sumo.SUMO_HOME) / "bin" / command[0])
    environment = {**os.environ, "SUMO_HOME": sumo.SUMO_HOME}
    done = subprocess.run(
        [program, *command[1:]], capture_output=True, text=True, env=environment, check=False
    )
    if done.returncode != 0 or not built.exists():
        told = [line for line in done.stderr.splitlines() if line.startswith("Error")]
        raise CorampError(
            f"--osm: {osm}: netconvert: {(told or ['failed'])[0]}; allowed is an extract of "
            "OpenStreetMap"
        )
