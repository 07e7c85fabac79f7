"""The on-ramps of a network: where they are, how long, and how they merge.

An on-ramp ends where a link and the through road join into one edge, each leading nowhere else.
The through road is the one that is no link by its type, else that of the higher priority, of more
lanes, of the higher speed limit, or that goes straight on, in this order.
"""

import math
from dataclasses import dataclass

from coramp.errors import CorampError
from coramp.networks.course import (
    Course,
    course_ahead_from,
    course_back_from,
    edges_ahead,
    edges_back,
)
from coramp.networks.graph import Connection, Edge, Network, Point
from coramp.networks.merging import Merging, merging_of

LOOK_BACK_M = 50.0
"""Over so much of a road its direction at a junction is taken."""


@dataclass(frozen=True)
class OnRamp:
    """An on-ramp; its id is made of the edges before and behind the nose.

    The nose is where the merge edge begins. ``ramp`` and ``mainline`` are the roads before it, back
    to the previous junction at which traffic joins or leaves; ``downstream`` begins with the merge
    edge. ``ramp_way`` and ``mainline_way`` lead over the nose, the latter onto the lane nearest to
    the ramp's.
    """

    ramp: Course
    mainline: Course
    downstream: Course
    ramp_ways: tuple[Connection, ...]
    mainline_ways: tuple[Connection, ...]
    ramp_way: Connection
    mainline_way: Connection
    merging: Merging
    is_from_outside: bool
    is_left_hand: bool

    @property
    def ramp_id(self) -> str:
        """RAMP_EDGE@MERGE_EDGE, which stays as long as the two edges keep their names."""
        return f"{self.ramp_edge.edge_id}@{self.merge_edge.edge_id}"

    @property
    def ramp_edge(self) -> Edge:
        """The last edge of the ramp."""
        return self.ramp.edges[-1]

    @property
    def mainline_edge(self) -> Edge:
        """The last edge of the mainline before the nose."""
        return self.mainline.edges[-1]

    @property
    def merge_edge(self) -> Edge:
        """The edge into which both lead."""
        return self.downstream.edges[0]

    @property
    def ramp_m(self) -> float:
        """The way on the ramp up to the nose, lanes inside junctions included."""
        return self.ramp.length_m + self.ramp_way.length_m

    @property
    def mainline_m(self) -> float:
        """The way on the mainline up to the nose, lanes inside junctions included."""
        return self.mainline.length_m + self.mainline_way.length_m

    @property
    def side(self) -> str:
        """The side of the mainline at which the ramp joins: left or right."""
        return "left" if self.is_from_outside == self.is_left_hand else "right"


@dataclass(frozen=True)
class Found:
    """The on-ramps of a network in the order of their ids, and merge edges that are none.

    Where ``links`` begin, two links join; where ``equals`` begin, two roads join of which neither
    is the through road.
    """

    ramps: tuple[OnRamp, ...]
    links: tuple[str, ...]
    equals: tuple[str, ...]

    def only(self) -> OnRamp:
        """Returns the one on-ramp that there is; raises CorampError for more, or none."""
        if len(self.ramps) == 1:
            return self.ramps[0]
        known = ", ".join(ramp.ramp_id for ramp in self.ramps)
        if not known:
            raise CorampError("there is no on-ramp; allowed is a network with one")
        raise CorampError(f"there are {len(self.ramps)} on-ramps; choose one by --ramp: {known}")

    def named(self, ramp_id: str) -> OnRamp:
        """Returns the on-ramp of an id; raises CorampError where there is none such."""
        for ramp in self.ramps:
            if ramp.ramp_id == ramp_id:
                return ramp
        known = ", ".join(ramp.ramp_id for ramp in self.ramps) or "none: there is no on-ramp"
        raise CorampError(f"there is no on-ramp {ramp_id!r}; allowed are {known}")


def on_ramps(network: Network) -> Found:
    """Returns every on-ramp of a network."""
    ramps: list[OnRamp] = []
    links, equals = [], []
    for edge_id, edge in network.edges.items():
        joining = network.edges_before(edge_id)
        if not _is_merge(network, edge, joining):
            continue
        mainline, *others = sorted(joining, key=lambda name: _rank(network, name, edge))
        if network.edges[mainline].is_link:
            links.append(edge_id)
        elif _rank(network, mainline, edge) == _rank(network, others[0], edge):
            equals.append(edge_id)
        else:
            ramps += [_on_ramp(network, mainline, name, edge) for name in others]
    ramps.sort(key=lambda ramp: ramp.ramp_id)
    return Found(tuple(ramps), tuple(links), tuple(equals))


