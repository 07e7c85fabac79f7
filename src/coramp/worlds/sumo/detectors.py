"""Detectors of a scenario as SUMO's induction loops, and what they counted."""

import re
import xml.etree.ElementTree as ET
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import polars as pl

from coramp.coordination.plant import Arrival
from coramp.counts.table import SCHEMA
from coramp.records.run_folder import SUMO_DETECTED
from coramp.scenarios.demand_sections import Detector
from coramp.scenarios.model import Scenario
from coramp.worlds.sumo.demand import cooperative_type
from coramp.worlds.sumo.lanes import LanedRoad
from coramp.worlds.sumo.network import RAMP_LANE, RoadPlan

Road = RoadPlan | LanedRoad
VEHICLE = re.compile(r'<vehicle id="([^"]+)" type="([^"]+)"')


class Loop(NamedTuple):
    """One loop: its detector, the lane there (0 is the outermost), and whom it counts."""

    name: str
    detector: str
    lane: int
    vehicle_class: str
    sumo_lane: str
    position_m: float
    period_s: float
    types: tuple[str, ...]


def loops_of(
    scenario: Scenario, road: Road, arrivals: Sequence[Arrival], routes: str
) -> list[Loop]:
    """Returns a loop for each detector, lane and type of vehicles of a scenario.

    ``routes`` is the run's route file, which says of which of SUMO's types vehicles are.
    """
    of_class = _types_by_class(scenario, arrivals, routes)
    return [
        Loop(
            f"{detector.id}_{lane}_{kind}",
            detector.id,
            lane,
            kind,
            name,
            position_m,
            detector.period_s,
            types,
        )
        for detector in scenario.detector
        for lane, (name, position_m) in enumerate(lanes_at(road, detector))
        for kind, types in of_class.items()
    ]


def lanes_at(road: Road, detector: Detector) -> list[tuple[str, float]]:
    """Returns SUMO's lanes of a road at a detector, from the outermost, and where on them it is.

    That is in m from the lane's start.
    """
    ramp = detector.road == "ramp"
    last: dict[int, tuple[float, str, float]] = {}
    for name, span in road.spans().items():
        behind_m = detector.station_m - span.start_m
        if name.startswith(":") or (span.lane == RAMP_LANE) != ramp or behind_m < 0.0:
            continue
        found = (span.start_m, name, behind_m / span.per_m)
        last[span.lane] = max(found, last.get(span.lane, found))
    return [last[lane][1:] for lane in sorted(last)]


def _types_by_class(
    scenario: Scenario, arrivals: Sequence[Arrival], routes: str
) -> dict[str, tuple[str, ...]]:
    """SUMO's types of each type of the scenario; none named where all are of one."""
    names = [kind.name for kind in scenario.vehicle_types]
    if len(names) == 1:
        return {names[0]: ()}
    kinds = {arrival.vehicle_id: arrival.vehicle_type for arrival in arrivals}
    found: dict[str, set[str]] = {name: set() for name in names}
    for arrival in arrivals:
        found[arrival.vehicle_type].add(cooperative_type(arrival))
    for vehicle_id, name in VEHICLE.findall(routes):
        found[kinds[vehicle_id]].add(name)
    return {name: tuple(sorted(types)) for name, types in found.items() if types}


def loops_file(loops: Sequence[Loop]) -> str:
    """Returns SUMO's file of loops, which write into a file beside it."""
    lines = [
        f'  <inductionLoop id="{loop.name}" lane="{loop.sumo_lane}" pos="{loop.position_m!r}" '
        f'period="{loop.period_s!r}" file="{SUMO_DETECTED}" friendlyPos="true"'
        + (f' vTypes="{" ".join(loop.types)}"' if loop.types else "")
        + "/>"
        for loop in loops
    ]
    return "\n".join(["<additional>", *lines, "</additional>", ""])


def counted(file: Path, loops: Sequence[Loop]) -> pl.DataFrame:
    """Returns what loops counted, in the columns of counts: whose rear has passed (nVehContrib)."""
    known: Mapping[str, Loop] = {loop.name: loop for loop in loops}
    rows = []
    for _, element in ET.iterparse(file):
        if element.tag == "interval":
            rows.append(_row(known[element.get("id", "")], element))
            element.clear()
    return pl.DataFrame(rows, schema=SCHEMA, orient="row").sort(
        "begin_s", "detector", "lane", "vehicle_class"
    )


def _row(loop: Loop, interval: ET.Element) -> tuple[float, float, str, int, str, int, float | None]:
    vehicles = int(interval.get("nVehContrib", "0"))
    speed_mps = float(interval.get("speed", "-1")) if vehicles else None
    begin_s, end_s = float(interval.get("begin", "nan")), float(interval.get("end", "nan"))
    return begin_s, end_s, loop.detector, loop.lane, loop.vehicle_class, vehicles, speed_mps
