"""Automated vehicles among SUMO's own drivers: they are commanded anew each period."""

import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from coramp._kernel import BoolArray, FloatArray, IntArray
from coramp.coordination.plant import Arrival
from coramp.demand.arrivals import arrivals_of, automated_of, connected_of
from coramp.mixed.laws import FollowingLaw, SafetyLaw
from coramp.mixed.on_board import Neighbours, driven_mps2, may_change_lane, neighbours_of
from coramp.mixed.situation import MixedStrategy, Places, Situation
from coramp.mixed.users import Gaps, MixedRoad, RoadUsers
from coramp.records.outcome import Outcome
from coramp.scenarios.model import Scenario
from coramp.scenarios.sections import DriverPopulation
from coramp.strategies.base import steps_of_period
from coramp.vehicles.traits import Traits
from coramp.worlds.outcomes import cap_step_of
from coramp.worlds.sumo.as_driven import outcome_as_driven
from coramp.worlds.sumo.demand import Automated, automated_cruise_mps, driver_routes
from coramp.worlds.sumo.files import RunFiles, SumoOptions
from coramp.worlds.sumo.network import RAMP_LANES, driver_road_plan
from coramp.worlds.sumo.session import Session
from coramp.worlds.sumo.traits import traits_of

LANE_END_M = 3.0
"""An automated vehicle that has not merged stands so far before the acceleration lane ends."""
MORE_BEHIND_DRIVER_M, MORE_BEHIND_DRIVER_S = 0.5, 0.3
"""How much more than behind an automated vehicle one keeps behind a driver."""
MORE_FOR_DRIVER_S = 0.3
"""How much more than a driver's own gap room for one who merges has."""
TRUCK_BRAKING_MPS2 = 5.0
"""What the brakes of a heavy vehicle must do (UN Regulation 13, type 0 test)."""
YIELDED_TO = 'lcCooperative="1"'
"""SUMO's drivers yield to it as to one another."""
MERGE_LANE = "merge_0"
NO_GAP_S = 30.0
"""With such a time gap SUMO finds no gap for a vehicle that is to merge, but has drivers yield."""
NO_GAP_SHARE = 0.75
"""Beyond this share of the acceleration lane SUMO takes gaps that such a time gap rules out."""
FOLLOWING = FollowingLaw()


def gaps_of(scenario: Scenario, drivers: DriverPopulation) -> Gaps:
    """Returns which gaps vehicles keep: automated ones those of ``[safety]``."""
    own_m, own_s = scenario.safety.standstill_gap_m, scenario.safety.time_gap_s
    theirs_m, theirs_s = drivers.min_gap_m, max(drivers.taus_s)
    return Gaps(
        behind_automated_m=own_m,
        behind_automated_s=own_s,
        behind_driver_m=own_m + MORE_BEHIND_DRIVER_M,
        behind_driver_s=own_s + MORE_BEHIND_DRIVER_S,
        of_driver_m=theirs_m,
        of_driver_s=theirs_s,
        for_driver_m=theirs_m,
        for_driver_s=theirs_s + MORE_FOR_DRIVER_S,
    )


def safety_law_of(scenario: Scenario, period_s: float) -> SafetyLaw:
    """Returns what automated vehicles keep on board on this road, commanded once a period.

    They react no sooner than their next command. Drivers move in Euler steps, in which one that
    brakes from v comes to a stand v h / 2 earlier than by v^2 / (2 b).
    """
    law = SafetyLaw()
    shorter_m = 0.5 * scenario.mainline.limit_mps * scenario.control.step_s
    end_m = scenario.ramp.acceleration_lane_m - LANE_END_M
    return law._replace(
        reaction_s=max(law.reaction_s, period_s),
        margin_m=max(law.margin_m, shorter_m),
        lane_end_m=end_m,
    )


def automated_types(scenario: Scenario, automated: BoolArray, law: SafetyLaw) -> Automated:
    """Returns how SUMO's drivers know automated vehicles: by the gaps that these keep at least."""
    return Automated(
        automated,
        max(scenario.safety.time_gap_s, law.reaction_s),
        max(scenario.safety.standstill_gap_m, law.margin_m),
        YIELDED_TO,
    )


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
    law = safety_law_of(scenario, period_steps * step_s)
    automated = automated_of(scenario, arrivals, seed)
    with tempfile.TemporaryDirectory(prefix="coramp-") as name:
        files = RunFiles(Path(name), scenario, plan, seed, options, ballistic=False, sampled=True)
        traits = traits_of(drivers, arrivals, seed)
        types = automated_types(scenario, automated, law)
        files.write_routes(driver_routes(scenario, drivers, arrivals, traits, automated=types))
        with Session(files.options(), step_s, options.gui) as session:
            plant = MixedPlant(
                session,
                plan.lane_starts_m(),
                Able.of(scenario, arrivals, automated),
                period_steps,
                step_s,
                types.tau_s,
                NO_GAP_SHARE * scenario.ramp.acceleration_lane_m,
            )
            hears = automated | connected_of(scenario, arrivals, seed)
            Control(scenario, strategy, gaps_of(scenario, drivers), law, hears).drive(
                plant, cap_step_of(scenario)
            )
        files.keep()
        samples, finished = files.samples(arrivals), files.finished()
        collisions, collided = files.collisions(), files.collided(arrivals)
    outcome = outcome_as_driven(scenario, arrivals, samples, finished, collisions)
    passages = replace(outcome.passages, plan_error_m=plant.largest_error_m, automated=automated)
    return replace(outcome, passages=passages, drivers=population, collided=collided)


