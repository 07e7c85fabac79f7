"""Vehicles that follow an acceleration late: a dead time, then a first-order lag."""

import math
from dataclasses import dataclass, field

import numpy as np

from coramp._kernel import FloatArray, IntArray
from coramp.scenarios.world_sections import Actuators

LARGEST_EXPONENT = 700.0
ROUNDING_STEPS = 1e-6


@dataclass
class SlowActuators:
    """The acceleration of each vehicle: da/dt = (command of the dead time ago - a) / lag.

    ``most_braking_mps2`` is what tyres and road allow, positive.
    """

    section: Actuators
    vehicles: int
    step_s: float
    most_braking_mps2: float
    _accel_mps2: FloatArray = field(init=False)
    _queue: FloatArray = field(init=False)

    def __post_init__(self) -> None:
        """Everyone cruises; the queue holds the commands of the dead time, oldest first.

        A dead time that is no multiple of the step counts as the next larger one.
        """
        steps = math.ceil(self.section.dead_time_s / self.step_s - ROUNDING_STEPS)
        self._accel_mps2 = np.zeros(self.vehicles)
        self._queue = np.zeros((steps, self.vehicles))

    @property
    def is_slow(self) -> bool:
        """Whether there is any delay at all."""
        return len(self._queue) > 0 or self.section.lag_s > 0.0

    @property
    def delay_s(self) -> float:
        """The dead time (s) that speeds have in the end, once a change of command is through."""
        return len(self._queue) * self.step_s + self._lag_s

    @property
    def _lag_s(self) -> float:
        """The dead time that the lag amounts to: h / (exp(h / T) - 1) in steps of h."""
        if self.section.lag_s == 0.0:
            return 0.0
        return self.step_s / math.expm1(min(self.step_s / self.section.lag_s, LARGEST_EXPONENT))

    def begin(self, number: int) -> None:
        """Forgets what a vehicle was commanded before it was left to others: now it cruises."""
        self._accel_mps2[number] = 0.0
        self._queue[:, number] = 0.0

    def driven(self, number: IntArray, command_mps2: FloatArray) -> FloatArray:
        """Returns the acceleration (m/s2) of these vehicles in the next step."""
        due = command_mps2
        if len(self._queue):
            due = self._queue[0, number].copy()
            self._queue[:-1, number] = self._queue[1:, number]
            self._queue[-1, number] = command_mps2
        self._accel_mps2[number] = self._after_a_step(self._accel_mps2[number], due)
        return np.asarray(self._accel_mps2[number])

    def _after_a_step(self, accel_mps2: FloatArray, due_mps2: FloatArray) -> FloatArray:
        """The mean acceleration of a step, as the lag brings it towards what is due."""
        due_mps2 = np.maximum(due_mps2, -self.most_braking_mps2)
        if self.section.lag_s == 0.0:
            return due_mps2
        share = 1.0 - np.exp(-self.step_s / self.section.lag_s)
        return np.asarray(accel_mps2 + share * (due_mps2 - accel_mps2))

    def predicted(self, number: IntArray, speed_mps: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Returns way (m) and speed (m/s) until a new command can act.

        Through the queue exactly. Then, with the lag's dead time d, a vehicle at x with v and a is
        taken to be at x + d v - h d a / 2 with v + d a. From there on that point moves as a vehicle
        does that follows commands at once; the vehicle stays behind it, and comes to a stop where
        it does.
        """
        accel, way_m, now_mps = self._accel_mps2[number], np.zeros(len(number)), speed_mps
        for due in self._queue[:, number]:
            accel = self._after_a_step(accel, due)
            way_m, now_mps = _onwards(way_m, now_mps, accel, self.step_s)
        lag_s = self._lag_s
        way_m = way_m + lag_s * now_mps - 0.5 * self.step_s * lag_s * accel
        return way_m, np.maximum(0.0, now_mps + lag_s * accel)


def _onwards(
    way_m: FloatArray, speed_mps: FloatArray, accel_mps2: FloatArray, time_s: float
) -> tuple[FloatArray, FloatArray]:
    then_mps = np.maximum(0.0, speed_mps + accel_mps2 * time_s)
    return way_m + 0.5 * (speed_mps + then_mps) * time_s, then_mps
