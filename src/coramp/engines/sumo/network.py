"""The road of a scenario as a SUMO network, with its true lengths.

Edges are ``mainline`` and ``ramp`` up to station 0, ``merge`` along the acceleration lane and
``downstream`` behind it. The acceleration lane (lane 0 of ``merge``) is a dead end, so that merging
is a lane change. x is the mainline's station.
"""

import atexit
import math
import os
import shutil
import subprocess
import tempfile
import xml.etree.ElementTree as ET
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import sumo

from coramp.errors import CorampError
from coramp.scenario import Scenario

LANE_WIDTH_M = 3.2
JUNCTION_LENGTH_M = 0.001
"""What SUMO's lanes inside a node take from a vehicle's way; less than it prints."""
LENGTH_TOLERANCE_M = 0.002


def sumo_binary(name: str) -> str:
    """Returns the path of a program of the installed SUMO."""
    return str(Path(sumo.SUMO_HOME) / "bin" / name)


@dataclass(frozen=True)
class RoadPlan:
    """What the network depends on; lengths in m, speeds in m/s."""

    mainline_m: float
    ramp_m: float
    acceleration_lane_m: float
    downstream_m: float
    mainline_limit_mps: float
    ramp_limit_mps: float
    merge_angle_deg: float
    metered: bool = False

    def lane_lengths_m(self) -> dict[str, float]:
        """Returns the length that each lane must have."""
        return {
            "mainline_0": self.mainline_m,
            "ramp_0": self.ramp_m,
            "merge_0": self.acceleration_lane_m,
            "merge_1": self.acceleration_lane_m,
            "downstream_0": self.downstream_m,
        }

    def lane_starts_m(self) -> dict[str, float]:
        """Returns the station at which each lane begins; lanes inside nodes included."""
        return {
            "mainline_0": -self.mainline_m,
            "ramp_0": -self.ramp_m,
            ":nose_0_0": 0.0,
            ":nose_1_0": 0.0,
            "merge_0": 0.0,
            "merge_1": 0.0,
            ":end_0_0": self.acceleration_lane_m,
            "downstream_0": self.acceleration_lane_m,
        }


def road_plan(
    scenario: Scenario, ramp_limit_mps: float | None = None, metered: bool = False
) -> RoadPlan:
    """Returns the plan of a scenario's road, with another speed limit on the ramp if given.

    ``metered`` puts a signal at the nose.
    """
    mainline, ramp = scenario.mainline, scenario.ramp
    return RoadPlan(
        mainline_m=-mainline.start_m,
        ramp_m=-ramp.start_m,
        acceleration_lane_m=ramp.acceleration_lane_m,
        downstream_m=mainline.end_m - ramp.acceleration_lane_m,
        mainline_limit_mps=mainline.limit_mps,
        ramp_limit_mps=ramp.limit_mps if ramp_limit_mps is None else ramp_limit_mps,
        merge_angle_deg=ramp.merge_angle_deg,
        metered=metered,
    )


