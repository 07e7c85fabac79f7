"""Arrivals as a SUMO route file: an explicit list with exact times."""

from collections.abc import Sequence

from coramp.coordination.plant import Arrival
from coramp.scenario import Drivers, Scenario

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
        'speedFactor="1" speedDev="0"/>'
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
    scenario: Scenario, drivers: Drivers, arrivals: Sequence[Arrival], metered: bool = False
) -> str:
    """Returns the route file of an uncontrolled run with a population of drivers.

    Drivers who wish their entry speed get a type of their own each, by ``maxSpeed``. Drivers who
    wish free flow take v_R0 from the ramp's limit and v0 from ``maxSpeed``; SUMO lets nobody enter
    faster than he wishes, so their entry speed is capped at that.
    """
    step_s = scenario.control.step_s
    types, vehicles = {}, []
    for arrival in arrivals:
        if drivers.wish == "entry-speed":
            wish_mps = entry_mps = arrival.speed_mps
            name = f"driver-{arrival.vehicle_id}"
        else:
            wish_mps = scenario.mainline.speed_mps
            entry_mps = min(
                arrival.speed_mps, scenario.ramp.speed_mps if arrival.on_ramp else wish_mps
            )
            name = f"driver-{arrival.length_m!r}"
        types[name] = _driver_type(name, drivers, wish_mps, arrival.length_m)
        vehicles.append(_vehicle(arrival, name, entry_mps, step_s))
    return _file(list(types.values()), vehicles, "ramp gore" if metered else "ramp")


def _driver_type(name: str, drivers: Drivers, wish_mps: float, length_m: float) -> str:
    model = drivers.car_following
    noise = f'sigma="{drivers.sigma!r}" ' if model == "Krauss" else f'carFollowModel="{model}" '
    return (
        f'  <vType id="{name}" length="{length_m!r}" maxSpeed="{wish_mps!r}" speedFactor="1" '
        f'speedDev="0" {noise}tau="{drivers.tau_s!r}" '
        f'minGap="{drivers.min_gap_m!r}" lcCooperative="{drivers.lc_cooperative!r}"/>'
    )


def _vehicle(arrival: Arrival, kind: str, speed_mps: float, step_s: float) -> str:
    route = "ramp" if arrival.on_ramp else "mainline"
    return (
        f'  <vehicle id="{arrival.vehicle_id}" type="{kind}" route="{route}" '
        f'depart="{arrival.step * step_s:.3f}" departPos="0" departSpeed="{speed_mps!r}"/>'
    )


def _file(types: Sequence[str], vehicles: Sequence[str], ramp: str = "ramp") -> str:
    return "\n".join(["<routes>", *types, ROUTES.format(ramp=ramp), *vehicles, "</routes>", ""])
