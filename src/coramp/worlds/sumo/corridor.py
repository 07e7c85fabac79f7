"""A run of a corridor: one SUMO session, and a coordinator for the zone of each merge site."""

import tempfile
import xml.etree.ElementTree as ET
from collections.abc import Sequence
from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from coramp._kernel import BoolArray, FloatArray
from coramp.demand.corridor_demand import Traffic, traffic_of
from coramp.records.corridor_outcome import CorridorOutcome
from coramp.scenarios.corridors import Corridor
from coramp.scenarios.sections import DriverPopulation
from coramp.strategies.base import steps_of_period
from coramp.worlds.outcomes import cap_step_of
from coramp.worlds.sumo.careless import Careless
from coramp.worlds.sumo.corridor_plant import CorridorPlant, ZoneUsers
from coramp.worlds.sumo.corridor_record import HAND_OVER, PASSAGE, CorridorRecord
from coramp.worlds.sumo.corridor_road import CorridorRoad, corridor_road, corridor_routes
from coramp.worlds.sumo.corridor_sites import SiteAnswer, Sites, SiteSetup, sites_running
from coramp.worlds.sumo.demand import Automated
from coramp.worlds.sumo.files import RunFiles, SumoOptions
from coramp.worlds.sumo.mixed_setup import Able, actuators_of, automated_types, laws_of
from coramp.worlds.sumo.session import Session
from coramp.worlds.sumo.uncontrolled import alone_among_drivers

TRIPS = ("entered_s", "left_s", "waiting_s", "driven_s", "lost_s", "way_m")
LOOK_S = 0.2
"""How often who is in a zone is looked at where nobody coordinates."""


@dataclass(frozen=True)
class Coordination:
    """By which strategy sites are coordinated, each how often it decides, in how many processes."""

    strategy: str
    decision_s: float
    processes: int


class CorridorFiles(RunFiles):
    """The files of a corridor's run: trips always, positions only where they are kept."""

    def options(self) -> list[str]:
        """Returns SUMO's options, output files included."""
        result = super().options()
        if self._keep_in is None:
            result += ["--tripinfo-output", str(self._folder / "tripinfo.xml")]
            result += ["--tripinfo-output.write-unfinished", "--tripinfo-output.write-undeparted"]
        return result

    def trips(self, number: dict[str, int]) -> dict[str, FloatArray]:
        """Returns SUMO's figures of each vehicle's trip, read one by one."""
        found = {name: np.full(len(number), np.nan) for name in TRIPS}
        for _, trip in ET.iterparse(self._folder / "tripinfo.xml"):
            if trip.tag == "tripinfo":
                k = number[trip.get("id", "")]
                values = (
                    _time_s(trip.get("depart")),
                    _time_s(trip.get("arrival")),
                    *(float(trip.get(key, "nan")) for key in ("departDelay", "duration")),
                    *(float(trip.get(key, "nan")) for key in ("timeLoss", "routeLength")),
                )
                for name, value in zip(TRIPS, values, strict=True):
                    found[name][k] = value
            trip.clear()
        return found


def _time_s(text: str | None) -> float:
    """SUMO tells what never happened by a time below 0."""
    value = float(text or "-1")
    return value if value >= 0.0 else float("nan")


def run_corridor(
    corridor: Corridor,
    coordination: Coordination | None,
    population: str,
    seed: int,
    options: SumoOptions,
) -> CorridorOutcome:
    """Returns what happened on a corridor: coordinated by sites, or with drivers alone."""
    drivers, road = corridor.common.drivers[population], corridor_road(corridor)
    traffic = traffic_of(corridor, seed)
    step_s, horizon_s = corridor.common.control.step_s, corridor.common.simulation.horizon_s
    period_steps = steps_of_period(coordination.decision_s if coordination else LOOK_S, step_s)
    actuators = actuators_of(corridor.common, sum(len(own.arrivals) for own in traffic))
    period_s = period_steps * step_s
    kinds = _kinds(traffic, coordination, period_s, actuators.delay_s)
    automated = np.concatenate(
        [
            np.zeros(len(own.arrivals), np.bool_) if found is None else found.vehicles
            for own, found in zip(traffic, kinds, strict=True)
        ]
    )
    with tempfile.TemporaryDirectory(prefix="coramp-") as name:
        ballistic = coordination is None and drivers.integrator == "ballistic"
        files = CorridorFiles(Path(name), corridor.common, road, seed, options, ballistic)
        files.write_routes(corridor_routes(corridor, drivers, traffic, kinds, road))
        files.write_additional()
        setups = []
        if coordination is not None:
            setups = _setups(corridor, coordination, drivers, traffic, (period_s, actuators.delay_s), seed)
        running = sites_running(setups, coordination.processes) if coordination else nullcontext()
        with running as sites, Session(files.options(), step_s, options.gui, options.tell) as session:
            plant = CorridorPlant(
                session,
                {},
                _able(traffic, automated),
                period_steps,
                step_s,
                max((found.min_gap_m for found in kinds if found is not None), default=0.0),
                actuators,
                corridor=road,
                record=CorridorRecord(len(automated), period_s),
                commands=coordination is not None,
            )
            careless = [
                Careless(scenario, session, seed + k) for k, scenario in enumerate(corridor.scenarios)
            ]
            most_at_once, end_s = _drive(plant, sites, careless, cap_step_of(corridor.common))
            messages = () if sites is None else tuple(sites.counts())
        files.keep()
        arrivals = [arrival for own in traffic for arrival in own.arrivals]
        trips = files.trips(dict(plant.able.number))
        plant.record.end()
        passages = plant.record.table(plant.record.passages, PASSAGE)
        return CorridorOutcome(
            corridor=corridor,
            **_vehicles(corridor, traffic),
            scheduled_s=np.array([arrival.step for arrival in arrivals]) * step_s,
            automated=automated,
            trips=trips,
            passages=passages,
            free_s=_free_s(road, plant.able, passages),
            hand_overs=plant.record.table(plant.record.hand_overs, HAND_OVER),
            plan_error_m=plant.largest_error_m if coordination else np.full(len(arrivals), np.nan),
            collided=files.collided(arrivals),
            messages=messages,
            until_s=max(end_s, horizon_s),
            most_at_once=most_at_once,
        )


