"""SUMO's own drivers on the arrivals of a scenario, metered or not."""

import math
import tempfile
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from coramp.coordination.plant import Arrival
from coramp.coordination.service import Service
from coramp.demand.arrivals import arrivals_of, automated_of
from coramp.messages.events import Report
from coramp.messages.log import Told
from coramp.records.outcome import Outcome
from coramp.scenarios.model import Scenario
from coramp.strategies.base import Decider, is_metered, period_of, steps_of_period
from coramp.worlds.outcomes import cap_step_of, step_after
from coramp.worlds.sumo.as_driven import Driving, outcome_as_driven
from coramp.worlds.sumo.careless import Careless, CarelessDrivers
from coramp.worlds.sumo.demand import KRAUSS, Automated, driver_routes
from coramp.worlds.sumo.files import RunFiles, Samples, SumoOptions
from coramp.worlds.sumo.lanes import LanedRoad, road_of
from coramp.worlds.sumo.metered_road import metered_road
from coramp.worlds.sumo.metering import Meter, loops
from coramp.worlds.sumo.session import Session
from coramp.worlds.sumo.telling import DriversInSumo, with_answers
from coramp.worlds.sumo.traits import traits_of, with_careless
from coramp.worlds.telling import reports_of_samples

LEAST_TAU_S = 0.1
"""The least time gap that SUMO's Krauss model keeps free of collisions: one step."""
AUTOMATION_MODELS = {"acc": 'carFollowModel="ACC"', "cacc": 'carFollowModel="CACC"'}
"""By ``traffic.automation``, where it is not Krauss."""
LOOK_S = 60.0
"""How long SUMO runs by itself between two looks at whether it is empty."""


def run_uncontrolled(
    scenario: Scenario,
    strategy: Decider,
    population: str,
    seed: int,
    options: SumoOptions,
) -> Outcome:
    """Returns what happened with SUMO's own drivers on the same arrivals, metered or not.

    They report and are never commanded; the loop is that of cooperative runs.
    """
    drivers = scenario.drivers[population]
    arrivals = arrivals_of(scenario, seed)
    metered = is_metered(strategy)
    automated = alone_among_drivers(scenario, arrivals, seed)
    plan, places = (
        metered_road(scenario, drivers) if metered else (road_of(scenario, drivers), None)
    )
    laned = plan if isinstance(plan, LanedRoad) else None
    step_s, cap_step = scenario.control.step_s, cap_step_of(scenario)
    with tempfile.TemporaryDirectory(prefix="coramp-") as name:
        ballistic = drivers.integrator == "ballistic"
        files = RunFiles(Path(name), scenario, plan, seed, options, ballistic, sampled=True)
        traits = with_careless(traits_of(drivers, arrivals, seed), scenario.behaviour, seed)
        files.write_routes(
            driver_routes(scenario, drivers, arrivals, traits, metered, automated, laned)
        )
        files.write_additional()
        files.write_detectors(arrivals)
        look_steps = steps_of_period(period_of(strategy) or LOOK_S, step_s)
        if places is not None:
            files.write_loops(loops([places], look_steps * step_s, plan.additional))
        with Session(files.options(), step_s, options.gui, options.tell) as session:
            road = DriversInSumo(session, plan.spans(), step_s)
            meter = None if places is None else Meter(session, step_s, places)
            service = Service(
                strategy, scenario.rules(), scenario.fastest_mainline_entry_mps, road.ask
            )
            careless = CarelessDrivers(Careless(scenario, session, seed), plan, arrivals)
            _let_drive(session, service, road, meter, careless, Looks(look_steps, cap_step))
        files.keep()
        samples = files.samples(arrivals)
        driving = Driving(samples, files.finished(arrivals))
        outcome = outcome_as_driven(scenario, arrivals, driving, files)
    told = None
    if options.keep_messages:
        end_step = _end_step(outcome, cap_step, step_s)
        told = _told_of_drivers(arrivals, samples, road.told, meter, step_s, end_step)
    alone = None if automated is None else automated.vehicles
    return replace(
        outcome,
        passages=replace(outcome.passages, automated=alone),
        refusals=tuple(service.coordinator.refusals),
        interventions=service.coordinator.interventions,
        told=told,
        drivers=population,
        world_events=tuple(careless.events),
    )


def _end_step(outcome: Outcome, cap_step: int, step_s: float) -> int:
    """The step at which a run is over: the last exit's, or where it is cut off."""
    left = not np.isnan(outcome.passages.exit_s).any()
    return min(cap_step, step_after(outcome.end_s if left else math.inf, step_s))


def alone_among_drivers(
    scenario: Scenario, arrivals: Sequence[Arrival], seed: int
) -> Automated | None:
    """Returns the automated vehicles that nobody coordinates, None where there are none.

    SUMO drives them as ``traffic.automation`` says, at the gaps of ``[safety]``. Where no share is
    given, all have drivers.
    """
    if not scenario.gives_shares:
        return None
    vehicles = automated_of(scenario, arrivals, seed)
    if not vehicles.any():
        return None
    automation = scenario.traffic.automation
    yields = 0.0 if automation == "not-yielding" else 1.0
    return Automated(
        vehicles,
        max(scenario.safety.time_gap_s, LEAST_TAU_S),
        scenario.safety.standstill_gap_m,
        f'lcCooperative="{yields!r}"',
        AUTOMATION_MODELS.get(automation, KRAUSS),
    )


class Looks(NamedTuple):
    """How many steps lie between two looks at SUMO, and at which step a run is cut off."""

    steps: int
    cap_step: int


def _let_drive(
    session: Session,
    service: Service,
    road: DriversInSumo,
    meter: Meter | None,
    careless: CarelessDrivers,
    looks: Looks,
) -> None:
    """Lets SUMO run until it is empty; tells the service so far each ``look_steps``, and obeys."""
    step = 0
    while step < looks.cap_step and (step == 0 or session.vehicles_left()):
        until = min(looks.cap_step, step + looks.steps)
        readings = [] if meter is None else [meter.read(step, until)]
        careless.step_to(step, until)
        road.now_step = step = until
        commands = service.handle(readings, step)
        if meter is not None:
            meter.obey(commands, step)


def _told_of_drivers(
    arrivals: Sequence[Arrival],
    samples: Samples,
    answers: Sequence[Report],
    meter: Meter | None,
    step_s: float,
    end_step: int,
) -> Told:
    """Returns the messages of a run of drivers, who are reported and never commanded."""
    number = {arrival.vehicle_id: k for k, arrival in enumerate(arrivals)}
    positions = reports_of_samples(*samples.motion, step_s)
    positions = with_answers(positions, answers, number, step_s)
    if meter is None:
        return Told(arrivals, [], positions, [], end_step)
    signals = [signal for signal in meter.signals if signal.step <= end_step]
    readings = [r for r in meter.readings if round(r.time_s / step_s) <= end_step]
    return Told(arrivals, signals, positions, readings, end_step)
