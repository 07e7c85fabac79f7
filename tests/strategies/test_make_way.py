"""The rung make way, by hand: vehicles 8 m apart at 20 m/s, of which one may change lanes.

The subject passes the nose at 16 m/s at 10 s. Free movement has it merge at 12 s at 36 m, at an
intercept of -204 m: where the conflict vehicle C is. The gaps of 3 m are too small for it: it needs
5 m and twice 0.858 m.
"""

import math

import numpy as np
import pytest

from coramp.road.rules import packed
from coramp.strategies.mainline_priority import plan_with_mainline_priority
from coramp.strategies.make_way import make_way
from coramp.strategies.ramp_priority import plan_with_ramp_priority
from coramp.strategies.situation import (
    RUNG_CREATE,
    RUNG_FREE,
    RUNG_MAKE_WAY,
    assess,
    conflict_position,
)
from coramp.vehicles import trace as t
from coramp.vehicles.fleet import empty_proposal
from tests.mathematics import RULES, close, fleet_of, pieces

STREAM, UNDECIDED = -math.inf, math.inf
LANES = RULES._replace(road=RULES.road._replace(lanes=2))
R, X, C, Y = range(4)
APART_M = 0.04000012 + 0.1
"""Eq. 1 of two vehicles at 20 m/s, and the allowance."""
PLANNERS = (plan_with_mainline_priority, plan_with_ramp_priority)


def ramp(station_m=-160.0):
    """A ramp vehicle that would stop at -10 m."""
    way_m = -10.0 - station_m
    return pieces(0.0, station_m, 16.0, [(16.0, (way_m - 51.2) / 16.0), (0.0, 6.4)]), UNDECIDED


def cruise(intercept_m):
    return pieces(0.0, intercept_m, 20.0), STREAM


def traffic(*further_in_m, subject=None, conflict=None, changes_s=math.inf, front_m=-196.0):
    """R, X, C, Y and one behind it on the outer lane; others further in."""
    outer = [ramp() if subject is None else subject, cruise(front_m)]
    outer += [cruise(-204.0) if conflict is None else conflict]
    outer += [cruise(-212.0), cruise(-220.0), cruise(-228.0)]
    everyone = [*outer, *map(cruise, further_in_m)]
    changes = np.full(len(everyone), math.inf)
    changes[C] = changes_s
    lanes = [0] * len(outer) + [1] * len(further_in_m)
    return fleet_of(*everyone, lanes=lanes, changes_s=changes)


def plan(planner, fleet, rules=LANES):
    found, proposal, _, _ = planner(fleet, R, 0.0, 20.0, packed(rules))
    return found, proposal


def tried(proposal):
    """What was tried by the rung make way."""
    count = int(proposal.trace[0, t.COUNT])
    return [row for row in proposal.trace[1 : count + 1] if row[t.RUNG] == RUNG_MAKE_WAY]


@pytest.mark.parametrize("planner", PLANNERS)
def test_the_conflict_vehicle_changes_lanes_and_the_subject_keeps_its_free_movement(planner):
    found, proposal = plan(planner, traffic())
    assert found.rung == RUNG_MAKE_WAY
    assert (found.merge_time_s, found.merge_station_m) == (close(12.0), close(36.0))
    assert (found.conflict_row, found.front_row, found.rear_row) == (C, X, Y)
    assert found.gap_m == close(11.0)
    assert math.isnan(found.severity_after)
    assert proposal.rows[: proposal.size[0]].tolist() == [R, C]
    assert proposal.lane_change_s[:2].tolist() == [math.inf, 0.1]
    assert proposal.pieces[1, : proposal.piece_count[1]] == close(pieces(0.1, -202.0, 20.0))
    chosen = proposal.trace[int(proposal.trace[0, t.CURRENT])]
    assert (chosen[t.REASON], chosen[t.MOVED]) == (t.CHOSEN, C)


@pytest.mark.parametrize("planner", PLANNERS)
def test_on_one_lane_nobody_makes_way(planner):
    found, _ = plan(planner, traffic(), RULES)
    assert found.rung == RUNG_CREATE


