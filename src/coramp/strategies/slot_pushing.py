"""Mainline vehicles that fall back behind a ramp vehicle which takes a slot among them.

That is so where the ramp is shorter than the mainline's approach: a ramp vehicle is then known
only after mainline vehicles that cross later than it.
"""

import math

from coramp._kernel import FloatArray, kernel
from coramp.equations.safe_distance import following_clearance_m
from coramp.kinematics.trajectory import SPEED
from coramp.road.rules import Rules
from coramp.strategies.situation import Situation
from coramp.strategies.slot_in_lane import SLOWEST_SHARE, Manner, slow_cruise
from coramp.vehicles.fleet import (
    ROUNDING_M,
    Fleet,
    Proposal,
    committed,
    is_full,
    merge_time_under_s,
    pair_margin_m,
    trajectory_under,
)
from coramp.vehicles.merge_state import is_on_mainline

SETBACKS_M = (0.0, 0.5, 1.0, 2.0, 4.0, 8.0)
"""How far behind its place a vehicle that falls back is tried."""
END_SHARES = (1.0, 0.8, 0.6, 0.45, 0.3, 0.15)
AT_ONCE = Manner(False, 0.0)


@kernel
def fall_back_behind(
    fleet: Fleet, proposal: Proposal, situation: Situation, gap: int, slot_m: float, rules: Rules
) -> bool:
    """Adds those behind the subject on the mainline that would come too near to who is ahead.

    Each takes a slower cruise to its new place behind the one before it, until one has room enough.
    """
    order, intercepts_m = situation.order, situation.intercepts_m
    ahead, ahead_m = situation.subject, slot_m
    clearance_m = situation.clearance_m
    for k in range(gap, len(order)):
        row = order[k]
        limit_m = ahead_m - fleet.length_m[ahead] - clearance_m
        if intercepts_m[k] <= limit_m + ROUNDING_M and keeps_behind(
            fleet, proposal, ahead, row, committed(fleet, row), situation.from_s, rules
        ):
            return True
        ahead_m = fall_back(
            fleet, proposal, ahead, row, min(limit_m, intercepts_m[k]), situation.from_s, rules
        )
        if math.isnan(ahead_m):
            return False
        ahead, clearance_m = row, following_clearance_m(rules.road, rules.safety)
        if not is_on_mainline(fleet.merge_time_s[row], situation.from_s):
            clearance_m = situation.clearance_m
    return True


@kernel
def fall_back(
    fleet: Fleet,
    proposal: Proposal,
    ahead: int,
    row: int,
    place_m: float,
    from_s: float,
    rules: Rules,
) -> float:
    """Adds a mainline vehicle that falls back to an intercept; returns that (m), nan for none."""
    if is_full(proposal) or not is_on_mainline(fleet.merge_time_s[row], from_s):
        return math.nan
    entry, v0 = proposal.size[0], rules.road.mainline_speed_mps
    out, before = proposal.pieces[entry], committed(fleet, row)
    for setback_m in SETBACKS_M:
        latest_s = -(place_m - setback_m) / v0
        for share in END_SHARES:
            end_s = from_s + share * (latest_s - from_s)
            n = slow_cruise(out, before, from_s, end_s, place_m - setback_m, 0.0, AT_ONCE, rules)
            if n == 0 or out[:n, SPEED].min() < SLOWEST_SHARE * v0:
                continue
            if keeps_behind(fleet, proposal, ahead, row, out[:n], from_s, rules):
                proposal.rows[entry], proposal.piece_count[entry] = row, n
                proposal.merge_time_s[entry] = fleet.merge_time_s[row]
                proposal.size[0] = entry + 1
                return place_m - setback_m
    return math.nan


@kernel
def keeps_behind(
    fleet: Fleet,
    proposal: Proposal,
    ahead: int,
    row: int,
    pieces: FloatArray,
    from_s: float,
    rules: Rules,
) -> bool:
    """Returns whether a mainline vehicle on these pieces keeps its distance to the one ahead."""
    margin_m = pair_margin_m(
        trajectory_under(fleet, proposal, ahead),
        fleet.traits[ahead],
        merge_time_under_s(fleet, proposal, ahead),
        pieces,
        fleet.traits[row],
        fleet.merge_time_s[row],
        from_s,
        rules,
    )
    return bool(margin_m >= rules.safety.execution_allowance_m - ROUNDING_M)
