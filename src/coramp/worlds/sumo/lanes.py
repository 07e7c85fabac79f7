"""Roads of several lanes in SUMO: coramp's own, and those of a user's network, lane by lane."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import NamedTuple

from coramp.networks.limits import Limits, limits_along
from coramp.networks.net_file import read_network
from coramp.networks.ramps import OnRamp, on_ramps
from coramp.networks.stations import stations_of
from coramp.road.lanes import ACCELERATION_LANE, MAINLINE
from coramp.scenarios.model import Scenario
from coramp.scenarios.network_section import site_of
from coramp.scenarios.sections import DriverPopulation
from coramp.worlds.sumo.network import (
    MADE_RAMP,
    RAMP_LANE,
    LaneSpan,
    RoadPlan,
    driver_road_plan,
    network_file,
    road_plan,
)

SIGNALS_OFF = ("--tls.all-off", "true")
"""A network's own signals show nothing: a ramp's might stay red for as long as a run lasts."""


class Way(NamedTuple):
    """A stream's way through a network: its edges, the lane of the first on which it enters.

    ``lane`` is SUMO's number; on the mainline it is that of the outermost lane.
    """

    edges: tuple[str, ...]
    lane: int
    limits: Limits


@dataclass(frozen=True)
class LanedRoad:
    """A merge site in a network: its file, both streams' ways, and where each of its lanes lies.

    ``closed`` are lanes of the ramp that end before the nose, on which nobody drives.
    """

    network: Path
    mainline: Way
    ramp: Way
    lanes: Mapping[str, LaneSpan]
    closed: tuple[str, ...]

    @property
    def file(self) -> Path:
        """The network's file."""
        return self.network

    @property
    def options(self) -> tuple[str, ...]:
        """SUMO's options for this network."""
        return SIGNALS_OFF

    def spans(self) -> Mapping[str, LaneSpan]:
        """Returns where each lane lies; lanes inside junctions included."""
        return self.lanes

    def way(self, on_ramp: bool) -> Way:
        """Returns the way of a stream."""
        return self.ramp if on_ramp else self.mainline

    @property
    def additional(self) -> str | None:
        """What SUMO is told beside the network: lanes that are closed; None without any."""
        if not self.closed:
            return None
        edges = " ".join(dict.fromkeys(lane.rpartition("_")[0] for lane in self.closed))
        lanes = "".join(f'<closingLaneReroute id="{lane}" disallow="all"/>' for lane in self.closed)
        return (
            f'<additional>\n  <rerouter id="closed" edges="{edges}">\n'
            f'    <interval begin="0" end="1000000">{lanes}</interval>\n  </rerouter>\n'
            "</additional>\n"
        )


def road_of(
    scenario: Scenario, drivers: DriverPopulation, metered: bool = False
) -> RoadPlan | LanedRoad:
    """Returns the road of a scenario for drivers: coramp's own, or that of its network.

    ``metered`` puts a signal on coramp's own ramp beside one lane.
    """
    if scenario.network is not None:
        section = scenario.network
        return laned_road(Path(section.file), site_of(section))
    plan = driver_road_plan(scenario, drivers, metered and scenario.has_one_lane)
    return plan if plan.lanes == 1 else _made(plan)


@cache
def _made(plan: RoadPlan) -> LanedRoad:
    return laned_road(network_file(plan), _made_site(plan))


@cache
def _made_site(plan: RoadPlan) -> OnRamp:
    return on_ramps(read_network(network_file(plan))).named(MADE_RAMP)


def site_of_road(scenario: Scenario) -> OnRamp | None:
    """Returns the merge site of a scenario in a network, or of a made road of several lanes.

    None for coramp's own road of one lane. Raises CorampError where the network is not there or has
    changed.
    """
    if scenario.network is not None:
        return site_of(scenario.network)
    return _made_site(road_plan(scenario)) if scenario.mainline.lanes > 1 else None


def laned_road(file: Path, site: OnRamp) -> LanedRoad:
    """Returns the road of a merge site in a network's file."""
    return LanedRoad(
        network=file,
        mainline=_way(site, on_ramp=False),
        ramp=_way(site, on_ramp=True),
        lanes=laned_spans(site),
        closed=_closed(site),
    )


def _way(site: OnRamp, on_ramp: bool) -> Way:
    before = site.ramp if on_ramp else site.mainline
    way = site.ramp_way if on_ramp else site.mainline_way
    first = before.crossings[0].reference.from_lane if before.crossings else way.from_lane
    edges = tuple(edge.edge_id for edge in (*before.edges, *site.downstream.edges))
    return Way(edges, first, limits_along(site, on_ramp))


def laned_spans(site: OnRamp) -> dict[str, LaneSpan]:
    """Returns where each lane of a merge site lies, those inside junctions included."""
    found, stretches = {}, stations_of(site).stretches
    names = {stretch.lane_id for stretch in stretches if stretch.code == MAINLINE}
    for stretch in stretches:
        lane = stretch.lane if stretch.code == MAINLINE else RAMP_LANE
        edge, _, index = stretch.lane_id.rpartition("_")
        beside = stretch.code in (ACCELERATION_LANE, MAINLINE) and not edge.startswith(":")
        changes = beside and f"{edge}_{int(index) + 1}" in names
        found[stretch.lane_id] = LaneSpan(
            stretch.start_m, stretch.end_m, stretch.metres_per_metre, lane, changes
        )
    return found


def _closed(site: OnRamp) -> tuple[str, ...]:
    """Lanes of the ramp's edges other than the one that leads to the nose."""
    lane, found = site.ramp_way.from_lane, []
    for k in range(len(site.ramp.edges) - 1, -1, -1):
        edge = site.ramp.edges[k]
        found += [own.lane_id for own in edge.lanes if own.index != lane]
        if k > 0:
            lane = site.ramp.crossings[k - 1].reference.from_lane
    return tuple(reversed(found))
