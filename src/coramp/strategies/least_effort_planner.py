"""Trajectories of least control effort into a given gap, which sequence strategies share.

Source: J. Rios-Torres, A. A. Malikopoulos, IEEE Trans. Intell. Transp. Syst. 18(4):780-789, 2017.
"""

import math
from dataclasses import dataclass

import numpy as np

from coramp._kernel import FloatArray
from coramp.equations.gap_creation import cascade_shift_m
from coramp.equations.safe_distance import following_clearance_m
from coramp.kinematics.trajectory import (
    MAX_PIECES,
    build,
    station_and_speed,
    superpose,
    time_at_station,
)
from coramp.motion.least_effort import constrained_optimum, held_shift, speeds_mps
from coramp.road.rules import Rules
from coramp.strategies.delays import delay_followers
from coramp.strategies.ladder import plan_of
from coramp.strategies.proposals import find_unsafe_pair
from coramp.strategies.rungs import Merge, unknown_bound_m
from coramp.strategies.situation import (
    RUNG_CREATE,
    RUNG_DELAY,
    RUNG_FREE,
    RUNG_REACH,
    MergePlan,
    Situation,
    conflict_position,
    gap_bounds_m,
)
from coramp.vehicles.fleet import MAX_CHANGED, Fleet, Proposal, committed, empty_proposal
from coramp.vehicles.trace import (
    CANNOT_FALL_BACK,
    HOLDS_UP_NEWCOMER,
    NO_EASY_WAY,
    note_merge,
    note_moves,
    open_in_gap,
    refuse,
)

MOST_PERIODS = MAX_PIECES - 8
"""Pieces of one trajectory; some are left for what was committed before."""
SAME_PLACE_M = 1e-6


