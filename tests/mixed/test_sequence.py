"""Everybody's place in the order of passing, and the room that is made for it."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from coramp.mixed.courtesy import courtesy_mps2
from coramp.mixed.on_board import neighbours_of
from coramp.mixed.sequence import sequence_of, virtual_station
from coramp.mixed.situation import MixedSituation
from coramp.mixed.users import gap_for_m, gap_m
from coramp.strategies.mixed_slots import MixedSlots
from tests.mathematics import close
from tests.mixed.roads import COURTESY, FOLLOWING, GAPS, ROAD, SEQUENCE, users_of

NEW = -2


@st.composite
def some_users(draw):
    """Any number of vehicles anywhere, standing ones and all of one kind included."""
    count = draw(st.integers(0, 14))
    kind = draw(st.sampled_from([None, "ramp", "mainline", "standing"]))
    rows = []
    for _ in range(count):
        mainline = kind == "mainline" or (kind != "ramp" and draw(st.booleans()))
        station_m = draw(st.floats(-800.0, 400.0 if mainline else 199.0))
        speed_mps = 0.0 if kind == "standing" and mainline else draw(st.floats(0.0, 25.0))
        rows.append((station_m, speed_mps, mainline, draw(st.booleans()), draw(lengths)))
    return users_of([(*row, 6.0) for row in rows])


lengths = st.sampled_from([4.0, 5.0, 16.5])


def copied(users):
    return users._make(column.copy() for column in users)


@settings(max_examples=200, deadline=None)
@given(some_users(), st.data())
def test_the_order_holds_everybody_once_and_each_stream_in_its_order(users, data):
    numbers = [NEW, -1, *users.number.tolist()]
    chosen = [data.draw(st.sampled_from(numbers)) for _ in users.number]
    before = np.array(chosen, np.int64)
    kept, kept_before = copied(users), before.copy()
    order, behind = sequence_of(users, before, COURTESY)
    assert sorted(order.place.tolist()) == list(range(len(users.number)))
    assert np.isfinite(order.station_m).all()
    assert np.isfinite(order.merge_in_s).all()
    for mainline in (False, True):
        own = [k for k in order.place.tolist() if users.on_mainline[k] == mainline]
        stations_m = users.station_m[own]
        assert (np.diff(stations_m) <= 0.0).all()
    for k, (place, virtual) in enumerate(zip(order.place, order.virtual, strict=True)):
        assert virtual == (not users.on_mainline[place])
        if virtual:
            ahead = order.place[:k]
            assert behind[place] in (-1, *users.number[ahead])
            assert (behind[place] == -1) == (k == 0) or len(ahead) > 0
    assert set(behind[users.on_mainline].tolist()) <= {-1}
    for column, was in zip(users, kept, strict=True):
        assert np.array_equal(column, was)
    assert np.array_equal(before, kept_before)


@settings(max_examples=100, deadline=None)
@given(some_users(), st.sampled_from(["least-cost", "mainline-first", "ramp-first"]))
def test_the_strategy_answers_any_situation_and_twice_the_same(users, order):
    situation = MixedSituation(10.0, 0.2, users, neighbours_of(users), GAPS, ROAD)
    kept = copied(users)
    strategy = MixedSlots(order=order)
    first, second = strategy.steer(situation, ()), strategy.steer(situation, ())
    assert np.array_equal(first.most_mps2, second.most_mps2)
    assert first.places == second.places
    assert not np.isnan(first.most_mps2).any()
    assert np.isinf(first.most_mps2[~users.automated]).all()
    assert not first.may_merge[users.on_mainline | ~users.automated].any()
    assert {number for number, _ in first.places} == set(users.number[~users.on_mainline].tolist())
    again = strategy.steer(situation, first.places)
    assert len(again.places) == len(first.places)
    for column, was in zip(users, kept, strict=True):
        assert np.array_equal(column, was)


def test_the_virtual_station_of_a_ramp_vehicle():
    """By hand: at 16 m/s and -80 m it is at the nose in 5 s, and from there to 20 m/s in 2 s.

    A vehicle at 20 m/s would come 100 m in 5 s: 20 m are lost, and 4^2/(2 x 2) = 4 m more.
    """
    station_m, merge_in_s = virtual_station(-80.0, 16.0, 20.0, FOLLOWING, ROAD)
    assert station_m == close(-104.0)
    assert merge_in_s == close(7.0)


def test_the_virtual_station_of_one_that_speeds_up_before_the_nose():
    """By hand: from 11 to 16 m/s at 2.5 m/s2 takes 2 s and 27 m; of -75 m that leaves 3 s."""
    station_m, merge_in_s = virtual_station(-75.0, 11.0, 16.0, FOLLOWING, ROAD)
    assert station_m == close(-75.0 - (16.0 * 5.0 - 75.0))
    assert merge_in_s == close(5.0)
    # 10 m are not enough: v = sqrt(121 + 50) = 13.0767 m/s after 2.0767 / 2.5 = 0.83067 s
    station_m, merge_in_s = virtual_station(-10.0, 11.0, 13.0, FOLLOWING, ROAD)
    nose_s = (math.sqrt(171.0) - 11.0) / 2.5
    assert merge_in_s == close(nose_s)
    assert station_m == close(-10.0 - (13.0 * nose_s - 10.0))


def test_the_virtual_station_on_the_acceleration_lane_and_in_a_slower_lane():
    """By hand: at 50 m with 16 m/s it loses 4^2/(2 x 2) = 4 m; in a lane at 10 m/s nothing."""
    assert virtual_station(50.0, 16.0, 20.0, FOLLOWING, ROAD) == (close(46.0), close(2.0))
    assert virtual_station(50.0, 16.0, 10.0, FOLLOWING, ROAD) == (close(50.0), 0.0)


def test_which_gap_is_kept_behind_and_left_for_whom():
    """By hand, at 20 m/s."""
    assert gap_m(True, True, 20.0, GAPS) == close(12.0)
    assert gap_m(True, False, 20.0, GAPS) == close(18.5)
    assert gap_m(False, True, 20.0, GAPS) == gap_m(False, False, 20.0, GAPS) == close(22.5)
    assert gap_for_m(True, True, 20.0, GAPS) == close(12.0)
    assert gap_for_m(True, False, 20.0, GAPS) == close(28.5)
    assert gap_for_m(False, False, 20.0, GAPS) == gap_for_m(False, True, 20.0, GAPS) == close(22.5)


def ordered(rows, before=NEW, law=SEQUENCE):
    users = users_of(rows)
    known = np.full(len(rows), before)
    return users, *sequence_of(users, known, COURTESY._replace(sequence=law))


def test_the_place_that_costs_least():
    """By hand: R at 16 m/s and -80 m stands for -104 m, with all of the lane at 20 m/s.

    Between A at -90 m and B at -116 m R keeps 12 m behind A's tail at -95 m: at -107 m, 3 m back,
    and its tail is at -112 m. B keeps 12 m and stands at -116 m: 8 m to fall back, 11 m in all.
    Before A it would stay at -104 m and A fall back from -90 m to -121 m: 31 m and more.
    Behind B R would fall back to -116 - 5 - 12 = -133 m: 29 m.
    """
    rows = [(-90.0, 20.0, True, True), (-116.0, 20.0, True, True), (-80.0, 16.0, False, True)]
    users, order, behind = ordered(rows)
    assert order.place.tolist() == [0, 2, 1]
    assert order.station_m[1] == close(-104.0)
    assert behind[2] == users.number[0]


@pytest.mark.parametrize(("automated", "place"), [(True, [0, 2, 1]), (False, [0, 1, 2])])
def test_a_driver_falls_back_less_readily(automated, place):
    """By hand: for A at -87 m and B at -116 m, R keeps 12 m to A's tail at -92 m: at -104 m.

    Its tail is at -109 m. An automated B keeps 12 m: it falls back 5 m; a driver 22.5 m, 15.5 m,
    and twice that counts: 31 m. Behind a driver B R keeps 18.5 m and falls back 35.5 m, which by
    half of its own weight is 17.75 m.
    """
    law = SEQUENCE._replace(own_weight=0.5)
    rows = [
        (-87.0, 20.0, True, True),
        (-116.0, 20.0, True, automated),
        (-80.0, 16.0, False, True),
    ]
    assert ordered(rows, law=law)[1].place.tolist() == place


def test_a_place_that_it_has_costs_less():
    """By hand: with one vehicle B at -100 m, behind it R falls back by 13 m, to -117 m.

    Before it R stays at -104 m, and B falls back to -121 m, 21 m. Of 10 m the place is worth more.
    """
    rows = [(-100.0, 20.0, True, True), (-80.0, 16.0, False, True)]
    assert ordered(rows)[1].place.tolist() == [0, 1]
    wide = SEQUENCE._replace(hysteresis_m=10.0)
    assert ordered(rows, before=-1, law=wide)[1].place.tolist() == [1, 0]
    assert ordered(rows, before=100, law=wide)[1].place.tolist() == [0, 1]


def room(rows, period_s=0.2):
    users, order, _ = ordered(rows)
    leaders = neighbours_of(users).leader
    return courtesy_mps2(users, order, leaders, COURTESY._replace(period_s=period_s))


def test_how_hard_one_brakes_for_a_vehicle_that_is_to_merge():
    """By hand: R stands for 46 m, its tail for 41 m; B at 25 m keeps 12 m: 4 m is left over.

    That is 0.1 x 4 + 0.5 (16 - 20) = -1.6 m/s2 behind R, which merges in 2 s at 16 m/s now.
    """
    rows = [(25.0, 20.0, True, True), (50.0, 16.0, False, True)]
    assert room(rows).tolist() == [close(-1.6), math.inf]


def test_courtesy_has_its_limits():
    """By hand: B at 35 m is 6 m short, -0.6 - 2 = -2.6 m/s2: not harder than 2 m/s2.

    R at -80 m stands for -104 m and merges in 7 s, more than 4 s: B at -110 m, 11 m short, brakes
    by half of 2 m/s2 instead of 1.1. R at -20 m stands for -29 m and merges in 3.25 s: B at -30 m,
    16 m short, brakes by 1.6.
    """
    assert room([(35.0, 20.0, True, True), (50.0, 16.0, False, True)])[0] == close(-2.0)
    assert room([(-110.0, 20.0, True, True), (-80.0, 16.0, False, True)])[0] == close(-1.0)
    assert room([(-30.0, 20.0, True, True), (-20.0, 16.0, False, True)])[0] == close(-1.6)


def test_a_driver_who_merges_gets_more_room():
    """By hand: a driver R needs 2.5 + 1.3 x 20 = 28.5 m behind his tail at 41 m: 12.5 m are left.

    For B at 0 m that is 0.1 x 12.5 - 2 = -0.75 m/s2; an automated R needs 12 m: 2.9 - 2 = 0.9.
    """
    assert room([(0.0, 20.0, True, True), (50.0, 16.0, False, False)])[0] == close(-0.75)
    assert room([(0.0, 20.0, True, True), (50.0, 16.0, False, True)])[0] == close(0.9)


def test_a_driver_is_asked_for_nothing():
    assert np.isinf(room([(35.0, 20.0, True, False), (50.0, 16.0, False, True)])[0])


@pytest.mark.parametrize(("at_m", "speed_mps"), [(192.0, 0.0), (191.6, 1.0), (195.0, 0.0)])
def test_who_is_beside_one_that_stands_does_not_wait_for_it_to_merge_ahead(at_m, speed_mps):
    """R stands at the lane's end, its tail at 192 m: nobody there could fall in behind it."""
    stands = (197.0, 0.0, False, True)
    assert math.isinf(room([(at_m, speed_mps, True, True), stands])[0])
    assert room([(190.0, speed_mps, True, True), stands])[0] <= 0.0  # 2 m behind it: it waits
    moves, faster = (197.0, 1.0, False, True), (191.6, 4.0, True, True)
    assert np.isfinite(room([(191.6, speed_mps, True, True), moves])[0])
    assert np.isfinite(room([faster, stands])[0])


def test_nobody_slows_below_a_share_of_the_lanes_speed():
    """By hand: the lane's mean is 20 m/s, six tenths are 12; B brakes to 12 in a period, no more.

    R loses 10^2/4 = 25 m and stands for 25 m; B at 14 m would brake by 0.2 + 1 m/s2.
    """
    rows = [(65.0, 27.98, True, False), (14.0, 12.02, True, True), (50.0, 10.0, False, True)]
    assert room(rows)[1] == pytest.approx((12.0 - 12.02) / 0.2, abs=1e-9)
    slower = [(65.0, 28.0, True, False), (14.0, 11.0, True, True), (50.0, 9.0, False, True)]
    assert room(slower)[1] < -0.5  # R is slow, at less than 0.6 of 16 m/s: down to 3 m/s
