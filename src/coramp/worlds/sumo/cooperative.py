"""Cooperative vehicles in SUMO: each follows its committed pieces.

Python is entered at events only: the start of a piece, a lane change, the last step before the
zone's end. At each the vehicle's position is compared with its plan.
"""

import heapq
import math
from dataclasses import dataclass, field
from itertools import count

from coramp._kernel import FloatArray
from coramp.coordination.plant import Arrival
from coramp.kinematics.trajectory import TIME, station_and_speed, time_at_station
from coramp.motion.clock import first_step_from
from coramp.road.rules import Rules
from coramp.vehicles.merge_state import is_planned
from coramp.worlds.sumo.commands import command_table, correction
from coramp.worlds.sumo.demand import cooperative_type
from coramp.worlds.sumo.network import RoadPlan
from coramp.worlds.sumo.session import Session

SPEED, MERGE, MEASURE, LOOK, FURTHER_IN = range(5)
CORRECT_FROM_M = 0.015
"""A vehicle this far off its plan is brought back."""
SAME_SPEED_MPS = 1e-6
CORRECTION_S = 0.5
"""Half of the time that bringing it back takes, if no knot is nearer."""
BEFORE_EXIT_M = 0.2
"""A vehicle this close to the zone's end is left alone: SUMO may have taken it off the road."""


@dataclass(slots=True)
class Following:
    """One commitment under way: its commands.

    ``last`` is the last step at which the vehicle is in the zone, ``until`` the one at which
    another commitment takes over.
    """

    row: int
    pieces: FloatArray
    commands: list[list[float]]
    last: float
    until: float = math.inf
    next_command: int = 0


@dataclass(slots=True)
class Driven:
    """A vehicle in SUMO, and how its speed has changed since its last command.

    ``lane`` is the number of the lane by which it came, ``lane_change_s`` when it begins to change
    to the next one.
    """

    vehicle_id: str
    lane: int = 0
    lane_change_s: float = math.inf
    taken_over: bool = False
    largest_error_m: float = 0.0
    speed_mps: float = 0.0
    accel_mps2: float = 0.0
    since: int = 0
    steps: float = 0.0
    following: Following | None = field(default=None)

    def speed_at(self, step: int, step_s: float) -> float:
        """Returns the speed at ``step`` if nothing new is commanded."""
        return self.speed_mps + self.accel_mps2 * min(self.steps, step - self.since) * step_s


