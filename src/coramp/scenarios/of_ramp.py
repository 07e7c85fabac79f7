"""Whether coramp can coordinate an on-ramp of a network: as the scenario that has its lengths."""

from collections.abc import Iterator
from typing import Any

from coramp.errors import CorampError
from coramp.networks.graph import Connection, Edge
from coramp.networks.merging import ACCELERATION_LANE
from coramp.networks.ramps import OnRamp
from coramp.scenarios.defaults import with_defaults
from coramp.scenarios.model import Scenario
from coramp.scenarios.toml_files import validated


def reason_against(ramp: OnRamp) -> str | None:
    """Returns why coramp cannot coordinate an on-ramp, nothing where it can.

    It can where the ramp has the shape of coramp's own road, and a scenario of its lengths and
    speed limits is valid.
    """
    if found := list(_differences(ramp)):
        return "; ".join(found)
    try:
        validated(Scenario, with_defaults(scenario_data(ramp), ramp.ramp_id), "")
    except CorampError as error:
        return "; ".join(error.messages)
    return None


def scenario_data(ramp: OnRamp) -> dict[str, Any]:
    """Returns the keys of a scenario, without traffic, on a road as long and fast as a ramp's."""
    return {
        "description": f"the road at {ramp.ramp_id}",
        "mainline": {
            "start_m": -ramp.mainline_m,
            "end_m": ramp.downstream.length_m,
            "speed_mps": ramp.mainline_edge.highest_limit_mps,
            "flow_veh_h": 0.0,
        },
        "ramp": {
            "start_m": -ramp.ramp_m,
            "speed_mps": ramp.ramp_edge.highest_limit_mps,
            "limit_mps": ramp.ramp_edge.highest_limit_mps,
            "flow_veh_h": 0.0,
            "acceleration_lane_m": ramp.merging.lane_m,
        },
    }


def _differences(ramp: OnRamp) -> Iterator[str]:
    """What is unlike coramp's road: one lane each, and an acceleration lane on the right."""
    if ramp.is_left_hand:
        yield "left-hand traffic: coramp knows right-hand traffic so far"
    elif ramp.side == "left":
        yield "it joins from the left: coramp knows ramps on the right so far"
    for name, edge in (("mainline", ramp.mainline_edge), ("ramp", ramp.ramp_edge)):
        if len(edge.lanes) > 1:
            yield f"{len(edge.lanes)} {name} lanes: coramp coordinates one lane so far"
    if ramp.merging.how != ACCELERATION_LANE:
        yield f"{ramp.merging.how}: coramp needs an acceleration lane that ends"
    elif len(ramp.merge_edge.lanes) > len(ramp.mainline_edge.lanes) + len(ramp.ramp_edge.lanes):
        lanes = len(ramp.merge_edge.lanes)
        yield f"{lanes} lanes behind the nose: coramp knows those that come from before it"
    before, behind = ramp.mainline, ramp.downstream
    crossings = (*before.crossings, *behind.crossings)
    mainline_ways = [way for crossing in crossings for way in crossing.ways]
    ramp_ways = [way for crossing in ramp.ramp.crossings for way in crossing.ways]
    roads = (
        ("mainline", (*before.edges, *behind.edges), (*mainline_ways, *ramp.mainline_ways)),
        ("ramp", ramp.ramp.edges, (*ramp_ways, *ramp.ramp_ways)),
    )
    for name, edges, ways in roads:
        limits_mps = _limits_mps(edges)
        if len(limits_mps) > 1:
            told = ", ".join(f"{limit:g}" for limit in limits_mps)
            yield f"speed limits of {told} m/s on the {name}: coramp knows one so far"
        yield from _junction_differences(name, ways, limits_mps[0])


def _junction_differences(
    name: str, ways: tuple[Connection, ...], lowest_mps: float
) -> Iterator[str]:
    """What the junctions on a road have that coramp's road has not, by its lowest speed limit."""
    if any(way.is_signalled for way in ways):
        yield f"a signal on the {name}: coramp knows none of a network's own"
    limit_mps = min((lane.limit_mps for way in ways for lane in way.inside), default=lowest_mps)
    if limit_mps < lowest_mps:
        yield (
            f"a bend inside a junction of the {name} that allows {limit_mps:g} m/s: coramp knows "
            "none so far"
        )


def _limits_mps(edges: tuple[Edge, ...]) -> list[float]:
    return sorted({lane.limit_mps for edge in edges for lane in edge.lanes})
