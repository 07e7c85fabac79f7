"""What a vehicle keeps on board, whatever it is told: driven here in plain Python."""

import math

import numpy as np
import pytest
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st

from coramp.mixed.laws import FollowingLaw, OnBoardLaws, SafetyLaw
from coramp.mixed.on_board import (
    Ahead,
    asks_for_room,
    distance_speed_mps,
    driven_mps2,
    may_change_lane,
    neighbours_of,
)
from coramp.mixed.users import onwards, soon
from coramp.worlds.sumo.mixed_setup import LANE_END_M
from tests.mathematics import close
from tests.mixed.roads import GAPS, ON_BOARD, ROAD, SAFETY, at_once, users_of

OURS = SafetyLaw()
PIECE_S = 0.05
PERIODS_S = [0.1, 0.2, 0.3, 0.5]
leader_accel = st.floats(-OURS.braking_mps2, 2.5)
speeds = st.floats(0.0, 25.0)
brakes = st.sampled_from([4.0, 5.0, 6.0])


class Leader:
    """Drives as it likes, braking at most at b; evenly or, as SUMO's drivers do, in Euler steps."""

    def __init__(self, station_m, speed_mps, euler):
        self.station_m, self.speed_mps, self.euler = station_m, speed_mps, euler

    def drive(self, accel_mps2, for_s):
        new_mps = max(0.0, self.speed_mps + accel_mps2 * for_s)
        if self.euler:
            self.station_m += new_mps * for_s
        elif new_mps > 0.0 or accel_mps2 >= 0.0:
            self.station_m += 0.5 * (self.speed_mps + new_mps) * for_s
        else:
            self.station_m += self.speed_mps**2 / (2.0 * -accel_mps2)
        self.speed_mps = new_mps


def stops_in_m(speed_mps, braking_mps2):
    return speed_mps**2 / (2.0 * braking_mps2)


def accel_of(own, leaders, braking_mps2, told_mps2, period_s, *, changes):
    """What the vehicle does behind leaders; with two, the first is in its own lane."""
    lane = not changes
    rows = [(*own, lane, True, 5.0, braking_mps2)]
    rows += [(x.station_m, x.speed_mps, lane or k > 0, False) for k, x in enumerate(leaders)]
    users = users_of(rows)
    changing = np.zeros(len(rows), np.bool_)
    changing[0] = changes
    told = np.full(len(rows), told_mps2)
    law = OURS._replace(lane_end_m=1e6, reaction_s=max(OURS.reaction_s, period_s))
    around = neighbours_of(users)
    laws = OnBoardLaws(GAPS, FollowingLaw(), law, ROAD, period_s)
    return driven_mps2(users, around, at_once(users), told, changing, laws)[0]


def smallest_gap_m(own_mps, braking_mps2, leaders, motions, told_mps2, period_s):
    """Drives on, and returns the smallest gap to any leader that there was."""
    own_m, smallest_m = 0.0, math.inf
    pieces = round(period_s / PIECE_S)
    for accels_mps2 in motions:
        changes = len(leaders) > 1
        accel = accel_of(
            (own_m, own_mps), leaders, braking_mps2, told_mps2, period_s, changes=changes
        )
        assert accel >= -OURS.hardest_mps2
        for _ in range(pieces):
            for leader, leader_mps2 in zip(leaders, accels_mps2, strict=True):
                leader.drive(leader_mps2, PIECE_S)
            new_mps = max(0.0, own_mps + accel * PIECE_S)
            own_m += 0.5 * (own_mps + new_mps) * PIECE_S
            own_mps = new_mps
            smallest_m = min(smallest_m, *(x.station_m - 5.0 - own_m for x in leaders))
    return smallest_m


def leader_at_distance(own_mps, braking_mps2, leader_mps, more_m, euler):
    """Returns a leader that is just as far ahead as the law asks, and ``more_m`` more."""
    needs_m = stops_in_m(own_mps, braking_mps2) - stops_in_m(leader_mps, OURS.braking_mps2)
    gap_m = OURS.margin_m + max(0.0, needs_m) + more_m
    return Leader(gap_m + 5.0, leader_mps, euler)