@pytest.mark.parametrize("ahead", [True, False])
@pytest.mark.parametrize(("more_m", "rung"), [(1e-6, RUNG_MAKE_WAY), (-1e-6, RUNG_CREATE)])
def test_it_changes_only_where_both_gaps_further_in_are_long_enough(ahead, more_m, rung):
    away_m = 5.0 + APART_M + more_m
    other_m = -204.0 + (away_m if ahead else -away_m)
    found, proposal = plan(plan_with_mainline_priority, traffic(other_m))
    assert found.rung == rung
    if rung == RUNG_CREATE:
        refused = tried(proposal)
        assert [row[t.REASON] for row in refused] == [t.TOO_NEAR, t.NO_GAP_FURTHER_IN]
        assert (refused[0][t.MOVED], refused[0][t.OTHER]) == (C, 6)
        assert refused[0][t.MISSING] == pytest.approx(-more_m, abs=1e-9)


def test_who_is_slower_than_the_next_lane_goes_back_to_its_speed_at_once():
    # C falls back 14 m by 8 s; who follows further in has 8 m to spare, of which 1.53 m are lost
    slow = pieces(0.0, -190.0, 18.0, [(18.0, 6.0), (20.0, 2.0)]), STREAM
    fleet = traffic(-203.14, conflict=slow, front_m=-176.0)
    found, proposal = plan(plan_with_mainline_priority, fleet)
    assert found.rung == RUNG_MAKE_WAY
    way = proposal.pieces[1, : proposal.piece_count[1]]
    assert way[:, 2:] == close(np.array([[18.0, 1.5], [20.0, 0.0]]))
    assert proposal.lane_change_s[1] == 0.1
    assert [row[t.REASON] for row in tried(proposal)] == [t.TOO_NEAR, t.CHOSEN]


def test_who_has_somebody_beside_it_moves_to_a_gap_and_changes_as_late_as_it_can():
    # who is 3 m behind C further in needs 5.14 m: C moves ahead 4 m, towards X 11 m away
    found, proposal = plan(plan_with_mainline_priority, traffic(-207.0, front_m=-188.0))
    assert found.rung == RUNG_MAKE_WAY
    assert (found.merge_time_s, found.largest_shift_m) == (close(12.0), 4.0)
    assert proposal.lane_change_s[1] == close(10.0 - 4.5)
    way = proposal.pieces[1, : proposal.piece_count[1]]
    assert way[-1, 1] - 20.0 * way[-1, 0] == close(-200.0)
    assert way[-1, 0] == close(5.5)
    assert [row[t.REASON] for row in tried(proposal)] == [t.TOO_NEAR, t.CHOSEN]


def test_who_is_gone_before_the_nose_is_reached_is_in_nobodys_way():
    found, proposal = plan(plan_with_mainline_priority, traffic(changes_s=-0.5))
    assert found.rung == RUNG_FREE
    assert proposal.size[0] == 1


@pytest.mark.parametrize(
    ("fleet", "rules", "reason"),
    [
        (
            traffic(subject=ramp(-90.0), conflict=cruise(-116.5), changes_s=2.0),
            LANES,
            "LEAVES_LANE",
        ),
        (traffic(conflict=(cruise(-204.0)[0], 8.0)), LANES, "NOT_ON_MAINLINE"),
        (traffic(subject=ramp(-70.0), conflict=cruise(-91.5)), LANES, "CHANGE_TOO_LATE"),
        (
            traffic(),
            LANES._replace(road=LANES.road._replace(mainline_start_m=-209.5)),
            "HOLDS_UP_FURTHER_IN",
        ),
    ],
)
def test_why_a_vehicle_cannot_make_way(fleet, rules, reason):
    proposal = empty_proposal()
    situation = assess(fleet, R, 0.0, 20.0, rules)
    conflict = conflict_position(fleet, situation, rules)
    assert situation.order[conflict] == C
    assert make_way(fleet, proposal, situation, conflict, False, rules).gap == -1
    assert tried(proposal)[0][t.REASON] == getattr(t, reason)


def test_a_vehicle_that_changes_lanes_is_not_moved_aside():
    from coramp.strategies.proposals import propose_shift

    proposal = empty_proposal()
    t.open_attempt(proposal.trace, RUNG_CREATE, 1, -1, -1)
    fleet = traffic(changes_s=0.5)
    assert not propose_shift(fleet, proposal, C, 0.1, 0.1, 12.0, 1.0, LANES)
    assert proposal.trace[1, t.REASON] == t.LEAVES_LANE
    assert propose_shift(fleet, proposal, Y, 0.1, 0.1, 12.0, 1.0, LANES)
