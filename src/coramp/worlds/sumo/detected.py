"""What detectors on the road of a scenario tell of drivers whom nobody controls.

Plain ``sumo`` runs in a process of its own, with induction loops and no other output, so that
several runs may go on at a time in threads.
"""

import subprocess
import tempfile
import xml.etree.ElementTree as ET
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import polars as pl

from coramp.coordination.plant import Arrival
from coramp.errors import CorampError
from coramp.scenarios.model import Scenario
from coramp.scenarios.sections import DriverPopulation
from coramp.worlds.sumo.demand import driver_routes
from coramp.worlds.sumo.files import PLAIN_OPTIONS
from coramp.worlds.sumo.network import RoadPlan, driver_road_plan, network_file, sumo_binary
from coramp.worlds.sumo.traits import traits_of

READINGS = {
    "begin_s": pl.Float64,
    "end_s": pl.Float64,
    "detector": pl.String,
    "vehicles": pl.Int64,
    "mean_speed_mps": pl.Float64,
}
"""Columns of what detectors told; the speed is null where nobody passed."""


@dataclass(frozen=True)
class Loop:
    """A detector across the lane of one road, at a station (m, 0 at the nose).

    ``road`` is ``mainline``, or ``ramp`` with its acceleration lane.
    """

    id: str
    road: Literal["mainline", "ramp"]
    station_m: float


@dataclass(frozen=True)
class Observed:
    """A stretch of time on a road: who arrives, which loops look, how often and how long."""

    arrivals: Sequence[Arrival]
    loops: Sequence[Loop]
    interval_s: float
    end_s: float


def detected(
    scenario: Scenario, drivers: DriverPopulation, observed: Observed, seed: int
) -> pl.DataFrame:
    """Returns what loops told in each interval, by loop and time, in columns ``READINGS``.

    Raises CorampError where SUMO fails, or a loop does not lie on the road.
    """
    plan = driver_road_plan(scenario, drivers)
    with tempfile.TemporaryDirectory(prefix="coramp-") as name:
        folder = Path(name)
        traits = traits_of(drivers, observed.arrivals, seed)
        (folder / "routes.rou.xml").write_text(
            driver_routes(scenario, drivers, observed.arrivals, traits)
        )
        (folder / "loops.add.xml").write_text(_loops(plan, observed))
        ballistic = "true" if drivers.integrator == "ballistic" else "false"
        command = [
            *(sumo_binary("sumo"), "--net-file", str(network_file(plan))),
            *("--route-files", "routes.rou.xml", "--additional-files", "loops.add.xml"),
            *("--seed", str(seed), *PLAIN_OPTIONS, "--no-warnings", "true"),
            *("--step-length", repr(scenario.control.step_s), "--end", repr(observed.end_s)),
            *("--step-method.ballistic", ballistic),
        ]
        result = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
        if result.returncode != 0:
            last = result.stderr.strip().splitlines()[-1:] or ["failed"]
            raise CorampError(f"SUMO: {last[0]}")
        return _readings(folder / "readings.xml")


def lane_of(plan: RoadPlan, loop: Loop) -> tuple[str, float]:
    """Returns the lane that a loop lies on and its position (m) along it.

    Raises CorampError where the road does not go so far.
    """
    if loop.road == "ramp":
        lanes, end_m = ("ramp_0", "merge_0"), plan.acceleration_lane_m
    else:
        lanes = ("mainline_0", "merge_1", "downstream_0")
        end_m = plan.acceleration_lane_m + plan.downstream_m
    starts_m = plan.lane_starts_m()
    first_m = starts_m[lanes[0]]
    if not first_m <= loop.station_m <= end_m:
        raise CorampError(
            f"detector {loop.id}: station {loop.station_m:g} m is not on the {loop.road}; "
            f"allowed is {first_m:g} to {end_m:g} m"
        )
    lane = max((lane for lane in lanes if starts_m[lane] <= loop.station_m), key=starts_m.get)
    return lane, loop.station_m - starts_m[lane]


def _loops(plan: RoadPlan, observed: Observed) -> str:
    lines = ["<additional>"]
    for loop in observed.loops:
        lane, place_m = lane_of(plan, loop)
        lines.append(
            f'  <inductionLoop id="{loop.id}" lane="{lane}" pos="{place_m!r}" '
            f'period="{observed.interval_s!r}" file="readings.xml"/>'
        )
    return "\n".join([*lines, "</additional>", ""])


def _readings(file: Path) -> pl.DataFrame:
    rows = [
        (
            float(found.get("begin", "nan")),
            float(found.get("end", "nan")),
            found.get("id", ""),
            int(found.get("nVehContrib", "0")),
            float(found.get("speed", "-1")),
        )
        for found in ET.parse(file).getroot().iter("interval")
    ]
    frame = pl.DataFrame(rows, schema=READINGS, orient="row")
    speed = pl.when(pl.col("vehicles") > 0).then("mean_speed_mps")
    return frame.with_columns(mean_speed_mps=speed).sort("detector", "begin_s")