@settings(max_examples=150, deadline=None)
@given(
    speeds,
    brakes,
    speeds,
    st.floats(0.0, 30.0),
    st.booleans(),
    st.lists(leader_accel, min_size=1, max_size=60),
    st.sampled_from([-1.0, 0.0, math.inf]),
    st.sampled_from(PERIODS_S),
)
@example(20.0, 6.0, 20.0, 0.0, True, [-6.0] * 40, math.inf, 0.3)
@example(25.0, 4.0, 5.0, 0.0, True, [-6.0] * 60, math.inf, 0.3)
def test_who_keeps_the_distance_never_touches_a_leader_that_brakes_at_most_at_b(
    own_mps, braking_mps2, leader_mps, more_m, euler, motion, told_mps2, period_s
):
    leader = leader_at_distance(own_mps, braking_mps2, leader_mps, more_m, euler)
    motions = [(accel,) for accel in motion] + [(-OURS.braking_mps2,)] * 40
    found_m = smallest_gap_m(own_mps, braking_mps2, [leader], motions, told_mps2, period_s)
    assert found_m > 0.0


@settings(max_examples=100, deadline=None)
@given(
    speeds,
    brakes,
    st.tuples(speeds, speeds),
    st.tuples(st.floats(0.0, 30.0), st.floats(0.0, 30.0)),
    st.booleans(),
    st.lists(st.tuples(leader_accel, leader_accel), min_size=1, max_size=40),
    st.sampled_from(PERIODS_S),
)
@example(20.0, 6.0, (20.0, 20.0), (10.0, 0.0), True, [(0.0, -6.0)] * 20, 0.3)
def test_who_changes_lanes_keeps_the_distance_in_both(
    own_mps, braking_mps2, leaders_mps, more_m, euler, motion, period_s
):
    leaders = [
        leader_at_distance(own_mps, braking_mps2, mps, more, euler)
        for mps, more in zip(leaders_mps, more_m, strict=True)
    ]
    motions = [*motion, *[(-OURS.braking_mps2,) * 2] * 40]
    assert smallest_gap_m(own_mps, braking_mps2, leaders, motions, math.inf, period_s) > 0.0


@settings(max_examples=100, deadline=None)
@given(
    st.floats(-300.0, 190.0),
    st.floats(0.0, 20.0),
    st.sampled_from([0.1, 0.2, 0.5]),
    st.floats(-2.0, 5.0),
)
def test_who_does_not_merge_stands_before_the_lane_ends(station_m, speed_mps, period_s, told_mps2):
    left_m = SAFETY.lane_end_m - station_m
    assume(speed_mps <= math.sqrt(2.0 * SAFETY.stop_mps2 * left_m))
    assume(speed_mps <= ROAD.ramp_limit_mps or station_m >= 0.0)
    largest_mps2 = 0.0
    for _ in range(round(120.0 / period_s)):
        users = users_of([(station_m, speed_mps, False, True)])
        told, changes = np.array([max(told_mps2, 0.0)]), np.zeros(1, np.bool_)
        laws = ON_BOARD._replace(period_s=period_s)
        around, ahead = neighbours_of(users), at_once(users)
        accel = driven_mps2(users, around, ahead, told, changes, laws)[0]
        new_mps = speed_mps + accel * period_s
        assert new_mps >= -1e-9
        station_m += 0.5 * (speed_mps + new_mps) * period_s
        largest_mps2 = max(largest_mps2, -accel)
        speed_mps = new_mps
    # each period begins a little late: 2 a t^2, of the LANE_END_M that are left
    assert station_m < SAFETY.lane_end_m + 2.0 * SAFETY.stop_mps2 * period_s**2 + 1e-6
    assert 2.0 * OURS.stop_mps2 * 0.5**2 < LANE_END_M
    assert largest_mps2 < SAFETY.hardest_mps2


