"""Proposals: a merge, shifts within their bounds, cascades, and the planner's own check."""

import math

import numpy as np
import pytest

from coramp.kinematics.trajectory import MAX_PIECES
from coramp.strategies.proposals import (
    find_unsafe_pair,
    intercept_m,
    largest_safe_distance_m,
    propose_merge,
    propose_shift,
    push_ahead,
    push_back,
)
from coramp.vehicles.fleet import (
    MAX_CHANGED,
    empty_proposal,
    merge_time_under_s,
    pair_margin_m,
    trajectory_under,
)
from tests.mathematics import RULES, close, fleet_of, pieces, sampled, with_safety

STREAM = -math.inf
THREE = (30.0, 20.0, 10.0)  # 5 m between bumpers, 4.85999988 m beyond the clearance


def _stream(*stations_m):
    return fleet_of(*((pieces(0.0, s, 20.0), STREAM) for s in stations_m))


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


SLOW = RULES._replace(motion=RULES.motion._replace(slow_deviation=0.5))
"""Down to 10 m/s, up to 22 m/s."""


@pytest.mark.parametrize(
    ("lasts_s", "back_m", "ahead_m"),
    [
        (10.0, 50.0, 10.0),  # half of 10 m/s, of 2 m/s, for 10 s
        (4.0, 11.76, 4.0),  # 2.94 m/s2 for 2 s, twice; half of 2 m/s for 4 s
        (1.0, 0.735, 0.735),
    ],
)
def test_shift_back_may_be_slower_than_one_ahead_is_fast(lasts_s, back_m, ahead_m):
    fleet = _stream(10.0)
    for most_m, side in ((back_m, -1.0), (ahead_m, 1.0)):
        for more_m in (-1e-3, 1e-3):
            proposal = empty_proposal()
            shift_m = side * (most_m + more_m)
            done = propose_shift(fleet, proposal, 0, 0.0, 0.0, lasts_s, shift_m, SLOW)
            assert done == (more_m < 0.0)
            speeds = proposal.pieces[0, : proposal.piece_count[0], 2] if done else np.array([20.0])
            assert 10.0 <= speeds.min() <= speeds.max() <= 22.0


def test_shifts_back_one_upon_the_other_keep_the_lower_bound_together():
    # 7 m/s below v0 after 3 s, again at v0 after 6 s: a second one may take 3 m/s more, 9 m
    once = fleet_of((pieces(0.0, 10.0, 20.0, [(13.0, 3.0), (20.0, 3.0)]), STREAM))
    for shift_m, possible in ((-1.8, True), (-2.0, False)):  # 7/3 m/s2 leave 0.607: 1.82 m/s
        done = propose_shift(once, empty_proposal(), 0, 0.0, 0.0, 6.0, 3.0 * shift_m, SLOW)
        assert done == possible
    # over 20 s the accelerations would do: 10 m/s are what binds
    gently = fleet_of((pieces(0.0, 10.0, 20.0, [(13.0, 10.0), (20.0, 10.0)]), STREAM))
    for shift_m, possible in ((-29.9, True), (-30.1, False)):
        done = propose_shift(gently, empty_proposal(), 0, 0.0, 0.0, 20.0, shift_m, SLOW)
        assert done == possible


def test_cascade_back_may_be_slow_and_one_ahead_not_fast():
    order = np.array([0, 1, 2])
    fleet = _stream(*THREE)
    proposal = empty_proposal()
    assert push_back(fleet, proposal, order, 0, 0.0, 0.0, 14.0, 25.0, SLOW)
    moved_m = [_moved_m(proposal, fleet, entry) for entry in range(3)]
    assert moved_m == close([-25.0, -25.0 + 4.85999988, -25.0 + 2 * 4.85999988])
    assert not push_back(fleet, empty_proposal(), order, 0, 0.0, 0.0, 14.0, 25.0, RULES)
    assert not push_ahead(fleet, empty_proposal(), order, 2, 0.0, 0.0, 14.0, 25.0, SLOW)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_shifts_one_upon_the_other_keep_the_bounds_together(side):
    # 1.5 m/s off v0 after 3 s, again at v0 after 6 s: a second one may add 0.5 m/s
    once = fleet_of((pieces(0.0, 10.0, 20.0, [(20.0 + side * 1.5, 3.0), (20.0, 3.0)]), STREAM))
    assert _shift(once, 0, 0.0, 6.0, side * 1.4) is not None
    assert _shift(once, 0, 0.0, 6.0, side * 1.6) is None
    # 1.8 m/s2 within 1 s: 1.2 m/s2 more are too many, though the speeds would do
    quick = fleet_of((pieces(0.0, 10.0, 20.0, [(20.0 + side * 1.8, 1.0), (20.0, 1.0)]), STREAM))
    assert _shift(quick, 0, 0.0, 0.6, side * 0.09) is not None  # 1 m/s2
    assert _shift(quick, 0, 0.0, 0.6, side * 0.108) is None


