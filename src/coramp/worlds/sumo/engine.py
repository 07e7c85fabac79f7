"""Runs a scenario in SUMO: cooperative vehicles in closed loop, or SUMO's own drivers."""

import math
import tempfile
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from coramp._kernel import FloatArray, IntArray
from coramp.coordination.coordinator import Coordinator
from coramp.coordination.plant import Arrival
from coramp.coordination.service import Service
from coramp.demand.arrivals import arrivals_of
from coramp.errors import CorampError
from coramp.messages.channel import Channel
from coramp.messages.events import Report
from coramp.messages.feed import RequestFeed
from coramp.messages.log import Told
from coramp.metrics.motion import pieces_of_samples
from coramp.records.lanes import first_on_mainline_s, seen_history
from coramp.records.outcome import Outcome, Pieces, until_s
from coramp.road.lanes import MAINLINE, RAMP
from coramp.scenarios.model import Scenario
from coramp.scenarios.sections import DriverPopulation
from coramp.strategies.base import Decider, is_metered, period_of, steps_of_period
from coramp.vehicles.merge_state import BY_MAINLINE_S
from coramp.worlds.outcomes import (
    cap_step_of,
    cooperative_outcome,
    passages_of,
    step_after,
    step_after_last_exit,
)
from coramp.worlds.sumo.cooperative import CooperativePlant
from coramp.worlds.sumo.demand import cooperative_routes, driver_routes
from coramp.worlds.sumo.files import RunFiles, Samples, SumoOptions
from coramp.worlds.sumo.metering import Meter, loops
from coramp.worlds.sumo.network import (
    driver_road_plan,
    road_plan,
)
from coramp.worlds.sumo.session import Session
from coramp.worlds.sumo.telling import DriversInSumo, positions_in_sumo, with_answers
from coramp.worlds.sumo.traits import traits_of
from coramp.worlds.telling import reports_of_samples, together

LOOK_S = 60.0
"""How long SUMO runs by itself between two looks at whether it is empty."""
LARGEST_PLAN_ERROR_M = 0.05
"""A run in which SUMO is further off a plan has not kept its promise."""


def run_cooperative(
    scenario: Scenario, strategy: Decider, seed: int, options: SumoOptions
) -> Outcome:
    """Returns what happened with cooperative vehicles under a strategy.

    What they drove is known from commands and from where each met its vehicle, as long as SUMO
    keeps to the plan. Where it does not, the run is done again and SUMO's positions are read, so
    that figures of safety are those of what happened. Raises CorampError where SUMO fails, or still
    has vehicles that should have left.
    """
    outcome = _run_cooperative(scenario, strategy, seed, options, sampled=False)
    if np.nanmax(outcome.passages.plan_error_m, initial=0.0) <= LARGEST_PLAN_ERROR_M:
        return outcome
    return _run_cooperative(scenario, strategy, seed, options, sampled=True)


def _run_cooperative(
    scenario: Scenario, strategy: Decider, seed: int, options: SumoOptions, sampled: bool
) -> Outcome:
    rules = scenario.rules()
    arrivals = arrivals_of(scenario, seed)
    plan = road_plan(scenario)
    with tempfile.TemporaryDirectory(prefix="coramp-") as name:
        keep = options.keep_messages
        files = RunFiles(
            Path(name), scenario, plan, seed, options, ballistic=True, sampled=sampled or keep
        )
        files.write_routes(cooperative_routes(scenario, arrivals, with_vehicles=False))
        with Session(
            [*files.options(), "--insertion-checks", "none"], rules.control.step_s, options.gui
        ) as session:
            plant = CooperativePlant(session, plan.lane_starts_m(), rules)
            channel = Channel(plant)
            coordinator = Coordinator(
                strategy,
                rules,
                RequestFeed(arrivals),
                scenario.fastest_mainline_entry_mps,
                channel if keep else plant,
            )
            cap_step = cap_step_of(scenario)
            coordinator.expect_arrivals()
            coordinator.run(cap_step)
            end_step = min(cap_step, step_after_last_exit(coordinator, rules.control.step_s))
            plant.finish(end_step)
            if end_step < cap_step and session.vehicles_left():
                raise CorampError("SUMO: vehicles are left although every plan has ended")
        if options.keep_in is not None:
            files.write_routes(cooperative_routes(scenario, arrivals, with_vehicles=True))
        files.keep()
        collisions = files.collisions()
        samples = files.samples(arrivals) if sampled or keep else None
    outcome = cooperative_outcome(
        coordinator,
        arrivals,
        rules.control.step_s,
        end_step,
        np.array([vehicle.largest_error_m for vehicle in plant.vehicles]),
        _driven(plant, coordinator.entered()[0], len(arrivals)),
        collisions,
    )
    if samples is None:
        return outcome
    if keep:
        positions = together(
            (
                reports_of_samples(*_motion_of(samples), rules.control.step_s),
                positions_in_sumo(plant, outcome.vehicle_of_row, rules.control.step_s),
            )
        )
        told = Told(arrivals, channel.commands, positions, (), end_step)
        outcome = replace(outcome, told=told)
    return _as_seen(outcome, samples) if sampled else outcome


def _motion_of(samples: Samples) -> tuple[IntArray, FloatArray, FloatArray, FloatArray]:
    return samples.vehicle, samples.time_s, samples.station_m, samples.speed_mps


def _as_seen(outcome: Outcome, samples: Samples) -> Outcome:
    """Returns the outcome with what vehicles drove as SUMO's positions have it, at each step."""
    vehicles = len(outcome.passages)
    first, rows = pieces_of_samples(*_motion_of(samples), vehicles)
    last_s = np.full(vehicles, np.nan)
    last_s[samples.vehicle] = samples.time_s  # the last one of each vehicle stays
    lanes = seen_history(samples.vehicle, samples.on_mainline, samples.time_s, last_s)
    return replace(outcome, driven=Pieces(first, rows), lanes=lanes)