def test_the_largest_speed_that_keeps_the_distance():
    """By hand: after 0.3 s at (20 + v')/2, v'^2/12 is left of 20 m - 1 m + 16^2/12 = 40.333 m.

    v'^2/12 + 0.15 v' = 37.333, so v' = 6 (sqrt(0.15^2 + 37.333/3) - 0.15) = 20.285.
    """
    found = distance_speed_mps(20.0, 20.0, 16.0, 6.0, SAFETY)
    assert found == pytest.approx(20.285, abs=1e-3)
    assert (20.0 + found) / 2.0 * 0.3 + found**2 / 12.0 == close(20.0 - 1.0 + 256.0 / 12.0)
    assert distance_speed_mps(1.0, 0.0, 0.0, 6.0, SAFETY) == 0.0
    assert distance_speed_mps(3.9, 20.0, 0.0, 6.0, SAFETY) == 0.0
    # 4 m, both stand: v'^2/12 + 0.15 v' = 3, so v' = 6 (sqrt(0.0225 + 1) - 0.15) = 5.16712
    assert distance_speed_mps(4.0, 0.0, 0.0, 6.0, SAFETY) == pytest.approx(5.16712, abs=1e-5)


def may_change(users, slowest_mps=None, laws=ON_BOARD):
    """Whether the first vehicle may change lanes; it may slow down until it is there."""
    if slowest_mps is None:
        slowest_mps = users.speed_mps[0]
    around, ahead = neighbours_of(users), at_once(users)
    return may_change_lane(users, 0, around, ahead, slowest_mps, laws)


def test_a_driver_behind_need_not_brake_harder_than_in_comfort():
    """By hand: at 20 behind 14 m/s he keeps 2.5 + 20 and brakes over (400 - 196)/9 = 22.667 m.

    That is 45.167 m, less 1.5 m: 43.667 m to the tail, 48.667 m to the front bumper.
    """

    def may(rear_m, slowest_mps):
        users = users_of([(100.0, 14.0, False, True), (rear_m, 20.0, True, False)])
        return may_change(users, slowest_mps)

    assert may(100.0 - 5.0 - 43.68, 14.0)
    assert not may(100.0 - 5.0 - 43.65, 14.0)
    # if it slows down to 13 m/s meanwhile, (400 - 169) / 9 = 25.667 m: 3 m more
    assert may(100.0 - 5.0 - 46.68, 13.0)
    assert not may(100.0 - 5.0 - 46.65, 13.0)


def test_towards_the_lanes_end_a_driver_behind_is_left_less():
    """By hand: at 98.5 of 197 m, a quarter of 4 m less than the 43.667 m of above; at 197 m, 4 m.

    At the end both drive at 6 m/s: 2.5 + 6 - 1.5 - 4 = 3 m.
    """
    laws = ON_BOARD._replace(safety=SAFETY._replace(relax_at_end_m=4.0))

    def may(own_m, own_mps, gap_m, rear_mps):
        rear_m = own_m - 5.0 - gap_m
        users = users_of([(own_m, own_mps, False, True), (rear_m, rear_mps, True, False)])
        return may_change(users, laws=laws)

    assert may(98.5, 14.0, 42.68, 20.0)
    assert not may(98.5, 14.0, 42.65, 20.0)
    assert may(197.0, 6.0, 3.01, 6.0)
    assert not may(197.0, 6.0, 2.99, 6.0)


def test_a_driver_behind_is_left_what_drivers_keep_on_average_and_at_the_end_the_least():
    """By hand, both at 20 m/s: 2.5 + 20 T - 1.5 m, with T = 1.2 s early, 1.2 - 0.3 / 4 s half-way.

    That is 25 m, 23.5 m at 98.5 of 197 m, and with T = 0.9 s 19 m at the end.
    """
    laws = ON_BOARD._replace(gaps=GAPS._replace(of_driver_s=1.2, least_of_driver_s=0.9))

    def may(own_m, gap_m):
        rear_m = own_m - 5.0 - gap_m
        users = users_of([(own_m, 20.0, False, True), (rear_m, 20.0, True, False)])
        return may_change(users, 20.0, laws=laws)

    assert may(1.0, 25.01)
    assert not may(1.0, 24.99)
    assert may(98.5, 23.51)
    assert not may(98.5, 23.49)
    assert may(197.0, 19.01)
    assert not may(197.0, 18.99)