def _vehicles(corridor: Corridor, traffic: Sequence[Traffic]) -> dict[str, Any]:
    """Who all vehicles are, where they come from, and by which exit they leave; None for none."""
    vehicle_id: list[str] = []
    origin: list[str] = []
    leaves_by: list[str | None] = []
    for own in traffic:
        name = corridor.sites[own.origin.site].ramp_id if own.origin.on_ramp else own.origin.name
        vehicle_id += [arrival.vehicle_id for arrival in own.arrivals]
        origin += [name] * len(own.arrivals)
        leaves_by += [None if k < 0 else own.exits[k].edge_id for k in own.leaves_by]
    return {
        "vehicle_id": tuple(vehicle_id),
        "origin": tuple(origin),
        "leaves_by": tuple(leaves_by),
    }


def _drive(
    plant: CorridorPlant, sites: Sites | None, careless: Sequence[Careless], cap_step: int
) -> tuple[int, float]:
    """Lets SUMO run until it is empty; returns how many were looked at at most, and when it ends."""
    step, most = 0, 0
    while step < cap_step and (step == 0 or plant.session.vehicles_left()):
        step = min(cap_step, step + plant.period_steps)
        plant.session.step_to(step)
        now_s = step * plant.step_s
        zones = plant.look(now_s)
        most = max(most, sum(len(zone.names) for zone in zones))
        for zone, own in zip(zones, careless, strict=True):
            _let_happen(now_s, zone, own)
        if sites is None or not any(zone.view.users.automated.any() for zone in zones):
            continue
        answers = sites.handle([zone.view for zone in zones])
        plant.obey(
            zones,
            [
                _with_breakdown(now_s, *found)
                for found in zip(zones, answers, careless, strict=True)
            ],
        )
    return most, step * plant.step_s


def _let_happen(now_s: float, zone: ZoneUsers, careless: Careless) -> None:
    """What happens by itself in a zone: careless drivers, and a vehicle that breaks down."""
    if not careless.is_needed:
        return
    careless.act_among(now_s, zone.names, zone.view.users)
    stopped = careless.broken_down(now_s, zone.view.users.number)
    zone.view = zone.view._replace(able=zone.view.able & ~stopped)


def _with_breakdown(
    now_s: float, zone: ZoneUsers, answer: SiteAnswer, careless: Careless
) -> SiteAnswer:
    accel_mps2 = careless.with_breakdown(now_s, zone.view.users, answer.accel_mps2)
    return answer._replace(accel_mps2=accel_mps2)


def _kinds(
    traffic: Sequence[Traffic], coordination: Coordination | None, period_s: float, delay_s: float
) -> list[Automated | None]:
    """How SUMO knows each origin's automated vehicles; None where there are none."""
    if coordination is None:
        return [
            alone_among_drivers(own.origin.scenario, own.arrivals, own.origin.seed)
            for own in traffic
        ]
    return [
        automated_types(own.origin.scenario, own.automated, period_s, delay_s) for own in traffic
    ]


def _setups(
    corridor: Corridor,
    coordination: Coordination,
    drivers: DriverPopulation,
    traffic: Sequence[Traffic],
    times_s: tuple[float, float],
    seed: int,
) -> list[SiteSetup]:
    """What each site's coordinator is made of; each has links with random numbers of its own."""
    automated = np.concatenate([own.automated for own in traffic])
    reporting = automated | np.concatenate([own.reporting for own in traffic])
    period_s, delay_s = times_s
    return [
        SiteSetup(
            scenario,
            coordination.strategy,
            laws_of(scenario, drivers, period_s, delay_s),
            automated,
            reporting,
            scenario.commands.delay_s + delay_s,
            seed + k,
        )
        for k, scenario in enumerate(corridor.scenarios)
    ]


def _able(traffic: Sequence[Traffic], automated: BoolArray) -> Able:
    """What all vehicles can do, in the order of origins."""
    parts, first = [], 0
    for own in traffic:
        until = first + len(own.arrivals)
        parts.append(Able.of(own.origin.scenario, own.arrivals, automated[first:until]))
        first = until
    names = [arrival.vehicle_id for own in traffic for arrival in own.arrivals]
    return Able(
        {name: k for k, name in enumerate(names)},
        automated,
        *(
            np.concatenate([getattr(part, name) for part in parts])
            for name in ("length_m", "cruise_mps", "acceleration_mps2", "power_wpkg", "braking_mps2")
        ),
    )


def _free_s(road: CorridorRoad, able: Able, passages: dict[str, FloatArray]) -> FloatArray:
    """How long (s) each passage takes who drives freely at his wish and to all limits."""
    known: dict[tuple[int, bool, float], float] = {}
    found = np.empty(len(passages["site"]))
    for k in range(len(found)):
        on_ramp = bool(passages["on_ramp"][k])
        cruise_mps = float(able.cruise_mps[int(passages["number"][k])])
        key = (int(passages["site"][k]), on_ramp, cruise_mps)
        if key not in known:
            known[key] = road.sites[key[0]].free_s(on_ramp, cruise_mps)
        found[k] = known[key]
    return found