def _is_merge(network: Network, edge: Edge, joining: list[str]) -> bool:
    """Whether several edges join into one and lead nowhere else, at no roundabout.

    A signal may meter a ramp, but where all that join have one, they cross rather than merge.
    """
    return (
        len(joining) > 1
        and edge.from_junction not in network.roundabout_junctions
        and all(network.edges_after(name) == [edge.edge_id] for name in joining)
        and not all(c.is_signalled for c in network.into(edge.edge_id))
    )


def _rank(network: Network, name: str, onto: Edge) -> tuple[float, ...]:
    """What orders the edges that join: the through road has the lowest."""
    edge = network.edges[name]
    ways = network.between(name, onto.edge_id)
    return (
        edge.is_link,
        -edge.priority,
        -len(edge.lanes),
        -edge.highest_limit_mps,
        round(math.degrees(_turn_rad(edge, onto))),
        -min(way.to_lane for way in ways),
    )


def _turn_rad(before: Edge, after: Edge) -> float:
    """By how much (rad, 0 to pi) who drives from one edge onto the other changes direction."""
    x, y = _direction(_end_of(before.lanes[0].shape_m))
    u, v = _direction(after.lanes[0].shape_m[:2])
    return abs(math.atan2(x * v - y * u, x * u + y * v))


def _end_of(shape_m: tuple[Point, ...]) -> tuple[Point, ...]:
    """The last stretch of a line, from the point on that lies far enough before its end."""
    end = shape_m[-1]
    for k in range(len(shape_m) - 2, -1, -1):
        if math.dist(shape_m[k], end) >= LOOK_BACK_M:
            return shape_m[k:]
    return shape_m


def _direction(shape_m: tuple[Point, ...]) -> Point:
    (x0, y0), (x1, y1) = shape_m[0], shape_m[-1]
    return x1 - x0, y1 - y0


def _on_ramp(network: Network, mainline: str, ramp: str, edge: Edge) -> OnRamp:
    ramp_ways = tuple(network.between(ramp, edge.edge_id))
    mainline_ways = tuple(network.between(mainline, edge.edge_id))
    from_outside = _is_from_outside(network, ramp_ways, mainline_ways)
    nearest = min if from_outside else max
    mainline_way = nearest(mainline_ways, key=lambda way: way.to_lane)
    ramp_way = (max if from_outside else min)(ramp_ways, key=lambda way: way.to_lane)
    ahead = edges_ahead(network, edge.edge_id)
    downstream = course_ahead_from(network, ahead, mainline_way.to_lane)
    return OnRamp(
        ramp=course_back_from(network, edges_back(network, ramp), ramp_way.from_lane),
        mainline=course_back_from(network, edges_back(network, mainline), mainline_way.from_lane),
        downstream=downstream,
        ramp_ways=ramp_ways,
        mainline_ways=mainline_ways,
        ramp_way=ramp_way,
        mainline_way=mainline_way,
        merging=merging_of(network, downstream, ramp_ways, mainline_ways),
        is_from_outside=from_outside,
        is_left_hand=network.is_left_hand,
    )


def _is_from_outside(
    network: Network, ramp_ways: tuple[Connection, ...], mainline_ways: tuple[Connection, ...]
) -> bool:
    """Whether a ramp joins where lane 0 is: by its lanes, else by the side that it comes from."""
    ramp, mainline = (
        sum(way.to_lane for way in ways) / len(ways) for ways in (ramp_ways, mainline_ways)
    )
    if ramp != mainline:
        return ramp < mainline
    x, y = _direction(_end_of(network.edges[mainline_ways[0].from_edge].lanes[0].shape_m))
    u, v = _direction(_end_of(network.edges[ramp_ways[0].from_edge].lanes[0].shape_m))
    comes_from_right = x * v - y * u > 0.0
    return comes_from_right != network.is_left_hand
