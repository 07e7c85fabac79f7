"""Writing a scenario of a merge site in a SUMO network, and networks of OpenStreetMap's files."""

import os
import shutil
import subprocess
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import sumo
import tomli_w

from coramp.errors import CorampError
from coramp.networks.net_file import read_network
from coramp.networks.ramps import on_ramps
from coramp.scenarios.corridors import corridor_of
from coramp.scenarios.defaults import with_defaults, with_populations
from coramp.scenarios.model import Scenario
from coramp.scenarios.network_section import sha256_of
from coramp.scenarios.of_ramp import reason_against, scenario_data
from coramp.scenarios.toml_files import validated

MODERATE_LANE_VEH_H, MODERATE_RAMP_VEH_H = 1000.0, 300.0
"""Moderate traffic, with which a new scenario begins."""
OSM_OPTIONS = (
    "--geometry.remove",
    *("--ramps.guess", "--junctions.join"),
    *("--roundabouts.guess", "--tls.guess-signals", "--tls.discard-simple", "--tls.join"),
    *("--remove-edges.isolated", "--no-turnarounds"),
)
"""What SUMO's documentation recommends for networks of OpenStreetMap with motorways."""


def new_scenario_text(name: str, network: Path, ramp_id: str, beside: Path) -> str:
    """Returns the TOML text of a scenario of an on-ramp; paths count from the folder ``beside``.

    Raises CorampError where there is no such ramp, or coramp cannot drive there.
    """
    found = on_ramps(read_network(network))
    try:
        site = found.named(ramp_id)
    except CorampError as error:
        raise CorampError(f"{network}: {error}") from error
    if reason := reason_against(site):
        raise CorampError(f"{network}: {ramp_id} cannot be coordinated: {reason}")
    data: dict[str, Any] = {"name": name, **scenario_data(site)}
    data["network"] = {
        "file": _path_from(network, beside),
        "sha256": sha256_of(network),
        "ramp": ramp_id,
    }
    lanes = data["mainline"]["lanes"]
    data["mainline"]["flow_veh_h"] = MODERATE_LANE_VEH_H * lanes
    data["ramp"]["flow_veh_h"] = MODERATE_RAMP_VEH_H
    validated(Scenario, with_defaults(with_populations(data), name), name)
    ordered = {key: data[key] for key in ("name", "description", "network", "mainline", "ramp")}
    return f"# {HEAD}\n{tomli_w.dumps(ordered)}"


def new_text(name: str, network: Path, ramp_ids: Sequence[str], beside: Path) -> str:
    """Returns the TOML text of a scenario of an on-ramp, or of a corridor of several.

    Paths count from the folder ``beside``. Raises CorampError where coramp cannot drive there.
    """
    if len(ramp_ids) == 1:
        return new_scenario_text(name, network, ramp_ids[0], beside)
    section: dict[str, Any] = {
        "file": str(network.absolute()),
        "sha256": sha256_of(network),
        "sites": list(ramp_ids),
        "mainline_flow_veh_h": 0.0,
        "ramp_flow_veh_h": [MODERATE_RAMP_VEH_H] * len(ramp_ids),
    }
    whole = corridor_of({"name": name, "corridor": section}, str(network))
    lanes = [len(road.sites[0].mainline_edge.lanes) for road in whole.roads]
    flows = [MODERATE_LANE_VEH_H * count for count in lanes]
    section["file"] = _path_from(network, beside)
    section["mainline_flow_veh_h"] = flows[0] if len(flows) == 1 else flows
    exits = [way.edge_id for road in whole.roads for way in road.exits]
    section["exits"] = [{"edge": edge_id, "share": EXIT_SHARE} for edge_id in exits]
    data = {"name": name, "corridor": section}
    corridor_of({**data, "corridor": {**section, "file": str(network.absolute())}}, name)
    return f"# {CORRIDOR_HEAD}\n{tomli_w.dumps(data)}"


EXIT_SHARE = 0.1
"""The share of vehicles that leave at each exit of a new corridor."""
CORRIDOR_HEAD = (
    "Sites stand in the order of driving; set the flows, the exits' shares and what else you need."
)
HEAD = "Lengths, lanes and limits are those of the network; set the flows and what else you need."


def _path_from(network: Path, beside: Path) -> str:
    """The path of a network from a folder where it lies inside, else the whole path."""
    whole, folder = network.absolute(), beside.absolute()
    return str(whole.relative_to(folder)) if whole.is_relative_to(folder) else str(whole)


def osm_network_beside(osm: Path, scenario: Path) -> Path:
    """Returns the network that netconvert makes beside a scenario; an earlier one is refused."""
    target = scenario.with_name(f"{scenario.stem}.net.xml")
    if target.exists():
        raise CorampError(f"{target}: is there already; use it by --net, or give another name")
    network_of_osm(osm, target)
    return target


def network_of_osm(osm: Path, target: Path) -> None:
    """Writes the network of a file of OpenStreetMap, and the command that made it beside it.

    Raises CorampError where netconvert fails; then nothing is written.
    """
    if not osm.is_file():
        raise CorampError(f"--osm: {osm}: no such file; allowed is an extract of OpenStreetMap")
    command = ["netconvert", "--osm-files", str(osm), *OSM_OPTIONS]
    command += ["--output-file", str(target)]
    with tempfile.TemporaryDirectory(prefix="coramp-osm-") as folder:
        built = Path(folder) / target.name
        run = [str(Path(sumo.SUMO_HOME) / "bin" / "netconvert"), *command[1:-1], str(built)]
        environment = {**os.environ, "SUMO_HOME": sumo.SUMO_HOME}
        done = subprocess.run(run, capture_output=True, text=True, env=environment, check=False)
        if done.returncode != 0 or not built.exists():
            told = [line for line in done.stderr.splitlines() if line.startswith("Error")]
            raise CorampError(f"--osm: {osm}: netconvert: {(told or ['failed'])[0]}")
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.move(built, target)
    target.with_name(target.name.removesuffix(".net.xml") + ".netconvert.txt").write_text(
        " ".join(command) + "\n", encoding="utf-8"
    )
