"""A run of a corridor: one SUMO session, and a coordinator for the zone of each merge site."""

import tempfile
import xml.etree.ElementTree as ET
from collections.abc import Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from coramp._kernel import BoolArray, FloatArray
from coramp.demand.corridor_demand import Traffic, traffic_of
from coramp.records.corridor_outcome import CorridorOutcome
from coramp.scenarios.corridors import Corridor
from coramp.scenarios.sections import DriverPopulation
from coramp.strategies.base import steps_of_period
from coramp.strategies.metering import MetersRamps
from coramp.worlds.faults.actuators import SlowActuators
from coramp.worlds.outcomes import cap_step_of
from coramp.worlds.sumo.careless import Careless
from coramp.worlds.sumo.corridor_meters import (
    CorridorMeters,
    metered_corridor,
    metering_on,
    rows_of,
)
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
        at = result.index("--precision")  # kept or not, trips have the same digits
        return result[:at] + result[at + 2 :]

    def trips(self, number: dict[str, int]) -> dict[str, FloatArray]:
        """Returns SUMO's figures of each vehicle's trip, read one by one."""
        found = {name: np.full(len(number), np.nan) for name in TRIPS}
        told = ET.iterparse(self._folder / "tripinfo.xml", events=("start", "end"))
        _, root = next(told)
        for event, trip in told:
            if event == "end" and trip.tag == "tripinfo":
                k = number[trip.get("id", "")]
                values = (
                    _time_s(trip.get("depart")),
                    _time_s(trip.get("arrival")),
                    *(float(trip.get(key, "nan")) for key in ("departDelay", "duration")),
                    *(float(trip.get(key, "nan")) for key in ("timeLoss", "routeLength")),
                )
                for name, value in zip(TRIPS, values, strict=True):
                    found[name][k] = value
                root.clear()  # what is read is not kept
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
    metering: MetersRamps | None = None,
) -> CorridorOutcome:
    """Returns what happened on a corridor: coordinated by sites, or with drivers alone.

    ``metering`` meters the ramps of a corridor that nobody coordinates.
    """
    metered = None if metering is None else metered_corridor(corridor)
    on = corridor if metered is None else metered.corridor
    planned = _planned(on, coordination, corridor.common.drivers[population], seed)
    step_s, road = corridor.common.control.step_s, planned.road
    with tempfile.TemporaryDirectory(prefix="coramp-") as name:
        ballistic = coordination is None and planned.drivers.integrator == "ballistic"
        files = CorridorFiles(Path(name), corridor.common, road, seed, options, ballistic)
        files.write_routes(corridor_routes(planned.drivers, planned.traffic, planned.kinds, road))
        files.write_additional()
        if metered is not None:
            files.write_loops(metered.loops(planned.period_s, road.additional))
        running = nullcontext() if coordination is None else planned.sites_running(coordination)
        with (
            running as sites,
            Session(files.options(), step_s, options.gui, options.tell) as session,
        ):
            plant = planned.plant(session, coordination is not None)
            careless = [
                Careless(scenario, session, seed + k)
                for k, scenario in enumerate(corridor.scenarios)
            ]
            meters = metering_on(session, step_s, metered, metering)
            driven = _drive(plant, sites, careless, cap_step_of(corridor.common), meters)
        files.keep()
        outcome = _outcome(planned, plant, files, driven)
        if meters is None:
            return outcome
        return replace(outcome, corridor=corridor, meters=rows_of(meters.updates, corridor))


@dataclass(frozen=True)
class _Planned:
    """All that a run begins with; ``kinds`` is how SUMO knows each origin's automated vehicles."""

    corridor: Corridor
    drivers: DriverPopulation
    seed: int
    road: CorridorRoad
    traffic: tuple[Traffic, ...]
    kinds: tuple[Automated | None, ...]
    period_steps: int
    actuators: SlowActuators

    @property
    def period_s(self) -> float:
        """The time (s) between two looks at the zones."""
        return self.period_steps * self.corridor.common.control.step_s

    @property
    def automated(self) -> BoolArray:
        """Who is automated, in the order of origins."""
        return np.concatenate(
            [
                np.zeros(len(own.arrivals), np.bool_) if found is None else found.vehicles
                for own, found in zip(self.traffic, self.kinds, strict=True)
            ]
        )

    def plant(self, session: Session, commands: bool) -> CorridorPlant:
        """Returns the vehicles of a session."""
        automated = self.automated
        return CorridorPlant(
            session,
            {},
            _able(self.traffic, automated),
            self.period_steps,
            self.corridor.common.control.step_s,
            max((found.min_gap_m for found in self.kinds if found is not None), default=0.0),
            self.actuators,
            corridor=self.road,
            record=CorridorRecord(len(automated), self.period_s),
            commands=commands,
        )

    def sites_running(self, coordination: Coordination) -> AbstractContextManager[Sites]:
        """Gives each site's coordinator; each has links with random numbers of its own."""
        automated = self.automated
        reporting = automated | np.concatenate([own.reporting for own in self.traffic])
        delay_s = self.actuators.delay_s
        setups = [
            SiteSetup(
                scenario,
                coordination.strategy,
                laws_of(scenario, self.drivers, self.period_s, delay_s),
                automated,
                reporting,
                scenario.commands.delay_s + delay_s,
                self.seed + k,
                self.seed,
            )
            for k, scenario in enumerate(self.corridor.scenarios)
        ]
        return sites_running(setups, coordination.processes)


