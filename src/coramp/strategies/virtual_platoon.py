"""Vehicle mapping: both streams follow one another as one virtual platoon, first come first served.

Source: A. Uno, T. Sakaguchi, S. Tsugawa, "A merging control algorithm based on inter-vehicle
communication", ITSC 1999; X.-Y. Lu, K. Hedrick, "Longitudinal control algorithm for automated
vehicle merging", Int. J. Control 76(2), 2003; with the constant time gap of arXiv 2103.15047.
"""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from coramp._kernel import FloatArray, IntArray
from coramp.road.lanes import ACCELERATION_LANE, RAMP
from coramp.road.rules import Rules
from coramp.strategies.base import (
    Decision,
    DriveWithAcceleration,
    Memory,
    View,
    held_period_s,
)
from coramp.strategies.feedback import Platoon, virtual_platoon
from coramp.strategies.parameters import parameter


@dataclass(frozen=True)
class VirtualPlatoon:
    """Every vehicle follows the one before it in the order of merging, on whichever road it is.

    ``u = k_p (s - t_c v - s_0) + k_v (v_p - v)``, no more than what brings it to its lane's speed,
    ``u = k_v (v_d - v)``, and saturated. s is the bumper distance to the predecessor and v_p its
    speed. To a predecessor on the other road ramp vehicles count at their places on the mainline
    (``feedback.Platoon``), and u is scaled back from there. Who is ahead on the same road is
    followed as well, as it is.
    """

    name: ClassVar[str] = "virtual-platoon"
    summary: ClassVar[str] = "vehicle mapping: one virtual platoon with a constant time gap"
    cooperative: ClassVar[bool] = True

    time_gap_s: float = parameter(0.6, 0.0, 5.0, meaning="t_c, time gap to the predecessor")
    standstill_gap_m: float = parameter(1.0, 0.0, 20.0, meaning="s_0, gap at standstill")
    gap_gain_ps2: float = parameter(0.25, 0.01, 10.0, meaning="k_p, gain on the error in distance")
    speed_gain_ps: float = parameter(
        0.8, 0.01, 10.0, meaning="k_v, gain on the difference in speed"
    )
    period_s: float = parameter(0.5, 0.1, 2.0, meaning="control period")

    def decide(self, view: View, memory: Memory) -> Decision:
        """Returns an acceleration for everyone but those on the acceleration lane."""
        if view.subjects:
            return Decision((), (), memory)
        at_s = view.time_s + view.rules.control.actuation_delay_s
        platoon = virtual_platoon(view.fleet, at_s, view.packed_rules)
        accel_mps2 = self.accelerations_mps2(platoon, view.rules)
        hold_s = held_period_s(self.period_s, view.rules)
        return Decision(drive_commands(platoon, accel_mps2, hold_s), (), memory)

    def accelerations_mps2(self, platoon: Platoon, rules: Rules) -> FloatArray:
        """Returns the law's accelerations (m/s2), front first."""
        v0, ramp_mps = rules.road.mainline_speed_mps, rules.road.ramp_speed_mps
        on_ramp = platoon.stage == RAMP
        wish_mps = np.where(on_ramp, ramp_mps, v0)
        accel_mps2 = self.speed_gain_ps * (wish_mps - platoon.speed_mps)
        road = self._following(
            platoon.station_m, platoon.speed_mps, platoon.length_m, platoon.same_road
        )
        order = np.arange(len(on_ramp)) - 1
        across = np.where(platoon.same_road == order, -1, order)
        merging = self._following(
            platoon.virtual_m, platoon.virtual_mps, platoon.length_m, across
        ) * np.where(on_ramp, ramp_mps / v0, 1.0)
        return saturated(np.minimum(accel_mps2, np.minimum(road, merging)), rules)

    def _following(
        self, place_m: FloatArray, speed_mps: FloatArray, length_m: FloatArray, ahead: IntArray
    ) -> FloatArray:
        """The law to the entry ahead of each; infinite for those that have none."""
        gap_m = place_m[ahead] - length_m[ahead] - place_m
        error_m = gap_m - self.time_gap_s * speed_mps - self.standstill_gap_m
        law = self.gap_gain_ps2 * error_m + self.speed_gain_ps * (speed_mps[ahead] - speed_mps)
        return np.where(ahead >= 0, law, np.inf)


def saturated(accel_mps2: FloatArray, rules: Rules) -> FloatArray:
    """Returns accelerations within comfort braking and the speeding up of vehicles."""
    motion = rules.motion
    return np.clip(accel_mps2, -motion.comfort_mps2, min(motion.speed_up_mps2, motion.comfort_mps2))


def drive_commands(
    platoon: Platoon, accel_mps2: FloatArray, hold_s: float
) -> tuple[DriveWithAcceleration, ...]:
    """Returns the commands of a law; vehicles on the acceleration lane keep their commitment."""
    return tuple(
        DriveWithAcceleration(row, accel, hold_s)
        for row, stage, accel in zip(
            platoon.rows.tolist(), platoon.stage.tolist(), accel_mps2.tolist(), strict=True
        )
        if stage != ACCELERATION_LANE
    )
