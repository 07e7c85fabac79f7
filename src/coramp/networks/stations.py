"""From SUMO's positions to stations of a merge site, and back.

Station 0 is the nose: where the merge edge begins, and the lanes of ramp and mainline first lie
side by side. Ramp and mainline have negative stations of their own before it. A station of an edge
is the same on all of its lanes. Inside a junction SUMO's lanes differ in length by their bends; the
lane next to the ramp's, and on the ramp the one next to the mainline, count with their true
length, the others in proportion.
"""

from bisect import bisect_right
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

from coramp.errors import CorampError
from coramp.networks.course import Course, Crossing
from coramp.networks.graph import Edge
from coramp.networks.ramps import OnRamp
from coramp.road.lanes import ACCELERATION_LANE, MAINLINE, RAMP

ROUNDING_M = 1e-6
"""What adding lengths may put a station beyond the end of its stretch."""


@dataclass(frozen=True)
class Place:
    """Where a front bumper is: its station, and the lane that it is on.

    ``code`` is that of ``road.lanes``: ramp, acceleration lane or mainline. Lane 0 of the mainline
    is the one next to the ramp, 1 the one beyond it, -1 the ramp's own beside it; lane 0 of the
    ramp is the one next to the mainline, -1 the one before it.
    """

    station_m: float
    code: int
    lane: int


@dataclass(frozen=True)
class Stretch:
    """One of SUMO's lanes, and the stations between which it lies."""

    lane_id: str
    lane_m: float
    start_m: float
    end_m: float
    code: int
    lane: int

    @property
    def metres_per_metre(self) -> float:
        """Metres of station for each metre on the lane; 1 but inside junctions."""
        return (self.end_m - self.start_m) / self.lane_m

    def station_m(self, position_m: float) -> float:
        """Returns the station of a position on the lane."""
        return self.start_m + position_m * self.metres_per_metre

    def position_m(self, station_m: float) -> float:
        """Returns the position on the lane at a station."""
        position_m = (station_m - self.start_m) / self.metres_per_metre
        return min(max(position_m, 0.0), self.lane_m)


@dataclass(frozen=True)
class Stations:
    """The stretches of a merge site, with what finds one by its lane or by its station."""

    stretches: tuple[Stretch, ...]

    @cached_property
    def _by_lane(self) -> dict[str, Stretch]:
        return {stretch.lane_id: stretch for stretch in self.stretches}

    @cached_property
    def _side_by_side(self) -> dict[tuple[bool, int], list[Stretch]]:
        """Stretches of ramp or mainline by the number of their lane, each list downstream."""
        found: dict[tuple[bool, int], list[Stretch]] = {}
        for stretch in sorted(self.stretches, key=lambda stretch: stretch.start_m):
            found.setdefault((stretch.code == RAMP, stretch.lane), []).append(stretch)
        return found

    def place(self, lane_id: str, position_m: float) -> Place:
        """Returns the place of a position on one of SUMO's lanes, measured from its start.

        Raises CorampError where the lane is no part of the merge site, or the position not on it.
        """
        stretch = self._by_lane.get(lane_id)
        if stretch is None:
            raise CorampError(f"{lane_id}: is no lane of this merge site")
        if not 0.0 <= position_m <= stretch.lane_m:
            raise CorampError(
                f"{lane_id}: {position_m:g} m is not on the lane; "
                f"allowed is 0 to {stretch.lane_m:g} m"
            )
        return Place(stretch.station_m(position_m), stretch.code, stretch.lane)

    def position(self, place: Place) -> tuple[str, float]:
        """Returns the lane of SUMO's and the position on it (m from its start) of a place.

        Where one stretch ends and the next begins it is the start of the next. Raises CorampError
        where there is no such lane at that station.
        """
        lanes = self._side_by_side.get((place.code == RAMP, place.lane), [])
        after = bisect_right(lanes, place.station_m, key=lambda stretch: stretch.start_m)
        stretch = lanes[max(after - 1, 0)] if lanes else None
        if stretch is None or not (
            stretch.start_m - ROUNDING_M <= place.station_m <= stretch.end_m + ROUNDING_M
        ):
            raise CorampError(f"station {place.station_m:g} m: there is no lane {place.lane}")
        return stretch.lane_id, stretch.position_m(place.station_m)


