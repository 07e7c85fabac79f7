"""Automated vehicles among SUMO's own drivers: they are commanded anew each period."""

import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import NamedTuple

from coramp._kernel import BoolArray, FloatArray
from coramp.coordination.plant import Arrival
from coramp.demand.arrivals import arrivals_of, automated_of, connected_of
from coramp.mixed.lanes import Lanes
from coramp.mixed.laws import OnBoardLaws
from coramp.mixed.on_board import (
    Ahead,
    Neighbours,
    asks_for_room,
    driven_and_changes,
    neighbours_of,
)
from coramp.mixed.situation import MixedSituation, MixedStrategy, Places, Steering
from coramp.mixed.users import RoadUsers, soon
from coramp.records.outcome import Outcome
from coramp.scenarios.model import Scenario
from coramp.strategies.base import steps_of_period
from coramp.worlds.faults.air import Air
from coramp.worlds.outcomes import cap_step_of
from coramp.worlds.sumo.as_driven import Driving, outcome_as_driven
from coramp.worlds.sumo.careless import Careless
from coramp.worlds.sumo.demand import driver_routes
from coramp.worlds.sumo.files import RunFiles, SumoOptions
from coramp.worlds.sumo.lanes import LanedRoad, road_of
from coramp.worlds.sumo.mixed_notes import Notes, notes_of
from coramp.worlds.sumo.mixed_plant import Foresees, MixedPlant
from coramp.worlds.sumo.mixed_setup import (
    Able,
    actuators_of,
    automated_types,
    laws_of,
)
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
    with tempfile.TemporaryDirectory(prefix="coramp-") as name:
        with begun(scenario, strategy, population, seed, options, Path(name)) as run:
            for moment in run.decisions():
                run.carry_out(moment)
        run.files.keep()
        return run.outcome()


@contextmanager
def begun(
    scenario: Scenario,
    strategy: MixedStrategy,
    population: str,
    seed: int,
    options: SumoOptions,
    folder: Path,
) -> Iterator["MixedRun"]:
    """Starts SUMO, with its files in a folder, and hands over the run; SUMO ends with it."""
    drivers = scenario.drivers[population]
    arrivals = arrivals_of(scenario, seed)
    plan = road_of(scenario, drivers)
    laned = plan if isinstance(plan, LanedRoad) else None
    step_s = scenario.control.step_s
    period_steps = steps_of_period(strategy.decision_s, step_s)
    automated = automated_of(scenario, arrivals, seed)
    files = RunFiles(folder, scenario, plan, seed, options, ballistic=False)
    traits = with_careless(traits_of(drivers, arrivals, seed), scenario.behaviour, seed)
    actuators = actuators_of(scenario, len(arrivals))
    types = automated_types(scenario, automated, period_steps * step_s, actuators.delay_s)
    files.write_routes(
        driver_routes(scenario, drivers, arrivals, traits, automated=types, road=laned)
    )
    files.write_additional()
    files.write_detectors(arrivals)
    with Session(files.options(), step_s, options.gui, options.tell) as session:
        plant_kind, control_kind = _kinds_on(laned)
        plant = plant_kind(
            session,
            plan.spans(),
            Able.of(scenario, arrivals, automated),
            period_steps,
            step_s,
            types.min_gap_m,
            actuators,
        )
        heard = automated | connected_of(scenario, arrivals, seed)
        laws = laws_of(scenario, drivers, plant.period_s, actuators.delay_s)
        air = Air(scenario, heard, automated, seed)
        acts_after_s = scenario.commands.delay_s + actuators.delay_s
        control = control_kind(strategy, laws, air, acts_after_s, notes=notes_of(options, air))
        if laned is not None:
            plant.is_on(laned)
            control.drives(plant)
        careless = Careless(scenario, session, seed)
        yield MixedRun(scenario, population, arrivals, files, plant, control, careless)


def _kinds_on(laned: LanedRoad | None) -> tuple[type[MixedPlant], type["Control"]]:
    """What carries and controls vehicles on a road of several lanes, or of one."""
    from coramp.worlds.sumo.mixed_lanes import LanedControl, LanedPlant

    return (MixedPlant, Control) if laned is None else (LanedPlant, LanedControl)


class Moment(NamedTuple):
    """All at one decision: where everybody is, what of it is known, and what the strategy answers.

    ``able`` is who is on the acceleration lane and can leave it. ``steering`` has one entry for
    each of those ``seen``, and is None where nobody automated is on the road, or nobody is seen.
    ``around`` is who is around whom of ``users``, None where nobody has looked yet. ``outer`` is
    who of them the strategy may command, where that is not all.
    """

    now_s: float
    names: list[str]
    able: BoolArray
    users: RoadUsers
    seen: RoadUsers
    steering: Steering | None
    around: Neighbours | None = None
    outer: RoadUsers | None = None


class Driven(NamedTuple):
    """What vehicles were told at a decision and what they did, one entry a user.

    ``told_mps2`` is how much each was to speed up at most, ``wishes`` who on the acceleration lane
    was to merge; ``accel_mps2`` is how each is driven, ``changes`` who changes lanes, ``asks`` who
    asks drivers to make room.
    """

    told_mps2: FloatArray
    wishes: BoolArray
    accel_mps2: FloatArray
    changes: BoolArray
    asks: BoolArray


