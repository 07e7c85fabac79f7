"""Automated vehicles that follow late: their answer to a step, and distances kept all the same."""

import math

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from coramp.mixed.laws import FollowingLaw, OnBoardLaws, SafetyLaw
from coramp.mixed.on_board import Ahead, driven_mps2, may_change_lane, neighbours_of
from coramp.scenarios.world_sections import Actuators
from coramp.worlds.faults.actuators import SlowActuators
from tests.mixed.roads import GAPS, ROAD, users_of

STEP_S = 0.1
OURS = SafetyLaw()
ONE = np.array([0])
dead_times = st.sampled_from([0.0, 0.1, 0.3, 0.5, 1.0, 2.0])
lags = st.sampled_from([0.0, 0.2, 0.3, 0.5, 0.8, 1.5, 2.0])


def actuators_of(dead_time_s=0.0, lag_s=0.0, most_mps2=math.inf):
    return SlowActuators(Actuators(dead_time_s=dead_time_s, lag_s=lag_s), 1, STEP_S, most_mps2)


def answers(actuators, commands):
    return [float(actuators.driven(ONE, np.array([c]))[0]) for c in commands]


def test_without_delay_a_command_is_driven_at_once():
    actuators = actuators_of()
    assert not actuators.is_slow
    assert answers(actuators, [-3.0, 2.0]) == [-3.0, 2.0]


def test_a_dead_time_moves_a_step_by_itself():
    assert answers(actuators_of(dead_time_s=0.3), [-2.0] * 5) == [0.0, 0.0, 0.0, -2.0, -2.0]


def test_a_dead_time_between_two_steps_is_the_longer_one():
    assert answers(actuators_of(dead_time_s=0.25), [-2.0] * 4) == [0.0, 0.0, 0.0, -2.0]


def test_a_lag_answers_a_step_exponentially():
    found = answers(actuators_of(lag_s=0.5), [-2.0] * 20)
    expected = [-2.0 * (1.0 - math.exp(-0.1 * (k + 1) / 0.5)) for k in range(20)]
    assert found == pytest.approx(expected, abs=1e-12)
    assert found[4] == pytest.approx(-2.0 * (1.0 - math.exp(-1.0)))


def test_dead_time_and_lag_follow_one_another():
    found = answers(actuators_of(dead_time_s=0.2, lag_s=0.5), [-2.0] * 5)
    assert found[:2] == [0.0, 0.0]
    assert found[2] == pytest.approx(-2.0 * (1.0 - math.exp(-0.2)))


def test_nobody_brakes_harder_than_adhesion_allows():
    assert answers(actuators_of(most_mps2=3.4), [-8.0, 2.0]) == [-3.4, 2.0]
    slow = actuators_of(lag_s=0.5, most_mps2=3.4)
    assert min(answers(slow, [-8.0] * 100)) == pytest.approx(-3.4)


def onwards(x_m, v_mps, accel_mps2):
    new_mps = v_mps + accel_mps2 * STEP_S
    return x_m + 0.5 * (v_mps + new_mps) * STEP_S, new_mps


@settings(max_examples=80, deadline=None)
@given(
    dead_times, lags, st.lists(st.floats(-6.0, 2.5), min_size=1, max_size=40), st.floats(3.0, 9.0)
)
def test_the_point_ahead_follows_commands_at_once(dead_time_s, lag_s, commands, most_mps2):
    """It is at x + way with its own speed, and moves evenly with each command: by hand."""
    actuators = actuators_of(dead_time_s, lag_s, most_mps2)
    x_m, v_mps = 0.0, 200.0  # never stands
    for command in commands:
        way_m, speed_mps = (float(a[0]) for a in actuators.predicted(ONE, np.array([v_mps])))
        goal_m, goal_mps = onwards(x_m + way_m, speed_mps, max(command, -most_mps2))
        (accel,) = answers(actuators, [command])
        x_m, v_mps = onwards(x_m, v_mps, accel)
        way_m, speed_mps = (float(a[0]) for a in actuators.predicted(ONE, np.array([v_mps])))
        assert x_m + way_m == pytest.approx(goal_m, abs=1e-6)
        assert speed_mps == pytest.approx(goal_mps, abs=1e-6)


