"""Vehicles that follow an acceleration late: a dead time, then a first-order lag."""

from dataclasses import dataclass, field

import numpy as np

from coramp._kernel import FloatArray, IntArray
from coramp.scenarios.world_sections import Actuators


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
        """Everyone cruises; the queue holds the commands of the dead time, oldest first."""
        steps = round(self.section.dead_time_s / self.step_s)
        self._accel_mps2 = np.zeros(self.vehicles)
        self._queue = np.zeros((steps, self.vehicles))

    @property
    def is_slow(self) -> bool:
        """Whether there is any delay at all."""
        return len(self._queue) > 0 or self.section.lag_s > 0.0

    @property
    def delay_s(self) -> float:
        """The dead time (s) that delays a change of acceleration as long, or longer."""
        return len(self._queue) * self.step_s + self.section.lag_s

    def driven(self, number: IntArray, command_mps2: FloatArray) -> FloatArray:
        """Returns the acceleration (m/s2) of these vehicles in the next step."""
        due = command_mps2
        if len(self._queue):
            due = self._queue[0, number].copy()
            self._queue[:-1, number] = self._queue[1:, number]
            self._queue[-1, number] = command_mps2
        self._accel_mps2[number] = self._after_a_step(self._accel_mps2[number], due)
        return np.maximum(self._accel_mps2[number], -self.most_braking_mps2)

    def _after_a_step(self, accel_mps2: FloatArray, due_mps2: FloatArray) -> FloatArray:
        """The mean acceleration of a step, as the lag brings it towards what is due."""
        if self.section.lag_s == 0.0:
            return due_mps2
        share = 1.0 - np.exp(-self.step_s / self.section.lag_s)
        return np.asarray(accel_mps2 + share * (due_mps2 - accel_mps2))

    def predicted(self, number: IntArray, speed_mps: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Returns way (m) and speed (m/s) until a new command can act.

        Through the queue exactly; then the acceleration that is there by then is held for the lag:
        a lag that goes from a_0 to a command that brakes comes less far than that.
        """
        accel, way_m, now_mps = self._accel_mps2[number], np.zeros(len(number)), speed_mps
        for due in self._queue[:, number]:
            accel = self._after_a_step(accel, due)
            way_m, now_mps = _onwards(way_m, now_mps, accel, self.step_s)
        return _onwards(way_m, now_mps, accel, self.section.lag_s)


def _onwards(
    way_m: FloatArray, speed_mps: FloatArray, accel_mps2: FloatArray, time_s: float
) -> tuple[FloatArray, FloatArray]:
    then_mps = np.maximum(0.0, speed_mps + accel_mps2 * time_s)
    return way_m + 0.5 * (speed_mps + then_mps) * time_s, then_mps
