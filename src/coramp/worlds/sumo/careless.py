"""Drivers who are careless, and vehicles that break down: what happens on the road by itself."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from coramp._kernel import BoolArray, FloatArray, IntArray
from coramp.coordination.plant import Arrival
from coramp.demand.generators import generator
from coramp.mixed.users import RoadUsers
from coramp.scenarios.model import Scenario
from coramp.worlds.faults.brakings import due_s
from coramp.worlds.sumo.lanes import LanedRoad
from coramp.worlds.sumo.network import RAMP_LANE, RoadPlan
from coramp.worlds.sumo.session import Session

STOPS_MPS2, STOPS_AT_MOST_MPS2 = 3.0, 4.0
"""A vehicle that breaks down rolls to a stop with this, and at a look too late with more."""
STOPS_EARLY_S, STOPS_WITHIN_M = 0.3, 1.0
"""It begins so early that it is not too late at the next look, and stops so near the station."""
LEAST_LEFT_M = 0.1
LOOK_STEPS = 2
NEAR_M = (-300.0, 150.0)
"""Where drivers brake for nothing: before and beside the acceleration lane."""


class Forced(NamedTuple):
    """A driver is forced to a speed that he has at ``there_s``, and keeps it until ``until_s``."""

    speed_mps: float
    there_s: float
    until_s: float


@dataclass
class Careless:
    """What drivers do without reason, and the breakdown of a vehicle, in one run.

    ``stopped_until_s`` tells of automated vehicles that have broken down, by number.
    Who brakes for nothing has random numbers of its own, whatever the waits in between are.
    """

    scenario: Scenario
    session: Session
    seed: int
    stopped_until_s: dict[int, float] = field(default_factory=dict)
    events: list[tuple[float, str, int]] = field(default_factory=list)
    _choices: np.random.Generator = field(init=False)
    _due_s: list[float] = field(init=False)
    _forced: dict[str, Forced] = field(default_factory=dict)
    _broken: bool = False

    def __post_init__(self) -> None:
        """When drivers brake for nothing is drawn, for as long as vehicles arrive."""
        rate_per_h = self.scenario.behaviour.brakes_for_nothing_per_h
        horizon_s = self.scenario.simulation.horizon_s
        self._due_s = due_s(rate_per_h, self.seed, horizon_s).tolist()
        self._choices = generator(self.seed, "faults/careless/choices")

    @property
    def is_needed(self) -> bool:
        """Whether anything of this can happen."""
        rate = self.scenario.behaviour.brakes_for_nothing_per_h
        return rate > 0.0 or self.scenario.incidents.breakdown_s is not None

    def act(self, now_s: float, seen: "Road") -> None:
        """Lets happen what is due, and ends what is over."""
        here = set(seen.names)
        for name, forced in list(self._forced.items()):
            if now_s >= forced.until_s or name not in here:
                self.session.release(name)
                del self._forced[name]
            elif now_s >= forced.there_s:
                self.session.hold(name, forced.speed_mps)
        if self._due_s and now_s >= self._due_s[0] and self._brake_for_nothing(now_s, seen):
            del self._due_s[0]
        incidents = self.scenario.incidents
        due = incidents.breakdown_s is not None and now_s >= incidents.breakdown_s
        if due and not self._broken:
            self._break_down(now_s, seen)

    def act_among(self, now_s: float, names: Sequence[str], users: RoadUsers) -> None:
        """As ``act``, among the users of a run of mixed traffic."""
        if not self.is_needed:
            return
        self.act(
            now_s,
            Road(
                names,
                users.number,
                users.station_m,
                users.speed_mps,
                users.on_mainline,
                users.automated,
            ),
        )

    def _brake_for_nothing(self, now_s: float, seen: "Road") -> bool:
        """One driver on the mainline near the merge brakes hard; which one is drawn.

        Returns whether there was one.
        """
        low_m, high_m = NEAR_M
        near = ~seen.automated & seen.on_mainline
        near &= (seen.station_m > low_m) & (seen.station_m < high_m)
        chosen = np.flatnonzero(near)
        chosen = chosen[[seen.names[i] not in self._forced for i in chosen.tolist()]]
        if len(chosen) == 0:
            return False
        behaviour = self.scenario.behaviour
        i = int(chosen[int(self._choices.random() * len(chosen))])
        brake_mps2 = min(behaviour.brake_mps2, self.scenario.road.most_braking_mps2)
        then_mps = max(0.0, float(seen.speed_mps[i]) - brake_mps2 * behaviour.brake_s)
        braking_s = (float(seen.speed_mps[i]) - then_mps) / brake_mps2
        self._force(
            seen.names[i], Forced(then_mps, now_s + braking_s, now_s + behaviour.brake_s), now_s
        )
        self.events.append((now_s, "driver brakes for nothing", int(seen.number[i])))
        return True

    def _break_down(self, now_s: float, seen: "Road") -> None:
        """The vehicle that is about to reach the station brakes, so that it stops there."""
        incidents = self.scenario.incidents
        left_m = incidents.station_m - seen.station_m
        stops_m = seen.speed_mps**2 / (2.0 * STOPS_MPS2)
        before = (seen.on_mainline == (incidents.place == "mainline")) & (left_m > 0.0)
        before &= left_m <= stops_m + seen.speed_mps * STOPS_EARLY_S + STOPS_WITHIN_M
        before &= left_m >= stops_m * STOPS_MPS2 / STOPS_AT_MOST_MPS2
        candidates = np.flatnonzero(before)
        if len(candidates) == 0:
            return
        i = int(candidates[np.argmin(left_m[candidates])])
        self._broken = True
        stops_s = self.scenario.control.step_s
        if seen.speed_mps[i] > 0.0:
            stops_s = max(stops_s, 2.0 * float(left_m[i] / seen.speed_mps[i]))
        end_s = now_s + stops_s + incidents.lasts_s
        self.events.append((now_s, "vehicle breaks down", int(seen.number[i])))
        if seen.automated[i]:
            self.stopped_until_s[int(seen.number[i])] = end_s
            return
        self._force(seen.names[i], Forced(0.0, now_s + stops_s, end_s), now_s)

    def _force(self, name: str, forced: Forced, now_s: float) -> None:
        self.session.force(name, forced.speed_mps, forced.there_s - now_s)
        self._forced[name] = forced

    def broken_down(self, now_s: float, number: IntArray) -> BoolArray:
        """Returns which automated vehicles stand, or brake, because they have broken down."""
        if not self.stopped_until_s:
            return np.zeros(len(number), np.bool_)
        until_s = self.stopped_until_s
        return np.array([now_s < until_s.get(n, -np.inf) for n in number.tolist()], np.bool_)

    def with_breakdown(self, now_s: float, users: RoadUsers, accel_mps2: FloatArray) -> FloatArray:
        """Returns accelerations (m/s2) in which an automated vehicle that broke down stops."""
        stopped = self.broken_down(now_s, users.number)
        if not stopped.any():
            return accel_mps2
        left_m = np.maximum(LEAST_LEFT_M, self.scenario.incidents.station_m - users.station_m)
        braking_mps2 = np.minimum(STOPS_AT_MOST_MPS2, users.speed_mps**2 / (2.0 * left_m))
        return np.where(stopped, np.minimum(accel_mps2, -braking_mps2), accel_mps2)


@dataclass(frozen=True)
class Road:
    """Who is on the road, as what happens by itself needs it: one entry a vehicle."""

    names: Sequence[str]
    number: IntArray
    station_m: FloatArray
    speed_mps: FloatArray
    on_mainline: BoolArray
    automated: BoolArray


class CarelessDrivers:
    """Lets a run that nobody coordinates go on, and has careless drivers act in it.

    Where nothing can happen by itself SUMO goes on without a look.
    """

    def __init__(
        self,
        careless: Careless,
        plan: RoadPlan | LanedRoad,
        arrivals: Sequence[Arrival],
    ) -> None:
        self._careless = careless
        self._spans = plan.spans()
        self._number = {arrival.vehicle_id: k for k, arrival in enumerate(arrivals)}

    @property
    def events(self) -> list[tuple[float, str, int]]:
        """What has happened by itself."""
        return self._careless.events

    def step_to(self, step: int, until: int) -> None:
        """Executes the steps before ``until``; the steps before ``step`` are done."""
        session = self._careless.session
        if self._careless.is_needed:
            step_s = self._careless.scenario.control.step_s
            for now in range(step + LOOK_STEPS, until, LOOK_STEPS):
                session.step_to(now)
                self._careless.act(now * step_s, self._seen())
        session.step_to(until)

    def _seen(self) -> Road:
        """Krauss' automated vehicles take no commands: to who breaks down they are as drivers."""
        names, lanes, position_m, speed_mps = self._careless.session.everyone()
        number = np.array([self._number[name] for name in names], np.int64)
        spans = [self._spans[lane] for lane in lanes]
        start_m = np.array([span.start_m for span in spans], np.float64)
        per_m = np.array([span.per_m for span in spans], np.float64)
        return Road(
            names,
            number,
            start_m + np.array(position_m, np.float64) * per_m,
            np.array(speed_mps, np.float64),
            np.array([span.lane > RAMP_LANE for span in spans], np.bool_),
            np.zeros(len(names), np.bool_),
        )
