"""Optimal control tracked under control barrier functions (OCBF), a quadratic program a period.

Source: W. Xiao, C. G. Cassandras, C. Belta, "Decentralized merging control in traffic networks
with noisy vehicle dynamics: a joint optimal control and barrier function approach", ITSC 2019;
W. Xiao, C. Belta, C. G. Cassandras, arXiv 1809.07916.
"""

import math
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

import numpy as np
import quadprog as untyped_quadprog

from coramp._kernel import FloatArray, IntArray
from coramp.road.lanes import ACCELERATION_LANE, MAINLINE
from coramp.road.rules import Rules
from coramp.strategies.base import Decision, Memory, View, held_period_s
from coramp.strategies.feedback import Platoon, virtual_platoon
from coramp.strategies.parameters import parameter
from coramp.strategies.virtual_platoon import drive_commands

quadprog: Any = untyped_quadprog
LONGEST_HEADWAYS = 8.0
"""So many times phi a period may last (``Ocbf.barriers``)."""


class Barriers(NamedTuple):
    """What a vehicle's barriers to one predecessor ask of its own acceleration, one entry each.

    ``ahead`` is the predecessor's entry, -1 for none. With u in m/s2 on the own road:
    ``weight u <= allowed_mps`` and what the predecessor's u adds (``Ocbf.highest_mps2``), once for
    the distance at speed and once for the distance to stop in. ``ahead_mps`` is the speed of the
    place at which the predecessor counts, which moves ``ahead_scale`` times as fast as it, and
    ``hardest_mps2`` the own hardest braking there.
    """

    ahead: IntArray
    ahead_scale: FloatArray
    ahead_mps: FloatArray
    hardest_mps2: FloatArray
    speed_weight: FloatArray
    speed_allowed_mps: FloatArray
    stop_weight: FloatArray
    stop_allowed_mps: FloatArray


