"""Arrivals as a SUMO route file: an explicit list with exact times."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from coramp._kernel import BoolArray
from coramp.coordination.plant import Arrival
from coramp.scenarios.model import Scenario
from coramp.scenarios.sections import DriverPopulation, Vehicle
from coramp.vehicles.traits import CAR
from coramp.worlds.sumo.lanes import LanedRoad, Way
from coramp.worlds.sumo.traits import DriverTraits

KRAUSS = 'sigma="0"'
"""SUMO's own model to follow by, without imperfection."""
FASTEST_COMMAND_MPS = 100.0
"""The highest speed that a cooperative vehicle may be told; SUMO's own limit is 200 km/h."""
PROFILE_MPS = (0.0, 5.0, 10.0, 15.0, 20.0, 25.0, 30.0, 40.0)
"""Speeds at which a driver's acceleration is given to SUMO, which interpolates."""


SUMO_BRAKING_MPS2 = {"passenger": (4.5, 9.0)}
HEAVY_BRAKING_MPS2 = 4.0, 7.0
"""SUMO's own braking by class, in comfort and at most."""


@dataclass(frozen=True)
class Automated:
    """Who is automated, one entry an arrival, and how SUMO's drivers know such vehicles.

    ``manners`` are further attributes of their types, on lane changes; ``model`` says by which
    model they follow, Krauss without imperfection if left out.
    """

    vehicles: BoolArray
    tau_s: float
    min_gap_m: float
    manners: str
    model: str = KRAUSS


class OriginWays(NamedTuple):
    """The ways on which vehicles of an origin come, and the route of each by its id."""

    mainline: Way
    ramp: Way
    route_of: Mapping[str, str]

    def way(self, on_ramp: bool) -> Way:
        """Returns the way of a stream."""
        return self.ramp if on_ramp else self.mainline


Ways = LanedRoad | OriginWays
"""Where vehicles enter a network."""

ROUTES = """  <route id="mainline" edges="mainline merge downstream"/>
  <route id="ramp" edges="{ramp} merge downstream"/>"""


def cooperative_type(arrival: Arrival) -> str:
    """Returns the name of a cooperative vehicle's type in SUMO: by length, and kind if no car."""
    kind = "" if arrival.vehicle_type == CAR else f"{arrival.vehicle_type}-"
    return f"cooperative-{kind}{arrival.length_m!r}"


def cooperative_types(scenario: Scenario, arrivals: Sequence[Arrival]) -> list[str]:
    """Returns one vehicle type for each kind and length.

    Speeds are commanded, so that only size matters for motion. Class and mass are for SUMO's own
    outputs, emissions among them, and for its window.
    """
    seen = {(a.length_m, cooperative_type(a)): a for a in arrivals}
    return [
        f'  <vType id="{name}" length="{length_m!r}" maxSpeed="{FASTEST_COMMAND_MPS!r}" '
        f'speedFactor="1" speedDev="0"{_class(scenario, seen[length_m, name])}/>'
        for length_m, name in sorted(seen)
    ]


def _class(scenario: Scenario, arrival: Arrival) -> str:
    """Returns class and mass of a vehicle of a type of the scenario's own, nothing for others."""
    if isinstance(scenario.vehicle, Vehicle):
        return ""
    kind = scenario.type_named(arrival.vehicle_type)
    return f' vClass="{kind.sumo_class}" mass="{kind.mass_kg!r}"'


def cooperative_routes(scenario: Scenario, arrivals: Sequence[Arrival], with_vehicles: bool) -> str:
    """Returns the route file of a cooperative run; the run itself adds its vehicles one by one.

    With vehicles it is the same demand for plain SUMO.
    """
    vehicles, step_s = [], scenario.control.step_s
    if with_vehicles:
        first = None if scenario.has_one_lane else 0
        vehicles = [
            _vehicle(a, cooperative_type(a), a.speed_mps, step_s, first_lane=first)
            for a in arrivals
        ]
    return _file(cooperative_types(scenario, arrivals), vehicles)


def driver_routes(
    scenario: Scenario,
    drivers: DriverPopulation,
    arrivals: Sequence[Arrival],
    traits: Sequence[DriverTraits],
    metered: bool = False,
    automated: Automated | None = None,
    road: LanedRoad | None = None,
) -> str:
    """Returns the route file of an uncontrolled run with a population of drivers.

    Who is ``automated`` has a type of its own. On a ``road`` of several lanes each enters on its
    own, no faster than the limits there let it.
    """
    types, vehicles = driver_lines(scenario, drivers, arrivals, traits, automated, road)
    if road is not None:
        return route_file(list(types.values()), _routes(road), vehicles)
    return _file(list(types.values()), vehicles, "ramp gore" if metered else "ramp")


