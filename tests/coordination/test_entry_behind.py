"""Entries onto the mainline where vehicles differ: behind a slower one, or not at all."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from coramp.coordination.admission import plan_entry
from coramp.coordination.entry_behind import last_on_mainline
from coramp.road.rules import Traffic
from tests.mathematics import (
    RULES,
    close,
    fleet_of,
    pieces,
    sampled,
    sampled_own_margins,
    sized,
    truck,
)

STREAM, UNDECIDED = -math.inf, math.inf
MIXED = RULES._replace(traffic=Traffic(True, 200.0))
NOBODY = fleet_of((pieces(0.0, 0.0, 20.0), STREAM), live=np.array([], dtype=np.int64))


def entry(fleet, traits=None, speed_mps=20.0, slowest_mps=15.0, rules=MIXED, time_s=0.0):
    own = sized() if traits is None else traits
    return plan_entry(fleet, own, False, time_s, -400.0, speed_mps, slowest_mps, rules)


def test_alone_it_goes_to_its_own_cruise():
    way = entry(NOBODY, speed_mps=15.0)
    # 0.1 s of delay, then 1.5 m/s2
    assert way.tolist()[:2] == [[0.0, -400.0, 15.0, 0.0], [0.1, -398.5, 15.0, close(1.5)]]
    assert way[-1, 2] == 20.0
    slow = entry(NOBODY, sized(top_speed_mps=16.0), speed_mps=15.0)
    assert slow[-1, 2] == 16.0
    weak = entry(NOBODY, truck(), speed_mps=15.0)
    assert weak[1, 3] == close(5.5 / (15.0 + 5.0 / 4.0))  # the first of four bands


def test_faster_than_its_cruise_it_slows_down_by_its_own_brakes():
    way = entry(NOBODY, sized(top_speed_mps=16.0, braking_mps2=1.2), speed_mps=20.0)
    assert way[:, 2:].tolist() == [[20.0, 0.0], [20.0, -1.2], [close(16.0), 0.0]]


def test_behind_a_truck_it_brakes_as_late_as_is_safe_by_hand():
    # the truck is 99 m ahead at 15 m/s: 82.5 m between bumpers, of which braking from 20 m/s takes
    # 6.25 m, and 0.04 m and the allowance stay: (82.5 - 6.25 - 0.14) / 5 = 15.222 s
    slow = truck(top_speed_mps=15.0)
    fleet = fleet_of((pieces(0.0, -301.0, 15.0), STREAM, slow))
    way = entry(fleet)
    assert way[:, :3] == close(
        np.array([[0.0, -400.0, 20.0], [15.2, -96.0, 20.0], [17.7, -52.25, 15.0]])
    )


def test_so_near_that_no_braking_helps_it_waits_outside():
    slow = truck(top_speed_mps=10.0)
    # 30 m from bumper to bumper; braking from 20 to 10 m/s takes 25 m, 0.1 s before that 1 m
    for gap_m, enters in ((27.0, True), (26.0, False)):
        fleet = fleet_of((pieces(0.0, -400.0 + 16.5 + gap_m, 10.0), STREAM, slow))
        assert (len(entry(fleet, slowest_mps=9.0)) > 0) is enters


def test_one_that_merges_ahead_counts_where_it_will_be():
    merging = pieces(0.0, -160.0, 16.0, [(16.0, 10.0), (12.0, 2.0)])
    ahead = pieces(0.0, 100.0, 20.0)
    fleet = fleet_of((ahead, STREAM), (merging, 12.0, truck(top_speed_mps=12.0)))
    assert last_on_mainline(fleet, 0.0) == 1
    way = entry(fleet)
    assert way[-1, 2] == close(12.0)  # it ends behind the truck, at its speed
    # a vehicle that has not decided counts for nothing on the mainline
    undecided = fleet_of((ahead, STREAM), (merging, UNDECIDED, truck()))
    assert last_on_mainline(undecided, 0.0) == 0
    alone = fleet_of((merging, UNDECIDED, truck()))
    assert last_on_mainline(alone, 0.0) == -1
    assert entry(undecided)[-1, 2] == 20.0


def test_the_hindmost_is_found_whatever_the_order_of_rows():
    ways = [(pieces(0.0, s, 20.0), STREAM) for s in (50.0, -30.0, 10.0)]
    assert last_on_mainline(fleet_of(*ways), 0.0) == 1
    assert last_on_mainline(fleet_of(*ways, live=[0, 2]), 0.0) == 2
    assert last_on_mainline(NOBODY, 0.0) == -1


own = st.builds(
    sized,
    st.sampled_from([5.0, 16.5]),
    positioning_error_m=st.sampled_from([0.02, 0.8]),
    clock_error_s=st.sampled_from([3e-9, 0.02]),
    time_gap_s=st.sampled_from([0.0, 0.8, 1.5]),
    top_speed_mps=st.sampled_from([math.inf, 21.0, 17.0]),
    power_wpkg=st.sampled_from([math.inf, 5.5]),
    braking_mps2=st.sampled_from([math.inf, 2.5, 1.5]),
)


@settings(max_examples=100)
@given(
    leader_mps=st.floats(10.0, 20.0),
    ahead_m=st.floats(20.0, 200.0),
    theirs=own,
    mine=own,
    speed_mps=st.floats(12.0, 17.0),
)
def test_whoever_enters_keeps_its_distance_to_the_end(leader_mps, ahead_m, theirs, mine, speed_mps):
    leader = pieces(0.0, -400.0 + ahead_m, min(leader_mps, theirs[4]))
    way = entry(fleet_of((leader, STREAM, theirs)), mine, speed_mps, slowest_mps=10.0)
    if len(way) == 0:
        return
    times_s = np.concatenate([np.arange(0.0, 90.0, 0.02), way[:, 0]])
    times_s = times_s[sampled(leader, times_s)[0] <= RULES.road.mainline_end_m]
    margins_m = sampled_own_margins(leader, theirs, way, mine, times_s, RULES.safety)
    assert margins_m.min(initial=1.0) >= 0.1 - 1e-6
    ends_mps = np.append(way[1:, 2], way[-1, 2])
    up = way[:, 3] > 0.0
    assert (way[up, 3] * ends_mps[up] <= mine[6] * (1.0 + 1e-9)).all()
    assert way[:, 3].min() >= -min(2.94, mine[7]) - 1e-9


@pytest.mark.parametrize("gap_m", [0.139, 0.141])
def test_at_equal_speeds_eq_1_and_the_allowance_decide(gap_m):
    ahead = pieces(0.0, -395.0 + gap_m, 20.0)
    assert (len(entry(fleet_of((ahead, STREAM)))) > 0) is (gap_m > 0.14)
