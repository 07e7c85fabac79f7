"""Who is in which zone of a corridor: all zones at once, as arrays, from who is on their lanes."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from coramp._kernel import BoolArray, FloatArray, IntArray, kernel
from coramp.worlds.sumo.corridor_road import SiteRoad
from coramp.worlds.sumo.network import RAMP_LANE, LaneSpan
from coramp.worlds.sumo.road_limits import (
    MAINLINE_WAY,
    RAMP_WAY,
    RoadLimits,
    allowed_mps,
    road_limits_of,
)

NO_SPAN = LaneSpan(0.0, 0.0, 0.0, RAMP_LANE, False)
"""Of a lane that is none of a site's."""


class Found(NamedTuple):
    """Who is on the lanes of all zones, one entry each, by number.

    ``place`` is that of each one's lane among all of them.
    """

    names: list[str]
    number: IntArray
    place: IntArray
    position_m: FloatArray
    speed_mps: FloatArray


class ZoneLanes(NamedTuple):
    """The lanes of all zones as arrays [site, place of the lane], and where each zone lies."""

    is_own: BoolArray
    start_m: FloatArray
    per_m: FloatArray
    lane: IntArray
    changes: BoolArray
    from_m: FloatArray
    to_m: FloatArray
    sees_m: FloatArray


class Placed(NamedTuple):
    """Who of those found is in a zone or seen from it: site by site, and by number in each.

    Those of site k are the entries ``first[k]`` to ``first[k + 1]``; ``place`` is each one's among
    all found. ``inside`` is who is in the zone; the others are those ahead of it. ``allowed_mps``
    is what the limits where it is, and ahead, let it drive.
    """

    first: IntArray
    place: IntArray
    site: IntArray
    station_m: FloatArray
    lane: IntArray
    beside: BoolArray
    inside: BoolArray
    beyond_start_m: FloatArray
    allowed_mps: FloatArray

    def of_site(self, site: int) -> slice:
        """Returns which entries are those of a site."""
        return slice(int(self.first[site]), int(self.first[site + 1]))

    def entry_of(self, site: int, place: int) -> int | None:
        """Returns the entry of one of those found on a site's lanes; None where it is not there."""
        own = self.of_site(site)
        there = np.flatnonzero(self.place[own] == place)
        return None if len(there) == 0 else own.start + int(there[0])


def zone_lanes_of(sites: Sequence[SiteRoad], lanes: Sequence[str]) -> ZoneLanes:
    """Returns where ``lanes`` lie in the zones of all sites."""
    spans = [[own.lanes.get(lane, NO_SPAN) for lane in lanes] for own in sites]
    starts = [[own.zone.from_m, own.zone.ramp_from_m] for own in sites]
    return ZoneLanes(
        np.array([[lane in own.lanes for lane in lanes] for own in sites], np.bool_),
        np.array([[span.start_m for span in row] for row in spans], np.float64),
        np.array([[span.per_m for span in row] for row in spans], np.float64),
        np.array([[span.lane for span in row] for row in spans], np.int64),
        np.array([[span.changes for span in row] for row in spans], np.bool_),
        np.array(starts, np.float64),
        np.array([own.zone.to_m for own in sites], np.float64),
        np.array([own.zone.sees_m for own in sites], np.float64),
    )


def zone_limits_of(sites: Sequence[SiteRoad]) -> RoadLimits:
    """Returns the limits along both ways of all sites."""
    return road_limits_of([[own.limits(on_ramp) for on_ramp in (False, True)] for own in sites])


def placed_of(lanes: ZoneLanes, limits: RoadLimits, found: Found) -> Placed:
    """Returns who is in a zone, or just ahead of it."""
    return Placed(*_placed(lanes, limits, found.place, found.position_m))


@kernel
def _placed(
    lanes: ZoneLanes, limits: RoadLimits, place: IntArray, position_m: FloatArray
) -> tuple[
    IntArray,
    IntArray,
    IntArray,
    FloatArray,
    IntArray,
    BoolArray,
    BoolArray,
    FloatArray,
    FloatArray,
]:
    sites, most = len(lanes.to_m), len(lanes.to_m) * len(place)
    first, count = np.zeros(sites + 1, np.int64), 0
    entry, own_site = np.empty(most, np.int64), np.empty(most, np.int64)
    station, own_lane = np.empty(most, np.float64), np.empty(most, np.int64)
    beside, inside = np.empty(most, np.bool_), np.empty(most, np.bool_)
    beyond_start, allowed = np.empty(most, np.float64), np.empty(most, np.float64)
    for site in range(sites):
        for i in range(len(place)):
            own = place[i]
            if not lanes.is_own[site, own]:
                continue
            station_m = lanes.start_m[site, own] + position_m[i] * lanes.per_m[site, own]
            way = RAMP_WAY if lanes.lane[site, own] == RAMP_LANE else MAINLINE_WAY
            from_m = lanes.from_m[site, way]
            if station_m < from_m or station_m >= lanes.sees_m[site]:
                continue
            entry[count], own_site[count], station[count] = i, site, station_m
            own_lane[count], beside[count] = lanes.lane[site, own], lanes.changes[site, own]
            inside[count] = station_m < lanes.to_m[site]
            beyond_start[count] = station_m - from_m
            allowed[count] = allowed_mps(limits, site, way, station_m)
            count += 1
        first[site + 1] = count
    return (
        first,
        entry[:count].copy(),
        own_site[:count].copy(),
        station[:count].copy(),
        own_lane[:count].copy(),
        beside[:count].copy(),
        inside[:count].copy(),
        beyond_start[:count].copy(),
        allowed[:count].copy(),
    )
