"""Commitments, proposals over them, and the margins of pairs.

A merges at 12 s at 36 m (free movement from -160 m at 16 m/s); X is then 15 m ahead, Y 13 m behind.
"""

import math

import numpy as np
import pytest

from coramp.vehicles.fleet import (
    PairSafety,
    committed,
    empty_proposal,
    entry_of,
    merge_margin_m,
    merge_time_under_s,
    ordered_margin_m,
    pair_margin_m,
    proposed,
    trajectory_under,
)
from tests.mathematics import RULES, close, fleet_of, pieces, sized

A = pieces(0.0, -160.0, 16.0, [(16.0, 10.0), (20.0, 2.0)])
X = pieces(0.0, -189.0, 20.0)
Y = pieces(0.0, -217.0, 20.0)
STREAM = -math.inf
EQ_15_20 = 0.7583002436540073  # L_r-X at 20 m/s


def _pair(one, one_merge_s, other, other_merge_s, from_s=0.0, rules=RULES):
    row = sized(5.0, rules.safety)
    return pair_margin_m(one, row, one_merge_s, other, row, other_merge_s, from_s, rules)


def _ordered(one, one_length_m, other, other_length_m, start_s, end_s):
    safety = PairSafety(RULES.safety, RULES.safety)
    return ordered_margin_m(
        one, one_length_m, other, other_length_m, start_s, end_s, RULES.road, safety
    )


def _at_merge(merging, merging_length_m, other, other_length_m, merge_s):
    lengths = (merging, merging_length_m, other, other_length_m)
    return merge_margin_m(*lengths, merge_s, RULES.road, RULES.safety)


def test_trajectories_and_merge_times_are_the_proposed_ones_where_there_are():
    fleet = fleet_of((X, STREAM), (A, 12.0), (Y, STREAM))
    proposal = empty_proposal()
    assert entry_of(proposal, 1) == -1
    assert (committed(fleet, 1) == A).all()
    assert (trajectory_under(fleet, proposal, 1) == A).all()
    assert merge_time_under_s(fleet, proposal, 1) == 12.0
    proposal.size[0] = 1
    proposal.rows[0] = 1
    proposal.pieces[0, :1] = Y
    proposal.piece_count[0] = 1
    proposal.merge_time_s[0] = 15.0
    assert entry_of(proposal, 1) == 0
    assert entry_of(proposal, 0) == -1
    assert (proposed(proposal, 0) == Y).all()
    assert (trajectory_under(fleet, proposal, 1) == Y).all()
    assert merge_time_under_s(fleet, proposal, 1) == 15.0
    assert (trajectory_under(fleet, proposal, 0) == X).all()


def test_ordered_margin_takes_whoever_is_ahead_for_the_leader():
    expected = close(52.0 - 28.0 - 4.0 + 3.0 - 0.04 - 3e-9 * 40.0)  # 28 m less the leader's 5
    assert _ordered(X, 5.0, Y, 9.0, 0.0, math.inf) == expected
    assert _ordered(Y, 9.0, X, 5.0, 0.0, math.inf) == expected


def test_ordered_margin_ends_where_the_leader_leaves_the_zone():
    leader, follower = pieces(0.0, 200.0, 10.0), pieces(0.0, 0.0, 15.0)
    # 20 s to the zone's end: 195 - 100 - 0.04 - 3e-9 * 25 - 18^2 / 129.54
    expected = close(92.4588419259009)
    assert _ordered(leader, 5.0, follower, 5.0, 0.0, math.inf) == expected
    assert _ordered(follower, 5.0, leader, 5.0, 0.0, math.inf) == expected
    # 4 s: 195 - 20 - ...
    expected = close(172.4588419259009)
    assert _ordered(leader, 5.0, follower, 5.0, 0.0, 4.0) == expected
    assert _ordered(follower, 5.0, leader, 5.0, 0.0, 4.0) == expected


def test_merge_margin_is_over_eq_15_and_16():
    assert _at_merge(A, 5.0, X, 7.0, 12.0) == close(8.0 - EQ_15_20)
    assert _at_merge(A, 7.0, Y, 5.0, 12.0) == close(6.0 - EQ_15_20)