@dataclass(frozen=True)
class Able:
    """What vehicles are and can do, one entry an arrival."""

    number: Mapping[str, int]
    automated: BoolArray
    length_m: FloatArray
    cruise_mps: FloatArray
    acceleration_mps2: FloatArray
    power_wpkg: FloatArray
    braking_mps2: FloatArray

    @classmethod
    def of(cls, scenario: Scenario, arrivals: Sequence[Arrival], automated: BoolArray) -> "Able":
        """Returns what the vehicles of these arrivals can do; the law's braking is the most."""
        usual = scenario.usual_traits(0.0)
        traits: list[Traits] = [a.traits or usual for a in arrivals]
        most_mps2 = SafetyLaw().braking_mps2
        brakes = [
            most_mps2 if np.isinf(t.braking_mps2) else max(t.braking_mps2, TRUCK_BRAKING_MPS2)
            for t in traits
        ]
        return cls(
            {a.vehicle_id: k for k, a in enumerate(arrivals)},
            automated,
            np.array([a.length_m for a in arrivals], np.float64),
            np.array([automated_cruise_mps(scenario, a) for a in arrivals], np.float64),
            np.array([t.acceleration_mps2 for t in traits], np.float64),
            np.array([t.power_wpkg for t in traits], np.float64),
            np.minimum(most_mps2, np.array(brakes, np.float64)),
        )


@dataclass
class MixedPlant:
    """The vehicles in a SUMO session: where they are, and what automated ones are told.

    An automated vehicle's speed is that of its commands: under Euler steps SUMO's own is off by
    half a step's acceleration. ``tau_s`` is the time gap by which drivers know it, once it is on
    the mainline; from ``no_gap_from_m`` on SUMO is told outright to change no lane by itself.
    ``largest_error_m`` is how far each was from where it was sent, nan for drivers.
    """

    session: Session
    lane_starts_m: Mapping[str, float]
    able: Able
    period_steps: int
    step_s: float
    tau_s: float
    no_gap_from_m: float
    largest_error_m: FloatArray = field(init=False)
    _sent_mps: FloatArray = field(init=False)
    _sent_m: FloatArray = field(init=False)
    _changing: set[int] = field(default_factory=set)
    _held: set[str] = field(default_factory=set)

    def __post_init__(self) -> None:
        """Nobody has been sent anywhere yet."""
        count = len(self.able.automated)
        self._sent_mps, self._sent_m = np.full(count, np.nan), np.full(count, np.nan)
        self.largest_error_m = np.where(self.able.automated, 0.0, np.nan)

    @property
    def period_s(self) -> float:
        """The time (s) between two commands."""
        return self.period_steps * self.step_s

    def users(self) -> tuple[list[str], BoolArray, RoadUsers]:
        """Returns names, who is on the acceleration lane, and all that is on the road."""
        names, lanes, position_m, sumo_mps = self.session.everyone()
        number = np.array([self.able.number[name] for name in names], np.int64)
        start_m = np.array([self.lane_starts_m[lane] for lane in lanes])
        station_m = start_m + np.array(position_m)
        speed_mps = self._known_speeds(number, station_m, np.array(sumo_mps))
        users = RoadUsers(
            number,
            station_m,
            speed_mps,
            self.able.length_m[number],
            np.array([lane not in RAMP_LANES for lane in lanes], np.bool_),
            self.able.automated[number],
            self.able.cruise_mps[number],
            self.able.acceleration_mps2[number],
            self.able.power_wpkg[number],
            self.able.braking_mps2[number],
        )
        return names, np.array([lane == MERGE_LANE for lane in lanes], np.bool_), users

    def _known_speeds(
        self, number: IntArray, station_m: FloatArray, speed_mps: FloatArray
    ) -> FloatArray:
        """SUMO's speeds for drivers, those of commands for automated vehicles; notes errors."""
        sent_mps = self._sent_mps[number]
        sent = ~np.isnan(sent_mps)
        error_m = np.abs(station_m[sent] - self._sent_m[number[sent]])
        there = number[sent]
        self.largest_error_m[there] = np.maximum(self.largest_error_m[there], error_m)
        return np.where(sent, sent_mps, speed_mps)

    def command(
        self, names: Sequence[str], users: RoadUsers, accel_mps2: FloatArray, changes: BoolArray
    ) -> None:
        """Has automated vehicles drive with these accelerations until the next command."""
        period_s, half_s = self.period_s, 0.5 * self.step_s
        own = np.flatnonzero(users.automated)
        number, accel = users.number[own], accel_mps2[own]
        before_mps = users.speed_mps[own]
        after_mps = np.maximum(0.0, before_mps + accel * period_s)
        accel = (after_mps - before_mps) / period_s
        new = np.isnan(self._sent_mps[number])
        self._sent_mps[number] = after_mps
        self._sent_m[number] = users.station_m[own] + 0.5 * (before_mps + after_mps) * period_s
        for k, i in enumerate(own.tolist()):
            name = names[i]
            if new[k]:
                self.session.take_over_among_drivers(name)
                if not users.on_mainline[i]:
                    self.session.judge_gaps_by(name, NO_GAP_S)
            self.session.drive_evenly(
                name,
                float(before_mps[k] - accel[k] * half_s),
                float(max(0.0, after_mps[k] - accel[k] * half_s)),
                self.period_steps,
            )
            if changes[i]:
                self.session.judge_gaps_by(name, self.tau_s)
                self.session.change_lane_now(name, 1, self.period_steps)
                self._changing.add(i_number := int(number[k]))
            elif not users.on_mainline[i] and users.station_m[i] > self.no_gap_from_m:
                self._hold(name)
            elif users.on_mainline[i] and (i_number := int(number[k])) in self._changing:
                self.session.take_over_among_drivers(name)
                self._changing.discard(i_number)

    def _hold(self, name: str) -> None:
        """Has SUMO take no gap by itself for a vehicle from now on."""
        if name not in self._held:
            self.session.accept_no_gap(name)
            self._held.add(name)


