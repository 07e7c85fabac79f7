"""Writing a scenario of a merge site in a SUMO network, and networks of OpenStreetMap's files."""

import os
import shutil
import subprocess
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import sumo
import tomli_w

from coramp.errors import CorampError
from coramp.networks.net_file import read_network
from coramp.networks.ramps import on_ramps
from coramp.scenarios.counted import path_from
from coramp.scenarios.defaults import with_defaults, with_populations
from coramp.scenarios.demand_flows import with_demand_flows
from coramp.scenarios.measured import COUNTS, with_counts
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


def new_scenario_data(network: Path, ramp_id: str, beside: Path) -> dict[str, Any]:
    """Returns the content of a scenario of an on-ramp; paths count from the folder ``beside``.

    Raises CorampError where there is no such ramp, or coramp cannot drive there.
    """
    found = on_ramps(read_network(network))
    try:
        site = found.named(ramp_id)
    except CorampError as error:
        raise CorampError(f"{network}: {error}") from error
    if reason := reason_against(site):
        raise CorampError(f"{network}: {ramp_id} cannot be coordinated: {reason}")
    data: dict[str, Any] = scenario_data(site)
    data["network"] = {
        "file": path_from(network, beside),
        "sha256": sha256_of(network),
        "ramp": ramp_id,
    }
    lanes = data["mainline"]["lanes"]
    data["mainline"]["flow_veh_h"] = MODERATE_LANE_VEH_H * lanes
    data["ramp"]["flow_veh_h"] = MODERATE_RAMP_VEH_H
    return data


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
    validated(Scenario, with_defaults(complete, label), label)
    keys = [*(key for key in FIRST if key in data), *(key for key in data if key not in FIRST)]
    heads = [HEAD] if "network" in data else []
    heads += [COUNTED] if COUNTS in data else []
    comments = "".join(f"# {head}\n" for head in heads)
    return f"{comments}{tomli_w.dumps({key: data[key] for key in keys})}"


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
