"""Who comes onto a corridor when, by which road or ramp, and where they leave it."""

import zlib
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from coramp._kernel import BoolArray
from coramp.coordination.plant import Arrival
from coramp.demand.arrivals import arrivals_of, automated_of, connected_of
from coramp.demand.generators import generator
from coramp.networks.roads import Exit, ThroughRoad
from coramp.scenarios.corridors import Corridor
from coramp.scenarios.model import Scenario

MOST_SEED = 2**31


@dataclass(frozen=True)
class Origin:
    """Where vehicles come from: a road's upstream end, or the ramp of a site.

    ``site`` is the place of its site among all, of a road's end that of the first site behind it.
    """

    name: str
    on_ramp: bool
    site: int
    road: ThroughRoad
    scenario: Scenario
    seed: int


@dataclass(frozen=True)
class Traffic:
    """The vehicles of one origin by time: who is automated, who reports, by which way each leaves.

    ``leaves_by`` has -1 for the road's end, else a place in ``exits``.
    """

    origin: Origin
    arrivals: tuple[Arrival, ...]
    automated: BoolArray
    reporting: BoolArray
    exits: tuple[Exit, ...]
    leaves_by: tuple[int, ...]

    def route(self, leaves_by: int) -> tuple[str, ...]:
        """Returns the edges from the origin to where a vehicle leaves."""
        road, site = self.origin.road, self.origin.scenario.network
        assert site is not None
        ramp_edges: tuple[str, ...] = ()
        first = road.edges[0]
        if self.origin.on_ramp:
            own = next(s for s in road.sites if s.ramp_id == site.ramp)
            ramp_edges = tuple(edge.edge_id for edge in own.ramp.edges)
            first = own.merge_edge.edge_id
        if leaves_by < 0:
            return (*ramp_edges, *road.edges_from(first))
        way = self.exits[leaves_by]
        return (*ramp_edges, *road.edges_from(first, way.after_edge), way.edge_id)


def traffic_of(corridor: Corridor, seed: int) -> list[Traffic]:
    """Returns the traffic of each origin; another origin never shifts the numbers of one.

    Vehicles are named after their origin: road1-m00001, ramp2-r00001 and so on.
    """
    return [_traffic(corridor, origin) for origin in _origins(corridor, seed)]


def _origins(corridor: Corridor, seed: int) -> list[Origin]:
    found, place = [], 0
    for number, road in enumerate(corridor.roads, 1):
        own = corridor.scenarios[place]
        no_ramp = own.ramp.model_copy(update={"flow_veh_h": 0.0, "flow_to_veh_h": None})
        mainline = own.model_copy(update={"ramp": no_ramp})
        name = f"road{number}"
        found.append(Origin(name, False, place, road, mainline, _seed(seed, name)))
        for site in road.sites:
            own = corridor.scenarios[place]
            none = own.mainline.model_copy(update={"flow_veh_h": 0.0, "flow_to_veh_h": None})
            ramp = own.model_copy(update={"mainline": none})
            found.append(
                Origin(f"ramp{place + 1}", True, place, road, ramp, _seed(seed, site.ramp_id))
            )
            place += 1
    return found


def _seed(seed: int, name: str) -> int:
    return zlib.crc32(f"{seed}/{name}".encode()) % MOST_SEED


def _traffic(corridor: Corridor, origin: Origin) -> Traffic:
    scenario, seed = origin.scenario, origin.seed
    arrivals = arrivals_of(scenario, seed)
    exits, shares = _exits_ahead(corridor, origin)
    return Traffic(
        origin,
        tuple(a._replace(vehicle_id=f"{origin.name}-{a.vehicle_id}") for a in arrivals),
        automated_of(scenario, arrivals, seed),
        connected_of(scenario, arrivals, seed),
        exits,
        _leaves_by(shares, len(arrivals), seed),
    )


def _exits_ahead(corridor: Corridor, origin: Origin) -> tuple[tuple[Exit, ...], tuple[float, ...]]:
    """The exits that an origin's vehicles pass, in the order of driving, and the share of each."""
    road, first = origin.road, 0
    if origin.on_ramp:
        first = road.edges.index(corridor.sites[origin.site].merge_edge.edge_id)
    shares = {way.edge: way.share for way in corridor.section.exits}
    ahead = [
        way
        for way in road.exits
        if way.edge_id in shares and road.edges.index(way.after_edge) >= first
    ]
    return tuple(ahead), tuple(shares[way.edge_id] for way in ahead)


def _leaves_by(shares: Sequence[float], count: int, seed: int) -> tuple[int, ...]:
    """At each exit its share of those that pass it leaves; a vehicle keeps its draws."""
    draws = generator(seed, "corridor/exits").random((count, max(1, len(shares))))
    found = []
    for own in draws:
        left = np.flatnonzero(own[: len(shares)] < np.array(shares))
        found.append(int(left[0]) if len(left) else -1)
    return tuple(found)
