"""A signal on a ramp of a SUMO network: the ramp's edge is cut in two at the stop line.

Nothing else of the network changes. What lies behind the stop line keeps the edge's name, so that
ids of ramps stay; lengths add up to what they were.
"""

import atexit
import gzip
import math
import shutil
import tempfile
import xml.etree.ElementTree as ET
from collections.abc import Sequence
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

from coramp.errors import CorampError
from coramp.worlds.sumo.network import JUNCTION_LENGTH_M

Point = tuple[float, ...]
SHORTEST_M = 1.0
"""What must be left of an edge on both sides of a stop line."""
GZIP = b"\x1f\x8b"


class StopLine(NamedTuple):
    """Where a signal stands: an edge, and the place on its lanes (m from their start)."""

    edge_id: str
    position_m: float

    @property
    def signal(self) -> str:
        """The name of the signal, and of the junction at which it stands."""
        return f"{self.edge_id}-stopline"

    @property
    def before(self) -> str:
        """The name of the edge that ends at the stop line."""
        return f"{self.edge_id}-before-stopline"


@cache
def signalled_network(file: Path, _sha256: str, lines: tuple[StopLine, ...]) -> Path:
    """Returns a network with signals at stop lines, written once in this process.

    The hash is that of the file: a changed one is cut anew.
    """
    content = file.read_bytes()
    root = ET.fromstring(gzip.decompress(content) if content.startswith(GZIP) else content)
    for line in lines:
        add_signal(root, line)
    folder = Path(tempfile.mkdtemp(prefix="coramp-net-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    target = folder / "signalled.net.xml"
    ET.ElementTree(root).write(target, encoding="UTF-8", xml_declaration=True)
    return target


def add_signal(root: ET.Element, line: StopLine) -> None:
    """Cuts an edge of a network in two at a stop line, and puts a signal there.

    Raises CorampError where the network has no such edge, or it is too short there.
    """
    edge = next((e for e in root.iter("edge") if e.get("id") == line.edge_id), None)
    if edge is None:
        raise CorampError(f"{line.edge_id}: the network has no such edge to put a signal on")
    length_m = min(float(lane.get("length", "nan")) for lane in edge.iter("lane"))
    if not SHORTEST_M <= line.position_m <= length_m - SHORTEST_M:
        raise CorampError(
            f"{line.edge_id}: a stop line at {line.position_m:g} m is too near to an end of the "
            f"edge; allowed is {SHORTEST_M:g} to {length_m - SHORTEST_M:g} m"
        )
    for way in root.iter("connection"):
        if way.get("to") == line.edge_id:
            way.set("to", line.before)
    before = _before(edge, line)
    places = [_points(lane.get("shape", ""))[-1] for lane in before.iter("lane")]
    edge.set("from", line.signal)
    for lane in edge.iter("lane"):
        _cut(lane, line.position_m, keep_end=True)
    _cut_shape(edge, line.position_m / length_m, keep_end=True)
    where = list(root).index(edge)
    root[where:where] = [_inside(before, places, line), before]
    root.extend([_logic(places, line), _junction(places, line), *_ways(places, line)])


def _before(edge: ET.Element, line: StopLine) -> ET.Element:
    """The edge up to the stop line."""
    found = ET.fromstring(ET.tostring(edge))
    length_m = min(float(lane.get("length", "nan")) for lane in edge.iter("lane"))
    found.set("id", line.before)
    found.set("to", line.signal)
    for lane in found.iter("lane"):
        lane.set("id", f"{line.before}_{lane.get('index')}")
        _cut(lane, line.position_m, keep_end=False)
    _cut_shape(found, line.position_m / length_m, keep_end=False)
    return found


def _cut(lane: ET.Element, position_m: float, *, keep_end: bool) -> None:
    """Leaves of a lane what is behind a place, or before it but for the way over the junction."""
    length_m = float(lane.get("length", "nan"))
    _cut_shape(lane, position_m / length_m, keep_end=keep_end)
    left_m = length_m - position_m if keep_end else position_m - JUNCTION_LENGTH_M
    lane.set("length", f"{left_m:.3f}")


def _cut_shape(element: ET.Element, share: float, *, keep_end: bool) -> None:
    if (text := element.get("shape")) is not None:
        cut = split_line(_points(text), share)[keep_end]
        element.set("shape", _text(cut))


def split_line(points: Sequence[Point], share: float) -> tuple[list[Point], list[Point]]:
    """Returns a line in two parts, the first of which has a share of its length."""
    steps_m = [math.dist(a, b) for a, b in pairwise(points)]
    left_m = share * math.fsum(steps_m)
    for k, step_m in enumerate(steps_m):
        if left_m < step_m or k == len(steps_m) - 1:
            part = min(1.0, left_m / step_m) if step_m > 0.0 else 0.0
            pairs = zip(points[k], points[k + 1], strict=True)
            at = tuple(a + part * (b - a) for a, b in pairs)
            return [*points[: k + 1], at], [at, *points[k + 1 :]]
        left_m -= step_m
    return list(points), list(points)


def _points(text: str) -> list[Point]:
    return [tuple(float(x) for x in point.split(",")) for point in text.split()]


def _text(points: Sequence[Point]) -> str:
    return " ".join(",".join(f"{x:.3f}" for x in point) for point in points)


def _inside(before: ET.Element, places: Sequence[Point], line: StopLine) -> ET.Element:
    """The edge over the junction, with a lane for each of the ramp's."""
    found = ET.Element("edge", id=f":{line.signal}_0", function="internal")
    for k, (lane, at) in enumerate(zip(before.iter("lane"), places, strict=True)):
        own = {"id": f":{line.signal}_0_{k}", "shape": _text([at, at])}
        ET.SubElement(found, "lane", {**lane.attrib, **own, "length": f"{JUNCTION_LENGTH_M:.3f}"})
    return found


def _logic(places: Sequence[Point], line: StopLine) -> ET.Element:
    found = ET.Element("tlLogic", id=line.signal, type="static", programID="0", offset="0")
    ET.SubElement(found, "phase", duration="90", state="G" * len(places))
    return found


def _junction(places: Sequence[Point], line: StopLine) -> ET.Element:
    count = len(places)
    found = ET.Element(
        "junction",
        id=line.signal,
        type="traffic_light",
        x=f"{places[0][0]:.3f}",
        y=f"{places[0][1]:.3f}",
        incLanes=" ".join(f"{line.before}_{k}" for k in range(count)),
        intLanes=" ".join(f":{line.signal}_0_{k}" for k in range(count)),
        shape=_text([places[0], places[-1]]),
    )
    for k in range(count):
        none = "0" * count
        ET.SubElement(found, "request", index=str(k), response=none, foes=none, cont="0")
    return found


def _ways(places: Sequence[Point], line: StopLine) -> list[ET.Element]:
    """The connections over the stop line: to it, and from inside the junction on."""
    found = []
    for k in range(len(places)):
        lanes = {"to": line.edge_id, "toLane": str(k), "dir": "s"}
        over = {"via": f":{line.signal}_0_{k}", "tl": line.signal, "linkIndex": str(k)}
        found += [
            ET.Element(
                "connection",
                {"from": line.before, "fromLane": str(k), **lanes, **over, "state": "O"},
            ),
            ET.Element(
                "connection",
                {"from": f":{line.signal}_0", "fromLane": str(k), **lanes, "state": "M"},
            ),
        ]
    return found
