"""The checker holds each vehicle to what it can do itself, and to its own errors."""

import numpy as np
import pytest

from coramp.checker.checker import Entry, examine_entry
from coramp.checker.reasons import ACCEPTED, TOO_FAST, TOO_HARD, TOO_NEAR, TOO_NEAR_AT_MERGE
from tests.checker.test_checker import (
    L_R,
    MERGE,
    ROAD,
    STREAM,
    New,
    R,
    X,
    Y,
    _on_road,
    traffic,
    verdict,
)
from tests.checker.test_distances import BOUNDS
from tests.mathematics import close, pieces, sized, truck


def alone(way, traits, merge_s=STREAM, makes_gap=0, others=(), new=()):
    vehicles = [(way, merge_s, traits), *others]
    return verdict(New(0, way, merge_s, makes_gap), *new, vehicles=vehicles, earliest_s=1.0).code


# power, top speed, braking ------------------------------------------------------------------


@pytest.mark.parametrize(("share", "code"), [(1.0, ACCEPTED), (1.001, TOO_HARD)])
def test_power_binds_at_the_end_of_a_piece(share, code):
    # 5.5 W/kg at 20 m/s: 0.275 m/s2; at the piece's start, 16 m/s, it could do 0.344
    rate_mps2 = share * 5.5 / 20.0
    way = pieces(1.0, -300.0, 16.0, [(20.0, 4.0 / rate_mps2)])
    assert alone(way, truck()) == code
    assert alone(way, sized()) == ACCEPTED


@pytest.mark.parametrize(("rate_mps2", "code"), [(1.0, ACCEPTED), (1.001, TOO_HARD)])
def test_the_largest_acceleration_binds_at_low_speeds(rate_mps2, code):
    way = pieces(1.0, -300.0, 2.0, [(5.0, 3.0 / rate_mps2)])
    assert alone(way, truck()) == code
    assert alone(way, sized()) == ACCEPTED


def test_power_binds_on_the_acceleration_lane_too():
    assert verdict(New(R, MERGE, 12.0)).code == ACCEPTED
    road = [*ROAD[:2], (*ROAD[2], truck()), ROAD[3]]
    assert verdict(New(R, MERGE, 12.0), vehicles=road).code == TOO_HARD


@pytest.mark.parametrize(("rate_mps2", "code"), [(1.5, ACCEPTED), (1.501, TOO_HARD)])
def test_weak_brakes_bind(rate_mps2, code):
    way = pieces(1.0, -300.0, 20.0, [(14.0, 6.0 / rate_mps2)])
    assert alone(way, truck(braking_mps2=1.5)) == code
    assert alone(way, truck()) == ACCEPTED
    # brakes that are better than comfort allow no more than comfort
    harder = pieces(1.0, -300.0, 20.0, [(14.0, 6.0 / 2.941)])
    assert alone(harder, truck(braking_mps2=9.0)) == TOO_HARD


@pytest.mark.parametrize(("speed_mps", "code"), [(18.0, ACCEPTED), (18.001, TOO_FAST)])
def test_nobody_is_commanded_above_its_own_top_speed(speed_mps, code):
    way = pieces(1.0, -300.0, 15.0, [(speed_mps, 3.0)])
    assert alone(way, sized(top_speed_mps=18.0)) == code
    assert alone(way, sized()) == ACCEPTED


def test_one_that_enters_above_its_top_speed_slows_down_from_there():
    slow = sized(top_speed_mps=18.0)
    assert alone(pieces(1.0, -300.0, 20.0, [(18.0, 1.0)]), slow) == ACCEPTED
    assert alone(pieces(1.0, -300.0, 20.0, [(20.1, 1.0), (18.0, 1.0)]), slow) == TOO_FAST


def test_a_gap_maker_may_not_exceed_its_own_top_speed_either():
    # 21 m/s for a while is a gap maker's right, but not that of one that drives 20 m/s at most
    ahead = pieces(1.0, -169.0, 20.0, [(21.0, 2.0), (20.0, 2.0)])
    for traits, code in ((sized(), ACCEPTED), (sized(top_speed_mps=20.0), TOO_FAST)):
        road = [(*ROAD[0], traits), *ROAD[1:]]
        found = verdict(New(R, MERGE, 12.0), New(X, ahead, STREAM, 1), vehicles=road)
        assert found.code == code