def test_a_vehicle_that_is_already_moved_is_not_shifted():
    fleet = _stream(30.0, 10.0)
    proposal = _shift(fleet, 0, 0.0, 6.0, 1.0)
    assert not propose_shift(fleet, proposal, 0, 0.0, 0.0, 6.0, 1.0, RULES)
    assert propose_shift(fleet, proposal, 1, 0.0, 0.0, 6.0, 1.0, RULES)
    proposal.size[0] = MAX_CHANGED
    assert not propose_shift(_stream(1.0, 2.0, 3.0), proposal, 2, 0.0, 0.0, 6.0, 1.0, RULES)


def test_vehicle_still_to_merge_moves_only_after_its_merge():
    merging = pieces(0.0, -160.0, 16.0, [(16.0, 10.0), (20.0, 2.0)])
    fleet = fleet_of((merging, 12.0))
    proposal = _shift(fleet, 0, 5.0, 16.0, 1.0)
    assert proposal.merge_time_s[0] == 12.0
    new = proposal.pieces[0, : proposal.piece_count[0]]
    times_s = np.linspace(0.0, 12.0, 25)
    assert sampled(new, times_s)[0] == close(sampled(merging, times_s)[0])
    assert _moved_m(proposal, fleet, 0) == close(1.0)
    # 4 s allow 4 m by speed, the 11 s of the window would allow 11 m
    assert _shift(fleet, 0, 5.0, 16.0, 4.1) is None


def test_bounds_are_for_what_a_shift_adds_not_for_what_is_committed():
    entering_fast = fleet_of((pieces(0.0, -300.0, 23.0, [(23.0, 1.0), (20.0, 2.0)]), STREAM))
    assert _shift(entering_fast, 0, 5.0, 11.0, 1.0) is not None
    entering_slowly = fleet_of((pieces(0.0, -300.0, 15.0, [(15.0, 1.0), (20.0, 5.0)]), STREAM))
    assert _shift(entering_slowly, 0, 7.0, 13.0, -1.0) is not None
    merging = fleet_of((pieces(0.0, -160.0, 16.0, [(16.0, 10.0), (20.0, 0.8)]), 10.8))
    assert _shift(merging, 0, 5.0, 16.8, 1.0) is not None


def test_window_that_ends_before_the_merge_moves_nobody():
    merging = pieces(0.0, -160.0, 16.0, [(16.0, 10.0), (20.0, 2.0)])
    fleet = fleet_of((merging, 12.0))
    assert _shift(fleet, 0, 5.0, 11.0, 1.0) is None
    assert _shift(fleet, 0, 5.0, 11.0, 0.5) is None


def test_trajectory_too_long_to_be_moved_is_left():
    weaving = [(20.0 + 0.1 * (k % 2), 1.0) for k in range(MAX_PIECES - 4)]
    fleet = fleet_of((pieces(0.0, -400.0, 20.0, weaving), STREAM))
    assert _shift(fleet, 0, 1.0, 7.0, 0.5) is None
    shorter = fleet_of((pieces(0.0, -400.0, 20.0, weaving[:-1]), STREAM))
    assert _shift(shorter, 0, 1.0, 7.0, 0.5) is not None


def test_intercept_is_the_final_cruise_run_back():
    fleet = fleet_of((pieces(2.0, 0.0, 16.0, [(20.0, 2.0)]), STREAM))
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


def test_cascade_ahead_ends_with_the_foremost():
    fleet = _stream(*THREE)
    order = np.array([0, 1, 2])
    proposal = empty_proposal()
    assert push_ahead(fleet, proposal, order, 2, 0.0, 0.0, 20.0, 12.0, RULES)
    assert proposal.rows[: proposal.size[0]].tolist() == [2, 1, 0]
    moved_m = [_moved_m(proposal, fleet, entry) for entry in range(3)]
    assert moved_m == close([12.0, 12.0 - 4.85999988, 12.0 - 2 * 4.85999988])
    proposal = empty_proposal()
    assert push_ahead(fleet, proposal, order, 0, 0.0, 0.0, 20.0, 12.0, RULES)
    assert proposal.rows[: proposal.size[0]].tolist() == [0]


@pytest.mark.parametrize(
    ("merge_s", "leader_m"),
    [(STREAM, 17 / 15), (4.0, 1.3)],  # in 6 s, or in the 4 s from the merge to the window's end
)
def test_cascade_ahead_with_a_time_gap_counts_the_time_there_is(merge_s, leader_m):
    # 0.1 m beyond 0.14000012 m and half a second at 20 m/s: 2 (0.5 * 2 / T - 0.1) + 1
    leader = pieces(0.0, 15.24000012, 20.0)
    fleet = fleet_of((leader, STREAM), (pieces(0.0, 0.0, 20.0), merge_s))
    proposal = empty_proposal()
    rules = with_safety(time_gap_s=0.5)
    assert push_ahead(fleet, proposal, np.array([0, 1]), 1, 0.0, 2.0, 8.0, 1.0, rules)
    moved_m = [_moved_m(proposal, fleet, entry) for entry in range(2)]
    assert moved_m == close([1.0, leader_m])


