"""The order of merging as a mixed-integer linear program over a rolling horizon.

Source: the formulation with big-M disjunctions that merging shares with single-machine scheduling,
as in M. Karimi et al., Transp. Res. C 115, 2020, and the rolling horizon of DCMC, Sustainability
17:7952, 2025. Solved by HiGHS.
"""

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from coramp._kernel import FloatArray
from coramp.strategies.base import Decision, Memory, View
from coramp.strategies.parameters import parameter
from coramp.strategies.sequence import Crossings, decide_in_sequence

SPARE_S = (0.0, 1e-5, 2e-5, 5e-5, 1e-4)
"""HiGHS now and then refuses its own optimum, which lies just at its tolerance; then all gaps are
asked to be larger by the next of these."""


@dataclass(frozen=True)
class MilpSequence:
    """The order with the least ``sum(t - t_min)`` of the vehicles in the horizon.

    With h_ij what j must leave after i, and y_ij = 1 if i crosses first:
    ``t_j - t_i >= h_ij - M (1 - y_ij)``, ``t_i - t_j >= h_ji - M y_ij`` for a lane vehicle i and a
    ramp vehicle j; within a stream the order is kept. The horizon holds the subject, the ramp
    vehicles behind it that come within ``horizon_s``, or h if that is longer, and the lane vehicles
    that cross from so long before the subject to so long after the last of them.
    """

    name: ClassVar[str] = "milp-sequence"
    summary: ClassVar[str] = "the order of merging by a mixed-integer program, rolling horizon"
    cooperative: ClassVar[bool] = True

    same_stream_s: float = parameter(0.0, 0.0, 10.0, meaning="smallest headway h within a stream")
    cross_stream_s: float = parameter(0.0, 0.0, 10.0, meaning="smallest headway h between streams")
    horizon_s: float = parameter(
        4.0, 0.5, 20.0, meaning="time around the subject that is put in order"
    )
    ramp_vehicles: int = parameter(4, 1, 12, meaning="most ramp vehicles in one problem")

    def decide(self, view: View, memory: Memory) -> Decision:
        """Returns the decision for the first subject, in its place of the best order."""
        return decide_in_sequence(self.vehicles_before, view, memory)

    def vehicles_before(self, seen: Crossings) -> int:
        """Returns how many lane vehicles cross before the subject in the best order."""
        first, horizon = self.within_horizon(seen)
        lane_s, ramp_s = self.crossing_times_s(horizon)
        return first + int((lane_s < ramp_s[0]).sum())

    def within_horizon(self, seen: Crossings) -> tuple[int, Crossings]:
        """Returns how many lane vehicles go before the horizon, and who is in it."""
        reach_s = max(self.horizon_s, self.same_stream_s, self.cross_stream_s)
        near = seen.ramp_s <= seen.ramp_s[0] + reach_s
        ramps = min(int(near.sum()), self.ramp_vehicles)
        first = int((seen.mainline_s < seen.ramp_s[0] - reach_s).sum())
        last = int((seen.mainline_s <= seen.ramp_s[ramps - 1] + reach_s).sum())
        return first, Crossings(
            seen.mainline_s[first:last],
            seen.ramp_s[:ramps],
            seen.mainline_next_s[first:last],
            seen.ramp_next_s[:ramps],
        )

    def crossing_times_s(self, seen: Crossings) -> tuple[FloatArray, FloatArray]:
        """Returns the best crossings (s) of lane and ramp vehicles."""
        lanes, ramps = len(seen.mainline_s), len(seen.ramp_s)
        if lanes + ramps == 1:
            return seen.mainline_s, seen.ramp_s
        earliest_s = np.concatenate([seen.mainline_s, seen.ramp_s])
        next_s = np.concatenate([seen.mainline_next_s, seen.ramp_next_s])
        origin_s = float(earliest_s.min())
        longest_s = float(earliest_s.max() - origin_s + np.sum(next_s)) + (lanes + ramps) * max(
            self.same_stream_s, self.cross_stream_s
        )
        for spare_s in SPARE_S:
            program = self._constraints(lanes, ramps, next_s + spare_s, 2.0 * longest_s)
            crossing_s = _solution(earliest_s - origin_s, lanes * ramps, longest_s, *program)
            if crossing_s is not None:
                return crossing_s[:lanes] + origin_s, crossing_s[lanes:] + origin_s
        raise ValueError("the program for the order of merging has no solution")

    def _constraints(
        self, lanes: int, ramps: int, next_s: FloatArray, big_m: float
    ) -> tuple[FloatArray, FloatArray]:
        """The rows and lower bounds of the program."""
        same = np.maximum(next_s, self.same_stream_s)
        cross = np.maximum(next_s, self.cross_stream_s)
        times = lanes + ramps
        rows, bounds = [], []

        def ask(later: int, earlier: int, gap_s: float, binary: int, share: float) -> None:
            row = np.zeros(times + lanes * ramps)
            row[later], row[earlier] = 1.0, -1.0
            if binary >= 0:
                row[times + binary] = share
            rows.append(row)
            bounds.append(gap_s)

        for k in range(times - 1):
            if k != lanes - 1:
                ask(k + 1, k, float(same[k]), -1, 0.0)
        for i in range(lanes):
            for j in range(ramps):
                binary, ramp = i * ramps + j, lanes + j
                ask(ramp, i, float(cross[i]) - big_m, binary, -big_m)
                ask(i, ramp, float(cross[ramp]), binary, big_m)
        return np.array(rows), np.array(bounds)


def _solution(
    earliest_s: FloatArray, choices: int, longest_s: float, rows: FloatArray, least: FloatArray
) -> FloatArray | None:
    import scipy.optimize as untyped_optimize  # takes 0.3 s, and no other strategy needs it

    optimize: Any = untyped_optimize
    times = len(earliest_s)
    found = optimize.milp(
        np.concatenate([np.ones(times), np.zeros(choices)]),
        integrality=np.concatenate([np.zeros(times), np.ones(choices)]),
        bounds=optimize.Bounds(
            np.concatenate([earliest_s, np.zeros(choices)]),
            np.concatenate([np.full(times, longest_s), np.ones(choices)]),
        ),
        constraints=optimize.LinearConstraint(rows, least, np.inf),
        options={"mip_rel_gap": 0.0},
    )
    return None if found.x is None else np.asarray(found.x[:times])
