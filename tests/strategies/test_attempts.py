"""Every reason why an attempt fails has a situation in which it is what the trace says."""

import math
from functools import cache

import numpy as np
import pytest

from coramp.coordination.coordinator import Coordinator
from coramp.demand.arrivals import arrivals_of
from coramp.messages.feed import RequestFeed
from coramp.road.rules import packed
from coramp.scenarios.loading import load_scenario
from coramp.strategies.attempts import CHOSEN, REASONS, Attempt, Tried, joined, tried_of
from coramp.strategies.ladder import held
from coramp.strategies.mainline_priority import plan_with_mainline_priority
from coramp.strategies.proposals import propose_shift
from coramp.strategies.registry import strategy_named
from coramp.strategies.rungs import merge_at
from coramp.strategies.situation import RUNG_FREE, RUNG_HOLD, assess
from coramp.strategies.slot_onto_lane import plan_onto_lane
from coramp.strategies.unequal_ladder import rung_free, subject_of
from coramp.vehicles import trace as t
from coramp.vehicles.fleet import empty_proposal, pair_margin_m
from tests.mathematics import RULES, close, fleet_of, pieces

STREAM = -math.inf
TIME_GAP = {"safety.time_gap_s": 1.4}
TRUCKS = {"vehicle": [{"name": "car", "share": 0.6}, {"name": "truck", "share": 0.4}]}
EASY = {"strategy.fifo-optimal-control.merge_station_m": 10.0}


@cache
def _decided(strategy, mainline, ramp, settings, until_s=90.0):
    overrides = {"mainline.flow_veh_h": float(mainline), "ramp.flow_veh_h": float(ramp)}
    scenario = load_scenario("paper", {**overrides, **dict(SETTINGS[settings])})
    loop = Coordinator(
        strategy_named(strategy)(**scenario.strategy.get(strategy, {})),
        scenario.rules(),
        RequestFeed(arrivals_of(scenario, 1)),
        scenario.fastest_mainline_entry_mps,
    )
    loop.expect_arrivals()
    loop.run(round(until_s / scenario.control.step_s))
    return loop.decisions


SETTINGS = {
    "plain": {},
    "time gap": TIME_GAP,
    "front": {"control.gap_position": "front"},
    "trucks": TRUCKS,
    "easy": EASY,
}
IN_TRAFFIC = {
    t.GAP_TOO_SMALL: ("mainline-priority", 1200, 400, "time gap"),
    t.AHEAD_OF_REACH: ("mainline-priority", 1200, 400, "plain"),
    t.BEHIND_REACH: ("mainline-priority", 1200, 400, "time gap"),
    t.HOLDS_UP_NEWCOMER: ("mainline-priority", 1200, 400, "time gap"),
    t.FRONT_OUT_OF_REACH: ("mainline-priority", 1800, 700, "front"),
    t.SHIFT_TOO_FAR: ("mainline-priority", 1200, 400, "time gap"),
    t.SHIFT_TOO_FAST: ("mainline-priority", 1200, 400, "time gap"),
    t.SHIFT_TOO_HARD: ("mainline-priority", 2400, 1000, "time gap"),
    t.TOO_NEAR: ("mainline-priority", 1200, 400, "plain"),
    t.NO_LATE_WAY: ("mainline-priority", 1200, 400, "time gap"),
    t.FOLLOWERS_CANNOT_BRAKE: ("ramp-priority", 3600, 1500, "time gap"),
    t.CANNOT_FALL_BACK: ("mainline-priority", 1800, 700, "trucks"),
    t.MOVES_MORE: ("ramp-priority", 1800, 700, "plain"),
    t.NO_EASY_WAY: ("fifo-optimal-control", 1800, 700, "easy"),
    t.CANNOT_FOLLOW: ("mainline-priority", 1800, 700, "trucks"),
}
OF_A_VEHICLE = {
    t.SHIFT_TOO_FAR,
    t.SHIFT_TOO_FAST,
    t.SHIFT_TOO_HARD,
    t.TOO_NEAR,
    t.FOLLOWERS_CANNOT_BRAKE,
    t.CANNOT_FOLLOW,
}
BY_A_DISTANCE = {
    t.GAP_TOO_SMALL,
    t.AHEAD_OF_REACH,
    t.BEHIND_REACH,
    t.HOLDS_UP_NEWCOMER,
    t.FRONT_OUT_OF_REACH,
    t.TOO_NEAR,
}
ELSEWHERE = {
    t.CHOSEN,
    t.PAST_LAST_STATION,
    t.BEFORE_THE_NOSE,
    t.TOO_MANY_MOVE,
    t.TOO_LATE,
    t.LEADER_WAITS,
    t.LEAVES_LANE,
    t.NOT_ON_MAINLINE,
    t.CHANGE_TOO_LATE,
    t.HOLDS_UP_FURTHER_IN,
    t.NO_GAP_FURTHER_IN,
}


