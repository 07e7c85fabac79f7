"""Several lanes: who is around whom, and that making way is safe on both lanes."""

import math

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from coramp.mixed.lanes import (
    GAIN_MPS2,
    HELD_MPS2,
    Lanes,
    decided_in_lanes,
    making_way,
    neighbours_in_lanes,
    on_endless_lanes,
)
from coramp.mixed.on_board import driven_mps2, neighbours_of
from coramp.networks.limits import Limits
from coramp.worlds.sumo.road_limits import NO_LIMITS, RAMP_WAY, allowed_mps, road_limits_of
from tests.mixed.roads import ON_BOARD, SAFETY, at_once, users_of

B_MPS2 = SAFETY.braking_mps2
STEP_S = 0.05
stations = st.floats(-300.0, 300.0)
speeds = st.floats(0.0, 20.0)


def users_in(rows):
    """Users from rows of lane, station (m), speed (m/s), automated; and their lanes."""
    lane = np.array([row[0] for row in rows], np.int64)
    return users_of([(at_m, v, lane >= 0, cav) for lane, at_m, v, cav in rows]), lane


def in_lanes(lane, tail=None):
    """Lanes of which nobody can change to the next, with nobody's rear on the ramp by default."""
    none = np.zeros(len(lane), np.bool_)
    return Lanes(lane, none, none if tail is None else np.array(tail, np.bool_))


def chosen_among(rows, told_mps2=-1.0, laws=ON_BOARD):
    """Which of the automated vehicles of lane 0 make way, all of them told to slow down."""
    users, lane = users_in(rows)
    around, ahead = neighbours_in_lanes(users, in_lanes(lane)), at_once(users)
    held = users.automated & (lane == 0)
    told = np.where(held, told_mps2, np.inf)
    return making_way(users, around, ahead, held, told, on_endless_lanes(laws)).tolist()


@settings(max_examples=200, deadline=None)
@given(st.lists(st.tuples(st.integers(-1, 3), stations, speeds, st.booleans()), max_size=12))
def test_each_lane_has_its_order_and_each_vehicle_its_neighbours_further_in(rows):
    rows = list({row[1]: row for row in rows}.values())
    users, lane = users_in(rows)
    around = neighbours_in_lanes(users, in_lanes(lane))
    for own, (number, at_m, *_) in enumerate(rows):
        of = {
            n: sorted((x, k) for k, (m, x, *_) in enumerate(rows) if m == n and k != own)
            for n in (number, number + 1)
        }
        ahead = [k for x, k in of[number] if x > at_m]
        before = [k for x, k in of[number + 1] if x > at_m]
        behind = [k for x, k in of[number + 1] if x < at_m]
        assert around.leader[own] == (ahead[0] if ahead else -1)
        assert around.front[own] == (before[0] if before else -1)
        assert around.rear[own] == (behind[-1] if behind else -1)


@settings(max_examples=100, deadline=None)
@given(st.lists(st.tuples(st.integers(-1, 0), stations, speeds, st.booleans()), max_size=10))
def test_on_one_lane_neighbours_are_those_of_the_one_lane_law(rows):
    rows = list({row[1]: row for row in rows}.values())
    users, lane = users_in(rows)
    found, known = neighbours_in_lanes(users, in_lanes(lane)), neighbours_of(users)
    ramp = lane < 0
    assert found.leader.tolist() == known.leader.tolist()
    assert found.front[ramp].tolist() == known.front[ramp].tolist()
    assert found.rear[ramp].tolist() == known.rear[ramp].tolist()


@pytest.mark.parametrize("rear_m", [-7.0, -9.0, -60.0])
def test_who_changed_lanes_at_the_nose_is_followed_while_its_rear_is_on_the_ramp(rear_m):
    """One stands 2 m behind the nose in lane 0, its rear 3 m before it; one comes along the ramp.

    Nobody stands in its way on the ramp's lane itself.
    """
    users, lane = users_in([(0, 2.0, 0.0, False), (-1, rear_m, 2.0, True)])
    free, wishes = np.full(2, np.inf), np.zeros(2, np.bool_)

    def accel_mps2(tail):
        laws = ON_BOARD, on_endless_lanes(ON_BOARD)
        lanes = in_lanes(lane, tail)
        return decided_in_lanes(users, lanes, at_once(users), free, wishes, *laws)[1][1]

    assert neighbours_in_lanes(users, in_lanes(lane, [True, False])).leader.tolist() == [-1, 0]
    assert accel_mps2([False, False]) > 0.0
    stands_before_m = -3.0 - rear_m
    if stands_before_m < 10.0:
        assert accel_mps2([True, False]) < -0.5 * 2.0**2 / (2.0 * stands_before_m)
    else:
        assert accel_mps2([True, False]) > 0.0


def test_a_driver_behind_further_in_is_left_what_he_comes_nearer_until_the_change_is_over():
    """At 15.5 m/s he keeps 2.5 m + 15.5 m, less 1.5 m; one at 6 m/s has 5.8 m/s a period later.

    (15.5^2 - 5.8^2) / 9 = 22.96 m, and 9.7 m/s times 0.2 s: 41.40 m.
    """

    def rows(gap_m):
        return [(0, 0.0, 6.0, True), (1, -5.0 - gap_m, 15.5, False)]

    assert chosen_among(rows(41.38)) == []
    assert chosen_among(rows(41.42)) == [0]


def stops_within_m(speed_mps):
    return speed_mps**2 / (2.0 * B_MPS2)


