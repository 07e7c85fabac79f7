"""The through roads on which merge sites lie one behind the other, and the exits between them."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

from coramp.errors import CorampError
from coramp.networks.graph import Edge, Network
from coramp.networks.limits import Limits
from coramp.networks.merging import onward_edge
from coramp.networks.ramps import OnRamp


@dataclass(frozen=True)
class Exit:
    """An edge that leaves a road behind one of the road's edges."""

    edge_id: str
    after_edge: str


@dataclass(frozen=True)
class ThroughRoad:
    """A road from its upstream end to its downstream end, and its merge sites downstream.

    ``starts_m`` is the distance along the road at which each edge begins, lanes inside junctions
    included; ``limits`` are by that distance. ``first_lanes`` is how many lanes its first edge has.
    ``exits`` are all edges by which traffic can leave it.
    """

    edges: tuple[str, ...]
    starts_m: tuple[float, ...]
    limits: Limits
    first_lanes: int
    sites: tuple[OnRamp, ...]
    exits: tuple[Exit, ...]

    def nose_m(self, site: OnRamp) -> float:
        """Returns the distance along the road at which the merge edge of a site begins."""
        return self.starts_m[self.edges.index(site.merge_edge.edge_id)]

    def edges_from(self, edge_id: str, until: str | None = None) -> tuple[str, ...]:
        """Returns the edges from one on, up to another and with it, or to the road's end."""
        first = self.edges.index(edge_id)
        last = len(self.edges) if until is None else self.edges.index(until) + 1
        return self.edges[first:last]


def roads_of(
    network: Network, sites: Sequence[OnRamp], exits: Sequence[str]
) -> tuple[ThroughRoad, ...]:
    """Returns the roads of merge sites, in the order in which their first sites are given.

    Sites of a road stand one behind the other, downstream. A road begins at the last junction
    before its first site at which other traffic joins, or where it begins. It ends at the first
    junction behind its last site, or behind the last of the ``exits`` that lies beyond.
    Raises CorampError where sites of a road are out of order, or an exit is none of a road.
    """
    groups: list[list[OnRamp]] = []
    for site in sites:
        if groups and site.merge_edge.edge_id in onward(network, groups[-1][-1].merge_edge.edge_id):
            groups[-1].append(site)
            continue
        _check_order(network, site, groups)
        groups.append([site])
    roads = tuple(_road(network, group, exits) for group in groups)
    known = [way.edge_id for road in roads for way in road.exits]
    for edge_id in exits:
        if edge_id not in known:
            allowed = ", ".join(known) or "none: no road of these sites has an exit"
            raise CorampError(f"there is no exit {edge_id!r}; allowed are {allowed}")
    return roads


def _check_order(network: Network, site: OnRamp, groups: list[list[OnRamp]]) -> None:
    for group in groups:
        for other in group:
            ahead = onward(network, site.merge_edge.edge_id)
            behind = onward(network, other.merge_edge.edge_id)
            if other.merge_edge.edge_id in ahead or site.merge_edge.edge_id in behind:
                first, second = (
                    (site, other) if other.merge_edge.edge_id in ahead else (other, site)
                )
                raise CorampError(
                    f"{first.ramp_id} lies upstream of {second.ramp_id}; allowed are the sites of "
                    "a road one after the other, in the order of driving"
                )


def onward(network: Network, edge_id: str) -> list[str]:
    """Returns an edge and those that a road goes on by, to its end or back to where it was."""
    found = [edge_id]
    while ways := network.out_of(found[-1]):
        following = onward_edge(network, ways)
        if following in found:
            break
        found.append(following)
    return found


def _road(network: Network, sites: list[OnRamp], exits: Sequence[str]) -> ThroughRoad:
    """The road of sites, which lie on it in this order."""
    before = [edge.edge_id for edge in sites[0].mainline.edges]
    while (back := network.edges_before(before[0])) and len(back) == 1 and back[0] not in before:
        before.insert(0, back[0])
    whole = [*before, *onward(network, sites[0].merge_edge.edge_id)]
    ends = {edge.edge_id for edge in sites[-1].downstream.edges}
    last = max(k for k, edge_id in enumerate(whole) if edge_id in ends)
    ways = _exits(network, whole)
    wanted = [whole.index(way.after_edge) + 1 for way in ways if way.edge_id in exits]
    last = min(max([last, *wanted]), len(whole) - 1)
    edges = whole[: last + 1]
    found = [network.edges[edge_id] for edge_id in edges]
    starts_m = _starts_m(network, found)
    lowest_mps = tuple(min(lane.limit_mps for lane in edge.lanes) for edge in found)
    return ThroughRoad(
        tuple(edges),
        starts_m,
        Limits(starts_m, lowest_mps),
        len(found[0].lanes),
        tuple(sites),
        tuple(way for way in ways if way.after_edge in edges[:-1] or way.edge_id in exits),
    )


def _exits(network: Network, edges: Sequence[str]) -> list[Exit]:
    return [
        Exit(other, edge_id)
        for edge_id in edges
        for other in network.edges_after(edge_id)
        if other not in edges
    ]


def _starts_m(network: Network, edges: Sequence[Edge]) -> tuple[float, ...]:
    starts_m = [0.0]
    for edge, following in pairwise(edges):
        ways = network.between(edge.edge_id, following.edge_id)
        inside_m = min((way.length_m for way in ways), default=math.nan)
        starts_m.append(starts_m[-1] + edge.length_m + inside_m)
    return tuple(starts_m)