@dataclass
class Control:
    """The strategy for all, and what each automated vehicle does on board.

    ``hears`` is which arrivals the strategy knows of; on board everybody near is seen.
    """

    scenario: Scenario
    strategy: MixedStrategy
    gaps: Gaps
    law: SafetyLaw
    hears: BoolArray
    following: FollowingLaw = FOLLOWING
    places: Places = ()

    def drive(self, plant: MixedPlant, cap_step: int) -> None:
        """Lets SUMO run until it is empty, commanding once a period."""
        step = 0
        while step < cap_step and (step == 0 or plant.session.vehicles_left()):
            step = min(cap_step, step + plant.period_steps)
            plant.session.step_to(step)
            names, on_lane, users = plant.users()
            if users.automated.any():
                accel_mps2, changes = self.commands(step * plant.step_s, plant, on_lane, users)
                plant.command(names, users, accel_mps2, changes)

    @property
    def _road(self) -> MixedRoad:
        scenario = self.scenario
        return MixedRoad(
            scenario.mainline.speed_mps, scenario.ramp.speed_mps, scenario.ramp.limit_mps
        )

    def commands(
        self, now_s: float, plant: MixedPlant, on_lane: BoolArray, users: RoadUsers
    ) -> tuple[FloatArray, BoolArray]:
        """Returns the acceleration (m/s2) of each vehicle and who changes lanes."""
        around = neighbours_of(users)
        most_mps2, may_merge = self._told(now_s, plant.period_s, users, around)
        changes = np.zeros(len(users.number), np.bool_)
        for own in np.flatnonzero(may_merge & on_lane & users.automated).tolist():
            changes[own] = may_change_lane(users, own, around, self.gaps, self.following, self.law)
        accel_mps2 = driven_mps2(
            users,
            around,
            most_mps2,
            changes,
            self.gaps,
            self.following,
            self.law,
            self._road,
            plant.period_s,
        )
        return accel_mps2, changes

    def _told(
        self, now_s: float, period_s: float, users: RoadUsers, around: Neighbours
    ) -> tuple[FloatArray, BoolArray]:
        """What the strategy says to whom it knows; others have no bound, and wait to merge."""
        known = self.hears[users.number]
        if known.all():
            seen, seen_around = users, around
        else:
            seen = RoadUsers._make(column[known] for column in users)
            seen_around = neighbours_of(seen)
        steering = self.strategy.steer(
            Situation(now_s, period_s, seen, seen_around, self.gaps, self._road), self.places
        )
        self.places = steering.places
        most_mps2 = np.full(len(users.number), np.inf)
        may_merge = np.zeros(len(users.number), np.bool_)
        most_mps2[known], may_merge[known] = steering.most_mps2, steering.may_merge
        return most_mps2, may_merge