@pytest.mark.parametrize(
    ("way", "code"),
    [
        (pieces(0.0, -400.0, 16.0, [(18.0, 2.0 * 18.0 / 5.5)]), ACCEPTED),
        (pieces(0.0, -400.0, 16.0, [(18.0, 2.0 * 17.9 / 5.5)]), TOO_HARD),
        (pieces(0.0, -400.0, 20.0, [(24.001, 20.0)]), TOO_FAST),
    ],
)
def test_an_entry_is_held_to_its_own_limits(way, code):
    bounds = BOUNDS._replace(mainline_speed_mps=27.0)
    entry = Entry(0.0, -400.0, way[0, 2], truck(), False)
    assert examine_entry(traffic(), entry, way, bounds).code == code


# distances ----------------------------------------------------------------------------------


@pytest.mark.parametrize("row", [R, X])
@pytest.mark.parametrize(("more_m", "code"), [(0.0, ACCEPTED), (-0.001, TOO_NEAR_AT_MERGE)])
def test_the_larger_error_of_either_counts_at_the_lane_change(row, more_m, code):
    # 1.48 m more than the usual 0.02 m on one side
    vehicles = _on_road(x_gap_m=L_R + 0.1 + 1.48 + more_m)
    own = sized(positioning_error_m=1.5)
    vehicles[row] = (*vehicles[row], own)
    found = verdict(New(R, MERGE, 12.0), vehicles=vehicles)
    assert found.code == code
    assert found.least_margin_m == close(0.1 + more_m)


@pytest.mark.parametrize(
    ("front", "rear", "needed_m"),
    [
        (sized(), sized(time_gap_s=0.5), 0.04 + 10.0),
        (sized(time_gap_s=0.5), sized(), 0.04),  # it keeps that to whom it follows
        (sized(clock_error_s=0.02), sized(), 0.04 + 0.4),
        (sized(), sized(clock_error_s=0.02), 0.04 + 0.4),
        (sized(positioning_error_m=0.5), sized(positioning_error_m=0.8), 1.3),
        (truck(), sized(), 11.5 + 0.04),
    ],
)
@pytest.mark.parametrize(("more_m", "code"), [(0.11, ACCEPTED), (0.09, TOO_NEAR)])
def test_each_ones_own_errors_count_on_the_mainline(front, rear, needed_m, more_m, code):
    behind = pieces(1.0, 100.0 - 5.0 - needed_m - more_m, 20.0)
    road = [(pieces(1.0, 100.0, 20.0), STREAM, front), (behind, STREAM, rear)]
    found = verdict(New(1, behind, STREAM), vehicles=road)
    assert found.code == code
    assert found.least_margin_m == pytest.approx(more_m, abs=1e-6)


def test_an_entry_too_near_by_its_own_errors_is_refused():
    ahead = (pieces(0.0, -390.0, 20.0), STREAM)
    way = pieces(0.0, -400.0, 20.0)
    record = traffic(ahead)
    for own, code in ((sized(), ACCEPTED), (sized(positioning_error_m=4.9), TOO_NEAR)):
        entry = Entry(0.0, -400.0, 20.0, own, False)
        assert examine_entry(record, entry, way, BOUNDS).code == code


def test_pairs_that_are_skipped_for_being_far_apart_are_so_by_their_own_needs_too():
    # 60 m apart: enough for all but one that keeps 3 s; a third vehicle behind has others looked at
    rng = np.random.default_rng(3)
    refused = 0
    for _ in range(200):
        gap_s, error_m = rng.uniform(0.0, 4.0), rng.uniform(0.0, 3.0)
        own = sized(time_gap_s=gap_s, positioning_error_m=error_m, clock_error_s=0.01)
        gap_m = rng.uniform(10.0, 90.0)
        way = pieces(1.0, 100.0 - 5.0 - gap_m, 20.0)
        road = [
            (pieces(1.0, 100.0, 20.0), STREAM),
            (way, STREAM, own),
            (pieces(1.0, -300.0, 20.0), STREAM),
        ]
        found = verdict(New(1, way, STREAM), vehicles=road)
        margin_m = gap_m - error_m - 0.02 - 0.01 * 20.0 - 20.0 * gap_s
        assert found.code == (TOO_NEAR if margin_m < 0.1 - 1e-6 else ACCEPTED)
        refused += found.code == TOO_NEAR
    assert 30 < refused < 170


def test_the_one_behind_a_merge_keeps_its_own_time_gap():
    # Y, 8 m behind R at its merge, keeps 0.5 s: 10 m
    road = [ROAD[0], (*ROAD[1], sized(time_gap_s=0.5)), *ROAD[2:]]
    found = verdict(New(R, MERGE, 12.0), vehicles=road)
    assert (found.code, found.row, found.other_row) == (TOO_NEAR, R, Y)
    road[Y] = (*ROAD[1], sized(time_gap_s=0.3))
    assert verdict(New(R, MERGE, 12.0), vehicles=road).code == ACCEPTED
