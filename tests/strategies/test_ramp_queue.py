"""Ramp vehicles that queue before the nose; the planned clearance at a stand is 0.14 m."""

import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from coramp.motion.approach import append_stop, harmonise
from coramp.strategies.ramp_queue import (
    longest_wait_s,
    next_behind_on_ramp,
    propose_place_ahead,
    propose_stop,
)
from coramp.vehicles.fleet import MAX_CHANGED, empty_proposal, pair_margin_m
from tests.mathematics import RULES, close, fleet_of, pieces, sampled, sized

UNDECIDED = math.inf


def stopping(station_m, stop_m, speed_mps=16.0):
    """Cruises and brakes by 2.5 m/s2 to a stand."""
    cruise_s = (stop_m - station_m - speed_mps**2 / 5.0) / speed_mps
    return pieces(0.0, station_m, speed_mps, [(speed_mps, cruise_s), (0.0, speed_mps / 2.5)])


def _proposed(proposal, entry=0):
    return proposal.pieces[entry, : proposal.piece_count[entry]]


def test_next_behind_is_the_nearest_without_a_merge():
    fleet = fleet_of(
        (stopping(-100.0, -1.0), UNDECIDED),
        (stopping(-160.0, -13.0), UNDECIDED),
        (stopping(-130.0, -7.0), UNDECIDED),
        (pieces(0.0, -115.0, 16.0), 20.0),  # merges
        (pieces(0.0, -115.0, 20.0), -math.inf),  # on the mainline
    )
    assert next_behind_on_ramp(fleet, 0, 0.0) == 2
    assert next_behind_on_ramp(fleet, 2, 0.0) == 1
    assert next_behind_on_ramp(fleet, 1, 0.0) == -1
    assert next_behind_on_ramp(fleet._replace(live=np.array([0, 1])), 0, 0.0) == 1


def test_lone_vehicle_goes_on_to_its_stop_without_braking_before():
    fleet = fleet_of((pieces(0.0, -160.0, 16.0), UNDECIDED))
    proposal = empty_proposal()
    assert propose_stop(fleet, proposal, 0, -10.0, 1.0, RULES)
    expected = [[1.0, -144.0, 16.0, 0.0], [6.175, -61.2, 16.0, -2.5], [12.575, -10.0, 0.0, 0.0]]
    assert _proposed(proposal) == close(np.array(expected))
    assert (proposal.size[0], proposal.rows[0], proposal.merge_time_s[0]) == (1, 0, math.inf)


def test_stop_that_is_too_near_adds_nothing():
    fleet = fleet_of((pieces(0.0, -60.0, 16.0), UNDECIDED))
    proposal = empty_proposal()
    assert not propose_stop(fleet, proposal, 0, -10.0, 0.0, RULES)
    assert proposal.size[0] == 0


def test_full_proposal_takes_no_stop():
    fleet = fleet_of((pieces(0.0, -160.0, 16.0), UNDECIDED))
    proposal = empty_proposal()
    proposal.size[0] = MAX_CHANGED
    assert not propose_stop(fleet, proposal, 0, -10.0, 0.0, RULES)
    assert not propose_place_ahead(fleet, proposal, 0, -10.0, 0.0, RULES)


def _margin_m(leader, follower, rules):
    row = sized(5.0, rules.safety)
    return pair_margin_m(leader, row, math.inf, follower, row, math.inf, 0.0, rules)


def _brake_margin_m(leader, station_m, stop_m, steps):
    """Margin of a vehicle behind ``leader`` that first brakes for that many steps."""
    out = np.empty((20, 4))
    n = harmonise(out, 0.0, station_m, 16.0, 0.0, steps * 0.1, 16.0, RULES.motion)
    n = append_stop(out, n, stop_m, RULES.motion.stop_mps2)
    assert n > 0
    return _margin_m(leader, out[:n], RULES)


