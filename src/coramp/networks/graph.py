"""A network as far as cars can drive on it: edges, their lanes, and what connects these."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

Point = tuple[float, float]


@dataclass(frozen=True)
class Lane:
    """One lane, of an edge or inside a junction; ``index`` counts as SUMO does, from outside."""

    lane_id: str
    index: int
    length_m: float
    limit_mps: float
    width_m: float
    shape_m: tuple[Point, ...]


@dataclass(frozen=True)
class Edge:
    """A road from one junction to the next, with those of its lanes that cars may use.

    ``kind`` is the type that the network gives it, such as ``highway.motorway_link``.
    """

    edge_id: str
    from_junction: str
    to_junction: str
    kind: str
    priority: int
    lanes: tuple[Lane, ...]

    @property
    def length_m(self) -> float:
        """The length of its lanes, which SUMO makes equal."""
        return self.lanes[0].length_m

    @property
    def is_link(self) -> bool:
        """Whether its type says that it links roads, as those of OpenStreetMap do."""
        return self.kind.endswith("_link")

    @property
    def highest_limit_mps(self) -> float:
        """The speed limit of its fastest lane."""
        return max(lane.limit_mps for lane in self.lanes)


@dataclass(frozen=True)
class Connection:
    """From one lane to the next, by the lanes inside the junction, in driving order.

    ``state`` is SUMO's letter for the right of way: M major, m minor, Z zipper, and so on.
    ``is_signalled`` says whether a traffic light shows a colour to it.
    """

    from_edge: str
    from_lane: int
    to_edge: str
    to_lane: int
    inside: tuple[Lane, ...]
    state: str
    is_signalled: bool

    @property
    def length_m(self) -> float:
        """The way inside the junction."""
        return math.fsum(lane.length_m for lane in self.inside)


@dataclass(frozen=True)
class Network:
    """All edges by their id, connections (turnarounds left out), and junctions of roundabouts.

    ``version`` is that of the file's format, ``written_by`` the program that wrote it, as the file
    has them.
    """

    edges: Mapping[str, Edge]
    connections: tuple[Connection, ...]
    roundabout_junctions: frozenset[str]
    is_left_hand: bool
    version: str
    written_by: str

    @cached_property
    def _outgoing(self) -> dict[str, list[Connection]]:
        found: dict[str, list[Connection]] = {edge_id: [] for edge_id in self.edges}
        for connection in self.connections:
            found[connection.from_edge].append(connection)
        return found

    @cached_property
    def _incoming(self) -> dict[str, list[Connection]]:
        found: dict[str, list[Connection]] = {edge_id: [] for edge_id in self.edges}
        for connection in self.connections:
            found[connection.to_edge].append(connection)
        return found

    def out_of(self, edge_id: str) -> list[Connection]:
        """Returns the connections that leave an edge."""
        return self._outgoing[edge_id]

    def into(self, edge_id: str) -> list[Connection]:
        """Returns the connections that lead into an edge."""
        return self._incoming[edge_id]

    def between(self, from_edge: str, to_edge: str) -> list[Connection]:
        """Returns the connections from one edge to another, from the outermost lane on."""
        found = [c for c in self.out_of(from_edge) if c.to_edge == to_edge]
        return sorted(found, key=lambda c: (c.from_lane, c.to_lane))

    def edges_before(self, edge_id: str) -> list[str]:
        """Returns the edges that lead into an edge, each once."""
        return list(dict.fromkeys(c.from_edge for c in self.into(edge_id)))

    def edges_after(self, edge_id: str) -> list[str]:
        """Returns the edges that an edge leads to, each once."""
        return list(dict.fromkeys(c.to_edge for c in self.out_of(edge_id)))
