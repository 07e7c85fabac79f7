"""The road of a scenario as a SUMO network, with its true lengths.

Edges are ``mainline`` and ``ramp`` up to station 0, ``merge`` along the acceleration lane and
``downstream`` behind it. The acceleration lane (lane 0 of ``merge``) is a dead end, so that merging
is a lane change. x is the mainline's station. Where the ramp is metered, ``ramp`` ends at the stop
line and ``gore`` leads on from there. The mainline has one lane or several.
"""

import atexit
import math
import os
import shutil
import subprocess
import tempfile
import xml.etree.ElementTree as ET
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import NamedTuple

import sumo

from coramp.errors import CorampError
from coramp.scenarios.model import Scenario
from coramp.scenarios.sections import DriverPopulation

LANE_WIDTH_M = 3.2
MOST_LANES = 4
"""So many lanes the mainline has at most."""
RAMP_LANES = frozenset({"ramp_0", ":stopline_0_0", "gore_0", "merge_0"}) | frozenset(
    f":nose_{lanes}_0" for lanes in range(1, MOST_LANES + 1)
)
"""The ramp's lanes, on roads of any number of lanes: its link at the nose comes after theirs."""
RAMP_LANE = -1
"""The number of the ramp and its acceleration lane; those of the mainline count from 0 on."""
MADE_RAMP = "ramp@merge"
JUNCTION_LENGTH_M = 0.001
"""What SUMO's lanes inside a node take from a vehicle's way; less than it prints."""
LENGTH_TOLERANCE_M = 0.002


def sumo_binary(name: str) -> str:
    """Returns the path of a program of the installed SUMO."""
    return str(Path(sumo.SUMO_HOME) / "bin" / name)


class LaneSpan(NamedTuple):
    """Where one of SUMO's lanes lies: the stations between which, and metres of station a metre.

    ``lane`` is its number: that of the mainline, 0 next to the ramp, or ``RAMP_LANE``. ``changes``
    tells that a vehicle can change from it to the next lane of the mainline further in.
    """

    start_m: float
    end_m: float
    per_m: float
    lane: int
    changes: bool


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
    gore_m: float = 0.0
    lanes: int = 1

    @property
    def file(self) -> Path:
        """The network's file."""
        return network_file(self)

    @property
    def options(self) -> tuple[str, ...]:
        """SUMO's options for this network: none."""
        return ()

    @property
    def additional(self) -> str | None:
        """What SUMO is told beside the network: nothing."""
        return None

    def spans(self) -> dict[str, LaneSpan]:
        """Returns where each lane lies, as ``lane_starts_m``."""
        found, length_m = {}, self.lane_lengths_m()
        for lane, start_m in self.lane_starts_m().items():
            edge, _, index = lane.rpartition("_")
            number = RAMP_LANE if lane in RAMP_LANES else int(index) - (edge == "merge")
            end_m = start_m + length_m.get(lane, 0.0)
            beside = lane in length_m and (number > RAMP_LANE or edge == "merge")
            found[lane] = LaneSpan(start_m, end_m, 1.0, number, beside and number < self.lanes - 1)
        return found

    def lane_lengths_m(self) -> dict[str, float]:
        """Returns the length that each lane must have."""
        lengths_m = {
            "ramp_0": self.ramp_m - self.gore_m,
            "gore_0": self.gore_m,
            "merge_0": self.acceleration_lane_m,
        }
        for k in range(self.lanes):
            lengths_m[f"mainline_{k}"] = self.mainline_m
            lengths_m[f"merge_{k + 1}"] = self.acceleration_lane_m
            lengths_m[f"downstream_{k}"] = self.downstream_m
        return {lane: length_m for lane, length_m in lengths_m.items() if length_m > 0.0}

    def lane_starts_m(self) -> dict[str, float]:
        """Returns the station at which each lane begins; lanes inside nodes included."""
        starts_m = {
            "ramp_0": -self.ramp_m,
            ":stopline_0_0": -self.gore_m,
            "gore_0": -self.gore_m,
            f":nose_{self.lanes}_0": 0.0,
            "merge_0": 0.0,
        }
        for k in range(self.lanes):
            starts_m[f"mainline_{k}"] = -self.mainline_m
            starts_m[f":nose_0_{k}"] = starts_m[f"merge_{k + 1}"] = 0.0
            starts_m[f":end_0_{k}"] = self.acceleration_lane_m
            starts_m[f"downstream_{k}"] = self.acceleration_lane_m
        return starts_m

    def lane_index(self, number: int, station_m: float) -> int:
        """Returns SUMO's index of a lane of the mainline, by its number, at a station."""
        return number + 1 if 0.0 <= station_m < self.acceleration_lane_m else number


def road_plan(scenario: Scenario) -> RoadPlan:
    """Returns the plan of a scenario's road."""
    mainline, ramp = scenario.mainline, scenario.ramp
    return RoadPlan(
        mainline_m=-mainline.start_m,
        ramp_m=-ramp.start_m,
        acceleration_lane_m=ramp.acceleration_lane_m,
        downstream_m=mainline.end_m - ramp.acceleration_lane_m,
        mainline_limit_mps=mainline.limit_mps,
        ramp_limit_mps=ramp.limit_mps,
        merge_angle_deg=ramp.merge_angle_deg,
        lanes=mainline.lanes,
    )