def test_who_is_faster_than_the_driver_ahead_asks_nobody_for_room():
    """SUMO would keep that driver from speeding up; an automated vehicle ahead is not SUMO's."""

    def asks(own, *others):
        users = users_of([own, *others])
        return asks_for_room(users, neighbours_of(users).front).tolist()

    behind, ahead = (30.0, 25.0, True, False), (70.0, 15.0, True, False)
    assert asks((50.0, 15.1, False, True), ahead, behind) == [False, False, False]
    assert asks((50.0, 15.0, False, True), ahead, behind) == [True, False, False]
    assert asks((50.0, 15.1, False, True), behind) == [True, False]
    assert asks((50.0, 15.1, False, True), (70.0, 15.0, True, True), behind) == [True, False, False]
    assert asks((50.0, 15.0, False, False), ahead) == [False, False]
    assert asks((50.0, 15.0, True, True), ahead) == [False, False]


def test_a_driver_who_moves_is_left_his_standstill_gap_at_least():
    """At 8 m/s before one at 4.5 m/s the rest asks for less than 2.5 m: 0 m and even below."""

    def may(gap_m, rear_mps):
        rear_m = 190.0 - 5.0 - gap_m
        users = users_of([(190.0, 8.0, False, True), (rear_m, rear_mps, True, False)])
        return may_change(users)

    assert may(2.51, 4.5)
    assert not may(2.49, 4.5)
    assert may(0.6, 0.0)


def test_one_that_stands_merges_ahead_of_one_that_stands_for_it():
    """By courtesy a vehicle may have come as near as its margin: both would wait for ever."""

    def may(gap_m, rear_mps=0.0):
        rear_m = 197.0 - 5.0 - gap_m
        return may_change(users_of([(197.0, 0.0, False, True), (rear_m, rear_mps, True, True)]))

    assert may(1.1)
    assert not may(0.4)
    assert not may(1.1, rear_mps=8.0)


def test_a_share_of_the_leaders_acceleration_is_taken_over():
    """By hand: 10 m behind at 20 m/s he keeps 2 + 0.5 * 20 = 12 m, 0.5 (10 - 12) = -1 m/s2.

    Half of the leader's -2 m/s2 is one more. A command that acts after 0.4 s finds the leader
    0.5 * 1 * 0.4^2 = 0.08 m further back and 0.4 m/s slower: 0.04 + 0.4 m/s2 less.
    """

    def driven(accel_mps2, delay_s=0.0):
        rows = [(100.0, 20.0, True, True, 5.0, 6.0, accel_mps2), (85.0, 20.0, True, True)]
        users = users_of(rows)
        ahead = Ahead(np.full(2, 20.0 * delay_s), users.speed_mps, delay_s)
        free, none = np.full(2, np.inf), np.zeros(2, np.bool_)
        laws = ON_BOARD._replace(safety=SAFETY._replace(margin_m=-100.0))
        return driven_mps2(users, neighbours_of(users), ahead, free, none, laws)[1]

    assert driven(0.0) == pytest.approx(-1.0)
    assert driven(-2.0) == pytest.approx(-2.0)
    assert driven(-2.0, delay_s=0.4) == pytest.approx(-2.44)


def test_a_string_of_vehicles_damps_every_wave():
    """Driven in plain Python: twelve vehicles behind one that swings by 1 m/s, at 0.5 s.

    2 k_v T + k_g T^2 >= 2 (1 - k_a); without k_a the waves would grow.
    """

    def grown(law, period_s):
        swing, step_s = 2.0 * math.pi / period_s, 0.02
        speeds, gaps = np.full(12, 20.0), np.full(12, 12.0)
        swings = np.zeros(12)
        for step in range(round(600.0 / step_s)):
            time_s = step * step_s
            lead_mps = 20.0 + math.sin(swing * time_s)
            lead_mps2 = swing * math.cos(swing * time_s)
            before, accels = np.append(lead_mps, speeds[:-1]), np.zeros(12)
            accel = lead_mps2
            for i in range(12):
                error_m = gaps[i] - 2.0 - 0.5 * speeds[i]
                accel = (
                    law.gap_gain_ps2 * error_m
                    + law.speed_gain_ps * (before[i] - speeds[i])
                    + law.feed_forward * accel
                )
                accels[i] = accel
            gaps += (before - speeds) * step_s
            speeds += accels * step_s
            if time_s > 300.0:
                swings = np.maximum(swings, np.abs(speeds - 20.0))
        return swings[-1]

    law = FollowingLaw()
    margin = (
        2.0 * law.speed_gain_ps * 0.5 + law.gap_gain_ps2 * 0.25 - 2.0 * (1.0 - law.feed_forward)
    )
    assert margin > 0.0
    for period_s in (10.0, 20.0, 60.0):
        assert grown(law, period_s) <= 1.02
    assert grown(law._replace(feed_forward=0.0), 20.0) > 1.2