class CooperativePlant:
    """Carries cooperative vehicles through a SUMO session.

    ``driven`` is a piece each: row, time, station, speed and acceleration, measured there but for
    those whose places are in ``carried_on``. ``compared`` are row, step, station and speed where a
    vehicle was compared with its plan besides.
    """

    def __init__(self, session: Session, road: RoadPlan, rules: Rules) -> None:
        self.vehicles: list[Driven] = []
        self.driven: list[tuple[int, float, float, float, float]] = []
        self.carried_on: list[int] = []
        self.compared: list[tuple[int, int, float, float]] = []
        self._session = session
        self._road = road
        self._spans = road.spans()
        self._step_s = rules.control.step_s
        self._exit_m = rules.road.mainline_end_m
        self._correction_steps = max(1, round(CORRECTION_S / self._step_s))
        self._events: list[tuple[int, int, int, Following]] = []
        self._number = count()

    def advance(self, step: int) -> None:
        """Executes what is due before ``step``; SUMO itself may lag behind until then."""
        events = self._events
        while events and events[0][0] < step:
            now, kind, _, following = heapq.heappop(events)
            if now < following.until:
                self._session.step_to(now + 1)
                self._execute(kind, now, following)

    def finish(self, step: int) -> None:
        """Executes what is due up to ``step`` and lets SUMO reach it."""
        self.advance(step + 1)
        self._session.step_to(step + 1)

    def enter(self, row: int, arrival: Arrival, step: int) -> None:
        """Lets a vehicle enter at ``step``."""
        if row != len(self.vehicles):
            raise ValueError("rows must enter in order")
        self.vehicles.append(
            Driven(arrival.vehicle_id, arrival.lane, speed_mps=arrival.speed_mps, since=step)
        )
        self._session.add(
            arrival.vehicle_id,
            "ramp" if arrival.on_ramp else "mainline",
            cooperative_type(arrival),
            step,
            arrival.speed_mps,
            arrival.lane,
        )

    def follow(
        self, row: int, pieces: FloatArray, merge_time_s: float, lane_change_s: float = math.inf
    ) -> None:
        """Makes a vehicle follow the pieces from their first time on.

        Where it is to change to the next lane further in, it does so in SUMO at once, at the first
        step from then on.
        """
        vehicle = self.vehicles[row]
        exit_s = time_at_station(pieces, self._exit_m - BEFORE_EXIT_M)
        last = math.inf
        if exit_s < math.inf:
            last = first_step_from(exit_s, self._step_s) - 1
        first = round(pieces[0, TIME] / self._step_s)
        commands = self._commands(pieces, first, last)
        if vehicle.following is not None:
            vehicle.following.until = first
        following = vehicle.following = Following(row, pieces, commands, last)
        if commands:
            self._push(first, SPEED, following)
        if is_planned(merge_time_s):
            change = first_step_from(merge_time_s, self._step_s) - 1
            if change >= first:
                self._push(change, MERGE, following)
                self._push(change + 1, MEASURE, following)
        vehicle.lane_change_s = min(vehicle.lane_change_s, lane_change_s)
        if vehicle.lane_change_s < math.inf:
            change = first_step_from(vehicle.lane_change_s, self._step_s) - 1
            self._push(max(change, first - 1), FURTHER_IN, following)
        if first <= last < math.inf:
            self._push(int(last), MEASURE, following)

    def _push(self, step: int, kind: int, following: Following) -> None:
        heapq.heappush(self._events, (step, kind, next(self._number), following))

    def _execute(self, kind: int, step: int, following: Following) -> None:
        vehicle = self.vehicles[following.row]
        if kind == SPEED:
            self._command_speed(step, vehicle, following)
        elif kind == MERGE:
            self._merge(step, vehicle, following)
        elif kind == FURTHER_IN:
            self._change_further_in(step, vehicle, following)
        elif kind == LOOK:
            self._session.act_now(vehicle.vehicle_id)
        else:
            planned_m, _ = station_and_speed(following.pieces, step * self._step_s)
            error_m = self._measure(vehicle, planned_m)
            now_mps = vehicle.speed_at(step, self._step_s)
            self.compared.append((following.row, step, planned_m + error_m, now_mps))

    def _command_speed(self, step: int, vehicle: Driven, following: Following) -> None:
        if not vehicle.taken_over:
            self._session.take_over(vehicle.vehicle_id)
            vehicle.taken_over = True
        _, _, _, planned_m, planned_mps = following.commands[following.next_command]
        error_m = self._measure(vehicle, planned_m)
        now_mps = vehicle.speed_at(step, self._step_s)
        if abs(error_m) > CORRECT_FROM_M or abs(now_mps - planned_mps) > SAME_SPEED_MPS:
            self._correct(step, following, error_m, now_mps)
        _, speed_mps, steps, _, _ = following.commands[following.next_command]
        if steps == 0:
            self._session.keep_speed(vehicle.vehicle_id, speed_mps)
        else:
            self._session.change_speed(vehicle.vehicle_id, speed_mps, int(steps))
        self._note_driven(step, vehicle, following.row, planned_m + error_m, speed_mps, steps)
        following.next_command += 1
        if following.next_command < len(following.commands):
            self._push(int(following.commands[following.next_command][0]), SPEED, following)

    def _note_driven(
        self,
        step: int,
        vehicle: Driven,
        row: int,
        station_m: float,
        target_mps: float,
        steps: float,
    ) -> None:
        """Notes the pieces that SUMO drives from here on: evenly from the speed it has now."""
        speed_mps = vehicle.speed_at(step, self._step_s)
        change_s = max(1.0, steps) * self._step_s  # a speed to keep is there after one step
        accel_mps2 = (target_mps - speed_mps) / change_s
        self.driven.append((row, step * self._step_s, station_m, speed_mps, accel_mps2))
        if steps == 0 and accel_mps2 != 0.0:
            then_m = station_m + 0.5 * (speed_mps + target_mps) * change_s
            self.carried_on.append(len(self.driven))
            self.driven.append((row, (step + 1) * self._step_s, then_m, target_mps, 0.0))
        vehicle.speed_mps, vehicle.accel_mps2 = speed_mps, accel_mps2
        vehicle.since, vehicle.steps = step, max(1.0, steps)

    def _correct(self, step: int, following: Following, error_m: float, speed_mps: float) -> None:
        """Replaces the commands to come: two that bring the vehicle back, then as planned."""
        pieces = following.pieces
        back = correction(
            pieces, self._step_s, step, error_m, speed_mps, self._correction_steps
        ).tolist()
        if not back or back[1][0] + back[1][2] > following.last:
            return
        after = step + 2 * int(back[0][2])
        following.commands = back + self._commands(pieces, after, following.last)
        following.next_command = 0

    def _commands(self, pieces: FloatArray, from_step: int, last: float) -> list[list[float]]:
        table = command_table(pieces, self._step_s, from_step).tolist()
        return [command for command in table if command[0] <= last]

    def _merge(self, step: int, vehicle: Driven, following: Following) -> None:
        lane, _ = self._session.lane_and_position_m(vehicle.vehicle_id)
        if lane == "merge_0":
            self._session.change_lane(vehicle.vehicle_id, 1)
            # until it acts, it goes by the lane that it has left, and stops dead where that ends
            self._push(step + 1, LOOK, following)
        else:  # the first step's travel behind the nose: the lane begins only now
            self._push(step + 1, MERGE, following)

    def _change_further_in(self, step: int, vehicle: Driven, following: Following) -> None:
        """Has a vehicle change to the next lane further in, once more where it still has not.

        Inside a node SUMO may not carry it out.
        """
        lane, _ = self._session.lane_and_position_m(vehicle.vehicle_id)
        if self._spans[lane].lane > vehicle.lane:
            self._session.act_now(vehicle.vehicle_id)
            return
        if step < following.last:
            station_m, _ = station_and_speed(following.pieces, (step + 1) * self._step_s)
            index = self._road.lane_index(vehicle.lane + 1, station_m)
            self._session.change_lane(vehicle.vehicle_id, index)
            self._push(step + 1, FURTHER_IN, following)

    def _measure(self, vehicle: Driven, planned_m: float) -> float:
        lane, position_m = self._session.lane_and_position_m(vehicle.vehicle_id)
        error_m = self._spans[lane].start_m + position_m - planned_m
        vehicle.largest_error_m = max(vehicle.largest_error_m, abs(error_m))
        return error_m