def driver_lines(
    scenario: Scenario,
    drivers: DriverPopulation,
    arrivals: Sequence[Arrival],
    traits: Sequence[DriverTraits],
    automated: Automated | None = None,
    road: Ways | None = None,
) -> tuple[dict[str, str], list[str]]:
    """Returns the types of a route file by their names, and its vehicles in order of arrivals.

    Drivers who wish their entry speed get a type of their own each, by ``maxSpeed``. Drivers who
    wish free flow take v_R0 from the ramp's limit, and v0 from ``maxSpeed`` or, with a speed
    factor, from the mainline's limit: a ``maxSpeed`` of v0 would cut off every factor above 1.
    SUMO lets nobody enter faster than he wishes, so their entry speed is capped at that.
    """
    types: dict[str, str] = {}
    vehicles: list[str] = []
    for k, (arrival, own) in enumerate(zip(arrivals, traits, strict=True)):
        if automated is not None and automated.vehicles[k]:
            name, line = _automated_type(scenario, arrival, automated)
            allowed_mps = automated_cruise_mps(scenario, arrival)
            if arrival.on_ramp and drivers.wish == "free-flow":  # the limit of the ramp's edge
                allowed_mps = min(allowed_mps, scenario.ramp.speed_mps)
            entry_mps = min(arrival.speed_mps, allowed_mps)
            types[name] = line
            vehicles.append(_vehicle(arrival, name, entry_mps, scenario.control.step_s, None, road))
            continue
        if drivers.wish == "entry-speed":
            wish_mps = entry_mps = arrival.speed_mps
            name = f"driver-{arrival.vehicle_id}"
        else:
            wish_mps = min(scenario.mainline.speed_mps, _top_mps(arrival))
            common_mps = scenario.ramp.speed_mps if arrival.on_ramp else wish_mps
            entry_mps = min(arrival.speed_mps, common_mps * (own.speed_factor or 1.0))
            name = f"driver-{arrival.length_m!r}"
            if road is not None and _is_cut(road, own, wish_mps):
                wish_mps *= (own.speed_factor or 1.0) / drivers.highest_factor
                name += f"-{arrival.vehicle_id}"
            if len(drivers.taus_s) > 1:
                name += f"-{own.tau_s!r}"
        if arrival.traits is not None and not math.isinf(arrival.traits.top_speed_mps):
            name += f"-{arrival.vehicle_id}"  # each draws a top speed of its own
        elif arrival.vehicle_type != CAR:
            name += f"-{arrival.vehicle_type}"
        name += _carelessness_name(own)
        size = f'length="{arrival.length_m!r}" {_wish(drivers, wish_mps)}'
        manners = f"{_manners(drivers, own)}{_ability(drivers, arrival)}{_grip(scenario, arrival)}"
        types[name] = f'  <vType id="{name}" {size} {manners}{_class(scenario, arrival)}/>'
        vehicles.append(
            _vehicle(arrival, name, entry_mps, scenario.control.step_s, own.speed_factor, road)
        )
    return types, vehicles


def _is_cut(road: Ways, own: DriverTraits, wish_mps: float) -> bool:
    """Whether v0 is below the limit, of which SUMO's factor is: each has a top speed instead."""
    return own.speed_factor is not None and wish_mps < max(road.mainline.limits.limit_mps)


def _routes(road: LanedRoad) -> list[str]:
    ways = (("mainline", road.mainline), ("ramp", road.ramp))
    return [f'  <route id="{name}" edges="{" ".join(way.edges)}"/>' for name, way in ways]


def automated_cruise_mps(scenario: Scenario, arrival: Arrival) -> float:
    """Returns the speed at which an automated vehicle cruises: v0, or its own top speed."""
    return min(scenario.mainline.speed_mps, _top_mps(arrival))


def _automated_type(scenario: Scenario, arrival: Arrival, automated: Automated) -> tuple[str, str]:
    """Returns an automated vehicle's type in SUMO, by name and line.

    Drivers judge gaps to it by its ``tau`` and ``minGap``, which are what it keeps.
    """
    top_mps = automated_cruise_mps(scenario, arrival)
    name = f"automated-{arrival.vehicle_type}-{arrival.length_m!r}-{top_mps!r}"
    line = (
        f'  <vType id="{name}" length="{arrival.length_m!r}" maxSpeed="{top_mps!r}" '
        f'speedFactor="1" speedDev="0" {automated.model} tau="{automated.tau_s!r}" '
        f'minGap="{automated.min_gap_m!r}" {automated.manners}'
        f"{_grip(scenario, arrival)}{_class(scenario, arrival)}/>"
    )
    return name, line


def _grip(scenario: Scenario, arrival: Arrival) -> str:
    """Returns how hard it brakes, comfortably and at most, where the road's adhesion says so."""
    most_mps2 = scenario.road.most_braking_mps2
    if math.isinf(most_mps2):
        return ""
    kind = scenario.type_named(arrival.vehicle_type).sumo_class
    comfort_mps2, hardest_mps2 = SUMO_BRAKING_MPS2.get(kind, HEAVY_BRAKING_MPS2)
    return (
        f' decel="{min(comfort_mps2, most_mps2)!r}"'
        f' emergencyDecel="{min(hardest_mps2, most_mps2)!r}"'
    )


