"""Whether coramp can coordinate an on-ramp of a network, and the scenario that has its lengths."""

import math
from collections.abc import Iterator
from typing import Any

from coramp.errors import CorampError
from coramp.networks.graph import Connection
from coramp.networks.limits import Limits, limits_along
from coramp.networks.merging import ACCELERATION_LANE
from coramp.networks.ramps import OnRamp
from coramp.scenarios.defaults import with_defaults
from coramp.scenarios.toml_files import validated

MOST_LANES = 4
"""coramp drives on so many lanes of a mainline."""
SPEED_UP_MPS2 = 2.0
"""With this who has passed a lower limit on the ramp speeds up before the nose."""
ENTRY_SHARE = 0.9
"""The lowest entry speed over the highest."""


def reason_against(ramp: OnRamp) -> str | None:
    """Returns why coramp cannot coordinate an on-ramp, nothing where it can."""
    if found := list(_differences(ramp)):
        return "; ".join(found)
    from coramp.scenarios.model import Scenario

    section = {"file": ramp.ramp_id, "sha256": "0" * 64, "ramp": ramp.ramp_id}
    data = {**scenario_data(ramp), "network": section}
    try:
        validated(Scenario, with_defaults(data, ramp.ramp_id), "")
    except CorampError as error:
        return "; ".join(error.messages)
    return None


def measures_of(ramp: OnRamp) -> dict[str, float]:
    """Returns the keys of a scenario that are lengths and lanes of its network."""
    return {
        "mainline.start_m": -round(ramp.mainline_m, 3),
        "mainline.end_m": round(ramp.downstream.length_m, 3),
        "mainline.lanes": len(ramp.mainline_edge.lanes),
        "ramp.start_m": -round(ramp.ramp_m, 3),
        "ramp.acceleration_lane_m": round(ramp.merging.lane_m or 0.0, 3),
    }


def scenario_data(ramp: OnRamp) -> dict[str, Any]:
    """Returns the keys of a scenario, without traffic, on the road at a ramp.

    v0 is the mainline's highest limit at the nose. v_R0 is what a vehicle reaches at the nose that
    keeps to all limits of the ramp.
    """
    data: dict[str, Any] = {
        "description": f"the road at {ramp.ramp_id}",
        "mainline": {"flow_veh_h": 0.0, "speed_mps": ramp.mainline_edge.highest_limit_mps},
        "ramp": {"flow_veh_h": 0.0},
    }
    for key, value in measures_of(ramp).items():
        table, name = key.split(".")
        data[table][name] = value
    mainline, own = limits_along(ramp, on_ramp=False), limits_along(ramp, on_ramp=True)
    first_mps = _down(mainline.allowed_mps(-ramp.mainline_m))
    data["mainline"]["limit_mps"] = max(mainline.limit_mps)
    data["mainline"]["entry_speed_mps"] = _entry(first_mps, data["mainline"]["speed_mps"])
    nose_mps = min(_down(_speed_at_nose(own, ramp.ramp_m)), data["mainline"]["speed_mps"])
    before = [limit for at, limit in zip(own.from_m, own.limit_mps, strict=True) if at < 0.0]
    data["ramp"]["speed_mps"] = nose_mps
    data["ramp"]["limit_mps"] = max(before)
    data["ramp"]["entry_speed_mps"] = _entry(_down(own.allowed_mps(-ramp.ramp_m)), max(before))
    return data


def _entry(first_mps: float, most_mps: float) -> list[float]:
    high_mps = min(first_mps, most_mps)
    return [_down(ENTRY_SHARE * high_mps), high_mps]


def _down(speed_mps: float) -> float:
    """Rounded down to a hundredth, as SUMO's networks have their limits."""
    return math.floor(100.0 * speed_mps + 1e-6) / 100.0


def _speed_at_nose(limits: Limits, ramp_m: float) -> float:
    """The speed with which a vehicle that keeps to limits reaches station 0."""
    speed_mps, at_m = limits.allowed_mps(-ramp_m), -ramp_m
    while at_m < 0.0:
        step_m = min(1.0, -at_m)
        at_m += step_m
        faster_mps = math.sqrt(speed_mps**2 + 2.0 * SPEED_UP_MPS2 * step_m)
        speed_mps = min(faster_mps, limits.allowed_mps(min(at_m, -1e-6)))
    return speed_mps


def _differences(ramp: OnRamp) -> Iterator[str]:
    """What coramp does not know to drive: all but an acceleration lane of one lane on the right."""
    if ramp.is_left_hand:
        yield "left-hand traffic: coramp knows right-hand traffic so far"
    elif ramp.side == "left":
        yield "it joins from the left: coramp knows ramps on the right so far"
    lanes = len(ramp.mainline_edge.lanes)
    if lanes > MOST_LANES:
        yield f"{lanes} mainline lanes: coramp coordinates up to {MOST_LANES}"
    if len(ramp.ramp_edge.lanes) > 1:
        yield f"{len(ramp.ramp_edge.lanes)} ramp lanes: coramp coordinates one lane so far"
    if ramp.merging.how != ACCELERATION_LANE:
        yield f"{ramp.merging.how}: coramp needs an acceleration lane that ends"
    elif len(ramp.merge_edge.lanes) > lanes + len(ramp.ramp_edge.lanes):
        merge_lanes = len(ramp.merge_edge.lanes)
        yield f"{merge_lanes} lanes behind the nose: coramp knows those that come from before it"
    yield from _lane_differences(ramp, lanes)
    crossings = (*ramp.mainline.crossings, *ramp.downstream.crossings)
    ways = [*(way for crossing in crossings for way in crossing.ways), *ramp.mainline_ways]
    if any(way.is_signalled for way in ways):
        yield "a signal on the mainline: coramp knows none of a network's own"


def _lane_differences(ramp: OnRamp, lanes: int) -> Iterator[str]:
    """Lanes of the mainline that begin or end beside the ramp's own."""
    for edge in (*ramp.mainline.edges, *ramp.downstream.edges[1:]):
        own = len(edge.lanes) - (edge.edge_id in _with_own_lane(ramp))
        if own != lanes:
            yield (
                f"{own} lanes on {edge.edge_id} and {lanes} before the nose: coramp knows a "
                "mainline that keeps its lanes so far"
            )
            return
    for crossing in ramp.mainline.crossings:
        if _turns(crossing.ways):
            yield "lanes of the mainline that cross over: coramp knows lanes that go straight on"
            return


def _with_own_lane(ramp: OnRamp) -> set[str]:
    """The edges along which the acceleration lane runs."""
    found, left_m = set(), ramp.merging.lane_m or 0.0
    for k, edge in enumerate(ramp.downstream.edges):
        if left_m <= 1e-6:
            break
        found.add(edge.edge_id)
        left_m -= edge.length_m
        if k < len(ramp.downstream.crossings):
            left_m -= ramp.downstream.crossings[k].length_m if left_m > 1e-6 else 0.0
    return found


def _turns(ways: tuple[Connection, ...]) -> bool:
    return len({way.to_lane - way.from_lane for way in ways}) > 1
