"""Where on a road the signal and the loops of ramp metering are, and what room the ramp has."""

import math
from typing import NamedTuple

from coramp.networks.net_file import read_network
from coramp.networks.ramps import OnRamp, on_ramps
from coramp.networks.stations import Stretch, stations_of
from coramp.road.lanes import RAMP
from coramp.scenarios.demand_sections import Detector
from coramp.scenarios.model import Scenario
from coramp.scenarios.network_section import sha256_of
from coramp.scenarios.sections import DriverPopulation
from coramp.worlds.sumo.detectors import lanes_at
from coramp.worlds.sumo.lanes import LanedRoad, laned_road, road_of, site_of_road
from coramp.worlds.sumo.network import RoadPlan
from coramp.worlds.sumo.signalled import SHORTEST_M, StopLine, signalled_network

MAINLINE_LOOP, QUEUE_LOOP = "mainline", "queue"
QUEUE_LOOP_M, QUEUE_LOOP_SHARE = 100.0, 0.3
"""How far behind its start, or at which share of the way to the stop line, the ramp has the loop
that sees a queue too long for it: SUMO lets nobody in who could not stop behind the queue, so that
at 16 m/s the last one stands some 80 m from the start and the others wait outside."""
QUEUED_M = 7.5
"""What a car takes of a queue: its length, and the gap that SUMO's drivers keep when they stand."""
SUMO_ACCEL_MPS2 = 2.6
"""With which SUMO's drivers speed up where a population says nothing."""


class Loop(NamedTuple):
    """An induction loop: its name, SUMO's lane, and the place on it (m from its start)."""

    name: str
    lane: str
    position_m: float


class MeterPlaces(NamedTuple):
    """Where a ramp is metered: the signal, the lane that ends at it, and those before it.

    ``before`` are all lanes from the ramp's start to the stop line. ``mainline`` has a loop on each
    lane of the mainline.
    """

    signal: str
    stop_lane: str
    before: tuple[str, ...]
    mainline: tuple[Loop, ...]
    queue: Loop

    @property
    def loops(self) -> tuple[Loop, ...]:
        """All loops."""
        return *self.mainline, self.queue


def queue_loop_m(scenario: Scenario) -> float:
    """Returns where (m from its start) the ramp has its loop for the queue."""
    to_stop_line_m = scenario.signal_station_m - scenario.ramp.start_m
    return min(QUEUE_LOOP_M, QUEUE_LOOP_SHARE * to_stop_line_m)


def room_veh(scenario: Scenario) -> float:
    """Returns how many cars the ramp holds between the loop for the queue and the stop line."""
    to_stop_line_m = scenario.signal_station_m - scenario.ramp.start_m
    return (to_stop_line_m - queue_loop_m(scenario)) / QUEUED_M


def speed_at_end_mps(scenario: Scenario, drivers: DriverPopulation) -> float:
    """Returns how fast who stopped at the signal is at the end of the acceleration lane.

    It is v = sqrt(2 a d) with the population's acceleration, and v0 at most.
    """
    way_m = scenario.ramp.acceleration_lane_m - scenario.signal_station_m
    reached_mps = math.sqrt(2.0 * (drivers.accel_mps2 or SUMO_ACCEL_MPS2) * way_m)
    return min(scenario.mainline.speed_mps, reached_mps)


def room_line(scenario: Scenario, drivers: DriverPopulation) -> str:
    """Returns in a line what room a metered ramp has to queue and to accelerate."""
    signal_m = scenario.signal_station_m
    return (
        f"the signal stands {-signal_m:.0f} m before the nose: "
        f"{room_veh(scenario):.0f} cars can queue before it, and one that stopped there is at "
        f"{speed_at_end_mps(scenario, drivers):.1f} m/s where the acceleration lane ends "
        f"(v0 is {scenario.mainline.speed_mps:.1f} m/s)"
    )


