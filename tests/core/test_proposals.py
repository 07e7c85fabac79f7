"""Proposals: a merge, shifts within their bounds, cascades, and the planner's own check."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from coramp.core.fleet import MAX_CHANGED, empty_proposal, pair_margin_m
from coramp.core.proposals import (
    find_unsafe_pair,
    intercept_m,
    largest_safe_distance_m,
    propose_merge,
    propose_shift,
    push_ahead,
    push_back,
)
from tests.core import RULES, close, fleet_of, pieces, sampled, trajectories

STREAM = -math.inf
THREE = (30.0, 20.0, 10.0)  # 5 m between bumpers, 4.85999988 m beyond the clearance


def _stream(*stations_m, adjustable=True):
    return fleet_of(*((pieces(0.0, s, 20.0), STREAM, adjustable) for s in stations_m))


def _moved_m(proposal, fleet, entry):
    """How far ahead the entry ends up of where it was."""
    row = proposal.rows[entry]
    end_s = proposal.pieces[entry, proposal.piece_count[entry] - 1, 0]
    first = fleet.first_piece[row]
    before = fleet.pieces[first : first + fleet.piece_count[row]]
    new_m = proposal.pieces[entry, proposal.piece_count[entry] - 1, 1]
    return new_m - sampled(before, np.array([end_s]))[0][0]


def _shift(fleet, row, start_s, end_s, shift_m):
    proposal = empty_proposal()
    done = propose_shift(fleet, proposal, row, 0.0, start_s, end_s, shift_m, RULES)
    assert proposal.size[0] == int(done)
    return proposal if done else None


def test_merge_is_the_approach_and_the_acceleration_up_to_v0():
    proposal = empty_proposal()
    approach = np.array([[2.0, -128.0, 16.0, 0.0], [10.0, 0.0, 16.0, 0.0]])
    assert propose_merge(proposal, 7, approach, 2.0, RULES) == (close(12.0), close(36.0))
    assert (proposal.size[0], proposal.rows[0], proposal.merge_time_s[0]) == (1, 7, close(12.0))
    expected = [[2.0, -128.0, 16.0, 0.0], [10.0, 0.0, 16.0, 2.0], [12.0, 36.0, 20.0, 0.0]]
    assert proposal.pieces[0, : proposal.piece_count[0]] == close(np.array(expected))


def test_shift_is_the_triangle_of_eq_42_and_43():
    proposal = _shift(_stream(10.0), 0, 2.0, 8.0, 1.8)
    # 4 * 1.8 / 36 = 0.2 m/s2: 20.6 m/s after 3 s, half of 121.8 m
    expected = [
        [0.0, 10.0, 20.0, 0.0],
        [2.0, 50.0, 20.0, 0.2],
        [5.0, 110.9, 20.6, -0.2],
        [8.0, 171.8, 20.0, 0.0],
    ]
    assert proposal.pieces[0, : proposal.piece_count[0]] == close(np.array(expected))
    assert (proposal.rows[0], proposal.merge_time_s[0]) == (0, STREAM)


@pytest.mark.parametrize(
    ("lasts_s", "most_m"),
    [(1.0, 0.735), (10.0, 10.0)],  # by 2.94 m/s2, by 2 m/s
)
@pytest.mark.parametrize("side", [1.0, -1.0])
def test_shift_keeps_the_bounds_on_acceleration_and_speed(lasts_s, most_m, side):
    assert _shift(_stream(10.0), 0, 0.0, lasts_s, side * (most_m - 1e-3)) is not None
    assert _shift(_stream(10.0), 0, 0.0, lasts_s, side * (most_m + 1e-3)) is None


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_shifts_one_upon_the_other_keep_the_bounds_together(side):
    # 1.5 m/s off v0 after 3 s, again at v0 after 6 s: a second one may add 0.5 m/s
    once = fleet_of(
        (pieces(0.0, 10.0, 20.0, [(20.0 + side * 1.5, 3.0), (20.0, 3.0)]), STREAM, True)
    )
    assert _shift(once, 0, 0.0, 6.0, side * 1.4) is not None
    assert _shift(once, 0, 0.0, 6.0, side * 1.6) is None
    # 1.8 m/s2 within 1 s: 1.2 m/s2 more are too many, though the speeds would do
    quick = fleet_of(
        (pieces(0.0, 10.0, 20.0, [(20.0 + side * 1.8, 1.0), (20.0, 1.0)]), STREAM, True)
    )
    assert _shift(quick, 0, 0.0, 0.6, side * 0.09) is not None  # 1 m/s2
    assert _shift(quick, 0, 0.0, 0.6, side * 0.108) is None


def test_vehicle_that_is_bound_or_already_moved_is_not_shifted():
    assert _shift(_stream(10.0, adjustable=False), 0, 0.0, 6.0, 1.0) is None
    fleet = _stream(30.0, 10.0)
    proposal = _shift(fleet, 0, 0.0, 6.0, 1.0)
    assert not propose_shift(fleet, proposal, 0, 0.0, 0.0, 6.0, 1.0, RULES)
    assert propose_shift(fleet, proposal, 1, 0.0, 0.0, 6.0, 1.0, RULES)
    proposal.size[0] = MAX_CHANGED
    assert not propose_shift(_stream(1.0, 2.0, 3.0), proposal, 2, 0.0, 0.0, 6.0, 1.0, RULES)


def test_vehicle_still_to_merge_moves_only_after_its_merge():
    merging = pieces(0.0, -160.0, 16.0, [(16.0, 10.0), (20.0, 2.0)])
    fleet = fleet_of((merging, 12.0, True))
    proposal = _shift(fleet, 0, 5.0, 16.0, 1.0)
    assert proposal.merge_time_s[0] == 12.0
    new = proposal.pieces[0, : proposal.piece_count[0]]
    times_s = np.linspace(0.0, 12.0, 25)
    assert sampled(new, times_s)[0] == close(sampled(merging, times_s)[0])
    assert _moved_m(proposal, fleet, 0) == close(1.0)
    # 4 s allow 4 m by speed, the 11 s of the window would allow 11 m
    assert _shift(fleet, 0, 5.0, 16.0, 4.1) is None


def test_intercept_is_the_final_cruise_run_back():
    fleet = fleet_of((pieces(2.0, 0.0, 16.0, [(20.0, 2.0)]), STREAM, True))
    assert intercept_m(fleet, 0, RULES) == close(-44.0)  # 36 - 20 * 4


def test_cascade_ahead_moves_each_leader_by_what_is_missing():
    fleet = _stream(*THREE)
    proposal = empty_proposal()
    order = np.array([0, 1, 2])
    assert push_ahead(fleet, proposal, order, 2, 0.0, 0.0, 10.0, 6.0, RULES)
    assert proposal.rows[: proposal.size[0]].tolist() == [2, 1]
    moved_m = [_moved_m(proposal, fleet, entry) for entry in range(2)]
    assert moved_m == close([6.0, 6.0 - 4.85999988])
    assert find_unsafe_pair(fleet, proposal, 0.0, RULES) == (-1, -1)


def test_cascade_back_moves_each_follower_by_what_is_missing():
    fleet = _stream(*THREE)
    proposal = empty_proposal()
    order = np.array([0, 1, 2])
    assert push_back(fleet, proposal, order, 0, 0.0, 0.0, 20.0, 11.0, RULES)
    assert proposal.rows[: proposal.size[0]].tolist() == [0, 1, 2]
    moved_m = [_moved_m(proposal, fleet, entry) for entry in range(3)]
    assert moved_m == close([-11.0, -11.0 + 4.85999988, -11.0 + 2 * 4.85999988])
    assert find_unsafe_pair(fleet, proposal, 0.0, RULES) == (-1, -1)


@pytest.mark.parametrize(("push", "first"), [(push_ahead, 2), (push_back, 0)])
def test_cascade_fails_with_a_vehicle_that_cannot_move(push, first):
    fleet = _stream(*THREE)
    fleet.adjustable[1] = False
    order = np.array([0, 1, 2])
    assert not push(fleet, empty_proposal(), order, first, 0.0, 0.0, 10.0, 6.0, RULES)
    assert push(fleet, empty_proposal(), order, first, 0.0, 0.0, 10.0, 4.8, RULES)


def test_vehicle_moved_without_its_leader_is_found_unsafe():
    fleet = _stream(*THREE)
    near = _shift(fleet, 2, 0.0, 10.0, 4.9)
    assert find_unsafe_pair(fleet, near, 0.0, RULES) == (2, 1)
    assert find_unsafe_pair(fleet, _shift(fleet, 2, 0.0, 10.0, 4.8), 0.0, RULES) == (-1, -1)


def test_no_safe_distance_exceeds_the_largest():
    # fastest 22 m/s, 79.2 km/h: 0.04 + 3e-9 * 44 + 6272.64 / 129.54 + 0.1
    assert largest_safe_distance_m(RULES) == close(48.56241791801204)


@settings(max_examples=60, deadline=None)
@given(
    ways=st.lists(
        trajectories(most_stretches=2, start_s=0.0, end_speed_mps=20.0), min_size=3, max_size=3
    ),
    merge_s=st.sampled_from([STREAM, 6.0, math.inf]),
    other_merge_s=st.sampled_from([STREAM, 3.0, math.inf]),
)
def test_unsafe_pairs_are_found_though_far_ones_are_skipped(ways, merge_s, other_merge_s):
    fleet = fleet_of(
        (ways[0], STREAM, True), (ways[1], other_merge_s, True), (ways[2], STREAM, True)
    )
    proposal = empty_proposal()
    proposal.size[0] = 1
    proposal.rows[0] = 0
    proposal.piece_count[0] = len(ways[2])
    proposal.pieces[0, : len(ways[2])] = ways[2] + np.array([0.0, 25.0, 0.0, 0.0])
    proposal.merge_time_s[0] = merge_s
    mine = proposal.pieces[0, : proposal.piece_count[0]]
    margins_m = [
        pair_margin_m(mine, 5.0, merge_s, ways[k], 5.0, fleet.merge_time_s[k], 0.0, RULES)
        for k in (1, 2)
    ]
    found = find_unsafe_pair(fleet, proposal, 0.0, RULES)
    if min(margins_m) >= 0.1:
        assert found == (-1, -1)
    elif margins_m[0] < 0.1 - 1e-9:
        assert found == (0, 1)
    elif margins_m[1] < 0.1 - 1e-9:
        assert found == (0, 2)
