"""Optimal control tracked under control barrier functions (OCBF), a quadratic program a period.

Source: W. Xiao, C. G. Cassandras, C. Belta, "Decentralized merging control in traffic networks
with noisy vehicle dynamics: a joint optimal control and barrier function approach", ITSC 2019;
W. Xiao, C. Belta, C. G. Cassandras, arXiv 1809.07916.
"""

from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

import numpy as np
import quadprog as untyped_quadprog

from coramp._kernel import FloatArray
from coramp.core.rules import Rules
from coramp.strategies.base import Decision, Memory, View
from coramp.strategies.feedback import MAINLINE, Platoon, virtual_platoon
from coramp.strategies.parameters import parameter
from coramp.strategies.virtual_platoon import drive_commands

quadprog: Any = untyped_quadprog
SLACK_MPS2 = 1e-6
"""Between bounds that coincide, so that rounding does not make a problem without solution."""


class Limits(NamedTuple):
    """For each vehicle the accelerations (m/s2, on its own road) that its barriers allow."""

    lowest_mps2: FloatArray
    highest_mps2: FloatArray


@dataclass(frozen=True)
class Ocbf:
    """Everyone tracks the unconstrained optimum as far as the barriers of his predecessors allow.

    Each vehicle's u and the relaxation e of its speed's Lyapunov condition minimise
    ``1/2 (u - u_ref)^2 + p/2 e^2`` subject to

    - ``2 (v - v_d) u + c (v - v_d)^2 <= e``, the speed tends to v_d;
    - ``v_p - v - phi u + kappa b >= m`` with ``b = x_p - x - L_p - phi v - d``, the barrier to the
      predecessor on the same road;
    - the same to the one before it in the order of merging, with a phi that grows in proportion to
      the way driven through the zone, and its term ``phi' v^2``, at places on the mainline
      (``feedback.Platoon``);
    - ``u <= kappa (v_max - v)`` and the bounds of u.

    m is the margin for the control period, ``sampling_margin_mps``.
    """

    name: ClassVar[str] = "ocbf"
    summary: ClassVar[str] = "optimal control tracked under control barrier functions, by QP"
    cooperative: ClassVar[bool] = True

    time_weight: float = parameter(0.25, 0.0, 0.95, meaning="alpha, of travel time against effort")
    headway_s: float = parameter(0.5, 0.05, 5.0, meaning="phi, of the barriers")
    standstill_gap_m: float = parameter(0.5, 0.0, 20.0, meaning="d, of the barriers")
    barrier_rate_ps: float = parameter(1.0, 0.05, 2.0, meaning="kappa, how fast b may fall")
    speed_rate_ps: float = parameter(1.0, 0.05, 10.0, meaning="c, of the Lyapunov condition")
    relaxation_weight: float = parameter(0.01, 1e-6, 1e6, meaning="p, of the Lyapunov condition")
    period_s: float = parameter(0.5, 0.1, 1.0, meaning="control period; kappa times it is below 1")

    def decide(self, view: View, memory: Memory) -> Decision:
        """Returns an acceleration for everyone but those on the acceleration lane."""
        if view.subjects:
            return Decision((), (), memory)
        at_s = view.time_s + view.rules.control.actuation_delay_s
        platoon = virtual_platoon(view.fleet, at_s, view.packed_rules)
        accel_mps2 = self.accelerations_mps2(platoon, view.rules)
        return Decision(drive_commands(platoon, accel_mps2, self.period_s), (), memory)

    def accelerations_mps2(self, platoon: Platoon, rules: Rules) -> FloatArray:
        """Returns the solution of the quadratic program (m/s2), front first."""
        road = rules.road
        on_mainline = platoon.stage == MAINLINE
        wish_mps = np.where(on_mainline, road.mainline_speed_mps, road.ramp_speed_mps)
        reference = self.reference_mps2(platoon, wish_mps, rules)
        limits = self.limits(platoon, rules)
        return self._solved(platoon.speed_mps - wish_mps, reference, limits)

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

    def sampling_margin_mps(self, hardest_mps2: float, rules: Rules) -> float:
        """Returns m, with which a barrier that holds at a sample holds until the next.

        While u is held for P, ``b(t) >= b (1 - kappa t) + m t - (d + u) t^2 / 2`` against a
        predecessor that brakes with d at most. With ``kappa P <= 1`` that is at least 0 if
        ``m >= (d + u_max) P / 2``.
        """
        return 0.5 * (hardest_mps2 + rules.motion.speed_up_mps2) * self.period_s

    def limits(self, platoon: Platoon, rules: Rules) -> Limits:
        """Returns the accelerations that bounds, speed limits and both barriers allow."""
        road, motion = rules.road, rules.motion
        phi, kappa = self.headway_s, self.barrier_rate_ps
        margin = self.sampling_margin_mps(motion.comfort_mps2, rules)
        on_mainline = platoon.stage == MAINLINE
        most_mps = np.where(on_mainline, road.mainline_speed_mps, road.ramp_limit_mps)
        v = platoon.speed_mps
        highest = np.minimum(motion.speed_up_mps2, kappa * (most_mps - v))
        ahead = platoon.same_lane
        x, length = platoon.station_m, platoon.length_m
        barrier = x[ahead] - length[ahead] - x - phi * v - self.standstill_gap_m
        same_road = (v[ahead] - v + kappa * barrier - margin) / phi
        highest = np.where(ahead >= 0, np.minimum(highest, same_road), highest)
        if len(v) > 1:
            highest[1:] = np.minimum(highest[1:], self._merge_limit_mps2(platoon, rules)[1:])
        lowest = np.full(len(v), -motion.comfort_mps2)
        return Limits(lowest, np.maximum(highest, lowest))

    def _merge_limit_mps2(self, platoon: Platoon, rules: Rules) -> FloatArray:
        """The highest acceleration that the barrier to the one before it on the other road allows.

        phi grows from 0 at the zone's start to its full value at the nose. What grows with the
        square of the time while u is held, ``1.5 phi' v u t^2 + phi' u^2 t^3 / 2``, adds to m.
        """
        road, motion = rules.road, rules.motion
        kappa, up = self.barrier_rate_ps, motion.speed_up_mps2
        x, v, length = platoon.virtual_m, platoon.virtual_mps, platoon.length_m
        scale = np.where(
            platoon.stage == MAINLINE, 1.0, road.mainline_speed_mps / road.ramp_speed_mps
        )
        share = np.clip(1.0 + x / -road.mainline_start_m, 0.05, 1.0)
        slope = np.where(share < 1.0, self.headway_s / -road.mainline_start_m, 0.0)
        phi = self.headway_s * share
        margin = 0.5 * (motion.comfort_mps2 * np.roll(scale, 1) + up * scale) * self.period_s
        margin += 1.5 * slope * v * up * scale * self.period_s
        margin += 0.5 * slope * (up * scale * self.period_s) ** 2
        gap = np.roll(x - length, 1) - x
        barrier = gap - phi * v - self.standstill_gap_m
        allowed = (np.roll(v, 1) - v - slope * v * v + kappa * barrier - margin) / phi / scale
        other_road = platoon.same_lane != np.arange(len(x)) - 1
        return np.where(other_road, allowed, np.inf)

    def _solved(self, excess_mps: FloatArray, reference: FloatArray, limits: Limits) -> FloatArray:
        weights = np.diag([1.0, self.relaxation_weight])
        rows = np.array([[0.0, -1.0, 1.0], [1.0, 0.0, 0.0]])
        bounds = np.zeros(3)
        result = np.empty(len(reference))
        for k, (excess, wanted) in enumerate(zip(excess_mps, reference, strict=True)):
            rows[0, 0] = -2.0 * excess
            bounds[0] = self.speed_rate_ps * excess * excess
            bounds[1] = -limits.highest_mps2[k]
            bounds[2] = limits.lowest_mps2[k] - SLACK_MPS2
            result[k] = quadprog.solve_qp(weights, np.array([wanted, 0.0]), rows, bounds)[0][0]
        return np.clip(result, limits.lowest_mps2, limits.highest_mps2)