def _top_mps(arrival: Arrival) -> float:
    return math.inf if arrival.traits is None else arrival.traits.top_speed_mps


def _ability(drivers: DriverPopulation, arrival: Arrival) -> str:
    """Returns how a driver's vehicle accelerates where its type says so; else it is as SUMO has it.

    SUMO takes a profile of speeds (m/s) and accelerations for a vehicle of limited power.
    """
    traits = arrival.traits
    own_mps2 = math.inf if traits is None else traits.acceleration_mps2
    accel_mps2 = min(own_mps2, drivers.accel_mps2 or math.inf)
    told = "" if math.isinf(accel_mps2) else f' accel="{accel_mps2!r}"'
    if traits is None:
        return told
    if not math.isinf(traits.power_wpkg):
        points = [
            (speed, min(traits.acceleration_mps2, traits.power_wpkg / max(speed, 0.1)))
            for speed in PROFILE_MPS
        ]
        speeds = " ".join(f"{speed:g}" for speed, _ in points)
        profile = " ".join(f"{min(accel, 10.0):.3f}" for _, accel in points)
        told += f' speedTable="{speeds}" maxAccelProfile="{profile}" desAccelProfile="{profile}"'
    return told


def _wish(drivers: DriverPopulation, wish_mps: float) -> str:
    """With factors the top speed is the highest wish that there can be, and so binds nobody."""
    if drivers.speed_factor is None:
        return f'maxSpeed="{wish_mps!r}" speedFactor="1" speedDev="0"'
    return f'maxSpeed="{drivers.speed_factor.high * wish_mps!r}"'


def _carelessness_name(own: DriverTraits) -> str:
    never = "-never-yields" if own.never_yields else ""
    return never if own.looks_each_s is None else f"{never}-looks-each-{own.looks_each_s:g}"


def _manners(drivers: DriverPopulation, own: DriverTraits) -> str:
    model = drivers.car_following
    yields = 0.0 if own.never_yields else drivers.lc_cooperative
    looks = "" if own.looks_each_s is None else f' actionStepLength="{own.looks_each_s!r}"'
    noise = f'sigma="{drivers.sigma!r}" ' if model == "Krauss" else f'carFollowModel="{model}" '
    return (
        f'{noise}tau="{own.tau_s!r}" '
        f'minGap="{drivers.min_gap_m!r}" lcCooperative="{yields!r}"{_changes(drivers)}{looks}'
    )


def _changes(drivers: DriverPopulation) -> str:
    """How drivers change lanes, where that differs from SUMO's own values, which are all 1."""
    told = {
        "lcAssertive": drivers.lc_assertive,
        "lcStrategic": drivers.lc_strategic,
        "lcSpeedGain": drivers.lc_speed_gain,
    }
    return "".join(f' {name}="{value!r}"' for name, value in told.items() if value != 1.0)


def _vehicle(
    arrival: Arrival,
    kind: str,
    speed_mps: float,
    step_s: float,
    speed_factor: float | None = None,
    road: Ways | None = None,
    first_lane: int | None = None,
) -> str:
    """The line of a vehicle; ``first_lane`` is the index of its stream's outermost lane.

    Without it none is told; a road tells its own.
    """
    route = "ramp" if arrival.on_ramp else "mainline"
    if isinstance(road, OriginWays):
        route = road.route_of[arrival.vehicle_id]
    factor = "" if speed_factor is None else f' speedFactor="{speed_factor!r}"'
    if road is not None:
        way = road.way(arrival.on_ramp)
        first_lane = way.lane
        allowed_mps = way.limits.allowed_mps(way.limits.from_m[0])
        speed_mps = min(speed_mps, allowed_mps * min(1.0, speed_factor or 1.0))
    lane = "" if first_lane is None else f' departLane="{first_lane + arrival.lane}"'
    return (
        f'  <vehicle id="{arrival.vehicle_id}" type="{kind}" route="{route}" '
        f'depart="{arrival.step * step_s:.3f}"{lane} departPos="0" '
        f'departSpeed="{speed_mps!r}"{factor}/>'
    )


def _file(types: Sequence[str], vehicles: Sequence[str], ramp: str = "ramp") -> str:
    return route_file(types, [ROUTES.format(ramp=ramp)], vehicles)


def route_file(types: Sequence[str], routes: Sequence[str], vehicles: Sequence[str]) -> str:
    """Returns a route file of these lines; vehicles are to stand in the order of departure."""
    return "\n".join(["<routes>", *types, *routes, *vehicles, "</routes>", ""])
