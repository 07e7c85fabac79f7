"""Yield or go: the order of merging from games between the ramp vehicle and one lane vehicle.

Source: H. Min, Y. Fang, X. Wu, G. Wu, X. Zhao, "On-ramp merging strategy for connected and
automated vehicles based on complete information static game", J. Adv. Transp. 2020, and
arXiv 2101.11237.
"""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from coramp.strategies.base import Decision, Memory, View
from coramp.strategies.parameters import parameter
from coramp.strategies.sequence import Crossings, decide_in_sequence

GO, YIELD = 0, 1


@dataclass(frozen=True)
class Game:
    """Ramp vehicle and conflict vehicle each go or yield; a pure Nash equilibrium decides.

    A player's payoff is ``-(w_t delay + w_f effort + w_s risk)``. With crossings t of the two and h
    between them: who goes while the other yields has no delay; who yields crosses h after the
    other; if both yield both lose h; if both go the risk is ``1 - |dt| / h``, below h. The effort
    of a delay d until the crossing in T is ``6 (v0 d)^2 / T^3``, that of the least-effort shift.
    Of several equilibria the one with the larger sum counts, and of equal ones that in which the
    lane vehicle goes. If the ramp vehicle yields, it plays the next lane vehicle.
    """

    name: ClassVar[str] = "game"
    summary: ClassVar[str] = "ramp and lane vehicle play yield or go, pair by pair"
    cooperative: ClassVar[bool] = True

    time_weight: float = parameter(1.0, 0.0, 100.0, meaning="w_t, weight of 1 s of delay")
    effort_weight: float = parameter(0.05, 0.0, 100.0, meaning="w_f, weight of 1 m2/s3 of effort")
    risk_weight: float = parameter(10.0, 0.001, 1000.0, meaning="w_s, weight of a conflict")

    def decide(self, view: View, memory: Memory) -> Decision:
        """Returns the decision for the first subject, where its games put it."""
        v0 = view.rules.road.mainline_speed_mps
        now_s = view.time_s

        def vehicles_before(seen: Crossings) -> int:
            return self.vehicles_before(seen, now_s, v0)

        return decide_in_sequence(vehicles_before, view, memory)

    def vehicles_before(self, seen: Crossings, now_s: float, speed_mps: float) -> int:
        """Returns how many lane vehicles go before the subject."""
        own_s, needs_s = float(seen.ramp_s[0]), float(seen.ramp_next_s[0])
        lane_s, lane_next_s = seen.mainline_s, seen.mainline_next_s
        k = int((lane_s + lane_next_s <= own_s).sum())
        while k < len(lane_s) and float(lane_s[k]) < own_s + needs_s:
            other_s, behind_s = float(lane_s[k]), float(lane_next_s[k])
            if not self.ramp_yields(own_s, other_s, needs_s, behind_s, now_s, speed_mps):
                return k
            own_s, k = max(own_s, other_s + behind_s), k + 1
        return k

    def ramp_yields(
        self,
        ramp_s: float,
        lane_s: float,
        ramp_next_s: float,
        lane_next_s: float,
        now_s: float,
        speed_mps: float,
    ) -> bool:
        """Returns whether the equilibrium has the ramp vehicle yield."""
        ramp, lane = self.payoffs(ramp_s, lane_s, ramp_next_s, lane_next_s, now_s, speed_mps)
        stable = [
            (float(ramp[i, j] + lane[i, j]), i)
            for i in (GO, YIELD)
            for j in (GO, YIELD)
            if ramp[i, j] >= ramp[1 - i, j] and lane[i, j] >= lane[i, 1 - j]
        ]
        return max(stable)[1] == YIELD if stable else True

    def payoffs(
        self,
        ramp_s: float,
        lane_s: float,
        ramp_next_s: float,
        lane_next_s: float,
        now_s: float,
        speed_mps: float,
    ) -> tuple[np.ndarray, np.ndarray]:
        """Returns payoffs of ramp and lane vehicle; first index what the ramp vehicle does."""
        apart_s = abs(ramp_s - lane_s)
        needs_s = ramp_next_s if ramp_s <= lane_s else lane_next_s
        risk = -self.risk_weight * max(0.0, 1.0 - apart_s / needs_s)
        behind_lane_s = max(0.0, lane_s + lane_next_s - ramp_s)
        behind_ramp_s = max(0.0, ramp_s + ramp_next_s - lane_s)

        def cost(delay_s: float, crossing_s: float) -> float:
            left_s = max(1.0, crossing_s - now_s)
            effort = 6.0 * (speed_mps * delay_s) ** 2 / left_s**3
            return -(self.time_weight * delay_s + self.effort_weight * effort)

        ramp_yields, lane_yields = cost(behind_lane_s, ramp_s), cost(behind_ramp_s, lane_s)
        both_ramp = cost(behind_lane_s + lane_next_s, ramp_s)
        both_lane = cost(behind_ramp_s + ramp_next_s, lane_s)
        ramp = np.array([[risk, 0.0], [ramp_yields, both_ramp]])
        lane = np.array([[risk, lane_yields], [0.0, both_lane]])
        return ramp, lane