@cache
def network_file(plan: RoadPlan) -> Path:
    """Returns the network of a plan, built by netconvert once in this process.

    Raises CorampError where netconvert fails or a lane gets another length than planned.
    """
    folder = Path(tempfile.mkdtemp(prefix="coramp-net-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    (folder / "road.nod.xml").write_text(_nodes(plan))
    (folder / "road.edg.xml").write_text(_edges(plan))
    (folder / "road.con.xml").write_text(_connections(plan))
    target = folder / "net.net.xml"
    command = [
        sumo_binary("netconvert"),
        *("--node-files", "road.nod.xml", "--edge-files", "road.edg.xml"),
        *("--connection-files", "road.con.xml", "--output-file", target.name),
        *("--offset.disable-normalization", "true", "--precision", "3"),
        *("--junctions.limit-turn-speed", "-1", "--no-turnarounds", "true"),
    ]
    result = subprocess.run(
        command, cwd=folder, capture_output=True, text=True, env=_environment(), check=False
    )
    if result.returncode != 0 or not target.exists():
        raise CorampError(f"netconvert: {result.stderr.strip().splitlines()[-1:] or 'failed'}")
    _check_lengths(target, plan)
    return target


def _environment() -> dict[str, str]:
    return {**os.environ, "SUMO_HOME": sumo.SUMO_HOME}


def _check_lengths(file: Path, plan: RoadPlan) -> None:
    root = ET.parse(file).getroot()
    lengths_m = {lane.get("id", ""): float(lane.get("length", "nan")) for lane in root.iter("lane")}
    for lane, wanted_m in plan.lane_lengths_m().items():
        if not abs(lengths_m.get(lane, math.nan) - wanted_m) <= LENGTH_TOLERANCE_M:
            raise CorampError(
                f"netconvert: lane {lane} became {lengths_m.get(lane)} m long; "
                f"wanted is {wanted_m:.3f} m"
            )


def ramp_shape_m(plan: RoadPlan) -> list[tuple[float, float]]:
    """Returns the ramp's centre line: at the merge angle, then beside the mainline up to x = 0."""
    beside_m = min(30.0, plan.ramp_m / 4.0)
    angle = math.radians(plan.merge_angle_deg)
    away_m = plan.ramp_m - beside_m
    bend = (-beside_m, -LANE_WIDTH_M)
    start = (bend[0] - away_m * math.cos(angle), bend[1] - away_m * math.sin(angle))
    return [start, bend, (0.0, -LANE_WIDTH_M)]


def _nodes(plan: RoadPlan) -> str:
    end_m = plan.acceleration_lane_m + plan.downstream_m
    (ramp_x, ramp_y), *_ = ramp_shape_m(plan)
    nose = "traffic_light" if plan.metered else "unregulated"
    places = [
        ("west", -plan.mainline_m, 0.0, ""),
        ("rampstart", ramp_x, ramp_y, ""),
        ("nose", 0.0, 0.0, f' type="{nose}" radius="0"'),
        ("end", plan.acceleration_lane_m, 0.0, ' type="unregulated" radius="0"'),
        ("east", end_m, 0.0, ""),
    ]
    lines = [f'  <node id="{n}" x="{x:.6f}" y="{y:.6f}"{rest}/>' for n, x, y, rest in places]
    return "\n".join(["<nodes>", *lines, "</nodes>"])


def _edges(plan: RoadPlan) -> str:
    main, ramp = plan.mainline_limit_mps, plan.ramp_limit_mps
    shape = " ".join(f"{x:.6f},{y:.6f}" for x, y in ramp_shape_m(plan))
    edge_y = LANE_WIDTH_M / 2.0
    return f"""<edges>
  <edge id="mainline" from="west" to="nose" numLanes="1" speed="{main!r}" spreadType="center"/>
  <edge id="ramp" from="rampstart" to="nose" numLanes="1" speed="{ramp!r}" spreadType="center"
        shape="{shape}" length="{plan.ramp_m!r}"/>
  <edge id="merge" from="nose" to="end" numLanes="2" speed="{main!r}"
        shape="0,{edge_y} {plan.acceleration_lane_m!r},{edge_y}">
    <lane index="0" acceleration="1"/>
  </edge>
  <edge id="downstream" from="end" to="east" numLanes="1" speed="{main!r}" spreadType="center"/>
</edges>"""


def _connections(plan: RoadPlan) -> str:
    rest = f'length="{JUNCTION_LENGTH_M}" speed="{plan.mainline_limit_mps!r}"'
    return f"""<connections>
  <connection from="mainline" to="merge" fromLane="0" toLane="1" {rest}/>
  <connection from="ramp" to="merge" fromLane="0" toLane="0" {rest}/>
  <connection from="merge" to="downstream" fromLane="1" toLane="0" {rest}/>
</connections>"""
