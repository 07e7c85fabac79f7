"""The least mean delay of a lane: by hand, against all orders, and against plans."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from coramp.core.rules import packed
from coramp.engines.outcomes import cooperative_outcome
from coramp.loading import load_scenario
from coramp.metrics.delay_bound import (
    Arrived,
    closest_headway_s,
    delay_bound,
    earliest_exits_s,
    first_come_exits_s,
    lane_headway_s,
    lane_limit_veh_h,
    quickest_exits_s,
)
from coramp.metrics.tables import tables_of
from tests.metrics import NEVER, PAPER, Car, outcome_of
from tests.situations import STEP_S, loop, scenarios, situations, traffic

IN_ORDER = ("fifo-optimal-control", "dp-sequence", "milp-sequence", "game")
"""Strategies that leave the mainline alone but for braking, and bring everyone out at v0."""


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
    found = delay_bound(arrived, earliest_s, headway_s, end_s=100.0)
    assert found == pytest.approx((0.757 / 2.0, 0.0, 0.757), abs=1e-6)
    # cut off at 41 s the second has lost half a second so far
    assert delay_bound(arrived, earliest_s, headway_s, 41.0).ramp_s == pytest.approx(0.5)


def test_a_platoon_and_a_ramp_vehicle():
    # a platoon at exactly 1.2 s with room for nobody, and one that comes between its first two:
    # it and the two behind it each wait until the lane is free again
    earliest_s = np.array([0.0, 1.2, 2.4, 0.7, 9.0])
    assert first_come_exits_s(earliest_s, 1.2) == pytest.approx([0.0, 2.4, 3.6, 1.2, 9.0])


def test_no_vehicles_and_one_stream():
    nobody = Arrived(*(np.empty(0),), np.empty(0, np.bool_), np.empty(0), np.empty(0))
    assert all(math.isnan(value) for value in delay_bound(nobody, np.empty(0), 1.2, 10.0))
    alone = Arrived(np.zeros(1), np.zeros(1, np.bool_), np.zeros(1), np.array([40.0]))
    found = delay_bound(alone, np.array([41.0]), 1.2, 100.0)
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
    assert closest_headway_s(1.2, exit_s) == pytest.approx(0.3)
    assert closest_headway_s(0.2, exit_s) == 0.2
    assert closest_headway_s(1.2, np.array([NEVER, 3.0])) == 1.2
    assert closest_headway_s(1.2, np.empty(0)) == 1.2


def finished(situation):
    """The figures of a run in the exact engine's way, its exits, and the arrivals' earliest."""
    scenario, arrivals, strategy = situation
    coordinator = loop(scenario, arrivals, strategy)
    last_step = round(400.0 / STEP_S)
    outcome = cooperative_outcome(
        coordinator, arrivals, STEP_S, last_step, np.zeros(len(coordinator.ledger))
    )
    passages = outcome.passages
    earliest_s = earliest_exits_s(
        passages.scheduled_s, passages.on_ramp, passages.entry_speed_mps, packed(scenario.rules())
    )
    return tables_of(outcome, scenario).metrics, outcome, earliest_s


@given(situations())
def test_no_run_loses_less_than_its_bound(situation):
    metrics, _, _ = finished(situation)
    assert metrics["unserved"] == 0
    assert metrics["delay_bound_s"] <= metrics["delay_s"] + 1e-9
    if metrics["delay_bound_ratio"] is not None:
        assert metrics["delay_bound_ratio"] >= 1.0 - 1e-6
    count = metrics["vehicles_mainline"], metrics["vehicles_ramp"]
    streams_s = metrics["mainline_fcfs_delay_s"] or 0.0, metrics["ramp_fcfs_delay_s"] or 0.0
    assert np.dot(count, streams_s) / sum(count) == pytest.approx(metrics["delay_bound_s"])


@st.composite
def ordered(draw):
    scenario = draw(scenarios())
    return scenario, draw(traffic(scenario)), draw(st.sampled_from(IN_ORDER))


@settings(max_examples=25)
@given(ordered())
def test_plans_in_an_order_are_no_quicker_than_the_arrivals_alone_allow(situation):
    metrics, outcome, earliest_s = finished(situation)
    scenario, exit_s = situation[0], outcome.passages.exit_s
    on_ramp, rules = outcome.passages.on_ramp, scenario.rules()
    headway_s = lane_headway_s(float(outcome.passages.length_m.min()), rules)
    assert closest_headway_s(headway_s, exit_s) >= headway_s - 1e-6
    assert metrics["lane_limit_veh_h"] == pytest.approx(3600.0 / headway_s)
    assert (exit_s >= earliest_s - 1e-6)[~on_ramp].all()
    # ramp vehicles may drive up to the ramp's limit, and up to v0 as hard as Eq. 22 allows
    road = rules.road
    v0, limit_mps = road.mainline_speed_mps, road.ramp_limit_mps
    lag_m = (v0 - limit_mps) ** 2 / (2.0 * rules.motion.ramp_acceleration_mps2)
    quickest_s = -road.ramp_start_m / limit_mps + (road.mainline_end_m + lag_m) / v0
    assert (exit_s >= outcome.passages.scheduled_s + quickest_s)[on_ramp].all()


def test_drivers_have_a_mean_delay_and_no_bound():
    cars = [Car("m00001", ((0.0, -400.0, 20.0, 0.0),), exit_s=43.0)]
    figures = tables_of(outcome_of(cars, end_s=60.0), PAPER).metrics
    assert figures["delay_s"] == pytest.approx(3.0)
    for name in ("delay_bound_s", "delay_bound_ratio", "lane_limit_veh_h"):
        assert figures[name] is None
    assert figures["mainline_fcfs_delay_s"] is None
    assert figures["ramp_fcfs_delay_s"] is None