def test_merge_margin_takes_the_merging_vehicle_s_own_speed():
    # at 11 s it drives 18 m/s: 18 cos 30 - 20 is -4.4115.. m/s, 252.2243..  / 129.54 with 3.6^2
    needed_m = 0.04 + (3.6 * (20.0 - 9.0 * 3.0**0.5)) ** 2 / 129.54
    assert _at_merge(A, 5.0, X, 5.0, 11.0) == close(31.0 - 5.0 - 17.0 - needed_m)


def test_pair_of_stream_and_merging_vehicle_counts_from_the_merge():
    assert _pair(A, 12.0, X, STREAM) == close(10.0 - EQ_15_20)
    assert _pair(X, STREAM, A, 12.0) == close(10.0 - EQ_15_20)
    assert _pair(A, 12.0, Y, STREAM) == close(8.0 - EQ_15_20)
    # once it is over the lane change is no matter: 10 - 0.04 - 1.2e-7
    assert _pair(A, 12.0, X, STREAM, from_s=12.5) == close(9.95999988)
    assert _pair(A, 12.0, X, STREAM, from_s=12.0) == close(10.0 - EQ_15_20)


def test_pair_takes_the_speed_of_the_one_that_merges():
    faster = pieces(0.0, -213.0, 22.0)  # at 51 m at 12 s
    expected = close(10.0 - 0.04 - (3.6 * (22.0 - 17.320508075688772)) ** 2 / 129.54)
    assert _pair(A, 12.0, faster, STREAM) == expected
    assert _pair(faster, STREAM, A, 12.0) == expected


@pytest.mark.parametrize("merge_s", [STREAM, 2.0])
def test_pair_on_the_mainline_counts_from_now_on(merge_s):
    leader, follower = pieces(0.0, 30.0, 22.0), pieces(0.0, 20.0, 20.0)
    # 5 m at 0 s, 15 m at 5 s
    assert _pair(leader, STREAM, follower, merge_s, from_s=5.0) == close(14.959999874)
    assert _pair(follower, merge_s, leader, STREAM, from_s=5.0) == close(14.959999874)


def test_pair_counts_eq_1_on_the_mainline_where_it_is_the_smaller():
    slower = pieces(0.0, -189.0, 20.0, [(20.0, 12.0), (19.0, 1.0)])
    # at 13 s: 10 - 0.5, 3.6^2 / 129.54; from then on ever nearer, to the zone's end:
    # X is at 51 + 19.5 m, 329.5 m at 19 m/s before it
    left_s = 329.5 / 19.0
    expected = 9.5 - left_s - 0.04 - 3e-9 * 39.0 - 12.96 / 129.54
    assert _pair(A, 12.0, slower, STREAM) == close(expected)


def test_pair_without_a_merge_never_meets_the_stream():
    assert _pair(A, math.inf, pieces(0.0, -160.0, 20.0), STREAM) == math.inf


def test_pair_on_the_ramp_counts_until_the_first_merge():
    ahead = pieces(0.0, -150.0, 16.0)
    assert _pair(A, math.inf, ahead, math.inf) < -10.0  # A speeds up into it
    # up to 10.5 s: A has gained 0.25 m and 1 m/s; 10 - 5 - 0.25 - 0.04 - 3e-9 * 33 - 12.96 / 129.54
    expected = 4.75 - 0.04 - 3e-9 * 33.0 - 12.96 / 129.54
    assert _pair(A, math.inf, ahead, 10.5) == close(expected)
    assert _pair(ahead, 10.5, A, math.inf) == close(expected)


def test_pair_of_two_merging_vehicles_meets_again_on_the_mainline():
    later = pieces(0.0, -176.0, 16.0, [(16.0, 11.0), (20.0, 2.0)])  # one second behind
    # 11 m on the ramp; A gains 4 m by 13 s, when the second merges at 36 m, A at 56 m
    assert _pair(A, 12.0, later, 13.0) == close(11.0 - 0.04 - 3e-9 * 32.0)
    near = np.array(later)
    near[:, 1] += 10.0  # 1 m on the ramp, 5 m at its merge
    assert _pair(A, 12.0, near, 13.0, from_s=12.5) == close(5.0 - EQ_15_20)
    assert _pair(near, 13.0, A, 12.0, from_s=12.5) == close(5.0 - EQ_15_20)
