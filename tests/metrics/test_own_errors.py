"""Eq. 1, 15 and 16 with each vehicle's own errors: four computations, one sampled, agree."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from coramp.audit.neighbours import MARGIN, MERGE_FRONT, MERGE_REAR, Stays, extremes_in_lane
from coramp.audit.neighbours import SEVERITY as AUDITED_SEVERITY
from coramp.audit.orders import Motion
from coramp.checker.distances import least_margin_m as checked_margin_m
from coramp.checker.distances import needs_of
from coramp.metrics.margins import budget_of
from coramp.metrics.margins import least_margin_m as counted_margin_m
from coramp.metrics.separations import MARGIN as COUNTED_MARGIN
from coramp.metrics.separations import MERGE_FRONT as COUNTED_FRONT
from coramp.metrics.separations import MERGE_REAR as COUNTED_REAR
from coramp.metrics.separations import SEVERITY as COUNTED_SEVERITY
from coramp.metrics.separations import LaneUse, lane_extremes
from coramp.vehicles.fleet import pair_margin_m
from coramp.vehicles.separation import smallest_margin_m
from coramp.vehicles.traits import pair_safety
from tests.checker.test_distances import BOUNDS
from tests.mathematics import (
    RULES,
    SAFETY,
    close,
    pieces,
    random_pairs,
    sampled,
    sampled_own_margins,
    sized,
    trajectories,
    truck,
)

STREAM = -math.inf
own = st.builds(
    sized,
    st.sampled_from([4.5, 16.5]),
    positioning_error_m=st.floats(0.0, 3.0),
    clock_error_s=st.floats(0.0, 0.3),
    time_gap_s=st.floats(0.0, 2.0),
    mass_kg=st.sampled_from([1500.0, 40000.0]),
)


def assert_agreement(front, rear, start_s, end_s, front_own, rear_own):
    planned_m, when_s = smallest_margin_m(
        front, front_own[0], rear, start_s, end_s, pair_safety(front_own, rear_own, SAFETY)
    )
    needs = needs_of(front_own, rear_own)
    checked_m = checked_margin_m(front, rear, start_s, end_s, needs, BOUNDS)
    counted_m, _ = counted_margin_m(
        front, front_own[0], rear, start_s, end_s, budget_of(front_own, rear_own, SAFETY)
    )
    knots_s = np.concatenate([front[:, 0], rear[:, 0], [when_s]])
    knots_s = knots_s[(knots_s >= start_s) & (knots_s <= end_s)]
    times_s = np.concatenate([np.linspace(start_s, end_s, 3001), knots_s])
    expected_m = sampled_own_margins(front, front_own, rear, rear_own, times_s, SAFETY).min()
    for found_m in (planned_m, checked_m, counted_m):
        assert found_m == pytest.approx(expected_m, abs=1e-7)


@settings(max_examples=100)
@given(
    front=trajectories(station_m=30.0),
    rear=trajectories(station_m=0.0),
    after_s=st.floats(0.0, 10.0),
    lasts_s=st.floats(0.0, 25.0),
    front_own=own,
    rear_own=own,
)
def test_planners_checker_and_metrics_agree_with_sampling(
    front, rear, after_s, lasts_s, front_own, rear_own
):
    start_s = max(front[0, 0], rear[0, 0]) + after_s
    assert_agreement(front, rear, start_s, start_s + lasts_s, front_own, rear_own)


def test_they_agree_for_busy_pairs():
    rng = np.random.default_rng(5)
    for front, rear, start_s, lasts_s in random_pairs(4, 200):
        rows = []
        for _ in range(2):
            error_m, clock_s, gap_s = rng.uniform(0.0, (3.0, 0.3, 2.0))
            row = sized(positioning_error_m=error_m, clock_error_s=clock_s, time_gap_s=gap_s)
            rows.append(row)
        assert_agreement(front, rear, start_s, start_s + lasts_s, *rows)


# a lane: metrics and audit ------------------------------------------------------------------


def audited(ways, traits, from_s, until_s, merges):
    motion = motion_of(ways)
    stays = Stays(np.arange(len(ways)), from_s, until_s, merges)
    return extremes_in_lane(motion, traits, stays, BOUNDS).extremes


def counted(ways, traits, from_s, until_s, merges):
    motion = motion_of(ways)
    lane = LaneUse(np.arange(len(ways)), *motion, traits, from_s, until_s, merges)
    return lane_extremes(lane, RULES.road.merge_angle_rad, SAFETY)


def motion_of(ways):
    first = np.cumsum([0, *map(len, ways)]).astype(np.int64)
    return Motion(first, np.concatenate(ways))


def test_a_lane_change_counts_both_errors_and_the_lighter_vehicle_by_hand():
    # a truck at 20 m/s comes onto the mainline at 1 s, 30 m behind a car's front and 40 m ahead of
    # a truck's; each has its own error
    ways = [pieces(0.0, 30.0, 20.0), pieces(0.0, 0.0, 20.0), pieces(0.0, -40.0, 20.0)]
    traits = np.array(
        [
            sized(positioning_error_m=0.5),
            truck(positioning_error_m=1.0),
            truck(positioning_error_m=2.0),
        ]
    )
    spans = np.array([0.0, 1.0, 0.0]), np.full(3, 5.0), np.array([False, True, False])
    slower_mps = 20.0 * math.cos(math.pi / 6.0)
    dv_mps = 20.0 - slower_mps
    along_m = (3.6 * dv_mps) ** 2 / 129.54
    merge_m = [close(30.0 - 5.0 - 1.5 - along_m), close(40.0 - 16.5 - 3.0 - along_m)]
    # Eq. 5, 7 and 9: dv / (1 + k) / 0.2 s, with k = 1500 / 40000 to the car; a_p over 25 m. To the
    # truck k = 1 and 23.5 m: that is less
    squares = 20.0**2 - slower_mps**2
    severity = dv_mps / (1.0375 * 0.2) * squares / 50.0
    assert severity > dv_mps / (2.0 * 0.2) * squares / 47.0
    found = counted(ways, traits, *spans)
    assert found[[COUNTED_FRONT, COUNTED_REAR]].tolist() == merge_m
    assert found[COUNTED_SEVERITY] == close(severity)
    again = audited(ways, traits, *spans)
    assert again[[MERGE_FRONT, MERGE_REAR]].tolist() == merge_m
    assert again[AUDITED_SEVERITY] == close(severity)


def test_metrics_and_audit_agree_with_sampling_in_a_lane():
    rng = np.random.default_rng(11)
    for one, other, from_s, lasts_s in random_pairs(12, 100):
        until_s = from_s + lasts_s
        rows = []
        for _ in range(2):
            error_m, clock_s, gap_s = rng.uniform(0.0, (3.0, 0.3, 2.0))
            length_m = rng.choice([5.0, 16.5])
            budget = {"positioning_error_m": error_m, "clock_error_s": clock_s}
            rows.append(sized(length_m, **budget, time_gap_s=gap_s))
        ways = [one, other]
        if sampled(one, np.array([from_s]))[0] < sampled(other, np.array([from_s]))[0]:
            ways.reverse()
        spans = np.full(2, from_s), np.full(2, until_s), np.zeros(2, np.bool_)
        knots_s = np.concatenate([way[:, 0] for way in ways])
        knots_s = knots_s[(knots_s >= from_s) & (knots_s <= until_s)]
        times_s = np.concatenate([np.linspace(from_s, until_s, 20001), knots_s])
        expected_m = sampled_own_margins(ways[0], rows[0], ways[1], rows[1], times_s, SAFETY).min()
        found_m = counted(ways, np.array(rows), *spans)[COUNTED_MARGIN]
        assert found_m == pytest.approx(expected_m, abs=1e-5)
        assert audited(ways, np.array(rows), *spans)[MARGIN] == close(found_m)


# a pair of planners -------------------------------------------------------------------------


def test_planners_count_own_errors_before_after_and_at_the_merge_by_hand():
    # A merges at 12 s at 36 m, 20 m/s; the truck is then 30 m ahead
    a_way = pieces(0.0, -160.0, 16.0, [(16.0, 10.0), (20.0, 2.0)])
    ahead = pieces(0.0, 66.0 - 240.0, 20.0)
    own, front = sized(positioning_error_m=1.0, time_gap_s=0.4), truck(clock_error_s=0.05)
    # Eq. 15: 30 - 16.5 - 1.02 - 0.7183; Eq. 1 with 0.05 * 20 and 0.4 * 20 is more: 3.48 m
    eq_15_m = 30.0 - 16.5 - 1.02 - (3.6 * 20.0 * (1.0 - math.cos(math.pi / 6.0))) ** 2 / 129.54
    eq_1_m = 30.0 - 16.5 - 1.02 - 0.05 * 20.0 - 3e-9 * 20.0 - 8.0
    assert eq_1_m < eq_15_m
    pair = a_way, own, 12.0, ahead, front, STREAM
    assert pair_margin_m(*pair, 0.0, RULES) == close(eq_1_m)
    swapped = ahead, front, STREAM, a_way, own, 12.0
    assert pair_margin_m(*swapped, 0.0, RULES) == close(eq_1_m)
    no_gap = sized(positioning_error_m=1.0)
    front = truck()
    assert pair_margin_m(a_way, no_gap, 12.0, ahead, front, STREAM, 0.0, RULES) == close(eq_15_m)
