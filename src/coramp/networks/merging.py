"""How vehicles get from a ramp onto the mainline."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

from coramp.networks.course import Course
from coramp.networks.graph import Connection, Network

ACCELERATION_LANE = "acceleration lane"
WEAVING_LANE = "weaving lane"
LANE_GAIN = "lane gain"
ZIPPER = "zipper"
GIVE_WAY = "give way"
NO_RULE = "no rule"
ZIPPER_STATE = "Z"
MINOR_STATES = frozenset("ms=w")
"""SUMO's letters for who gives way: minor, stop, equal, all-way stop."""


@dataclass(frozen=True)
class Merging:
    """How a ramp merges, and how far (m) its lane runs beside the mainline from the nose.

    ``acceleration lane``: it gets a lane that ends. ``weaving lane``: one that leaves by the next
    exit. ``lane gain``: one that goes on. Where it leads into a lane of the mainline there is no
    length: ``zipper`` (each in turn), ``give way`` (one of the two has to), or ``no rule``.
    ``lanes`` are those that the ramp brings, by their index on the merge edge.
    """

    how: str
    lane_m: float | None
    lanes: tuple[int, ...]


def merging_of(
    network: Network,
    downstream: Course,
    ramp_ways: Sequence[Connection],
    mainline_ways: Sequence[Connection],
) -> Merging:
    """Returns how a ramp merges; of several lanes, the one that leaves least room tells."""
    of_mainline = {way.to_lane for way in mainline_ways}
    if shared := [way for way in ramp_ways if way.to_lane in of_mainline]:
        onto = {way.to_lane for way in shared}
        rivals = [*shared, *(way for way in mainline_ways if way.to_lane in onto)]
        return Merging(_rule_of(rivals), None, ())
    added = tuple(sorted({way.to_lane for way in ramp_ways}))
    found = [_followed(network, downstream, lane, of_mainline) for lane in added]
    how, lane_m = min(found, key=lambda fate: (fate[0] == LANE_GAIN, fate[1] or 0.0))
    return Merging(how, lane_m, added)


def _rule_of(rivals: Sequence[Connection]) -> str:
    states = {way.state for way in rivals}
    if ZIPPER_STATE in states:
        return ZIPPER
    return GIVE_WAY if states & MINOR_STATES else NO_RULE


def _followed(
    network: Network, downstream: Course, lane: int, of_mainline: set[int]
) -> tuple[str, float | None]:
    """What becomes of an added lane on the way to the next junction, and how long it is."""
    length_m = 0.0
    for k, edge in enumerate(downstream.edges):
        length_m += edge.length_m
        ways = [way for way in network.out_of(edge.edge_id) if way.from_lane == lane]
        through = [way for way in network.out_of(edge.edge_id) if way.from_lane in of_mainline]
        if not through:
            return LANE_GAIN, None
        if not ways or _joins(ways, through):
            return ACCELERATION_LANE, length_m
        if all(way.to_edge != onward_edge(network, through) for way in ways):
            return WEAVING_LANE, length_m
        if k + 1 < len(downstream.edges):
            length_m += ways[0].length_m
            lane = ways[0].to_lane
            of_mainline = {way.to_lane for way in through}
    return LANE_GAIN, None


def onward_edge(network: Network, through: Sequence[Connection]) -> str:
    """Returns by which edge a road goes on: that of most lanes, and rather a road than a link."""
    ways = Counter(way.to_edge for way in through)

    def rank(name: str) -> tuple[int, bool, int, int]:
        edge = network.edges[name]
        return ways[name], not edge.is_link, edge.priority, len(edge.lanes)

    return max(ways, key=rank)


def _joins(ways: Sequence[Connection], through: Sequence[Connection]) -> bool:
    """Whether a lane leads into lanes of the mainline alone."""
    taken = {(way.to_edge, way.to_lane) for way in through}
    return all((way.to_edge, way.to_lane) in taken for way in ways)