def least_gap_m(front, rear, cav):
    """The smallest gap while ``front`` brakes at b to a stand, and ``rear`` by the law or at b."""
    (front_m, front_mps), (rear_m, rear_mps) = front, rear
    least_m = math.inf
    for k in range(round(12.0 / STEP_S)):
        if k % 4 == 0:
            if cav:
                users, lane = users_in(
                    [(1, rear_m, rear_mps, True), (1, front_m, front_mps, False)]
                )
                none = np.zeros(2, np.bool_)
                around = neighbours_in_lanes(users, in_lanes(lane))
                free = np.full(2, np.inf)
                rear_mps2 = driven_mps2(users, around, at_once(users), free, none, ON_BOARD)[0]
            else:
                rear_mps2 = -B_MPS2
        for_s = STEP_S
        front_m += max(0.0, front_mps * for_s - 0.5 * B_MPS2 * for_s**2)
        front_mps = max(0.0, front_mps - B_MPS2 * for_s)
        new_mps = max(0.0, rear_mps + rear_mps2 * for_s)
        rear_m += 0.5 * (rear_mps + new_mps) * for_s
        rear_mps = new_mps
        least_m = min(least_m, front_m - 5.0 - rear_m)
    return least_m


@settings(max_examples=150, deadline=None)
@given(
    st.lists(st.tuples(st.integers(0, 1), stations, speeds, st.booleans()), min_size=2, max_size=8),
)
@example([(0, 0.0, 20.0, True), (1, 40.0, 20.0, False), (1, -40.0, 20.0, False)])
@example([(0, 0.0, 20.0, True), (1, 30.0, 20.0, True), (1, -30.0, 20.0, True)])
def test_who_makes_way_can_stop_behind_its_new_leader_and_its_follower_behind_it(rows):
    rows = list({row[1]: row for row in rows}.values())
    users, lane = users_in(rows)
    around = neighbours_in_lanes(users, in_lanes(lane))
    for own in chosen_among(rows):
        _, own_m, own_mps, _ = rows[own]
        front, rear = around.front[own], around.rear[own]
        if front >= 0:
            there = rows[front][1], rows[front][2]
            assert least_gap_m(there, (own_m, own_mps), cav=True) > 0.0
        if rear >= 0:
            there = rows[rear][1], rows[rear][2]
            assert least_gap_m((own_m, own_mps), there, cav=rows[rear][3]) > 0.0


def test_a_driver_behind_is_left_what_he_keeps_and_comfortable_braking():
    def goes(gap_m, rear_mps=20.0):
        return chosen_among([(0, 100.0, 20.0, True), (1, 95.0 - gap_m, rear_mps, False)]) == [0]

    # 2.5 m + 1.0 s at 20 m/s, less 1.5 m; it slows down by 0.2 m/s until it is there
    braking_m = (20.0**2 - 19.8**2) / 9.0
    needs_m = 2.5 + 20.0 - 1.5 + braking_m + (20.0 - 19.8) * ON_BOARD.period_s
    assert goes(needs_m + 0.01)
    assert not goes(needs_m - 0.01)
    assert not goes(needs_m + 0.01, rear_mps=22.0)
    assert goes(60.0, rear_mps=22.0)


def test_near_the_end_of_the_acceleration_lane_nobody_gets_less():
    relaxed = ON_BOARD._replace(safety=SAFETY._replace(relax_at_end_m=4.0))
    for gap_m, goes in ((21.0, False), (22.0, True)):
        for at_m in (-190.0, 0.0, 190.0):
            rows = [(0, at_m, 20.0, True), (1, at_m - 5.0 - gap_m, 20.0, False)]
            assert chosen_among(rows, laws=relaxed) == ([0] if goes else [])


@pytest.mark.parametrize(("told_mps2", "goes"), [(HELD_MPS2, True), (HELD_MPS2 + 0.01, False)])
def test_only_who_is_told_to_slow_down_makes_way(told_mps2, goes):
    assert chosen_among([(0, 0.0, 20.0, True)], told_mps2) == ([0] if goes else [])


def test_nobody_makes_way_who_would_have_to_brake_as_much_further_in():
    def goes(inner_mps, gap_m, told_mps2):
        rows = [(0, 0.0, 20.0, True), (1, gap_m + 5.0, inner_mps, True)]
        return chosen_among(rows, told_mps2) == [0]

    # behind one as fast, a_f = 0.5 (gap - 2 - 0.5 v)
    assert goes(20.0, 12.0, -GAIN_MPS2)
    assert not goes(20.0, 11.6, -GAIN_MPS2)
    assert goes(20.0, 11.6, -GAIN_MPS2 - 0.21)
    assert not goes(14.0, 12.0, -2.0)


def test_two_do_not_change_into_one_gap_at_once():
    pair = [(0, 0.0, 20.0, True), (0, -40.0, 20.0, True)]
    assert chosen_among(pair) == [0]
    apart = [*pair, (1, -20.0, 20.0, True)]
    assert chosen_among(apart) == [0, 1]


def test_limits_as_arrays_allow_what_they_allow():
    limits = Limits((-300.0, -50.0, 0.0, 50.0), (20.0, 10.0, 12.5, 8.33))
    stations_m = [-1e3, -300.0, -200.3, -60.0, -50.0, -1e-9, 0.0, 17.7, 49.9, 50.0, 1e6]
    expected = [limits.allowed_mps(at_m) for at_m in stations_m]
    arrays = road_limits_of([[Limits((-9.0,), (1.0,)), limits]])
    assert [allowed_mps(arrays, 0, RAMP_WAY, at_m) for at_m in stations_m] == expected
    assert allowed_mps(NO_LIMITS, 0, RAMP_WAY, 3.0) == np.inf