@settings(max_examples=25, deadline=None)
@given(
    headway_m=st.floats(6.0, 30.0),
    leader_mps=st.floats(8.0, 16.0),
)
def test_brake_before_the_stop_is_the_shortest_that_keeps_the_distance(headway_m, leader_mps):
    leader = stopping(-120.0, -1.0, leader_mps)
    station_m, stop_m = -120.0 - headway_m, -6.2
    fleet = fleet_of((leader, UNDECIDED), (pieces(0.0, station_m, 16.0), UNDECIDED))
    proposal = empty_proposal()
    if not propose_stop(fleet, proposal, 1, stop_m, 0.0, RULES):
        assert _brake_margin_m(leader, station_m, stop_m, 80) < 0.1
        return
    proposed = _proposed(proposal)
    assert proposed[-1, 1:3].tolist() == [stop_m, 0.0]
    margin_m = _margin_m(leader, proposed, RULES)
    assert margin_m >= 0.1 - 1e-9
    steps = round((16.0 - proposed[1, 2]) / 0.2) if proposed[0, 3] == -2.0 else 0
    assume(steps > 0)
    assert _brake_margin_m(leader, station_m, stop_m, steps) == close(margin_m)
    assert _brake_margin_m(leader, station_m, stop_m, steps - 1) < 0.1


def test_vehicle_about_to_merge_is_kept_away_from_until_then():
    merging = pieces(0.0, -110.0, 12.0, [(12.0, 20.0), (20.0, 4.0)])
    fleet = fleet_of((merging, 24.0), (pieces(0.0, -120.0, 16.0), UNDECIDED))
    proposal = empty_proposal()
    assert propose_stop(fleet, proposal, 1, -1.0, 0.0, RULES)
    times_s = np.linspace(0.0, 24.0, 2401)
    gap_m = sampled(merging, times_s)[0] - 5.0 - sampled(_proposed(proposal), times_s)[0]
    assert gap_m.min() > 0.14
    # once it has merged it is no matter on the ramp
    gone = fleet._replace(merge_time_s=np.array([0.0, math.inf]))
    free = empty_proposal()
    assert propose_stop(gone, free, 1, -1.0, 0.0, RULES)
    assert _proposed(free)[0, 3] == 0.0


def standing(station_m):
    return pieces(0.0, station_m, 0.0)


def test_vehicle_of_a_queue_that_starts_waits_until_the_time_gap_has_come_about():
    # the leader starts at 0 s: 0.75 t^2, at 16 m/s from 10.667 s on. 3.74 m behind it, w seconds
    # later, the distance at 16 m/s is 3.74 + 16 w, and 0.14 + 1 * 16 m are to be kept: w >= 0.775 s
    rules = RULES._replace(safety=RULES.safety._replace(time_gap_s=1.0, clock_error_s=0.0))
    start_s = 16.0 / 1.5
    cruise_s = (329.0 - 0.75 * start_s**2 - 51.2) / 16.0
    leader = pieces(0.0, -330.0, 0.0, [(16.0, start_s), (16.0, cruise_s), (0.0, 6.4)])
    assert leader[-1, 1] == close(-1.0)
    fleet = fleet_of((leader, UNDECIDED), (standing(-338.74), UNDECIDED), safety=rules.safety)
    proposal = empty_proposal()
    assert propose_place_ahead(fleet, proposal, 1, -40.0, 0.0, rules)
    expected = [
        [0.0, -338.74, 0.0, 0.0],
        [0.8, -338.74, 0.0, 1.5],
        [0.8 + start_s, -338.74 + 0.75 * start_s**2, 16.0, 0.0],
    ]
    assert _proposed(proposal)[:3] == close(np.array(expected))
    assert _proposed(proposal)[-1, 1:3].tolist() == [-40.0, 0.0]
    margin_m = _margin_m(leader, _proposed(proposal), rules)
    assert margin_m == close(0.1 + 0.4)  # 16 (0.8 - 0.775)


def test_vehicle_of_a_queue_behind_one_that_stands_for_ever_stays():
    for time_gap_s in (0.0, 1.0):
        rules = RULES._replace(safety=RULES.safety._replace(time_gap_s=time_gap_s))
        fleet = fleet_of((standing(-100.0), UNDECIDED), (standing(-108.74), UNDECIDED))
        proposal = empty_proposal()
        assert not propose_place_ahead(fleet, proposal, 1, -9.0, 0.0, rules)
        assert proposal.size[0] == 0


def test_nobody_waits_where_the_distances_of_eq_1_are_all():
    assert longest_wait_s(RULES) == 0.0
    with_gap = RULES._replace(safety=RULES.safety._replace(time_gap_s=0.6))
    assert longest_wait_s(with_gap) == close(19.2)  # 32 vehicles
    still = RULES._replace(safety=RULES.safety._replace(standstill_gap_m=2.5))
    assert longest_wait_s(still) == close(32 * 2.5 / RULES.road.mainline_speed_mps)


