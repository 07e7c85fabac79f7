"""What must fit together in the types of vehicles of a scenario, and what is worth a warning."""

from typing import TYPE_CHECKING

from coramp.errors import CorampError
from coramp.scenarios.vehicle_types import VehicleType, share_problems
from coramp.strategies.base import coordinates_meters, vehicles_may_differ
from coramp.strategies.registry import strategies, strategy_named

if TYPE_CHECKING:
    from coramp.scenarios.model import Scenario

SLOWEST_TYPE_MPS = 3.0
"""A type that cruises slower than this can be served on no lane of an expressway."""


def vehicle_problems(scenario: "Scenario") -> list[str]:
    """Returns a line ``key: what is wrong; what is allowed`` for all that does not fit."""
    types, problems = scenario.vehicle_types, []
    if isinstance(scenario.vehicle, tuple):
        problems = share_problems(types)
        for k, kind in enumerate(types):
            problems += [f"vehicle.{k}.{line}" for line in _type_problems(scenario, kind)]
    names = [kind.name for kind in types]
    problems += [
        f"arrivals.{k}.type: there is no type {arrival.type!r}; allowed are {', '.join(names)}"
        for k, arrival in enumerate(scenario.arrivals)
        if arrival.type is not None and arrival.type not in names
    ]
    problems += [
        f"arrivals.{k}.{_too_slow(arrival.top_speed_mps)}"
        for k, arrival in enumerate(scenario.arrivals)
        if arrival.top_speed_mps is not None and arrival.top_speed_mps < SLOWEST_TYPE_MPS
    ]
    return problems


def _type_problems(scenario: "Scenario", kind: VehicleType) -> list[str]:
    """What keeps a type from being served: too slow, too long, or too weak brakes."""
    problems = []
    low_mps, high_mps = kind.top_speeds_mps
    if low_mps > high_mps:
        problems.append(
            f"top_speed_mps: [{low_mps:g}, {high_mps:g}] falls; write the lower speed first"
        )
    if low_mps < SLOWEST_TYPE_MPS:
        problems.append(_too_slow(low_mps))
    if kind.length_m > scenario.ramp.acceleration_lane_m:
        problems.append(
            f"length_m: {kind.length_m:g} is longer than ramp.acceleration_lane_m; "
            f"allowed is up to {scenario.ramp.acceleration_lane_m:g} m"
        )
    if kind.braking_mps2 is not None and kind.braking_mps2 < scenario.stop_mps2:
        way_m = scenario.stop_station_m - scenario.decision_station_m
        need_mps2 = 0.5 * scenario.ramp.limit_mps**2 / way_m
        if kind.braking_mps2 < need_mps2:
            problems.append(
                f"braking_mps2: {kind.braking_mps2:g} does not stop before the nose from "
                f"ramp.decision_station_m; allowed is at least {need_mps2:.2f} m/s2"
            )
    return problems


def _too_slow(top_mps: float) -> str:
    return (
        f"top_speed_mps: {top_mps:g} is too slow for any lane; "
        f"allowed is at least {SLOWEST_TYPE_MPS:g} m/s"
    )


def check_vehicles_may_differ(scenario: "Scenario", strategy: str) -> None:
    """Raises CorampError for a strategy that plans for equal vehicles where they differ."""
    chosen = strategy_named(strategy)
    if not scenario.vehicles_differ or not chosen.cooperative or vehicles_may_differ(chosen):
        return
    able = ", ".join(
        name
        for name, kind in strategies().items()
        if vehicles_may_differ(kind) or not (kind.cooperative or coordinates_meters(kind))
    )
    raise CorampError(
        f"strategy: {strategy} plans for vehicles that are alike but for their length and mass; "
        f"with these types of vehicles allowed are {able}"
    )


def slow_merge_warning(scenario: "Scenario") -> str | None:
    """Returns one line about types that cannot reach their cruising speed on the acceleration lane.

    With power P per mass a vehicle needs ``(v_c^3 - v_R0^3) / (3 P)`` metres from v_R0 to v_c once
    the power binds, and ``(v_1^2 - v_R0^2) / (2 a_0)`` before that, up to ``v_1 = P / a_0``.
    """
    lines = []
    for kind in scenario.vehicle_types:
        cruise_mps = min(scenario.mainline.speed_mps, kind.top_speeds_mps[1])
        need_m = _run_up_m(kind, scenario.ramp.speed_mps, cruise_mps)
        if need_m > scenario.last_merge_station_m and kind.share_of(True) > 0.0:
            whole_m = need_m + scenario.ramp.acceleration_lane_m - scenario.last_merge_station_m
            lines.append(
                f"{kind.name}: an acceleration lane of {scenario.ramp.acceleration_lane_m:g} m is "
                f"too short to reach its cruising speed of {cruise_mps:.1f} m/s; {whole_m:.0f} m "
                "would do. It merges at the speed that it reaches"
            )
    return "; ".join(lines) or None


def _run_up_m(kind: VehicleType, from_mps: float, to_mps: float) -> float:
    """Returns the way (m) from one speed to another with all that a type can do, 0 if unbound."""
    if to_mps <= from_mps:
        return 0.0
    most_mps2, power = kind.acceleration_mps2, kind.power_wpkg
    if power is None:
        return 0.0 if most_mps2 is None else 0.5 * (to_mps**2 - from_mps**2) / most_mps2
    bound_mps = from_mps
    way_m = 0.0
    if most_mps2 is not None and power / most_mps2 > from_mps:
        bound_mps = min(to_mps, power / most_mps2)
        way_m = 0.5 * (bound_mps**2 - from_mps**2) / most_mps2
    return way_m + (to_mps**3 - bound_mps**3) / (3.0 * power)