def test_vehicles_go_on_accelerating_for_half_a_second():
    """By hand: from 10 m/s with 2 m/s2, 5.25 m in 0.5 s and 11 m/s from then on."""
    way_m, speed_mps = onwards(np.array([10.0, 10.0, 0.5]), np.array([2.0, 2.0, -4.0]), 1.0)
    assert way_m.tolist() == pytest.approx([10.75, 10.75, 0.125])
    assert speed_mps.tolist() == pytest.approx([11.0, 11.0, 0.0])
    way_m, _ = onwards(np.array([10.0]), np.array([2.0]), np.array([0.3]))
    assert way_m.tolist() == pytest.approx([3.09])
    users = users_of([(-50.0, 10.0, False, True, 5.0, 6.0, 2.0)])
    assert soon(users, 1.0).station_m.tolist() == pytest.approx([-39.25])
    assert soon(users, 0.0) is users


def test_no_lane_change_too_near_to_the_vehicle_in_front_or_an_automated_one_behind():
    def may(*others):
        users = users_of([(100.0, 18.0, False, True), *others])
        return may_change(users)

    assert may()
    assert may((140.0, 18.0, True, False), (60.0, 18.0, True, True))
    assert not may((106.0, 18.0, True, False))
    assert not may((130.0, 3.0, True, False))
    assert not may((94.0, 18.0, True, True))
    assert not may((70.0, 25.0, True, True))


def test_nobody_changes_lanes_before_the_nose_or_from_the_mainline():
    for row in [(0.5, 16.0, False, True), (-20.0, 16.0, False, True), (50.0, 16.0, True, True)]:
        users = users_of([row])
        assert not may_change(users)


def test_drivers_are_given_nothing_to_do():
    users = users_of([(100.0, 20.0, True, False), (94.0, 20.0, True, False)])
    told, changes = np.full(2, -3.0), np.zeros(2, np.bool_)
    accel = driven_mps2(users, neighbours_of(users), at_once(users), told, changes, ON_BOARD)
    assert accel.tolist() == [0.0, 0.0]


def test_who_is_ahead_and_who_is_beside():
    users = users_of(
        [
            (50.0, 20.0, True, True),
            (10.0, 16.0, False, True),
            (-30.0, 20.0, True, False),
            (30.0, 16.0, False, False),
        ]
    )
    around = neighbours_of(users)
    assert around.leader.tolist() == [-1, 3, 0, -1]
    assert around.front.tolist() == [-1, 0, -1, 0]
    assert around.rear.tolist() == [-1, 2, -1, 2]


def accels_of(rows, told_mps2, changes=None):
    """Returns the acceleration of each vehicle; ``changes`` is the one that changes lanes."""
    users = users_of(rows)
    changing = np.arange(len(rows)) == (-1 if changes is None else changes)
    told = np.full(len(rows), told_mps2)
    around = neighbours_of(users)
    return driven_mps2(users, around, at_once(users), told, changing, ON_BOARD)


@pytest.mark.parametrize(
    "rows",
    [
        [(0.0, 15.0, True, True)],
        [(80.0, 15.0, True, False), (60.0, 16.0, True, True)],
        [(80.0, 5.0, True, False), (55.0, 16.0, True, True)],
        [(120.0, 12.0, False, True)],
    ],
)
def test_what_is_told_lowers_the_acceleration_and_never_raises_it(rows):
    alone = accels_of(rows, math.inf)[-1]
    assert accels_of(rows, alone + 1.0)[-1] == alone
    assert accels_of(rows, alone - 0.5)[-1] == close(alone - 0.5)


def test_who_is_behind_a_lane_change_brakes_with_it():
    """One at 10 m/s comes in 12 m ahead of an automated one at 16 m/s, 7 m from its rear."""
    rows = [(60.0, 10.0, False, True), (48.0, 16.0, True, True)]
    assert accels_of(rows, math.inf)[1] > 0.0
    assert accels_of(rows, math.inf, changes=0)[1] < -2.0
