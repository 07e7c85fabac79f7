"""Automated vehicles among SUMO's own drivers: they are commanded anew each period."""

import tempfile
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from coramp._kernel import BoolArray, FloatArray
from coramp.demand.arrivals import arrivals_of, automated_of, connected_of
from coramp.mixed.laws import OnBoardLaws
from coramp.mixed.on_board import driven_mps2, may_change_lane, neighbours_of
from coramp.mixed.situation import MixedSituation, MixedStrategy, Places
from coramp.mixed.users import RoadUsers
from coramp.records.outcome import Outcome
from coramp.scenarios.model import Scenario
from coramp.strategies.base import steps_of_period
from coramp.worlds.faults.air import Air
from coramp.worlds.outcomes import cap_step_of
from coramp.worlds.sumo.as_driven import outcome_as_driven
from coramp.worlds.sumo.careless import Careless
from coramp.worlds.sumo.demand import driver_routes
from coramp.worlds.sumo.files import RunFiles, SumoOptions
from coramp.worlds.sumo.mixed_notes import Notes, notes_of
from coramp.worlds.sumo.mixed_plant import MixedPlant
from coramp.worlds.sumo.mixed_setup import (
    Able,
    actuators_of,
    automated_types,
    laws_of,
)
from coramp.worlds.sumo.network import driver_road_plan
from coramp.worlds.sumo.session import Session
from coramp.worlds.sumo.traits import traits_of, with_careless


def run_mixed(
    scenario: Scenario,
    strategy: MixedStrategy,
    population: str,
    seed: int,
    options: SumoOptions,
) -> Outcome:
    """Returns what happened with automated vehicles under a strategy, and drivers beside them."""
    drivers = scenario.drivers[population]
    arrivals = arrivals_of(scenario, seed)
    plan = driver_road_plan(scenario, drivers)
    step_s = scenario.control.step_s
    period_steps = steps_of_period(strategy.decision_s, step_s)
    automated = automated_of(scenario, arrivals, seed)
    with tempfile.TemporaryDirectory(prefix="coramp-") as name:
        files = RunFiles(Path(name), scenario, plan, seed, options, ballistic=False, sampled=True)
        traits = with_careless(traits_of(drivers, arrivals, seed), scenario.behaviour, seed)
        actuators = actuators_of(scenario, len(arrivals))
        types = automated_types(scenario, automated, period_steps * step_s, actuators.delay_s)
        files.write_routes(driver_routes(scenario, drivers, arrivals, traits, automated=types))
        with Session(files.options(), step_s, options.gui, options.tell) as session:
            plant = MixedPlant(
                session,
                plan.lane_starts_m(),
                Able.of(scenario, arrivals, automated),
                period_steps,
                step_s,
                types.min_gap_m,
                actuators,
            )
            heard = automated | connected_of(scenario, arrivals, seed)
            laws = laws_of(scenario, drivers, plant.period_s)
            air = Air(scenario, heard, automated, seed)
            control = Control(strategy, laws, air, notes=notes_of(options, air))
            careless = Careless(scenario, session, seed)
            control.drive(plant, careless, cap_step_of(scenario))
        files.keep()
        samples = files.samples(arrivals)
        outcome = outcome_as_driven(scenario, arrivals, samples, files)
    passages = replace(outcome.passages, plan_error_m=plant.largest_error_m, automated=automated)
    notes = control.notes or Notes(None, None)
    return replace(
        outcome,
        passages=passages,
        drivers=population,
        messages_of_air=control.air.counts,
        world_events=(*careless.events, *air.faults(passages.entry_s, outcome.until_s)),
        heard=None if notes.heard is None else notes.heard.columns(),
        on_board=None if notes.on_board is None else notes.on_board.columns(),
    )


@dataclass
class Control:
    """The strategy for all, what reaches it and whom, and what each vehicle does on board.

    ``notes`` is where that is noted, if anywhere.
    """

    strategy: MixedStrategy
    laws: OnBoardLaws
    air: Air
    places: Places = field(default=())
    notes: Notes | None = None

    def drive(self, plant: MixedPlant, careless: Careless, cap_step: int) -> None:
        """Lets SUMO run until it is empty, commanding once a period."""
        step = 0
        while step < cap_step and (step == 0 or plant.session.vehicles_left()):
            step = min(cap_step, step + plant.period_steps)
            plant.session.step_to(step)
            names, on_lane, users = plant.users()
            now_s = step * plant.step_s
            careless.act_among(now_s, names, users)
            if users.automated.any():
                able = on_lane & ~careless.broken_down(now_s, users.number)
                accel_mps2, changes = self.commands(now_s, plant, able, users)
                accel_mps2 = careless.with_breakdown(now_s, users, accel_mps2)
                if self.notes is not None:
                    known = self.air, self.places, self.laws
                    driven = accel_mps2, changes
                    self.notes.driven(now_s, users, plant.ahead(users), driven, known)
                plant.command(names, users, accel_mps2, changes)

    def commands(
        self, now_s: float, plant: MixedPlant, on_lane: BoolArray, users: RoadUsers
    ) -> tuple[FloatArray, BoolArray]:
        """Returns the acceleration (m/s2) of each vehicle and who changes lanes.

        Only who is ``on_lane``, the acceleration lane, and able to may do that.
        """
        most_mps2, may_merge = self._told(now_s, users)
        around, ahead = neighbours_of(users), plant.ahead(users)
        wishes = may_merge & on_lane & users.automated
        accel_mps2 = driven_mps2(users, around, ahead, most_mps2, wishes, self.laws)
        if not wishes.any():
            return accel_mps2, wishes
        slower_mps = users.speed_mps + np.minimum(0.0, accel_mps2) * plant.period_s
        slowest_mps = np.minimum(slower_mps, ahead.speed_mps)
        changes = np.zeros(len(users.number), np.bool_)
        for own in np.flatnonzero(wishes).tolist():
            changes[own] = may_change_lane(users, own, around, ahead, slowest_mps[own], self.laws)
        return driven_mps2(users, around, ahead, most_mps2, changes, self.laws), changes

    def _told(self, now_s: float, users: RoadUsers) -> tuple[FloatArray, BoolArray]:
        """What vehicles are told: by the strategy, from what it has heard, as far as it arrives."""
        laws, seen = self.laws, self.air.heard(now_s, users)
        if len(seen.number):
            steering = self.strategy.steer(
                MixedSituation(
                    now_s, laws.period_s, seen, neighbours_of(seen), laws.gaps, laws.road
                ),
                self.places,
            )
            self.places = steering.places
            self.air.tell(now_s, seen, steering)
        told_mps2, may_merge = self.air.told(now_s, users)
        if self.notes is not None:
            self.notes.told(now_s, users, seen, told_mps2, self.air)
        return told_mps2, may_merge
