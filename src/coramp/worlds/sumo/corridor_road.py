"""A corridor in SUMO: its network, where each zone's lanes lie, and its route file."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from coramp._kernel import FloatArray
from coramp.demand.corridor_demand import Origin, Traffic
from coramp.networks.limits import Limits
from coramp.networks.ramps import OnRamp
from coramp.networks.stations import stations_of
from coramp.road.lanes import RAMP
from coramp.scenarios.corridors import Corridor, Zone
from coramp.scenarios.sections import DriverPopulation
from coramp.worlds.sumo.demand import Automated, OriginWays, driver_lines, route_file
from coramp.worlds.sumo.lanes import SIGNALS_OFF, LanedRoad, Way, laned_road, laned_spans
from coramp.worlds.sumo.network import LaneSpan
from coramp.worlds.sumo.traits import traits_of, with_careless

FREE_STEP_M = 1.0
"""The road is cut into pieces of about this length for the time that free driving takes."""


@dataclass(frozen=True)
class SiteRoad:
    """The road of one merge site: its lanes in SUMO, and the zone that its coordinator knows.

    ``lanes`` are those on which somebody in the zone, or seen from it, can be.
    """

    site: OnRamp
    zone: Zone
    road: LanedRoad
    lanes: Mapping[str, LaneSpan]

    def limits(self, on_ramp: bool) -> Limits:
        """Returns the limits along the ramp or the mainline."""
        return self.road.way(on_ramp).limits

    def from_m(self, on_ramp: bool) -> float:
        """Returns the station at which the zone begins."""
        return self.zone.ramp_from_m if on_ramp else self.zone.from_m

    def free_s(self, on_ramp: bool, cruise_mps: float) -> float:
        """Returns the time (s) through the zone at a speed, or at lower limits where there are."""
        return _free_s(self.limits(on_ramp), self.from_m(on_ramp), self.zone.to_m, cruise_mps)


def _free_s(limits: Limits, from_m: float, to_m: float, cruise_mps: float) -> float:
    count = max(1, round((to_m - from_m) / FREE_STEP_M))
    step_m = (to_m - from_m) / count
    at_m = from_m + step_m * (np.arange(count) + 0.5)
    speeds: FloatArray = np.array([limits.allowed_mps(x) for x in at_m.tolist()])
    return float((step_m / np.minimum(speeds, cruise_mps)).sum())


@dataclass(frozen=True)
class CorridorRoad:
    """The network of a corridor, with the roads of its sites in the order of the corridor."""

    network: Path
    sites: tuple[SiteRoad, ...]

    @property
    def file(self) -> Path:
        """The network's file."""
        return self.network

    @property
    def options(self) -> tuple[str, ...]:
        """SUMO's options for this network."""
        return SIGNALS_OFF

    def spans(self) -> Mapping[str, LaneSpan]:
        """Returns nothing: stations of different sites are not those of one road."""
        return {}

    @cached_property
    def lanes(self) -> tuple[str, ...]:
        """All lanes of all zones, each once."""
        return tuple(dict.fromkeys(lane for own in self.sites for lane in own.lanes))

    @property
    def additional(self) -> str | None:
        """What SUMO is told beside the network: closed lanes of ramps; None without any."""
        closed = [(k, own.road.closed) for k, own in enumerate(self.sites) if own.road.closed]
        if not closed:
            return None
        return "\n".join(
            ["<additional>", *(_closing(*found) for found in closed), "</additional>", ""]
        )


def _closing(number: int, closed: Sequence[str]) -> str:
    edges = " ".join(dict.fromkeys(lane.rpartition("_")[0] for lane in closed))
    lanes = "".join(f'<closingLaneReroute id="{lane}" disallow="all"/>' for lane in closed)
    return (
        f'  <rerouter id="closed{number}" edges="{edges}">\n'
        f'    <interval begin="0" end="1000000">{lanes}</interval>\n  </rerouter>'
    )


def corridor_road(corridor: Corridor) -> CorridorRoad:
    """Returns a corridor's road in SUMO."""
    return CorridorRoad(
        corridor.file,
        tuple(
            SiteRoad(site, zone, laned_road(corridor.file, site), _lanes(site, zone))
            for site, zone in zip(corridor.sites, corridor.zones, strict=True)
        ),
    )


def _lanes(site: OnRamp, zone: Zone) -> dict[str, LaneSpan]:
    """The spans of those lanes of a site that lie in its zone, or where it sees who is ahead."""
    whole = laned_spans(site)
    found = {}
    for stretch in stations_of(site).stretches:
        span = whole[stretch.lane_id]
        on_ramp = stretch.code == RAMP
        from_m = zone.ramp_from_m if on_ramp else zone.from_m
        if stretch.end_m > from_m and stretch.start_m < zone.sees_m:
            found[stretch.lane_id] = span
    return found


def corridor_routes(
    drivers: DriverPopulation,
    traffic: Sequence[Traffic],
    automated: Sequence[Automated | None],
    road: CorridorRoad,
) -> str:
    """Returns the route file of all origins' vehicles; ``automated`` has one entry an origin."""
    types: list[str] = []
    routes: list[str] = []
    vehicles: list[tuple[int, str]] = []
    for own, kinds in zip(traffic, automated, strict=True):
        origin = own.origin
        names = {leaves: f"{origin.name}-{leaves + 1}" for leaves in sorted(set(own.leaves_by))}
        routes += [
            f'  <route id="{name}" edges="{" ".join(own.route(leaves))}"/>'
            for leaves, name in names.items()
        ]
        route_of = {
            arrival.vehicle_id: names[leaves]
            for arrival, leaves in zip(own.arrivals, own.leaves_by, strict=True)
        }
        traits = traits_of(drivers, own.arrivals, origin.seed)
        traits = with_careless(traits, origin.scenario.behaviour, origin.seed)
        found, lines = driver_lines(
            origin.scenario, drivers, own.arrivals, traits, kinds, _ways(origin, road, route_of)
        )
        renamed = {name: f"{origin.name}-{name}" for name in found}
        types += [
            line.replace(f'id="{name}"', f'id="{renamed[name]}"') for name, line in found.items()
        ]
        for arrival, line in zip(own.arrivals, lines, strict=True):
            kind = line.split('type="', 1)[1].split('"', 1)[0]
            named = line.replace(f'type="{kind}"', f'type="{renamed[kind]}"')
            vehicles.append((arrival.step, named))
    vehicles.sort(key=lambda found: found[0])
    return route_file(types, routes, [line for _, line in vehicles])


def _ways(origin: Origin, road: CorridorRoad, route_of: Mapping[str, str]) -> OriginWays:
    """The ways of an origin: the whole road, or those of the site at which its ramp joins.

    On a road's first edge the lanes of its sites are those furthest in.
    """
    own = road.sites[origin.site].road
    if origin.on_ramp:
        return OriginWays(own.mainline, own.ramp, route_of)
    outermost = origin.road.first_lanes - origin.scenario.mainline.lanes
    whole = Way(origin.road.edges, max(0, outermost), origin.road.limits)
    return OriginWays(whole, own.ramp, route_of)
