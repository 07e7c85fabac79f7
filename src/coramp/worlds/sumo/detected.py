"""What a scenario's detectors tell of drivers whom nobody controls.

Plain ``sumo`` runs in a process of its own, with induction loops and no other output, so that
several runs may go on at a time in threads.
"""

import subprocess
import tempfile
from pathlib import Path

import polars as pl

from coramp.demand.arrivals import arrivals_of
from coramp.errors import CorampError
from coramp.records.run_folder import SUMO_DETECTED, SUMO_DETECTORS
from coramp.scenarios.model import Scenario
from coramp.scenarios.sections import DriverPopulation
from coramp.worlds.sumo.demand import driver_routes
from coramp.worlds.sumo.detectors import counted, loops_file, loops_of
from coramp.worlds.sumo.files import PLAIN_OPTIONS
from coramp.worlds.sumo.lanes import LanedRoad, road_of
from coramp.worlds.sumo.network import sumo_binary
from coramp.worlds.sumo.traits import traits_of

ROUTES, CLOSED = "routes.rou.xml", "closed.add.xml"


def build_network(scenario: Scenario, drivers: DriverPopulation) -> None:
    """Builds the network of a run, which is kept for later ones: once, before threads need it."""
    _ = road_of(scenario, drivers).file


def detected(scenario: Scenario, drivers: DriverPopulation, seed: int) -> pl.DataFrame:
    """Returns what detectors counted up to the horizon, in the columns of counts.

    Arrivals and drivers are those of an uncontrolled run with that seed, cars without automation.
    Raises CorampError where SUMO fails.
    """
    road, arrivals = road_of(scenario, drivers), arrivals_of(scenario, seed)
    laned = road if isinstance(road, LanedRoad) else None
    traits = traits_of(drivers, arrivals, seed)
    routes = driver_routes(scenario, drivers, arrivals, traits, road=laned)
    loops = loops_of(scenario, road, arrivals, routes)
    with tempfile.TemporaryDirectory(prefix="coramp-") as name:
        folder = Path(name)
        (folder / ROUTES).write_text(routes)
        (folder / SUMO_DETECTORS).write_text(loops_file(loops))
        additional = [SUMO_DETECTORS]
        if road.additional is not None:
            (folder / CLOSED).write_text(road.additional)
            additional.append(CLOSED)
        command = [
            *(sumo_binary("sumo"), "--net-file", str(road.file)),
            *("--route-files", ROUTES, "--additional-files", ",".join(additional), *road.options),
            *("--seed", str(seed), *PLAIN_OPTIONS, "--no-warnings", "true"),
            *("--step-length", repr(scenario.control.step_s)),
            *("--end", repr(scenario.simulation.horizon_s)),
            *("--step-method.ballistic", str(drivers.integrator == "ballistic").lower()),
        ]
        result = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
        if result.returncode != 0:
            last = result.stderr.strip().splitlines()[-1:] or ["failed"]
            raise CorampError(f"SUMO: {last[0]}")
        return counted(folder / SUMO_DETECTED, loops)