def test_every_reason_has_a_test():
    assert set(IN_TRAFFIC) | ELSEWHERE == set(REASONS)
    assert len(set(REASONS.values())) == len(REASONS)


@pytest.mark.parametrize("code", IN_TRAFFIC, ids=[REASONS[code] for code in IN_TRAFFIC])
def test_a_reason_is_recorded_with_who_and_by_how_much(code):
    attempts = [
        attempt
        for decision in _decided(*IN_TRAFFIC[code])
        for attempt in decision.explanation.tried
        if attempt.reason == REASONS[code]
    ]
    assert attempts
    if code in OF_A_VEHICLE:
        assert all(attempt.other_row >= 0 for attempt in attempts)
    if code in BY_A_DISTANCE:
        assert all(attempt.missing_m > 0.0 for attempt in attempts)


@pytest.mark.parametrize(
    "case",
    [
        *((name, 1800, 700, "plain") for name in ("slots", "game", "dp-sequence")),
        *((f"{name}-priority", 1800, 700, "time gap") for name in ("mainline", "ramp")),
        *((f"{name}-priority", 1800, 700, "trucks") for name in ("mainline", "ramp")),
    ],
)
def test_just_the_attempt_that_is_carried_out_is_chosen(case):
    decisions = _decided(*case)
    assert decisions
    for decision in decisions:
        why = decision.explanation
        chosen = [attempt for attempt in why.tried if attempt.reason == CHOSEN]
        assert len(why.tried) > 0
        assert len(chosen) == (why.rung != "hold")
        for attempt in chosen:
            told = (attempt.rung, attempt.scenario, attempt.front_row, attempt.rear_row)
            assert told == (why.rung, why.scenario, why.front_row, why.rear_row)
            assert attempt.merge_time_s == why.merge_time_s
            assert attempt.merge_station_m == why.merge_station_m
            assert attempt.accel_mps2 == why.accel_mps2


# a ramp vehicle 160 m before the nose, which merges at 36 m, 12 s from now
RAMP = (pieces(0.0, -160.0, 16.0), math.inf)
FREE_MERGE_S, FREE_MERGE_M = 12.0, 36.0


def _beside_m(station_m):
    """Where a mainline vehicle is now that is at a station when the ramp vehicle merges."""
    return station_m - 20.0 * FREE_MERGE_S


def _planned(*others):
    fleet = fleet_of(RAMP, *others)
    return fleet, *plan_with_mainline_priority(fleet, 0, 0.0, 20.0, packed(RULES))


def test_what_is_missing_to_a_vehicle_too_near_is_its_margin():
    other = (pieces(0.0, _beside_m(38.0), 20.0), STREAM)  # 2 m ahead of the front: they overlap
    fleet, _, proposal, _, _ = _planned(other)
    first = tried_of(proposal)[0]
    assert (first.rung, first.reason) == ("free", REASONS[t.TOO_NEAR])
    assert (first.other_row, first.moved_row) == (1, -1)
    assert first.merge_time_s == close(FREE_MERGE_S)
    way = np.array(
        [[0.1, -158.4, 16.0, 0.0], [10.0, 0.0, 16.0, 2.0], [12.0, FREE_MERGE_M, 20.0, 0.0]]
    )
    margin_m = pair_margin_m(
        way, fleet.traits[0], 12.0, other[0], fleet.traits[1], STREAM, 0.1, RULES
    )
    assert first.missing_m == close(RULES.safety.execution_allowance_m - margin_m)


def test_what_is_missing_to_a_gap_is_its_size():
    # 10 m from bumper to bumper less 5: the gap of 5 m takes 5 m and twice the clearance
    front, rear = ((pieces(0.0, _beside_m(s), 20.0), STREAM) for s in (42.0, 32.0))
    _, plan, proposal, _, _ = _planned(front, rear)
    first_gap = next(
        attempt
        for attempt in tried_of(proposal)
        if (attempt.rung, attempt.front_row, attempt.rear_row) == ("reach", 1, 2)
    )
    assert first_gap.reason == REASONS[t.GAP_TOO_SMALL]
    assert first_gap.missing_m == close(plan.required_gap_m - 5.0)


def test_a_merge_past_the_last_merge_station_says_how_far():
    fleet = fleet_of(RAMP)
    situation = assess(fleet, 0, 0.0, 20.0, RULES)
    proposal = empty_proposal()
    t.open_in_gap(proposal.trace, RUNG_FREE, 0, situation.order, 0)
    behind_m = situation.lowest_m - 10.0
    assert merge_at(fleet, proposal, situation, 0, behind_m, False, RULES).gap < 0
    (attempt,) = tried_of(proposal)
    assert attempt.reason == REASONS[t.PAST_LAST_STATION]
    last_m = RULES.road.last_merge_station_m
    assert attempt.missing_m == close(attempt.merge_station_m - last_m)
    assert attempt.missing_m > 0.0