def metering_problem(scenario: Scenario, drivers: DriverPopulation) -> str:
    """Returns what keeps a ramp from being metered, nothing where it can be.

    Who enters must be able to stop at the line. On roads of several lanes, who has stopped must be
    no slower at the end of the acceleration lane than others are at the nose.
    """
    if scenario.signal_problem or scenario.has_one_lane:
        return scenario.signal_problem
    reached_mps, nose_mps = speed_at_end_mps(scenario, drivers), scenario.ramp.speed_mps
    if reached_mps >= min(nose_mps, scenario.mainline.speed_mps):
        return ""
    way_m = nose_mps**2 / (2.0 * (drivers.accel_mps2 or SUMO_ACCEL_MPS2))
    return (
        f"ramp.signal_station_m: who stops at {scenario.signal_station_m:g} reaches "
        f"{reached_mps:.1f} m/s where the acceleration lane of "
        f"{scenario.ramp.acceleration_lane_m:g} m ends, others pass the nose at {nose_mps:g} m/s; "
        f"allowed is {scenario.ramp.acceleration_lane_m - way_m:.1f} m or before"
    )


def metered_road(
    scenario: Scenario, drivers: DriverPopulation
) -> tuple[RoadPlan | LanedRoad, MeterPlaces]:
    """Returns the road of a scenario with a signal on its ramp, and where signal and loops are."""
    plan = road_of(scenario, drivers, metered=True)
    if isinstance(plan, RoadPlan):
        return plan, _made_places(scenario)
    found = site_of_road(scenario)
    assert found is not None
    line = stop_line(found, scenario.signal_station_m)
    file = signalled_network(plan.file, sha256_of(plan.file), (line,))
    site = on_ramps(read_network(file)).named(found.ramp_id)
    road = laned_road(file, site)
    return road, places_of(scenario, road, site, line)


def _made_places(scenario: Scenario) -> MeterPlaces:
    """Those of coramp's own road of one lane, which netconvert makes with a signal."""
    return MeterPlaces(
        "stopline",
        "ramp_0",
        ("ramp_0",),
        (Loop(MAINLINE_LOOP, "merge_1", scenario.detector_station_m),),
        Loop(QUEUE_LOOP, "ramp_0", queue_loop_m(scenario)),
    )


def stop_line(site: OnRamp, station_m: float) -> StopLine:
    """Returns the stop line at a station of a ramp, or at the nearest place where one fits."""
    edges = {edge.edge_id: edge for edge in site.ramp.edges}
    stretches = [s for s in _ramp_lanes(site) if not s.lane_id.startswith(":")]
    fitting = [s for s in stretches if s.lane_m > 2.0 * SHORTEST_M]
    own = min(fitting, key=lambda s: max(s.start_m - station_m, station_m - s.end_m, 0.0))
    edge_id = own.lane_id.rpartition("_")[0]
    longest_m = edges[edge_id].length_m - SHORTEST_M
    return StopLine(edge_id, round(min(max(own.position_m(station_m), SHORTEST_M), longest_m), 3))


def _ramp_lanes(site: OnRamp) -> list[Stretch]:
    """The lanes of a ramp on which it is driven, in driving order."""
    found = [s for s in stations_of(site).stretches if s.code == RAMP and s.lane == 0]
    return sorted(found, key=lambda s: s.start_m)


def places_of(
    scenario: Scenario, road: LanedRoad, site: OnRamp, line: StopLine, suffix: str = ""
) -> MeterPlaces:
    """Returns where a ramp of a network is metered; loops have names of their own by ``suffix``.

    ``road`` and ``site`` are those with the signal.
    """
    lanes = _ramp_lanes(site)
    last = next(k for k, s in enumerate(lanes) if s.lane_id.rpartition("_")[0] == line.before)
    queue_m = scenario.ramp.start_m + queue_loop_m(scenario)
    on = [s for s in lanes[: last + 1] if not s.lane_id.startswith(":")]
    own = min(on, key=lambda s: max(s.start_m - queue_m, queue_m - s.end_m, 0.0))
    beside = Detector(id="meter", road="mainline", station_m=scenario.detector_station_m)
    return MeterPlaces(
        line.signal,
        lanes[last].lane_id,
        tuple(s.lane_id for s in lanes[: last + 1]),
        tuple(
            Loop(f"{MAINLINE_LOOP}{k}{suffix}", lane, position_m)
            for k, (lane, position_m) in enumerate(lanes_at(road, beside))
        ),
        Loop(f"{QUEUE_LOOP}{suffix}", own.lane_id, own.position_m(queue_m)),
    )
