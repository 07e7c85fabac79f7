"""Vehicle mapping: both streams follow one another as one virtual platoon, first come first served.

Source: A. Uno, T. Sakaguchi, S. Tsugawa, "A merging control algorithm based on inter-vehicle
communication", ITSC 1999; X.-Y. Lu, K. Hedrick, "Longitudinal control algorithm for automated
vehicle merging", Int. J. Control 76(2), 2003; with the constant time gap of arXiv 2103.15047.
"""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from coramp._kernel import FloatArray
from coramp.core.rules import Rules
from coramp.strategies.base import Decision, DriveWithAcceleration, Memory, View
from coramp.strategies.feedback import LANE, RAMP, Platoon, virtual_platoon
from coramp.strategies.parameters import parameter


@dataclass(frozen=True)
class VirtualPlatoon:
    """Every vehicle follows the one before it in the order of merging, on whichever road it is.

    ``u = k_p (s - t_c v - s_0) + k_v (v_p - v)``, no more than what brings it to its lane's speed,
    ``u = k_v (v_d - v)``, and saturated. s is the bumper distance to the predecessor and v_p its
    speed, where ramp vehicles count at their places on the mainline (``feedback.Platoon``).
    """

    name: ClassVar[str] = "virtual-platoon"
    summary: ClassVar[str] = "vehicle mapping: one virtual platoon with a constant time gap"
    cooperative: ClassVar[bool] = True

    time_gap_s: float = parameter(0.6, 0.0, 5.0, meaning="t_c, kept to the predecessor")
    standstill_gap_m: float = parameter(1.0, 0.0, 20.0, meaning="s_0, kept at a stand")
    gap_gain_ps2: float = parameter(0.25, 0.01, 10.0, meaning="k_p, of the error in distance")
    speed_gain_ps: float = parameter(0.8, 0.01, 10.0, meaning="k_v, of the difference in speed")
    period_s: float = parameter(0.5, 0.1, 2.0, meaning="control period")

    def decide(self, view: View, memory: Memory) -> Decision:
        """Returns an acceleration for everyone but those on the acceleration lane."""
        if view.subjects:
            return Decision((), (), memory)
        at_s = view.time_s + view.rules.control.actuation_delay_s
        platoon = virtual_platoon(view.fleet, at_s, view.packed_rules)
        accel_mps2 = self.accelerations_mps2(platoon, view.rules)
        return Decision(drive_commands(platoon, accel_mps2, self.period_s), (), memory)

    def accelerations_mps2(self, platoon: Platoon, rules: Rules) -> FloatArray:
        """Returns the law's accelerations (m/s2), front first."""
        on_ramp = platoon.stage == RAMP
        v0, ramp_mps = rules.road.mainline_speed_mps, rules.road.ramp_speed_mps
        free = self.speed_gain_ps * (v0 - platoon.virtual_mps)
        gap_m = platoon.virtual_m[:-1] - platoon.length_m[:-1] - platoon.virtual_m[1:]
        own_mps, ahead_mps = platoon.virtual_mps[1:], platoon.virtual_mps[:-1]
        follow = self.gap_gain_ps2 * (gap_m - self.time_gap_s * own_mps - self.standstill_gap_m)
        follow += self.speed_gain_ps * (ahead_mps - own_mps)
        free[1:] = np.minimum(free[1:], follow)
        scaled = np.where(on_ramp, free * ramp_mps / v0, free)
        return saturated(scaled, rules)


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
        if stage != LANE
    )