def stations_of(ramp: OnRamp) -> Stations:
    """Returns the stations of an on-ramp's merge site, on all lanes before and behind its nose."""
    sites = (
        (RAMP, ramp.ramp, Crossing(ramp.ramp_ways, ramp.ramp_way)),
        (MAINLINE, ramp.mainline, Crossing(ramp.mainline_ways, ramp.mainline_way)),
    )
    inward = 1 if ramp.is_from_outside else -1
    stretches: list[Stretch] = []
    for code, course, nose in sites:
        first = _first_lane(course, nose.reference.from_lane)
        start_m = -nose.length_m - course.length_m
        stretches += _along(course, first, _Side(start_m, code, inward))
        stretches += _crossed(nose, _Side(-nose.length_m, code, inward))
    beyond = _along(ramp.downstream, ramp.mainline_way.to_lane, _Side(0.0, MAINLINE, inward))
    own = frozenset(_own_lanes(ramp))
    for stretch in beyond:
        is_own = stretch.lane_id in own
        stretches.append(replace(stretch, code=ACCELERATION_LANE) if is_own else stretch)
    return Stations(tuple(stretches))


def _first_lane(course: Course, last_lane: int) -> int:
    """The reference lane of the first edge of a course that ends on a lane."""
    return course.crossings[0].reference.from_lane if course.crossings else last_lane


def _own_lanes(ramp: OnRamp) -> Iterator[str]:
    """The ids of the lanes that the ramp brings, up to where the first of them ends."""
    if ramp.merging.lane_m is None:
        return
    lanes, left_m = set(ramp.merging.lanes), ramp.merging.lane_m
    course = ramp.downstream
    for k, edge in enumerate(course.edges):
        yield from (lane.lane_id for lane in edge.lanes if lane.index in lanes)
        left_m -= edge.length_m
        if left_m <= ROUNDING_M:
            return
        ways = [way for way in course.crossings[k].ways if way.from_lane in lanes]
        yield from (lane.lane_id for way in ways for lane in way.inside)
        left_m -= ways[0].length_m
        lanes = {way.to_lane for way in ways}


class _Side(NamedTuple):
    """What stretches side by side have in common; ``inward`` is 1 where lane numbers grow away."""

    start_m: float
    code: int
    inward: int


def _along(course: Course, lane: int, side: _Side) -> Iterator[Stretch]:
    """The stretches of a course, whose first edge has a reference lane and begins at a station."""
    for k, edge in enumerate(course.edges):
        yield from _side_by_side(edge, lane, side)
        side = side._replace(start_m=side.start_m + edge.length_m)
        if k < len(course.crossings):
            crossing = course.crossings[k]
            yield from _crossed(crossing, side)
            side = side._replace(start_m=side.start_m + crossing.length_m)
            lane = crossing.reference.to_lane


def _side_by_side(edge: Edge, reference: int, side: _Side) -> Iterator[Stretch]:
    first = [lane.index for lane in edge.lanes].index(reference)
    for number, lane in enumerate(edge.lanes):
        yield Stretch(
            lane_id=lane.lane_id,
            lane_m=lane.length_m,
            start_m=side.start_m,
            end_m=side.start_m + edge.length_m,
            code=side.code,
            lane=side.inward * (number - first),
        )


def _crossed(crossing: Crossing, side: _Side) -> Iterator[Stretch]:
    """The lanes inside a junction, stretched to the length of the reference way."""
    first = crossing.ways.index(crossing.reference)
    for number, way in enumerate(crossing.ways):
        scale = crossing.length_m / way.length_m if way.inside else 0.0
        done_m = 0.0
        for lane in way.inside:
            begin_m, done_m = done_m, done_m + lane.length_m
            yield Stretch(
                lane_id=lane.lane_id,
                lane_m=lane.length_m,
                start_m=side.start_m + scale * begin_m,
                end_m=side.start_m + scale * done_m,
                code=side.code,
                lane=side.inward * (number - first),
            )
