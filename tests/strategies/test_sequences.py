"""Orders of merging: dynamic programming against all orders, the program against both, the game."""

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from coramp.strategies.dp_sequence import DpSequence
from coramp.strategies.game import GO, YIELD, Game
from coramp.strategies.milp_sequence import MilpSequence
from coramp.strategies.sequence import Crossings, gaps_around


@st.composite
def queues(draw, most=8):
    """Up to ``most`` vehicles on both streams, near enough to be in one another's way."""
    lanes = draw(st.integers(0, most - 1))
    ramps = draw(st.integers(1, most - lanes))
    times = st.floats(0.0, 4.0).map(lambda t: round(t, 3))
    lengths = st.sampled_from([0.26, 0.6, 1.5])

    def stream(count):
        return np.sort(np.array([draw(times) for _ in range(count)]))

    def follows(count):
        return np.array([draw(lengths) for _ in range(count)])

    return Crossings(stream(lanes), stream(ramps), follows(lanes), follows(ramps))


def crossed(seen, ramp_places, same_s=0.0, cross_s=0.0):
    """Crossing times in the order in which ramp vehicles take the given places."""
    n = len(seen.mainline_s) + len(seen.ramp_s)
    times, m, r, last, last_ramp, gap = [], 0, 0, -np.inf, None, 0.0
    delay = 0.0
    for k in range(n):
        ramp = k in ramp_places
        earliest = seen.ramp_s[r] if ramp else seen.mainline_s[m]
        least = 0.0 if last_ramp is None else (same_s if ramp == last_ramp else cross_s)
        time = max(earliest, last + max(gap, least)) if last_ramp is not None else earliest
        gap = seen.ramp_next_s[r] if ramp else seen.mainline_next_s[m]
        delay += time - earliest
        r, m = (r + 1, m) if ramp else (r, m + 1)
        times.append(time)
        last, last_ramp = time, ramp
    return times, delay


def least_cost(seen, weight, same_s=0.0, cross_s=0.0):
    n = len(seen.mainline_s) + len(seen.ramp_s)
    costs = []
    for places in combinations(range(n), len(seen.ramp_s)):
        times, delay = crossed(seen, places, same_s, cross_s)
        costs.append(weight * times[-1] + delay)
    return min(costs)


@settings(max_examples=60)
@given(queues(), st.sampled_from([0.0, 1.0, 3.0]), st.sampled_from([(0.0, 0.0), (1.5, 2.0)]))
def test_dynamic_programming_equals_brute_force(seen, weight, least):
    strategy = DpSequence(*least, weight)
    best = strategy.best(seen)
    assert weight * best.last_s + best.delay_s == pytest.approx(least_cost(seen, weight, *least))
    places = [k for k, ramp in enumerate(best.ramp) if ramp]
    times, delay = crossed(seen, places, *least)
    assert (times[-1], delay) == (pytest.approx(best.last_s), pytest.approx(best.delay_s))


@settings(max_examples=100)
@given(queues(7), st.floats(0.0, 12.0), st.sampled_from([(0.0, 0.0), (1.5, 2.0), (0.0, 8.0)]))
def test_who_surely_goes_first_changes_nothing_for_the_others(seen, later_s, least):
    """Lane vehicles long before the ramp's first are left out; the best order is that of all."""
    lane_s = np.sort(np.concatenate([seen.mainline_s[:1] - later_s, seen.mainline_s[1:]]))
    seen = replace(seen, mainline_s=lane_s)
    strategy = DpSequence(*least, 0.0)
    before = strategy.vehicles_before(seen)
    costs = [
        crossed(seen, places, *least)[1]
        for places in combinations(range(len(lane_s) + len(seen.ramp_s)), len(seen.ramp_s))
        if places[0] == before
    ]
    assert min(costs) == pytest.approx(least_cost(seen, 0.0, *least))


def test_a_lane_vehicle_of_long_ago_still_binds_where_gaps_are_long():
    # by hand: L1, L2, S: S crosses at 8.5 s; L1, S, L2: at 1.5 s, and L2 at 9.5 s, 10.5 s in all
    seen = Crossings(*map(np.array, ([-6.5, 0.5], [0.0], [0.26, 0.26], [0.26])))
    assert DpSequence(0.0, 8.0, 0.0).vehicles_before(seen) == 2
    assert MilpSequence(0.0, 8.0).vehicles_before(seen) == 2


@settings(max_examples=40, deadline=None)
@given(queues(7), st.sampled_from([(0.0, 0.0), (1.5, 2.0)]))
def test_the_program_equals_dynamic_programming_where_both_apply(seen, least):
    lane_s, ramp_s = MilpSequence(*least).crossing_times_s(seen)
    delay = (lane_s - seen.mainline_s).sum() + (ramp_s - seen.ramp_s).sum()
    assert delay == pytest.approx(DpSequence(*least, 0.0).best(seen).delay_s, abs=2e-3)


def test_one_value_a_state_would_not_be_enough():
    # the first crossing is late either way; only who loses less until then differs
    seen = Crossings(*map(np.array, ([0.0, 1.0], [0.1], [1.5, 1.5], [0.26])))
    best = DpSequence(last_weight=0.0).best(seen)
    assert best.delay_s == pytest.approx(least_cost(seen, 0.0))


def test_a_subject_that_disturbs_nobody_goes_where_it_would():
    seen = Crossings(*map(np.array, ([0.0, 5.0], [2.5], [0.26, 0.26], [0.26])))
    for strategy in (DpSequence(), MilpSequence()):
        assert strategy.vehicles_before(seen) == 1
    assert Game().vehicles_before(seen, -10.0, 20.0) == 1


def test_two_platoons_and_one_between_them():
    # Pei et al.: passing a platoon at once is better than alternating, where changing streams costs
    seen = Crossings(*map(np.array, ([0.0, 1.5, 3.0], [0.2, 1.7], [0.26] * 3, [0.26] * 2)))
    best = DpSequence(same_stream_s=1.5, cross_stream_s=4.0, last_weight=1.0).best(seen)
    assert list(best.ramp) in ([False] * 3 + [True] * 2, [True] * 2 + [False] * 3)


def test_who_would_lose_more_goes_first():
    game = Game()
    # the ramp vehicle is just ahead: letting it go costs the other 0.16 s, the reverse 0.36 s
    assert not game.ramp_yields(0.0, 0.1, 0.26, 0.26, -12.0, 20.0)
    assert game.ramp_yields(0.1, 0.0, 0.26, 0.26, -12.0, 20.0)


def test_payoffs_by_hand():
    ramp, lane = Game(1.0, 0.05, 10.0).payoffs(0.0, 0.2, 0.4, 0.4, -10.0, 20.0)
    assert ramp[GO, GO] == lane[GO, GO] == pytest.approx(-10.0 * (1.0 - 0.2 / 0.4))
    assert ramp[GO, YIELD] == lane[YIELD, GO] == 0.0
    late, effort = 0.6, 6.0 * (20.0 * 0.6) ** 2 / 10.0**3
    assert ramp[YIELD, GO] == pytest.approx(-(late + 0.05 * effort))
    late, effort = 0.2, 6.0 * (20.0 * 0.2) ** 2 / 10.2**3
    assert lane[GO, YIELD] == pytest.approx(-(late + 0.05 * effort))


def test_the_gaps_around_a_chosen_one():
    assert gaps_around(2, 6).tolist() == [2, 3, 1, 4, 0, 5]
    assert gaps_around(0, 1).tolist() == [0]
