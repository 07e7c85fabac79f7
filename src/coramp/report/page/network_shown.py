"""The lanes of a network as they lie, as the map of a page takes them."""

import math

from coramp.errors import CorampError
from coramp.networks.graph import Lane, Point
from coramp.networks.ramps import OnRamp
from coramp.networks.stations import Stretch, stations_of
from coramp.records.schemas import Row
from coramp.road.lanes import ACCELERATION_LANE, MAINLINE
from coramp.scenarios.model import Scenario
from coramp.worlds.sumo.lanes import site_of_road

RAMP = -1
DIGITS = 2


def shapes_data(scenario: Scenario) -> list[Row]:
    """Returns each lane of a scenario's merge site: its stations, its number, and its centre line.

    ``lane`` is that of the mainline, 0 next to the ramp, -1 on the ramp and its acceleration lane,
    None where nobody drives. ``xy`` are x and y (m) in turn, from the nose and turned so that the
    mainline leads to the right there, y upwards. Empty where the network is not there any more, or
    has changed: a run can be looked at without it.
    """
    try:
        site = site_of_road(scenario)
    except CorampError:
        return []
    assert site is not None
    lanes = {lane.lane_id: lane for lane in _lanes(site)}
    turn = _Turn(site)
    return [
        {
            "lane": _number(stretch),
            "from": round(stretch.start_m, DIGITS),
            "to": round(stretch.end_m, DIGITS),
            "width": lanes[stretch.lane_id].width_m,
            "xy": [
                round(value, DIGITS)
                for point in lanes[stretch.lane_id].shape_m
                for value in turn.turned(point)
            ],
        }
        for stretch in stations_of(site).stretches
    ]


def _number(stretch: Stretch) -> int | None:
    if stretch.code == MAINLINE:
        return stretch.lane
    own = RAMP if stretch.code == ACCELERATION_LANE else 0
    return RAMP if stretch.lane == own else None


def _lanes(site: OnRamp) -> list[Lane]:
    """Every lane of a merge site, those inside junctions included."""
    courses = (site.ramp, site.mainline, site.downstream)
    ways = [*site.ramp_ways, *site.mainline_ways]
    ways += [way for course in courses for crossing in course.crossings for way in crossing.ways]
    own = [lane for course in courses for edge in course.edges for lane in edge.lanes]
    return own + [lane for way in ways for lane in way.inside]


class _Turn:
    """Turns points about where the mainline lane next to the ramp's begins behind the nose."""

    def __init__(self, site: OnRamp) -> None:
        beside = site.mainline_way.to_lane
        shape_m = next(lane for lane in site.merge_edge.lanes if lane.index == beside).shape_m
        self.start = shape_m[0]
        bend = next((point for point in shape_m if math.dist(point, self.start) > 1.0), shape_m[-1])
        away_m = math.dist(bend, self.start) or 1.0
        self.along = (bend[0] - self.start[0]) / away_m
        self.across = (bend[1] - self.start[1]) / away_m

    def turned(self, point: Point) -> Point:
        x, y = point[0] - self.start[0], point[1] - self.start[1]
        return x * self.along + y * self.across, y * self.along - x * self.across