def test_cascade_back_moves_each_follower_by_what_is_missing():
    fleet = _stream(*THREE)
    proposal = empty_proposal()
    order = np.array([0, 1, 2])
    assert push_back(fleet, proposal, order, 0, 0.0, 0.0, 20.0, 11.0, RULES)
    assert proposal.rows[: proposal.size[0]].tolist() == [0, 1, 2]
    moved_m = [_moved_m(proposal, fleet, entry) for entry in range(3)]
    assert moved_m == close([-11.0, -11.0 + 4.85999988, -11.0 + 2 * 4.85999988])
    assert find_unsafe_pair(fleet, proposal, 0.0, RULES) == (-1, -1)


def test_vehicle_moved_without_its_leader_is_found_unsafe():
    fleet = _stream(*THREE)
    near = _shift(fleet, 2, 0.0, 10.0, 4.9)
    assert find_unsafe_pair(fleet, near, 0.0, RULES) == (2, 1)
    assert find_unsafe_pair(fleet, _shift(fleet, 2, 0.0, 10.0, 4.8), 0.0, RULES) == (-1, -1)


def test_ramp_pair_that_is_far_apart_only_later_is_found_unsafe():
    # they overlap now, and are 100 m apart when the slower one merges
    slow = pieces(0.0, -100.0, 10.0, [(10.0, 10.0), (20.0, 5.0)])
    fast = pieces(0.0, -96.0, 20.0)
    fleet = fleet_of((slow, math.inf), (fast, 5.0))
    proposal = empty_proposal()
    proposal.size[0], proposal.rows[0], proposal.merge_time_s[0] = 1, 0, 15.0
    proposal.piece_count[0] = len(slow)
    proposal.pieces[0, : len(slow)] = slow
    assert find_unsafe_pair(fleet, proposal, 0.0, RULES) == (0, 1)


def test_no_safe_distance_exceeds_the_largest():
    # fastest 22 m/s, 79.2 km/h: 0.04 + 3e-9 * 44 + 6272.64 / 129.54 + 0.1
    assert largest_safe_distance_m(RULES) == close(48.56241791801204)


def _random_fleet(rng):
    """Six vehicles over 700 m that end at v0; merges are to come, past or not planned."""
    ways, merges_s, lengths_m = [], [], []
    for _ in range(6):
        speeds_mps, durations_s = rng.uniform(10.0, 25.0, 3), rng.uniform(0.5, 4.0, 3)
        stretches = list(zip([*speeds_mps[1:], 20.0], durations_s, strict=True))
        ways.append(pieces(0.0, rng.uniform(-400.0, 300.0), speeds_mps[0], stretches))
        merges_s.append(rng.choice([STREAM, STREAM, rng.uniform(1.0, 15.0), math.inf]))
        lengths_m.append(rng.uniform(4.0, 18.0))
    return fleet_of(*zip(ways, merges_s, lengths_m, strict=True))


def test_unsafe_pairs_are_found_though_far_ones_are_skipped():
    rng = np.random.default_rng(3)
    safe = 0
    for _ in range(600):
        fleet, planned = _random_fleet(rng), _random_fleet(rng)
        from_s = rng.choice([0.0, 2.0])
        proposal = empty_proposal()
        proposal.size[0] = 2
        for entry, row in enumerate((3, 1)):
            way = planned.pieces[planned.first_piece[row] :][: planned.piece_count[row]]
            proposal.rows[entry], proposal.piece_count[entry] = row, len(way)
            proposal.pieces[entry, : len(way)] = way
            proposal.merge_time_s[entry] = planned.merge_time_s[row]
        expected = (-1, -1)
        for row, others in ((1, (0, 2, 4, 5)), (3, (0, 1, 2, 4, 5))):
            unsafe = [
                other for other in others if _margin_m(fleet, proposal, row, other, from_s) < 0.1
            ]
            expected = (row, unsafe[0]) if unsafe else expected
        safe += expected == (-1, -1)
        assert find_unsafe_pair(fleet, proposal, from_s, RULES) == expected
    assert 100 < safe < 500


def _margin_m(fleet, proposal, row, other, from_s):
    return pair_margin_m(
        trajectory_under(fleet, proposal, row),
        fleet.traits[row],
        merge_time_under_s(fleet, proposal, row),
        trajectory_under(fleet, proposal, other),
        fleet.traits[other],
        merge_time_under_s(fleet, proposal, other),
        from_s,
        RULES,
    )