def test_a_merge_before_the_nose_is_told():
    # at the nose after 10.05 s, past 0.5 m after 10.08 s: the step between them is the one at 10 s
    fleet = fleet_of((pieces(0.0, -160.8, 16.0), math.inf))
    short = RULES._replace(road=RULES.road._replace(last_merge_station_m=0.5))
    proposal = empty_proposal()
    subject = subject_of(fleet, 0, 0.0, 20.0, RULES)
    assert not rung_free(fleet, proposal, subject, short).done
    (attempt,) = tried_of(proposal)
    assert attempt.reason == REASONS[t.BEFORE_THE_NOSE]
    assert attempt.missing_m == close(0.8)


def test_more_than_may_change_is_told_of_the_vehicle_that_is_too_many():
    fleet = fleet_of((pieces(0.0, 30.0, 20.0), STREAM), (pieces(0.0, 10.0, 20.0), STREAM))
    proposal = empty_proposal()
    t.open_attempt(proposal.trace, RUNG_FREE, 0, -1, -1)
    proposal.size[0] = len(proposal.rows)
    assert not propose_shift(fleet, proposal, 1, 0.0, 0.0, 6.0, 1.0, RULES)
    (attempt,) = tried_of(proposal)
    assert (attempt.reason, attempt.other_row) == (REASONS[t.TOO_MANY_MOVE], 1)


def test_a_plan_that_waits_for_a_leader_says_so():
    _, plan, proposal, _, _ = _planned()
    assert plan.rung == RUNG_FREE
    why = held(0, plan, proposal)
    assert why.rung == "hold"
    assert [attempt.reason for attempt in why.tried] == [REASONS[t.LEADER_WAITS]]


def test_a_slot_that_is_too_late_says_by_how_far():
    # the one behind the claim merges just now and cannot fall back, and those behind it leave no
    # room for 130 m, more than the 100 m of 5 s
    merge_m = FREE_MERGE_M - 20.0 * (FREE_MERGE_S + 8.75)
    stream = [(pieces(0.0, merge_m + 1.0 - 6.0 * k, 20.0), STREAM if k else 0.2) for k in range(22)]
    fleet = fleet_of((pieces(0.0, -300.0, 16.0), math.inf), *stream)
    claim_s = -(merge_m + 2.0) / 20.0
    plan, proposal, _, _ = plan_onto_lane(fleet, 0, 0.0, claim_s, True, 0.0, packed(RULES))
    tried = tried_of(proposal)
    assert plan.rung == RUNG_HOLD
    assert tried[-1].reason == REASONS[t.TOO_LATE]
    assert tried[-1].missing_m > 0.0


def test_attempts_beyond_the_room_leave_the_first_ones_and_the_last():
    trace = t.empty_trace()
    for k in range(t.ROOM + 10):
        t.open_attempt(trace, 1, 0, k, -1)
    tried = Tried(trace)
    assert len(tried) == t.ROOM - 1
    assert tried.left_out == 11
    assert [tried[0].front_row, tried[-2].front_row, tried[-1].front_row] == [0, 509, 521]


def test_traces_of_plans_made_one_after_the_other_are_one():
    traces = []
    for rows in ((0, 1), (), (2,)):
        trace = t.empty_trace()
        for row in rows:
            t.open_attempt(trace, 2, 1, row, -1)
        t.note_subject(trace, float(len(rows)), 5.0, 1.0)
        traces.append(trace)
    tried = Tried(joined(traces[:2], traces[2]))
    assert [attempt.front_row for attempt in tried] == [0, 1, 2]
    assert {attempt.free_accel_mps2 for attempt in tried} == {1.0}
    last = joined(traces, t.empty_trace())
    t.refuse(last, t.LEADER_WAITS, -1, math.nan)
    assert [a.reason for a in Tried(last)] == [CHOSEN, CHOSEN, REASONS[t.LEADER_WAITS]]


def test_what_was_tried_is_read_only_and_compared_by_content():
    trace = t.empty_trace()
    t.open_attempt(trace, 0, 0, 1, 2)
    one, other = Tried(trace), Tried(trace)
    assert one == other
    assert hash(one) == hash(other)
    t.refuse(trace, t.TOO_NEAR, 2, 1.0)
    assert one[0].reason == CHOSEN
    assert one != Tried(trace)
    assert isinstance(one[0], Attempt)
    assert [a.rear_row for a in one] == [a.rear_row for a in one[:]] == [2]
