"""Runs a scenario of cooperative vehicles in SUMO, in closed loop."""

import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np

from coramp._kernel import IntArray
from coramp.coordination.coordinator import Coordinator
from coramp.demand.arrivals import arrivals_of
from coramp.errors import CorampError
from coramp.messages.channel import Channel
from coramp.messages.feed import RequestFeed
from coramp.messages.log import Positions, Told
from coramp.metrics.motion import pieces_of_samples
from coramp.records.lanes import seen_history
from coramp.records.outcome import Outcome, Pieces
from coramp.scenarios.model import Scenario
from coramp.strategies.base import Decider
from coramp.worlds.outcomes import (
    cap_step_of,
    cooperative_outcome,
    step_after_last_exit,
)
from coramp.worlds.sumo.cooperative import CooperativePlant
from coramp.worlds.sumo.demand import cooperative_routes
from coramp.worlds.sumo.files import RunFiles, Samples, SumoOptions
from coramp.worlds.sumo.network import (
    road_plan,
)
from coramp.worlds.sumo.session import Session
from coramp.worlds.sumo.telling import positions_in_sumo
from coramp.worlds.telling import reports_of_samples, together

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
        files.write_detectors(arrivals)
        with Session(
            [*files.options(), "--insertion-checks", "none"],
            rules.control.step_s,
            options.gui,
            options.tell,
        ) as session:
            plant = CooperativePlant(session, plan, rules)
            channel = Channel(plant)
            coordinator = Coordinator(
                strategy,
                rules,
                RequestFeed(arrivals),
                scenario.fastest_mainline_entry_mps,
                channel if keep else plant,
            )
            cap_step = cap_step_of(scenario)
            end_step = _let_drive(coordinator, plant, cap_step, rules.control.step_s)
            if end_step < cap_step and session.vehicles_left():
                raise CorampError("SUMO: vehicles are left although every plan has ended")
        if options.keep_in is not None:
            files.write_routes(cooperative_routes(scenario, arrivals, with_vehicles=True))
        files.keep()
        collisions = files.collisions()
        samples = files.samples(arrivals) if sampled or keep else None
    step_s = rules.control.step_s
    outcome = cooperative_outcome(
        coordinator,
        arrivals,
        step_s,
        end_step,
        np.array([vehicle.largest_error_m for vehicle in plant.vehicles]),
        _driven(plant, coordinator.entered()[0], len(arrivals)),
        collisions,
    )
    if samples is None:
        return outcome
    if keep:
        positions = _reported(plant, outcome.vehicle_of_row, samples, step_s)
        told = Told(arrivals, channel.commands, positions, (), end_step)
        outcome = replace(outcome, told=told)
    return _as_seen(outcome, samples) if sampled else outcome


def _let_drive(
    coordinator: Coordinator, plant: CooperativePlant, cap_step: int, step_s: float
) -> int:
    """Runs until everybody has left; returns the step at which that was, at most the cap."""
    coordinator.expect_arrivals()
    coordinator.run(cap_step)
    end_step = min(cap_step, step_after_last_exit(coordinator, step_s))
    plant.finish(end_step)
    return end_step


def _reported(
    plant: CooperativePlant, vehicle_of_row: IntArray, samples: Samples, step_s: float
) -> Positions:
    """What vehicles report of themselves: once a second, at changes, where they are compared."""
    told = positions_in_sumo(plant, vehicle_of_row, step_s)
    return together((reports_of_samples(*samples.motion, step_s), told))


def _as_seen(outcome: Outcome, samples: Samples) -> Outcome:
    """Returns the outcome with what vehicles drove as SUMO's positions have it, at each step."""
    vehicles = len(outcome.passages)
    first, rows = pieces_of_samples(*samples.motion, vehicles)
    last_s = np.full(vehicles, np.nan)
    last_s[samples.vehicle] = samples.time_s  # the last one of each vehicle stays
    lanes = seen_history(samples.vehicle, samples.lane, samples.time_s, last_s)
    return replace(outcome, driven=Pieces(first, rows), lanes=lanes)


def _driven(plant: CooperativePlant, vehicle_of_row: IntArray, vehicles: int) -> Pieces:
    """What vehicles drove in SUMO: from each command and where it met them, by vehicle and time."""
    rows = np.array(plant.driven, dtype=np.float64).reshape(-1, 5)
    vehicle = vehicle_of_row[rows[:, 0].astype(np.int64)]
    order = np.argsort(vehicle, kind="stable")
    first = np.searchsorted(vehicle[order], np.arange(vehicles + 1)).astype(np.int64)
    return Pieces(first, np.ascontiguousarray(rows[order, 1:]))