@dataclass(frozen=True)
class Ocbf:
    """Everyone tracks the unconstrained optimum as far as the barriers to his predecessors allow.

    Front first, each vehicle's u and the relaxation e of its speed's Lyapunov condition minimise
    ``1/2 (u - u_ref)^2 + p/2 e^2`` subject to

    - ``2 (v - v_d) u + c (v - v_d)^2 <= e``, the speed tends to v_d;
    - ``v_p - v - phi u + kappa b >= m`` with ``b = x_p - x - L_p - phi v - d``, the barrier to the
      predecessor on the same road;
    - the same with ``b_s = b - (v^2 - v_p^2) / (2 u_min)``, where ``b_s'`` has
      ``-(v u - v_p u_p) / u_min`` more: the distance to stop in, without which no bounded braking
      could keep b;
    - the first to the one before it in the order of merging, with a phi that grows in proportion to
      the way driven through the zone, and its term ``phi' v^2``, at places on the mainline
      (``feedback.Platoon``);
    - ``u <= kappa (v_max - v)`` and the bounds of u.

    u_p is what the predecessor has been told for the same period. m covers what changes while
    accelerations are held for the period (``barriers``).
    """

    name: ClassVar[str] = "ocbf"
    summary: ClassVar[str] = "optimal control tracked under control barrier functions, by QP"
    cooperative: ClassVar[bool] = True

    time_weight: float = parameter(0.25, 0.0, 0.95, meaning="alpha, weight of travel time")
    headway_s: float = parameter(0.5, 0.05, 5.0, meaning="phi, headway in the barriers")
    standstill_gap_m: float = parameter(
        0.5, 0.0, 20.0, meaning="d, gap at standstill in the barriers"
    )
    barrier_rate_ps: float = parameter(1.0, 0.05, 2.0, meaning="kappa, rate at which b may fall")
    speed_rate_ps: float = parameter(1.0, 0.05, 10.0, meaning="c, rate of the Lyapunov condition")
    relaxation_weight: float = parameter(0.01, 1e-6, 1e6, meaning="p, weight of its relaxation")
    period_s: float = parameter(0.5, 0.1, 1.0, meaning="control period, at most 1 / kappa")

    def problems(self) -> list[str]:
        """Returns what does not fit together: the proof of ``barriers`` needs it."""
        told = []
        if self.barrier_rate_ps * self.period_s > 1.0:
            told.append(
                f"barrier_rate_ps: {self.barrier_rate_ps:g} is too much for period_s "
                f"{self.period_s:g}; allowed is up to {1.0 / self.period_s:g}"
            )
        if self.period_s > LONGEST_HEADWAYS * self.headway_s:
            told.append(
                f"headway_s: {self.headway_s:g} is too short for period_s {self.period_s:g}; "
                f"allowed is {self.period_s / LONGEST_HEADWAYS:g} and more"
            )
        return told

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
        """Returns the solutions of the quadratic programs (m/s2), front first.

        Who is on the acceleration lane keeps its commitment, which never brakes there: it counts
        as not accelerating.
        """
        road, v = rules.road, platoon.speed_mps
        on_mainline = platoon.stage == MAINLINE
        wish_mps = np.where(on_mainline, road.mainline_speed_mps, road.ramp_speed_mps)
        reference_mps2 = self.reference_mps2(platoon, wish_mps, rules)
        lowest_mps2, highest_mps2 = self.bounds_mps2(platoon, rules)
        same_road, merging = self.barriers(platoon, rules), self.merge_barriers(platoon, rules)
        accel_mps2 = np.zeros(len(v))
        for k in range(len(v)):
            if platoon.stage[k] == ACCELERATION_LANE:
                continue
            highest = min(
                float(highest_mps2[k]),
                self.highest_mps2(same_road, k, accel_mps2, rules, stopping=True),
                self.highest_mps2(merging, k, accel_mps2, rules, stopping=False),
            )
            accel_mps2[k] = self._solved(
                float(v[k] - wish_mps[k]), float(reference_mps2[k]), lowest_mps2, highest
            )
        return accel_mps2

    def reference_mps2(self, platoon: Platoon, wish_mps: FloatArray, rules: Rules) -> FloatArray:
        """Returns u(0) of the optimum without constraints, end speed free, to the merge.

        ``u(t) = 3 (D - v T) (T - t) / T^3`` minimises the effort to drive D in T, and T minimises
        ``beta T`` plus that: ``beta = 1.5 (D - v T) (3 D - v T) / T^4``, where beta is
        ``alpha u_max^2 / (2 (1 - alpha))``. Behind the nose the reference keeps v_d.
        """
        limit = rules.motion.comfort_mps2
        beta = 0.5 * self.time_weight * limit * limit / (1.0 - self.time_weight)
        way_m = np.maximum(-platoon.station_m, 1.0)
        speed_mps = np.maximum(platoon.speed_mps, 0.1)
        low_s, high_s = np.zeros_like(way_m), way_m / speed_mps
        for _ in range(30):
            middle_s = 0.5 * (low_s + high_s)
            left_m = way_m - speed_mps * middle_s
            too_fast = 1.5 * left_m * (2.0 * way_m + left_m) > beta * middle_s**4
            low_s, high_s = (
                np.where(too_fast, middle_s, low_s),
                np.where(too_fast, high_s, middle_s),
            )
        towards = 3.0 * (way_m - speed_mps * high_s) / high_s**2
        keeping = self.speed_rate_ps * (wish_mps - platoon.speed_mps)
        reference = np.where(platoon.station_m < -1.0, towards, keeping)
        return np.clip(reference, -limit, rules.motion.speed_up_mps2)

    def bounds_mps2(self, platoon: Platoon, rules: Rules) -> tuple[float, FloatArray]:
        """Returns the accelerations (m/s2) that vehicles and speed limits allow, least and most."""
        road, motion = rules.road, rules.motion
        most_mps = np.where(platoon.stage == MAINLINE, road.mainline_speed_mps, road.ramp_limit_mps)
        kappa = self._rate_ps(held_period_s(self.period_s, rules))
        highest = np.minimum(motion.speed_up_mps2, kappa * (most_mps - platoon.speed_mps))
        return -motion.comfort_mps2, np.maximum(highest, -motion.comfort_mps2)

    def barriers(self, platoon: Platoon, rules: Rules) -> Barriers:
        """Returns the barriers to the predecessors on the same road.

        While both hold their u for P, ``b(t) = b + b' t - (u - u_p) t^2 / 2`` and
        ``b_s(t) = b_s + b_s' t - (g(u) - g(u_p)) t^2 / 2`` with ``g(u) = u + u^2 / u_min``. With
        ``kappa P <= 1`` both stay at or above 0 for ``m = (u_max - u_p) P / 2`` and
        ``m_s = (g(u_max) - g(u_p)) P / 2``. Where that asks for more than u_min, full braking
        keeps them: then ``b_s' >= phi u_min``, and ``g(-u_min) - g(u_p) <= u_min / 4``, so that
        ``P <= 8 phi`` is enough; b is above b_s while v > v_p, and grows otherwise. Who comes to a
        stand within the period only leaves more than the formulas say.
        """
        ones = np.ones(len(platoon.rows))
        return self._barriers(
            platoon.station_m,
            platoon.speed_mps,
            platoon.length_m,
            platoon.same_road,
            ones,
            self.headway_s * ones,
            0.0 * ones,
            rules,
        )

    def merge_barriers(self, platoon: Platoon, rules: Rules) -> Barriers:
        """Returns the barriers to those before it in the order of merging, on the other road.

        phi grows from 0 at the zone's start to its full value at the nose. That adds
        ``phi' v^2`` to what b loses, and ``1.5 phi' v u_max P + phi' u_max^2 P^2 / 2`` to m.
        """
        road = rules.road
        order = np.arange(len(platoon.rows)) - 1
        ahead = np.where(platoon.same_road == order, -1, order)
        share = np.clip(1.0 + platoon.virtual_m / -road.mainline_start_m, 0.05, 1.0)
        slope_s_per_m = np.where(share < 1.0, self.headway_s / -road.mainline_start_m, 0.0)
        scale = np.where(
            platoon.stage == MAINLINE, 1.0, road.mainline_speed_mps / road.ramp_speed_mps
        )
        return self._barriers(
            platoon.virtual_m,
            platoon.virtual_mps,
            platoon.length_m,
            ahead,
            scale,
            self.headway_s * share,
            slope_s_per_m,
            rules,
        )

    def _barriers(
        self,
        place_m: FloatArray,
        speed_mps: FloatArray,
        length_m: FloatArray,
        ahead: IntArray,
        scale: FloatArray,
        phi_s: FloatArray,
        slope_s_per_m: FloatArray,
        rules: Rules,
    ) -> Barriers:
        """The barriers between places, which move ``scale`` times as fast as their vehicles."""
        period_s, motion = held_period_s(self.period_s, rules), rules.motion
        kappa, half_s = self._rate_ps(period_s), 0.5 * period_s
        v, v_p = speed_mps, speed_mps[ahead]
        up, down = scale * motion.speed_up_mps2, scale * motion.comfort_mps2
        b = place_m[ahead] - length_m[ahead] - place_m - phi_s * v - self.standstill_gap_m
        b_stop = b - 0.5 * (v * v - v_p * v_p) / down
        growing = slope_s_per_m * (v * v + 1.5 * v * up * period_s + 0.5 * (up * period_s) ** 2)
        rest = v_p - v - growing
        return Barriers(
            ahead,
            scale[ahead],
            v_p,
            down,
            phi_s * scale,
            rest + kappa * b - half_s * up,
            (phi_s + v / down) * scale,
            rest + kappa * b_stop - half_s * (up + up * up / down),
        )

    def highest_mps2(
        self,
        barriers: Barriers,
        k: int,
        accel_mps2: FloatArray,
        rules: Rules,
        *,
        stopping: bool,
    ) -> float:
        """Returns the highest u that the barriers of entry k allow, given that of who is ahead."""
        ahead = int(barriers.ahead[k])
        if ahead < 0:
            return math.inf
        period_s = held_period_s(self.period_s, rules)
        v_p, down = float(barriers.ahead_mps[k]), float(barriers.hardest_mps2[k])
        u_p = float(barriers.ahead_scale[k] * accel_mps2[ahead])
        allowed_mps = float(barriers.speed_allowed_mps[k]) + 0.5 * period_s * u_p
        highest = allowed_mps / float(barriers.speed_weight[k])
        if stopping:
            held_mps = 0.5 * period_s * (u_p + u_p * u_p / down)
            allowed_mps = float(barriers.stop_allowed_mps[k]) + v_p * u_p / down + held_mps
            highest = min(highest, allowed_mps / float(barriers.stop_weight[k]))
        return highest

    def _rate_ps(self, period_s: float) -> float:
        """kappa; a period that was rounded up to the clock could be a little too long for it."""
        return min(self.barrier_rate_ps, 1.0 / period_s)

    def _solved(
        self, excess_mps: float, reference_mps2: float, lowest_mps2: float, highest_mps2: float
    ) -> float:
        if highest_mps2 <= lowest_mps2:
            return lowest_mps2
        weights = np.diag([1.0, self.relaxation_weight])
        rows = np.array([[-2.0 * excess_mps, -1.0, 1.0], [1.0, 0.0, 0.0]])
        bounds = np.array([self.speed_rate_ps * excess_mps**2, -highest_mps2, lowest_mps2])
        wanted = np.array([reference_mps2, 0.0])
        solution = quadprog.solve_qp(weights, wanted, rows, bounds)[0]
        return float(min(max(solution[0], lowest_mps2), highest_mps2))