class Slow:
    """A vehicle with slow actuators behind a leader in its lane, in plain Python."""

    def __init__(self, dead_time_s, lag_s, period_s):
        self.actuators = actuators_of(dead_time_s, lag_s)
        self.law = OURS._replace(lane_end_m=1e6, reaction_s=max(OURS.reaction_s, period_s))
        self.steps = round(period_s / STEP_S)
        self.period_s = period_s
        self.x_m, self.v_mps = 0.0, 0.0

    def ahead(self, count):
        way_m, speed_mps = np.zeros(count), np.zeros(count)
        way, speed = self.actuators.predicted(ONE, np.array([self.v_mps]))
        way_m[0], speed_mps[0] = way[0], speed[0]
        return Ahead(way_m, speed_mps, self.actuators.delay_s)

    def commanded(self, leader_m, leader_mps, told_mps2):
        users = users_of([(self.x_m, self.v_mps, True, True), (leader_m, leader_mps, True, False)])
        return driven_mps2(
            users,
            neighbours_of(users),
            self.ahead(2),
            np.full(2, told_mps2),
            np.zeros(2, np.bool_),
            OnBoardLaws(GAPS, FollowingLaw(), self.law, ROAD, self.period_s),
        )[0]

    def step(self, command_mps2):
        (accel,) = answers(self.actuators, [command_mps2])
        new_mps = max(0.0, self.v_mps + accel * STEP_S)
        self.x_m += 0.5 * (self.v_mps + new_mps) * STEP_S
        self.v_mps = new_mps

    def least_gap_m(self, leader_m, leader_mps, motion, told_mps2):
        least_m = math.inf
        for leader_accel in motion:
            command = self.commanded(leader_m, leader_mps, told_mps2)
            for _ in range(self.steps):
                self.step(command)
                leader_mps = max(0.0, leader_mps + leader_accel * STEP_S)
                leader_m += leader_mps * STEP_S  # as SUMO's drivers move
                least_m = min(least_m, leader_m - 5.0 - self.x_m)
        return least_m


def distance_m(own_mps, leader_mps, delay_s):
    """What the law asks for of a vehicle that cruises and acts after its delay."""
    stops_m = (own_mps**2 - leader_mps**2) / (2.0 * OURS.braking_mps2)
    return OURS.margin_m + max(0.0, stops_m) + own_mps * delay_s


@settings(max_examples=200, deadline=None)
@given(
    dead_times,
    lags,
    st.floats(0.0, 25.0),
    st.floats(0.0, 25.0),
    st.floats(0.0, 30.0),
    st.lists(st.floats(-OURS.braking_mps2, 2.5), min_size=1, max_size=60),
    st.sampled_from([-1.0, 0.0, math.inf]),
    st.sampled_from([0.1, 0.2, 0.3]),
)
@example(2.0, 2.0, 20.0, 20.0, 0.0, [-6.0] * 40, math.inf, 0.2)
@example(0.0, 1.0, 20.0, 15.0, 0.0, [-6.0, 2.5] * 30, math.inf, 0.2)
@example(0.5, 0.5, 5.0, 0.0, 1.0, [2.5, 2.5, -6.0, -6.0] * 15, math.inf, 0.2)
def test_the_distance_holds_under_dead_time_and_lag(
    dead_time_s, lag_s, own_mps, leader_mps, more_m, motion, told_mps2, period_s
):
    own = Slow(dead_time_s, lag_s, period_s)
    own.v_mps = own_mps
    gap_m = distance_m(own_mps, leader_mps, own.actuators.delay_s) + own.law.reaction_s * own_mps
    motion = [*motion, *[-OURS.braking_mps2] * 60]
    assert own.least_gap_m(gap_m + 5.0 + more_m, leader_mps, motion, told_mps2) > 0.0


def test_who_did_not_look_ahead_would_touch():
    """The same without the state ahead: what a lag of 1 s costs who does not reckon with it."""
    own = Slow(0.5, 0.5, 0.2)
    own.v_mps = 20.0
    own.ahead = lambda count: Ahead(np.zeros(count), np.array([own.v_mps, 0.0]), 0.0)
    gap_m = distance_m(20.0, 20.0, 0.0) + 6.0
    assert own.least_gap_m(gap_m + 5.0, 20.0, [-6.0] * 60, math.inf) < 0.0


def test_nobody_merges_ahead_of_one_that_could_only_stop_beyond():
    """The one behind is slow and brakes, but with its lag it stops past who merges."""
    rows = [(196.0, 0.0, False, True), (188.5, 4.0, True, True)]
    users = users_of(rows)
    for way_m, allowed in ((0.5, True), (6.0, False)):
        ahead = Ahead(np.array([0.0, way_m]), np.array([0.0, 0.3]), 2.0)
        laws = OnBoardLaws(GAPS, FollowingLaw(), OURS, ROAD, period_s=0.2)
        found = may_change_lane(users, 0, neighbours_of(users), ahead, 0.0, laws)
        assert found is allowed
