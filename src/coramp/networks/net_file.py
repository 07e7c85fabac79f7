"""Reading a SUMO network; the only module here that touches a file."""

import gzip
import io
import math
import re
import xml.sax
import zlib
from itertools import chain
from pathlib import Path
from typing import Any

from coramp.errors import CorampError
from coramp.networks.graph import Connection, Edge, Lane, Network

FORMAT = "1.20"
"""The format that netconvert of the installed SUMO writes."""
ALLOWED = "allowed is a SUMO network, .net.xml or .net.xml.gz"
WRITER = re.compile(r"by Eclipse SUMO (\w+) (?:Version )?(\S+)")
LONGEST_HEAD = 4000
"""Within so many characters a network says what wrote it."""
CARS = "passenger"
UNREADABLE = (LookupError, ValueError, AttributeError)
"""What sumolib and the parser raise at values that no network has, and at what is missing."""
GZIP = b"\x1f\x8b"


def read_network(path: Path) -> Network:
    """Returns the network of a file, packed by gzip or not, as far as cars can drive on it.

    Raises CorampError where the file cannot be read or is no network.
    """
    content = _content(path)
    reader, root = _parsed(path, content)
    try:
        return _network(reader.getNet(), root, content[:LONGEST_HEAD].decode("utf-8", "replace"))
    except UNREADABLE as error:
        raise CorampError(_incomplete(path, error)) from error


def _incomplete(path: Path, error: Exception) -> str:
    what = f"{error.args[0]} is missing" if isinstance(error, KeyError) else str(error)
    return f"{path}: is no complete network: {what}; {ALLOWED}"


def _content(path: Path) -> bytes:
    try:
        content = path.read_bytes()
        return gzip.decompress(content) if content.startswith(GZIP) else content
    except (EOFError, zlib.error, gzip.BadGzipFile) as error:
        raise CorampError(
            f"{path}: is cut off or damaged ({error}); allowed is a whole .gz file"
        ) from error
    except OSError as error:
        raise CorampError(f"{path}: cannot be read: {error.strerror}; {ALLOWED}") from error


def _parsed(path: Path, content: bytes) -> tuple[Any, dict[str, str]]:
    """What sumolib makes of a file, and the attributes of its root, which sumolib leaves out."""
    from sumolib import net as untyped_net

    sumolib_net: Any = untyped_net
    root: dict[str, str] = {}

    class Reader(sumolib_net.NetReader):  # type: ignore[misc]
        def startElement(self, name: str, attrs: Any) -> None:  # noqa: N802 - sax's name
            if not root:
                if name != "net":
                    raise CorampError(f"{path}: holds <{name}> and no network; {ALLOWED}")
                root.update(attrs)
            super().startElement(name, attrs)

    reader = Reader(withInternal=True, withFoes=False)
    try:
        xml.sax.parse(io.BytesIO(content), reader)  # noqa: S317 - expat limits entities
    except xml.sax.SAXParseException as error:
        line = error.getLineNumber()
        what = "is empty" if not content.strip() else "is cut off or no XML"
        raise CorampError(
            f"{path}: {what}: line {line}: {error.getMessage()}; {ALLOWED}"
        ) from error
    except UNREADABLE as error:
        raise CorampError(_incomplete(path, error)) from error
    return reader, root


def _network(net: Any, root: dict[str, str], head: str) -> Network:
    edges = {}
    for edge in net.getEdges(withInternal=False):
        if lanes := tuple(_lane(lane) for lane in edge.getLanes() if lane.allows(CARS)):
            edges[edge.getID()] = Edge(
                edge_id=edge.getID(),
                from_junction=edge.getFromNode().getID(),
                to_junction=edge.getToNode().getID(),
                kind=edge.getType(),
                priority=edge.getPriority(),
                lanes=lanes,
            )
    writer = WRITER.search(head)
    return Network(
        edges=edges,
        connections=_connections(net, edges),
        roundabout_junctions=frozenset(j for r in net.getRoundabouts() for j in r.getNodes()),
        is_left_hand=root.get("lefthand") in ("true", "1"),
        version=root.get("version", ""),
        written_by=" ".join(writer.groups()) if writer else "",
    )


def _lane(lane: Any) -> Lane:
    found = Lane(
        lane_id=lane.getID(),
        index=lane.getIndex(),
        length_m=lane.getLength(),
        limit_mps=lane.getSpeed(),
        width_m=lane.getWidth(),
        shape_m=tuple((x, y) for x, y in lane.getShape()),
    )
    if not (0.0 < found.length_m < math.inf and 0.0 < found.limit_mps < math.inf):
        raise ValueError(
            f"lane {found.lane_id} of {found.length_m} m with a limit of {found.limit_mps} m/s"
        )
    if len(found.shape_m) < 2 or not all(map(math.isfinite, chain(*found.shape_m))):
        raise ValueError(f"lane {found.lane_id} without a shape of two points or more")
    return found


def _connections(net: Any, edges: dict[str, Edge]) -> tuple[Connection, ...]:
    found = []
    for edge_id in edges:
        for connection in (c for many in net.getEdge(edge_id).getOutgoing().values() for c in many):
            ends = (connection.getFromLane(), connection.getToLane())
            if not all(lane.allows(CARS) for lane in ends) or not connection.allows(CARS):
                continue
            if connection.getDirection().lower() == connection.LINKDIR_TURN:
                continue
            found.append(
                Connection(
                    from_edge=edge_id,
                    from_lane=ends[0].getIndex(),
                    to_edge=connection.getTo().getID(),
                    to_lane=ends[1].getIndex(),
                    inside=_inside(net, connection.getViaLaneID()),
                    state=connection.getState(),
                    is_signalled=bool(connection.getTLSID()),
                )
            )
    return tuple(found)


def _inside(net: Any, lane_id: str) -> tuple[Lane, ...]:
    """The lanes inside a junction from one on; there are several where vehicles wait between."""
    found: list[Lane] = []
    while lane_id:
        lane = net.getLane(lane_id)
        found.append(_lane(lane))
        following = lane.getOutgoing()
        lane_id = following[0].getViaLaneID() if following else ""
    return tuple(found)