def test_place_ahead_drives_on_as_committed_and_leaves_out_the_old_stop():
    fleet = fleet_of((stopping(-160.0, -30.0), UNDECIDED))
    proposal = empty_proposal()
    assert propose_place_ahead(fleet, proposal, 0, -10.0, 1.0, RULES)
    expected = [[1.0, -144.0, 16.0, 0.0], [6.175, -61.2, 16.0, -2.5], [12.575, -10.0, 0.0, 0.0]]
    assert _proposed(proposal) == close(np.array(expected))


def test_place_ahead_brakes_where_someone_is_in_the_way():
    leader = stopping(-110.0, -1.0, 12.0)
    fleet = fleet_of((leader, UNDECIDED), (stopping(-120.0, -60.0), UNDECIDED))
    proposal = empty_proposal()
    assert propose_place_ahead(fleet, proposal, 1, -6.2, 0.0, RULES)
    proposed = _proposed(proposal)
    assert proposed[0, 3] == -2.0
    assert proposed[-1, 1] == -6.2
    margin_m = _margin_m(leader, proposed, RULES)
    assert margin_m >= 0.1 - 1e-9


@pytest.mark.parametrize(("behind_m", "possible"), [(-150.0, True), (-125.5, False)])
def test_place_ahead_must_not_touch_who_is_behind(behind_m, possible):
    # braking for the leader brings the subject back onto a follower that is near
    leader = stopping(-110.0, -1.0, 12.0)
    fleet = fleet_of(
        (stopping(behind_m, -26.0), UNDECIDED),
        (stopping(-120.0, -20.0), UNDECIDED),
        (leader, UNDECIDED),
    )
    proposal = empty_proposal()
    assert propose_place_ahead(fleet, proposal, 1, -6.2, 0.0, RULES) is possible
    assert proposal.size[0] == int(possible)


def test_place_ahead_keeps_the_commitment_s_own_pace():
    # 1 m/s2 where a new approach would take 1.5
    gently = pieces(0.0, -200.0, 12.0, [(16.0, 4.0), (16.0, 4.0), (0.0, 6.4)])
    fleet = fleet_of((gently, UNDECIDED))
    proposal = empty_proposal()
    assert propose_place_ahead(fleet, proposal, 0, -10.0, 0.0, RULES)
    expected = [
        [0.0, -200.0, 12.0, 1.0],
        [4.0, -144.0, 16.0, 0.0],
        [9.175, -61.2, 16.0, -2.5],
        [15.575, -10.0, 0.0, 0.0],
    ]
    assert proposal.size[0] == 1
    assert _proposed(proposal) == close(np.array(expected))


def test_place_that_is_taken_is_not_to_be_had():
    fleet = fleet_of((stopping(-100.0, -1.0), UNDECIDED), (stopping(-160.0, -20.0), UNDECIDED))
    for stop_m, free in ((-1.0, False), (-6.1399, False), (-6.14, True)):
        for propose in (propose_stop, propose_place_ahead):
            proposal = empty_proposal()
            assert propose(fleet, proposal, 1, stop_m, 0.0, RULES) is free
            assert proposal.size[0] == int(free)


def test_standing_vehicle_beyond_a_merging_one_is_in_the_way():
    merging = pieces(0.0, -140.0, 16.0, [(16.0, 8.75), (20.0, 2.0)])
    fleet = fleet_of(
        (pieces(0.0, -40.0, 0.0), UNDECIDED),
        (merging, 10.75),
        (pieces(0.0, -160.0, 16.0), UNDECIDED),
    )
    assert not propose_stop(fleet, empty_proposal(), 2, -30.0, 0.0, RULES)
    assert propose_stop(fleet, empty_proposal(), 2, -46.0, 0.0, RULES)


def test_merging_vehicle_behind_is_not_the_concern_of_the_one_ahead():
    behind = pieces(0.0, -166.0, 16.0, [(16.0, 10.375), (20.0, 2.0)])
    fleet = fleet_of((behind, 12.375), (pieces(0.0, -160.0, 16.0), UNDECIDED))
    proposal = empty_proposal()
    assert propose_stop(fleet, proposal, 1, -10.0, 0.0, RULES)
    assert _proposed(proposal)[0, 3] == 0.0