def _driven(plant: CooperativePlant, vehicle_of_row: IntArray, vehicles: int) -> Pieces:
    """What vehicles drove in SUMO: from each command and where it met them, by vehicle and time."""
    rows = np.array(plant.driven, dtype=np.float64).reshape(-1, 5)
    vehicle = vehicle_of_row[rows[:, 0].astype(np.int64)]
    order = np.argsort(vehicle, kind="stable")
    first = np.searchsorted(vehicle[order], np.arange(vehicles + 1)).astype(np.int64)
    return Pieces(first, np.ascontiguousarray(rows[order, 1:]))


def run_uncontrolled(
    scenario: Scenario,
    strategy: Decider,
    drivers: DriverPopulation,
    seed: int,
    options: SumoOptions,
) -> Outcome:
    """Returns what happened with SUMO's own drivers on the same arrivals, metered or not.

    They report and are never commanded; the loop is that of cooperative runs.
    """
    arrivals = arrivals_of(scenario, seed)
    metered = is_metered(strategy)
    plan = driver_road_plan(scenario, drivers, metered)
    step_s, cap_step = scenario.control.step_s, cap_step_of(scenario)
    with tempfile.TemporaryDirectory(prefix="coramp-") as name:
        ballistic = drivers.integrator == "ballistic"
        files = RunFiles(Path(name), scenario, plan, seed, options, ballistic, sampled=True)
        traits = traits_of(drivers, arrivals, seed)
        files.write_routes(driver_routes(scenario, drivers, arrivals, traits, metered))
        look_steps = steps_of_period(period_of(strategy) or LOOK_S, step_s)
        if metered:
            files.write_loops(loops(scenario, look_steps * step_s))
        with Session(files.options(), step_s, options.gui) as session:
            road = DriversInSumo(session, plan.lane_starts_m(), step_s)
            meter = Meter(session, step_s) if metered else None
            service = Service(
                strategy, scenario.rules(), scenario.fastest_mainline_entry_mps, road.ask
            )
            _let_drive(session, service, road, meter, look_steps, cap_step)
        files.keep()
        samples, finished = files.samples(arrivals), files.finished()
        collisions = files.collisions()
    entry_s, exit_s = _passing_times(samples, arrivals, finished, scenario.mainline.end_m, step_s)
    first, rows = pieces_of_samples(
        samples.vehicle, samples.time_s, samples.station_m, samples.speed_mps, len(arrivals)
    )
    left = not np.isnan(exit_s).any()
    no_plan = np.full(len(arrivals), np.nan)
    end_s = float(np.max(exit_s, initial=0.0)) if left else cap_step * step_s
    lanes = seen_history(
        samples.vehicle, samples.on_mainline, samples.time_s, until_s(exit_s, end_s)
    )
    merge_s = first_on_mainline_s(lanes, len(arrivals))
    merge_s[[not arrival.on_ramp for arrival in arrivals]] = BY_MAINLINE_S
    told = None
    if options.keep_messages:
        last_s = end_s if left else math.inf
        end_step = min(cap_step, step_after(last_s, step_s))
        told = _told_of_drivers(arrivals, samples, road.told, meter, step_s, end_step)
    return Outcome(
        cooperative=False,
        passages=passages_of(arrivals, step_s, entry_s, merge_s, exit_s, no_plan),
        pieces=Pieces(first, rows),
        lane=np.where(samples.on_mainline, MAINLINE, RAMP),
        driven=Pieces(first, rows),
        lanes=lanes,
        end_s=end_s,
        collisions=collisions,
        refusals=tuple(service.coordinator.refusals),
        interventions=service.coordinator.interventions,
        told=told,
    )


def _let_drive(
    session: Session,
    service: Service,
    road: DriversInSumo,
    meter: Meter | None,
    look_steps: int,
    cap_step: int,
) -> None:
    """Lets SUMO run until it is empty; tells the service so far each ``look_steps``, and obeys."""
    step = 0
    while step < cap_step and (step == 0 or session.vehicles_left()):
        until = min(cap_step, step + look_steps)
        readings = [] if meter is None else [meter.read(step, until)]
        session.step_to(until)
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
    positions = reports_of_samples(*_motion_of(samples), step_s)
    positions = with_answers(positions, answers, number, step_s)
    if meter is None:
        return Told(arrivals, [], positions, [], end_step)
    signals = [signal for signal in meter.signals if signal.step <= end_step]
    readings = [r for r in meter.readings if round(r.time_s / step_s) <= end_step]
    return Told(arrivals, signals, positions, readings, end_step)


def _passing_times(
    samples: Samples,
    arrivals: Sequence[Arrival],
    finished: set[str],
    end_m: float,
    step_s: float,
) -> tuple[FloatArray, FloatArray]:
    """Entry and exit of each vehicle; its last sample is run on to the zone's end."""
    entry_s, exit_s = (np.full(len(arrivals), np.nan) for _ in range(2))
    seen, first = np.unique(samples.vehicle, return_index=True)
    last = np.append(first[1:], len(samples.vehicle))[: len(first)] - 1
    entry_s[seen] = samples.time_s[first]
    left_m = end_m - samples.station_m[last]
    run_on_s = np.minimum(left_m / np.maximum(samples.speed_mps[last], 1e-9), step_s)
    exit_s[seen] = samples.time_s[last] + run_on_s
    done = np.array([arrival.vehicle_id in finished for arrival in arrivals], np.bool_)
    return entry_s, np.where(done, exit_s, np.nan)