def _planned(
    corridor: Corridor, coordination: Coordination | None, drivers: DriverPopulation, seed: int
) -> _Planned:
    traffic, step_s = tuple(traffic_of(corridor, seed)), corridor.common.control.step_s
    steps = steps_of_period(coordination.decision_s if coordination else LOOK_S, step_s)
    actuators = actuators_of(corridor.common, sum(len(own.arrivals) for own in traffic))
    kinds: list[Automated | None] = []
    for own in traffic:
        scenario = own.origin.scenario
        if coordination is None:
            kinds.append(alone_among_drivers(scenario, own.arrivals, own.origin.seed))
        else:
            period_s = steps * step_s
            kinds.append(automated_types(scenario, own.automated, period_s, actuators.delay_s))
    road = corridor_road(corridor)
    return _Planned(corridor, drivers, seed, road, traffic, tuple(kinds), steps, actuators)


class _DrivenUntil(NamedTuple):
    """When SUMO was left, how many were looked at at most, and what became of messages by site."""

    until_s: float
    most_at_once: int
    messages: tuple[dict[str, int], ...]


def _outcome(
    planned: _Planned, plant: CorridorPlant, files: CorridorFiles, driven: _DrivenUntil
) -> CorridorOutcome:
    """What happened, once SUMO has ended."""
    corridor, record = planned.corridor, plant.record
    arrivals = [arrival for own in planned.traffic for arrival in own.arrivals]
    record.end()
    passages = record.table(record.passages, PASSAGE)
    step_s, horizon_s = corridor.common.control.step_s, corridor.common.simulation.horizon_s
    promised_m = plant.largest_error_m if plant.commands else np.full(len(arrivals), np.nan)
    return CorridorOutcome(
        corridor=corridor,
        **_vehicles(corridor, planned.traffic),
        scheduled_s=np.array([arrival.step for arrival in arrivals]) * step_s,
        automated=planned.automated,
        trips=files.trips(dict(plant.able.number)),
        passages=passages,
        free_s=_free_s(planned.road, plant.able, passages),
        hand_overs=record.table(record.hand_overs, HAND_OVER),
        plan_error_m=promised_m,
        collided=files.collided(arrivals),
        messages=driven.messages,
        until_s=max(driven.until_s, horizon_s),
        most_at_once=driven.most_at_once,
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
    plant: CorridorPlant,
    sites: Sites | None,
    careless: Sequence[Careless],
    cap_step: int,
    meters: CorridorMeters | None = None,
) -> _DrivenUntil:
    """Lets SUMO run until it is empty; ``meters`` let it go on where there are some."""
    step_to = plant.session.step_to if meters is None else meters.step_to
    step, most = 0, 0
    while step < cap_step and (step == 0 or plant.session.vehicles_left()):
        step = min(cap_step, step + plant.period_steps)
        step_to(step)
        now_s = step * plant.step_s
        zones = plant.look(now_s)
        most = max(most, sum(len(zone.names) for zone in zones))
        for zone, own in zip(zones, careless, strict=True):
            _let_happen(now_s, zone, own)
        if sites is None or not any(zone.view.users.automated.any() for zone in zones):
            continue
        answers = sites.handle([zone.view for zone in zones])
        plant.obey(
            [_with_breakdown(now_s, *found) for found in zip(zones, answers, careless, strict=True)]
        )
    messages = () if sites is None else tuple(sites.counts())
    return _DrivenUntil(step * plant.step_s, most, messages)


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
    if not careless.is_needed:
        return answer
    accel_mps2 = careless.with_breakdown(now_s, zone.view.users, answer.accel_mps2)
    return answer._replace(accel_mps2=accel_mps2)


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
            for name in (
                "length_m",
                "cruise_mps",
                "acceleration_mps2",
                "power_wpkg",
                "braking_mps2",
            )
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
