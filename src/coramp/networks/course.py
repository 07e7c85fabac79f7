"""The road before and behind a place, edge by edge, as long as there is only one way."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

from coramp.networks.graph import Connection, Edge, Network


@dataclass(frozen=True)
class Crossing:
    """The ways through the junction between two edges of a course, from the outermost lane on.

    ``reference`` is the one whose length counts as that of the crossing.
    """

    ways: tuple[Connection, ...]
    reference: Connection

    @property
    def length_m(self) -> float:
        """The length of the reference way."""
        return self.reference.length_m


@dataclass(frozen=True)
class Course:
    """Edges that follow each other, and the crossing behind each of them but the last."""

    edges: tuple[Edge, ...]
    crossings: tuple[Crossing, ...]

    @property
    def length_m(self) -> float:
        """The length of edges and crossings."""
        lengths_m = [edge.length_m for edge in self.edges]
        return math.fsum([*lengths_m, *(crossing.length_m for crossing in self.crossings)])


def edges_back(network: Network, edge_id: str) -> tuple[Edge, ...]:
    """Returns an edge and those before it, in driving order.

    It goes back to the last junction at which traffic joins or leaves, or to where the road begins.
    """
    back = _chain(edge_id, network.edges_before, network.edges_after)
    return tuple(network.edges[name] for name in reversed(back))


def edges_ahead(network: Network, edge_id: str) -> tuple[Edge, ...]:
    """Returns an edge and those behind it, up to the next junction where traffic joins or leaves.

    Or to where the road ends.
    """
    ahead = _chain(edge_id, network.edges_after, network.edges_before)
    return tuple(network.edges[name] for name in ahead)


def _chain(
    edge_id: str, onward: Callable[[str], list[str]], back: Callable[[str], list[str]]
) -> list[str]:
    found = [edge_id]
    while True:
        following = onward(found[-1])
        if len(following) != 1 or following[0] in found or len(back(following[0])) != 1:
            return found
        found.append(following[0])


def course_back_from(network: Network, edges: tuple[Edge, ...], lane: int) -> Course:
    """Returns the course of edges whose reference ways lead to a lane of the last of them."""
    crossings: list[Crossing] = []
    for before, after in reversed(list(pairwise(edges))):
        ways = network.between(before.edge_id, after.edge_id)
        reference = min(ways, key=lambda way: (abs(way.to_lane - lane), way.from_lane))
        crossings.insert(0, Crossing(tuple(ways), reference))
        lane = reference.from_lane
    return Course(edges, tuple(crossings))


def course_ahead_from(network: Network, edges: tuple[Edge, ...], lane: int) -> Course:
    """Returns the course of edges whose reference ways come from a lane of the first of them."""
    crossings: list[Crossing] = []
    for before, after in pairwise(edges):
        ways = network.between(before.edge_id, after.edge_id)
        reference = min(ways, key=lambda way: (abs(way.from_lane - lane), way.to_lane))
        crossings.append(Crossing(tuple(ways), reference))
        lane = reference.to_lane
    return Course(edges, tuple(crossings))
