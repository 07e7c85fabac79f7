"""Arrivals as a SUMO route file: an explicit list with exact times."""

from collections.abc import Sequence

from coramp.coordination.plant import Arrival
from coramp.scenarios.model import Drivers, Scenario
from coramp.worlds.sumo.traits import Traits

FASTEST_COMMAND_MPS = 100.0
"""The highest speed that a cooperative vehicle may be told; SUMO's own limit is 200 km/h."""
ROUTES = """  <route id="mainline" edges="mainline merge downstream"/>
  <route id="ramp" edges="{ramp} merge downstream"/>"""


def cooperative_type(length_m: float) -> str:
    """Returns the name of the vehicle type of cooperative vehicles of a length."""
    return f"cooperative-{length_m!r}"


def cooperative_types(arrivals: Sequence[Arrival]) -> list[str]:
    """Returns one vehicle type for each length; speeds are commanded, so only size matters."""
    lengths_m = sorted({arrival.length_m for arrival in arrivals})
    return [
        f'  <vType id="{cooperative_type(length_m)}" length="{length_m!r}" '
        f'maxSpeed="{FASTEST_COMMAND_MPS!r}" speedFactor="1" speedDev="0"/>'
        for length_m in lengths_m
    ]


def cooperative_routes(scenario: Scenario, arrivals: Sequence[Arrival], with_vehicles: bool) -> str:
    """Returns the route file of a cooperative run; the run itself adds its vehicles one by one.

    With vehicles it is the same demand for plain SUMO.
    """
    vehicles = []
    if with_vehicles:
        vehicles = [
            _vehicle(a, cooperative_type(a.length_m), a.speed_mps, scenario.control.step_s)
            for a in arrivals
        ]
    return _file(cooperative_types(arrivals), vehicles)


def driver_routes(
    scenario: Scenario,
    drivers: Drivers,
    arrivals: Sequence[Arrival],
    traits: Sequence[Traits],
    metered: bool = False,
) -> str:
    """Returns the route file of an uncontrolled run with a population of drivers.

    Drivers who wish their entry speed get a type of their own each, by ``maxSpeed``. Drivers who
    wish free flow take v_R0 from the ramp's limit, and v0 from ``maxSpeed`` or, with a speed
    factor, from the mainline's limit: a ``maxSpeed`` of v0 would cut off every factor above 1.
    SUMO lets nobody enter faster than he wishes, so their entry speed is capped at that.
    """
    types, vehicles = {}, []
    for arrival, own in zip(arrivals, traits, strict=True):
        if drivers.wish == "entry-speed":
            wish_mps = entry_mps = arrival.speed_mps
            name = f"driver-{arrival.vehicle_id}"
        else:
            wish_mps = scenario.mainline.speed_mps
            common_mps = scenario.ramp.speed_mps if arrival.on_ramp else wish_mps
            entry_mps = min(arrival.speed_mps, common_mps * (own.speed_factor or 1.0))
            name = f"driver-{arrival.length_m!r}"
            if len(drivers.taus_s) > 1:
                name += f"-{own.tau_s!r}"
        size = f'length="{arrival.length_m!r}" {_wish(drivers, wish_mps)}'
        types[name] = f'  <vType id="{name}" {size} {_manners(drivers, own.tau_s)}/>'
        vehicles.append(
            _vehicle(arrival, name, entry_mps, scenario.control.step_s, own.speed_factor)
        )
    return _file(list(types.values()), vehicles, "ramp gore" if metered else "ramp")


def _wish(drivers: Drivers, wish_mps: float) -> str:
    """With factors the top speed is the highest wish that there can be, and so binds nobody."""
    if drivers.speed_factor is None:
        return f'maxSpeed="{wish_mps!r}" speedFactor="1" speedDev="0"'
    return f'maxSpeed="{drivers.speed_factor.high * wish_mps!r}"'


def _manners(drivers: Drivers, tau_s: float) -> str:
    model = drivers.car_following
    noise = f'sigma="{drivers.sigma!r}" ' if model == "Krauss" else f'carFollowModel="{model}" '
    accel = "" if drivers.accel_mps2 is None else f' accel="{drivers.accel_mps2!r}"'
    return (
        f'{noise}tau="{tau_s!r}" '
        f'minGap="{drivers.min_gap_m!r}" lcCooperative="{drivers.lc_cooperative!r}"{accel}'
    )


def _vehicle(
    arrival: Arrival, kind: str, speed_mps: float, step_s: float, speed_factor: float | None = None
) -> str:
    route = "ramp" if arrival.on_ramp else "mainline"
    factor = "" if speed_factor is None else f' speedFactor="{speed_factor!r}"'
    return (
        f'  <vehicle id="{arrival.vehicle_id}" type="{kind}" route="{route}" '
        f'depart="{arrival.step * step_s:.3f}" departPos="0" departSpeed="{speed_mps!r}"{factor}/>'
    )


def _file(types: Sequence[str], vehicles: Sequence[str], ramp: str = "ramp") -> str:
    return "\n".join(["<routes>", *types, ROUTES.format(ramp=ramp), *vehicles, "</routes>", ""])