@dataclass(frozen=True)
class LeastEffort:
    """Plans a merge into a gap with the least effort of everyone who moves for it.

    The ramp vehicle takes the way of least effort from its decision to ``merge_station_m``, or the
    lane's end if that is nearer, at v0; who is behind it falls back until then, and whoever comes
    too near to that one. Accelerations are held for ``hold_s``.
    """

    merge_station_m: float = 120.0
    hold_s: float = 0.5

    def plan(
        self, fleet: Fleet, situation: Situation, gap: int, rules: Rules
    ) -> tuple[MergePlan | None, Proposal]:
        """Returns the plan for a gap with its trajectories; None where limits or others forbid."""
        proposal = empty_proposal()
        low_m, high_m = gap_bounds_m(fleet, situation, gap)
        target_m = min(high_m, situation.free_m)
        back_m = max(0.0, low_m - target_m)
        rung, scenario = _rung(situation, target_m, back_m)
        open_in_gap(proposal.trace, rung, scenario, situation.order, gap)
        unknown_m = unknown_bound_m(fleet, situation)
        if back_m > 0.0 and (gap == len(situation.order) or target_m < unknown_m):
            refuse(proposal.trace, HOLDS_UP_NEWCOMER, -1, unknown_m - target_m)
            return None, proposal
        merge_m = min(self.merge_station_m, rules.road.last_merge_station_m)
        merge_s = (merge_m - target_m) / rules.road.mainline_speed_mps
        pieces = self.way_to_merge(fleet, situation, merge_s, merge_m, rules)
        if pieces is None:
            refuse(proposal.trace, NO_EASY_WAY, -1, math.nan)
            return None, proposal
        _add(proposal, situation.subject, pieces, merge_s)
        self._note(proposal, pieces, target_m, merge_s, back_m)
        if not self._fall_back(fleet, proposal, situation, gap, back_m, merge_s, rules):
            refuse(proposal.trace, CANNOT_FALL_BACK, -1, math.nan)
            return None, proposal
        if not delay_followers(fleet, proposal, situation.subject, situation.from_s, rules):
            return None, proposal
        if find_unsafe_pair(fleet, proposal, situation.from_s, rules)[0] >= 0:
            return None, proposal
        merge = Merge(gap, float(pieces[:, 3].max()), merge_s, merge_m, back_m)
        conflict = conflict_position(fleet, situation, rules)
        return plan_of(fleet, proposal, situation, merge, rung, scenario, conflict, rules), proposal

    def _note(
        self,
        proposal: Proposal,
        pieces: FloatArray,
        target_m: float,
        merge_s: float,
        back_m: float,
    ) -> None:
        nose_s = time_at_station(pieces, 0.0)
        _, nose_mps = station_and_speed(pieces, nose_s)
        accel_mps2 = float(pieces[:, 3].max())
        merge_m = float(pieces[-1, 1])
        note_merge(proposal.trace, target_m, accel_mps2, merge_s, merge_m, nose_s, nose_mps)
        note_moves(proposal.trace, 0.0, back_m, float(pieces[0, 0]))

    def way_to_merge(
        self, fleet: Fleet, situation: Situation, merge_s: float, merge_m: float, rules: Rules
    ) -> FloatArray | None:
        """Returns the subject's pieces from the decision to its merge, None where limits forbid.

        The ramp's limit holds up to the nose; when that is passed follows from the solution, which
        is found anew until both agree.
        """
        start_m, start_mps = station_and_speed(
            committed(fleet, situation.subject), situation.from_s
        )
        duration_s = merge_s - situation.from_s
        v0, motion = rules.road.mainline_speed_mps, rules.motion
        most_mps2 = min(motion.comfort_mps2, motion.ramp_acceleration_mps2)
        if duration_s <= 2.0 * self.hold_s:
            return None
        periods = min(MOST_PERIODS, math.ceil(duration_s / self.hold_s))
        period_s = duration_s / periods
        on_ramp = 0
        while True:
            limit_mps = np.where(np.arange(periods) < on_ramp, rules.road.ramp_limit_mps, v0)
            limit_mps[-1] = v0
            accel_mps2 = constrained_optimum(
                merge_m - start_m, duration_s, start_mps, v0, most_mps2, limit_mps
            )
            if accel_mps2 is None:
                return None
            pieces = build(
                situation.from_s, start_m, start_mps, [(u, period_s) for u in accel_mps2.tolist()]
            )
            before_nose = int((pieces[:, 1] < 0.0).sum())
            ends_mps = speeds_mps(start_mps, accel_mps2, period_s)[:before_nose]
            if (ends_mps <= rules.road.ramp_limit_mps + SAME_PLACE_M).all():
                pieces[-1, 1:3] = merge_m, v0
                return pieces
            if before_nose <= on_ramp:
                return None
            on_ramp = before_nose

    def _fall_back(
        self,
        fleet: Fleet,
        proposal: Proposal,
        situation: Situation,
        first: int,
        back_m: float,
        merge_s: float,
        rules: Rules,
    ) -> bool:
        shifts = _shifts(fleet, situation, first, back_m, rules)
        if shifts is None:
            return False
        for row, shift_m in shifts:
            pieces = self.way_back(fleet, row, situation.from_s, merge_s, shift_m, rules)
            if pieces is None:
                return False
            _add(proposal, row, pieces, float(fleet.merge_time_s[row]))
        return True

    def way_back(
        self, fleet: Fleet, row: int, from_s: float, until_s: float, back_m: float, rules: Rules
    ) -> FloatArray | None:
        """Returns the pieces of a lane vehicle that falls back by ``back_m``, None if it cannot."""
        start_s = max(from_s, float(fleet.merge_time_s[row]))
        duration_s = until_s - start_s
        if duration_s <= 2.0 * self.hold_s:
            return None
        periods = 2 * max(1, min(MOST_PERIODS // 4, math.ceil(0.5 * duration_s / self.hold_s)))
        extra_mps2 = held_shift(-back_m, duration_s, periods, rules.motion.comfort_mps2)
        if extra_mps2 is None:
            return None
        out = np.empty((MAX_PIECES, 4))
        n = superpose(committed(fleet, row), from_s, start_s, until_s, extra_mps2, out)
        pieces = out[:n]
        slowest = (1.0 - rules.motion.slow_deviation) * rules.road.mainline_speed_mps
        hardest_mps2 = np.abs(pieces[:, 3]).max(initial=0.0)
        if n == 0 or pieces[:, 2].min() < min(slowest, station_and_speed(pieces, from_s)[1]):
            return None
        return pieces if hardest_mps2 <= rules.motion.comfort_mps2 else None


def _shifts(
    fleet: Fleet, situation: Situation, first: int, back_m: float, rules: Rules
) -> list[tuple[int, float]] | None:
    """Returns who has to fall back by how much (m), None where they are more than may change."""
    clearance_m = following_clearance_m(rules.road, rules.safety)
    order, places_m = situation.order, situation.intercepts_m
    shifts: list[tuple[int, float]] = []
    for k in range(first, len(order)):
        if back_m <= SAME_PLACE_M:
            break
        if len(shifts) + 1 >= MAX_CHANGED:  # the subject is one of them
            return None
        row = int(order[k])
        shifts.append((row, back_m))
        if k + 1 < len(order):
            spare_m = places_m[k] - fleet.length_m[row] - places_m[k + 1] - clearance_m
            back_m = cascade_shift_m(back_m, float(spare_m), 0.0, 0.0)
    return shifts


def _rung(situation: Situation, target_m: float, back_m: float) -> tuple[int, int]:
    if back_m > 0.0:
        return RUNG_CREATE, 2
    if target_m < situation.lowest_m:
        return RUNG_DELAY, 0
    return (RUNG_FREE if target_m == situation.free_m else RUNG_REACH), 0


def _add(proposal: Proposal, row: int, pieces: FloatArray, merge_s: float) -> None:
    entry = int(proposal.size[0])
    proposal.rows[entry], proposal.piece_count[entry] = row, len(pieces)
    proposal.pieces[entry, : len(pieces)] = pieces
    proposal.merge_time_s[entry] = merge_s
    proposal.size[0] = entry + 1