def driver_road_plan(
    scenario: Scenario, drivers: DriverPopulation, metered: bool = False
) -> RoadPlan:
    """Returns the plan of the road for drivers, who find their wishes on its limits.

    Free flow is v_R0 on the ramp; where drivers wish more or less than the common speed by a
    factor, that is SUMO's factor of the limit, and so v0 is the limit of the mainline. ``metered``
    puts a signal on the ramp.
    """
    plan = road_plan(scenario)
    if drivers.wish == "free-flow":
        plan = replace(plan, ramp_limit_mps=scenario.ramp.speed_mps)
    if drivers.speed_factor is not None:
        plan = replace(plan, mainline_limit_mps=scenario.mainline.speed_mps)
    return replace(plan, gore_m=-scenario.signal_station_m) if metered else plan


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


def _gore_shape_m(plan: RoadPlan) -> list[tuple[float, float]]:
    """The ramp's centre line from the stop line on."""
    start, bend, nose = ramp_shape_m(plan)
    beside_m = nose[0] - bend[0]
    if plan.gore_m <= beside_m:
        return [(-plan.gore_m, bend[1]), nose]
    share = (plan.gore_m - beside_m) / (plan.ramp_m - beside_m)
    line = (bend[0] + share * (start[0] - bend[0]), bend[1] + share * (start[1] - bend[1]))
    return [line, bend, nose]


def _nodes(plan: RoadPlan) -> str:
    end_m = plan.acceleration_lane_m + plan.downstream_m
    (ramp_x, ramp_y), *_ = ramp_shape_m(plan)
    places = [
        ("west", -plan.mainline_m, 0.0, ""),
        ("rampstart", ramp_x, ramp_y, ""),
        ("nose", 0.0, 0.0, ' type="unregulated" radius="0"'),
        ("end", plan.acceleration_lane_m, 0.0, ' type="unregulated" radius="0"'),
        ("east", end_m, 0.0, ""),
    ]
    if plan.gore_m > 0.0:
        places.append(("stopline", *_gore_shape_m(plan)[0], ' type="traffic_light" radius="0"'))
    lines = [f'  <node id="{n}" x="{x:.6f}" y="{y:.6f}"{rest}/>' for n, x, y, rest in places]
    return "\n".join(["<nodes>", *lines, "</nodes>"])


def _edges(plan: RoadPlan) -> str:
    """The edges; the outermost lane of the mainline lies at y = 0, others to its left."""
    main, edge_y = plan.mainline_limit_mps, LANE_WIDTH_M / 2.0 * plan.lanes
    end_m = plan.acceleration_lane_m
    before = behind = 'spreadType="center"'
    if plan.lanes > 1:
        edge_y = LANE_WIDTH_M * (plan.lanes - 0.5)
        west, east = f"{-plan.mainline_m!r},{edge_y}", f"{end_m + plan.downstream_m!r},{edge_y}"
        before, behind = f'shape="{west} 0,{edge_y}"', f'shape="{end_m!r},{edge_y} {east}"'
    many = f'numLanes="{plan.lanes}" speed="{main!r}"'
    return f"""<edges>
  <edge id="mainline" from="west" to="nose" {many} {before}/>
{_ramp_edges(plan)}
  <edge id="merge" from="nose" to="end" numLanes="{plan.lanes + 1}" speed="{main!r}"
        shape="0,{edge_y} {end_m!r},{edge_y}">
    <lane index="0" acceleration="1"/>
  </edge>
  <edge id="downstream" from="end" to="east" {many} {behind}/>
</edges>"""


def _ramp_edges(plan: RoadPlan) -> str:
    def edge(name: str, ends: str, shape_m: list[tuple[float, float]], length_m: float) -> str:
        shape = " ".join(f"{x:.6f},{y:.6f}" for x, y in shape_m)
        return (
            f'  <edge id="{name}" {ends} numLanes="1" speed="{plan.ramp_limit_mps!r}" '
            f'spreadType="center" shape="{shape}" length="{length_m!r}"/>'
        )

    if plan.gore_m == 0.0:
        return edge("ramp", 'from="rampstart" to="nose"', ramp_shape_m(plan), plan.ramp_m)
    line, *rest = _gore_shape_m(plan)
    start, *bends, _ = ramp_shape_m(plan)
    before = [start, *(place for place in bends if place not in rest), line]
    return "\n".join(
        [
            edge("ramp", 'from="rampstart" to="stopline"', before, plan.ramp_m - plan.gore_m),
            edge("gore", 'from="stopline" to="nose"', [line, *rest], plan.gore_m),
        ]
    )


def _connections(plan: RoadPlan) -> str:
    rest = f'length="{JUNCTION_LENGTH_M}" speed="{plan.mainline_limit_mps!r}"'
    onto = "ramp"
    ramp = ""
    if plan.gore_m > 0.0:
        ramp = f'  <connection from="ramp" to="gore" fromLane="0" toLane="0" {rest}/>\n'
        onto = "gore"
    lanes = range(plan.lanes)
    on = "\n".join(
        f'  <connection from="mainline" to="merge" fromLane="{k}" toLane="{k + 1}" {rest}/>'
        for k in lanes
    )
    off = "\n".join(
        f'  <connection from="merge" to="downstream" fromLane="{k + 1}" toLane="{k}" {rest}/>'
        for k in lanes
    )
    return f"""<connections>
{on}
{ramp}  <connection from="{onto}" to="merge" fromLane="0" toLane="0" {rest}/>
{off}
</connections>"""