@dataclass
class MixedRun:
    """A run that SUMO has begun. Each moment is to be carried out before the next one is taken."""

    scenario: Scenario
    population: str
    arrivals: list[Arrival]
    files: RunFiles
    plant: MixedPlant
    control: "Control"
    careless: Careless

    def decisions(self) -> Iterator[Moment]:
        """Lets SUMO run until it is empty, and stops at each decision."""
        plant, careless = self.plant, self.careless
        step, cap_step = 0, cap_step_of(self.scenario)
        while step < cap_step and (step == 0 or plant.session.vehicles_left()):
            step = min(cap_step, step + plant.period_steps)
            plant.watch.step_to(step)
            names, on_lane, users = plant.users()
            now_s = step * plant.step_s
            careless.act_among(now_s, names, users)
            able = on_lane & ~careless.broken_down(now_s, users.number)
            yield self.control.decided(now_s, names, able, users)

    def carry_out(self, moment: Moment) -> Driven | None:
        """Tells vehicles what the moment has, and drives them for a period; None without any."""
        users = moment.users
        if not users.automated.any():
            return None
        driven = self.control.driven(moment, self.plant)
        accel_mps2 = self.careless.with_breakdown(moment.now_s, users, driven.accel_mps2)
        if self.control.notes is not None:
            self.control.note(moment, self.plant.ahead(users), accel_mps2, driven.changes)
        self.plant.command(moment.names, users, accel_mps2, driven.changes, driven.asks)
        return driven

    def outcome(self, end_s: float | None = None) -> Outcome:
        """Returns what happened once SUMO has ended, at ``end_s`` where it was cut off early."""
        passed, seen = self.plant, self.plant.watch
        driven = Driving(seen.samples(), seen.finished())
        outcome = outcome_as_driven(self.scenario, self.arrivals, driven, self.files, end_s)
        passages = replace(
            outcome.passages,
            plan_error_m=passed.largest_error_m,
            automated=passed.able.automated,
        )
        air, notes = self.control.air, self.control.notes or Notes(None, None)
        faults = air.faults(passages.entry_s, outcome.until_s)
        return replace(
            outcome,
            passages=passages,
            drivers=self.population,
            messages_of_air=air.counts,
            world_events=(*self.careless.events, *faults),
            heard=None if notes.heard is None else notes.heard.columns(),
            on_board=None if notes.on_board is None else notes.on_board.columns(),
        )


@dataclass
class Control:
    """The strategy for all, what reaches it and whom, and what each vehicle does on board.

    A command acts ``acts_after_s`` on average after it was given: its way, and slow actuators.
    ``notes`` is where all is noted, if anywhere.
    """

    strategy: MixedStrategy
    laws: OnBoardLaws
    air: Air
    acts_after_s: float = 0.0
    places: Places = field(default=())
    notes: Notes | None = None

    def drives(self, plant: MixedPlant) -> None:
        """Is told whom it drives, which it asks for lanes where there are several."""

    def decided(self, now_s: float, names: list[str], able: BoolArray, users: RoadUsers) -> Moment:
        """Returns what the strategy answers to what it has heard.

        It is shown where vehicles will be when its commands act.
        """
        if not users.automated.any():
            return Moment(now_s, names, able, users, users, None)
        laws, seen = self.laws, self.air.heard(now_s, users)
        if len(seen.number) == 0:
            return Moment(now_s, names, able, users, seen, None)
        then = soon(seen, self.acts_after_s)
        around = neighbours_of(then)
        situation = MixedSituation(now_s, laws.period_s, then, around, laws.gaps, laws.road)
        steering = self.strategy.steer(situation, self.places)
        self.places = steering.places
        known = around if then is users else None
        return Moment(now_s, names, able, users, seen, steering, known)

    def driven(self, moment: Moment, plant: Foresees) -> Driven:
        """Returns what vehicles are told, as far as it arrives, and what they do on board.

        Only who is ``able`` to changes lanes.
        """
        users = moment.users
        if moment.steering is not None:
            self.air.tell(moment.now_s, moment.seen, moment.steering)
        most_mps2, may_merge = self.air.told(moment.now_s, users)
        if self.notes is not None:
            self.notes.told(moment.now_s, users, moment.seen, most_mps2, self.air)
        around = neighbours_of(users) if moment.around is None else moment.around
        wishes = may_merge & moment.able & users.automated
        accel_mps2, changes = driven_and_changes(
            users, around, plant.ahead(users), most_mps2, wishes, self.laws
        )
        asks = asks_for_room(users, around.front)
        return Driven(most_mps2, wishes, accel_mps2, changes, asks)

    def note(
        self, moment: Moment, ahead: Ahead, accel_mps2: FloatArray, changes: BoolArray
    ) -> None:
        """Notes what vehicles do, if anything is noted."""
        self._note(moment, ahead, (accel_mps2, changes), None)

    def _note(
        self,
        moment: Moment,
        ahead: Ahead,
        driven: tuple[FloatArray, BoolArray],
        lanes: Lanes | None,
    ) -> None:
        if self.notes is not None:
            known = self.air, self.places, self.laws
            self.notes.driven(moment.now_s, (moment.users, lanes), ahead, driven, known)
