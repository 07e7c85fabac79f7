"""The least mean delay of a lane: by hand, against all orders, and against plans."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from coramp.metrics.delay_bound import (
    Arrived,
    earliest_exits_s,
    first_come_exits_s,
    lane_headway_s,
    lane_limit_veh_h,
    mean_delays,
    quickest_exits_s,
    saved_s,
)
from coramp.metrics.tables import tables_of
from coramp.road.rules import packed
from coramp.scenarios.loading import load_scenario
from coramp.worlds.outcomes import cooperative_outcome
from tests.metrics import NEVER, PAPER, Car, outcome_of
from tests.situations import COOPERATIVE, STEP_S, loop, situations

PLANNED = [name for name in COOPERATIVE if not name.startswith(("virtual", "ocbf"))]
"""Strategies whose plans bring everyone to v0 before the zone ends."""


def with_gaps(time_gap_s, standstill_gap_m=0.0):
    overrides = {
        "safety.time_gap_s": time_gap_s,
        "safety.standstill_gap_m": standstill_gap_m,
    }
    return load_scenario("paper", overrides)


def earliest_of(scenario, *arrivals):
    """Earliest exits of ``(scheduled, on the ramp, entry speed)``."""
    scheduled_s, on_ramp, speed_mps = zip(*arrivals, strict=True)
    return earliest_exits_s(
        np.array(scheduled_s, float),
        np.array(on_ramp, np.bool_),
        np.array(speed_mps, float),
        packed(scenario.rules()),
    )


@pytest.mark.parametrize(
    ("time_gap_s", "standstill_gap_m", "headway_s", "limit_veh_h"),
    [
        # 5 m, 0.04 of Eq. 1 and 0.1 of the allowance at 20 m/s are 0.257 s
        (0.0, 0.0, 0.257, 14007.78),
        (1.0, 0.0, 1.257, 2863.96),
        (1.0, 2.5, 1.382, 2604.92),
        (0.6, 2.5, 0.982, 3665.99),
        (1.4, 0.0, 1.657, 2172.60),
    ],
)
def test_headway_and_limit_of_the_lane(time_gap_s, standstill_gap_m, headway_s, limit_veh_h):
    found_s = lane_headway_s(5.0, with_gaps(time_gap_s, standstill_gap_m).rules())
    assert found_s == pytest.approx(headway_s, abs=1e-8)
    assert lane_limit_veh_h(found_s) == pytest.approx(limit_veh_h, abs=0.01)


def test_earliest_exits_on_the_mainline():
    # at 20 m/s 800 m in 40 s; at 15 m/s 0.1 s of delay and 10/3 s of 1.5 m/s2 lose 0.5 + 25/3 m
    found = earliest_of(PAPER, (7.0, False, 20.0), (7.0, False, 15.0))
    assert found == pytest.approx([47.0, 47.0 + (0.5 + 25.0 / 3.0) / 20.0])


def test_earliest_exits_from_the_ramp():
    # at 16 m/s 25 s to the nose, 4 m lost to v0 with 2 m/s2, 400 m: 45.2 s
    # at 15 m/s 0.1 m and 1/3 m are lost on the ramp, at 17 m/s 0.1 m and 0.25 m gained
    found = earliest_of(PAPER, (3.0, True, 16.0), (3.0, True, 15.0), (3.0, True, 17.0))
    assert found == pytest.approx([48.2, 48.2 + (0.1 + 1.0 / 3.0) / 16.0, 48.2 - 0.35 / 16.0])


def test_two_vehicles_want_one_slot():
    # out at 40.0 and 40.5 s; the second waits for its 1.257 s: 0 and 0.757 s of delay
    scenario = with_gaps(1.0)
    arrivals = (0.0, False, 20.0), (-4.7, True, 16.0)
    earliest_s = earliest_of(scenario, *arrivals)
    assert earliest_s == pytest.approx([40.0, 40.5])
    headway_s = lane_headway_s(5.0, scenario.rules())
    arrived = Arrived(
        np.array([0.0, -4.7]), np.array([False, True]), np.array([20.0, 16.0]), np.array([40, 45.2])
    )
    exit_s = first_come_exits_s(earliest_s, headway_s)
    found = mean_delays(arrived, exit_s)
    assert found == pytest.approx((0.757 / 2.0, 0.0, 0.757), abs=1e-6)


def test_a_platoon_and_a_ramp_vehicle():
    # a platoon at exactly 1.2 s with room for nobody, and one that comes between its first two:
    # it and the two behind it each wait until the lane is free again
    earliest_s = np.array([0.0, 1.2, 2.4, 0.7, 9.0])
    assert first_come_exits_s(earliest_s, 1.2) == pytest.approx([0.0, 2.4, 3.6, 1.2, 9.0])


def test_no_vehicles_and_one_stream():
    nobody = Arrived(*(np.empty(0),), np.empty(0, np.bool_), np.empty(0), np.empty(0))
    assert all(math.isnan(value) for value in mean_delays(nobody, np.empty(0)))
    alone = Arrived(np.zeros(1), np.zeros(1, np.bool_), np.zeros(1), np.array([40.0]))
    found = mean_delays(alone, np.array([41.0]))
    assert found[:2] == (1.0, 1.0)
    assert math.isnan(found.ramp_s)


@given(
    st.lists(st.floats(0.0, 8.0), min_size=1, max_size=6),
    st.floats(0.2, 2.0),
)
def test_no_order_has_a_smaller_sum(earliest_s, headway_s):
    least_s = math.inf
    for order in itertools.permutations(earliest_s):
        last_s, sum_s = -math.inf, 0.0
        for e in order:
            last_s = max(e, last_s + headway_s)
            sum_s += last_s
        least_s = min(least_s, sum_s)
    found_s = first_come_exits_s(np.array(earliest_s), headway_s)
    assert found_s.sum() == pytest.approx(least_s, abs=1e-9)
    assert (found_s >= np.array(earliest_s)).all()


def test_what_a_run_did_quicker_counts():
    exit_s = np.array([40.2, NEVER, 39.9, 44.0])
    assert quickest_exits_s(np.array([40.0, 41.0, 41.2, 44.5]), exit_s).tolist() == [
        40.0,
        41.0,
        39.9,
        44.0,
    ]
    # out 0.3 and 3.8 s apart: 0.9 s saved by one headway, and by two or more
    assert saved_s(1.2, exit_s) == pytest.approx([0.0, 0.9])
    assert saved_s(4.0, exit_s) == pytest.approx([0.0, 3.7, 3.9])
    assert saved_s(0.2, exit_s).tolist() == [0.0]
    assert saved_s(1.2, np.array([NEVER, 3.0])).tolist() == [0.0]


def test_saved_headways_count_from_the_head_of_a_queue():
    # 1.2 s apart from 0 s on, 0.5 s saved by one headway and 0.7 s by two or more
    earliest_s, saved = np.array([0.0, 0.1, 0.2, 2.0, 9.0]), np.array([0.0, 0.5, 0.7])
    found_s = first_come_exits_s(earliest_s, 1.2, saved)
    assert found_s == pytest.approx([0.0, 0.7, 1.7, 2.9, 9.0])


@given(
    st.lists(st.tuples(st.floats(0.0, 6.0), st.floats(0.0, 3.0)), min_size=1, max_size=8),
    st.floats(0.2, 2.0),
)
def test_no_run_of_any_headways_is_beaten(vehicles, headway_s):
    earliest_s, late_s = np.array(vehicles).T
    exit_s = earliest_s + late_s
    found_s = first_come_exits_s(earliest_s, headway_s, saved_s(headway_s, exit_s))
    assert found_s.sum() <= exit_s.sum() + 1e-9
    assert (found_s >= earliest_s).all()


def finished(situation):
    """The figures and the outcome of a run, as the exact engine makes them."""
    scenario, arrivals, strategy = situation
    coordinator = loop(scenario, arrivals, strategy)
    no_error_m = np.zeros(len(coordinator.ledger))
    outcome = cooperative_outcome(coordinator, arrivals, STEP_S, round(400.0 / STEP_S), no_error_m)
    return tables_of(outcome, scenario).metrics, outcome


@settings(max_examples=40)
@given(situations())
def test_no_run_loses_less_than_its_bound(situation):
    metrics, _ = finished(situation)
    assert metrics["unserved"] == 0
    assert metrics["delay_bound_s"] <= metrics["delay_s"] + 1e-9
    if metrics["delay_bound_ratio"] is not None:
        assert metrics["delay_bound_ratio"] >= 1.0 - 1e-6
    count = metrics["vehicles_mainline"], metrics["vehicles_ramp"]
    streams_s = metrics["mainline_fcfs_delay_s"] or 0.0, metrics["ramp_fcfs_delay_s"] or 0.0
    # of the arrivals alone, so never less than where the run's own early exits are granted
    assert np.dot(count, streams_s) / sum(count) >= metrics["delay_bound_s"] - 1e-9


@settings(max_examples=30)
@given(situations(PLANNED))
def test_planned_vehicles_leave_at_the_lane_s_headway_or_later(situation):
    metrics, outcome = finished(situation)
    rules = situation[0].rules()
    headway_s = lane_headway_s(float(outcome.passages.length_m.min()), rules)
    assert saved_s(headway_s, outcome.passages.exit_s)[-1] < 1e-6
    assert metrics["lane_limit_veh_h"] == pytest.approx(3600.0 / headway_s)


CLEAR = ((0.0, -400.0, 20.0, 0.0),)


def bound_of(*cars, end_s=100.0):
    scenario = with_gaps(1.0)
    return tables_of(outcome_of(cars, end_s=end_s, cooperative=True), scenario).metrics


def test_the_figures_of_a_run_by_hand():
    # earliest exits 40, 40.5 and 41 s: 0 + 0.757 + 1.514 s of delay at least; it lost 0, 2 and 3 s
    cars = [
        Car(f"m{k:05d}", CLEAR, scheduled_s=0.5 * k, entry_s=0.5 * k, exit_s=40.0 + 0.5 * k + lost)
        for k, lost in enumerate((0.0, 2.0, 3.0))
    ]
    figures = bound_of(*cars)
    assert figures["delay_s"] == pytest.approx(5.0 / 3.0)
    assert figures["delay_bound_s"] == pytest.approx(2.271 / 3.0)
    assert figures["delay_bound_ratio"] == pytest.approx(5.0 / 2.271)
    assert figures["mainline_fcfs_delay_s"] == pytest.approx(2.271 / 3.0)
    assert figures["ramp_fcfs_delay_s"] is None
    assert figures["lane_limit_veh_h"] == pytest.approx(2863.96, abs=0.01)


def test_what_a_run_did_not_do_by_its_end_counts_up_to_it():
    cars = [Car(f"m{k:05d}", CLEAR, entry_s=0.0, exit_s=NEVER) for k in range(3)]
    # out at 40, 41.257 and 42.514 s at best, cut off at 41 s
    figures = bound_of(*cars, end_s=41.0)
    assert figures["delay_s"] == pytest.approx(1.0)
    assert figures["delay_bound_s"] == pytest.approx(2.0 / 3.0)
    assert figures["mainline_fcfs_delay_s"] == pytest.approx((1.257 + 2.514) / 3.0)


def test_an_early_vehicle_lowers_the_bound_of_its_run_alone():
    late = Car("m00002", CLEAR, scheduled_s=0.0, exit_s=41.057)
    figures = bound_of(Car("m00001", CLEAR, exit_s=39.8), late)
    assert figures["delay_bound_s"] == pytest.approx((-0.2 + 1.057) / 2.0)
    assert figures["delay_bound_ratio"] == pytest.approx(1.0)
    assert figures["mainline_fcfs_delay_s"] == pytest.approx(1.257 / 2.0)


def test_no_ratio_to_a_bound_of_nothing():
    figures = bound_of(Car("m00001", CLEAR, exit_s=41.0))
    assert figures["delay_bound_s"] == pytest.approx(0.0)
    assert figures["delay_bound_ratio"] is None


def test_drivers_have_a_mean_delay_and_no_bound():
    cars = [Car("m00001", ((0.0, -400.0, 20.0, 0.0),), exit_s=43.0)]
    figures = tables_of(outcome_of(cars, end_s=60.0), PAPER).metrics
    assert figures["delay_s"] == pytest.approx(3.0)
    for name in ("delay_bound_s", "delay_bound_ratio", "lane_limit_veh_h"):
        assert figures[name] is None
    assert figures["mainline_fcfs_delay_s"] is None
    assert figures["ramp_fcfs_delay_s"] is None
