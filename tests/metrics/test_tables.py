import math

import numpy as np
import polars as pl
import pytest

from coramp.coordination.decision_log import DecisionRecord, Refusal
from coramp.metrics.frames import decisions_table, trajectories_table
from coramp.metrics.tables import tables_of
from coramp.records.schemas import RUN_METRICS, SPEEDS, TRAJECTORIES, VEHICLES, VIOLATIONS
from coramp.strategies.base import Explanation
from tests.metrics import NEVER, PAPER, Car, outcome_of

CRUISE = ((0.0, -400.0, 20.0, 0.0),)
RAMP_FREE_FLOW_S = 25.0 + 2.0 + 364.0 / 20.0


def cruising(name, entry_s, exit_s, scheduled_s=None, speed=20.0, **rest):
    return Car(
        name,
        ((entry_s, -400.0, speed, 0.0),),
        scheduled_s=entry_s if scheduled_s is None else scheduled_s,
        entry_s=entry_s,
        exit_s=exit_s,
        **rest,
    )


def rows(frame, *columns):
    return frame.select(*columns).rows()


class TestVehicles:
    CARS = (
        cruising("m00001", entry_s=1.0, exit_s=43.0, scheduled_s=0.0),
        cruising("r00001", entry_s=2.0, exit_s=50.2, scheduled_s=2.0, merge_s=30.0),
        cruising("m00002", entry_s=12.0, exit_s=NEVER, scheduled_s=10.0),
        Car("r00002", scheduled_s=20.0, entry_s=NEVER),
    )

    @pytest.fixture
    def table(self):
        return tables_of(outcome_of(self.CARS, end_s=100.0), PAPER).vehicles

    def test_columns_and_order_are_those_of_the_file(self, table):
        assert dict(table.schema) == VEHICLES
        assert table["vehicle_id"].to_list() == ["m00001", "r00001", "m00002", "r00002"]
        assert table["stream"].to_list() == ["mainline", "ramp", "mainline", "ramp"]

    def test_delay_counts_from_the_scheduled_entry_less_free_flow(self, table):
        assert table["delay_s"].to_list()[:2] == pytest.approx([3.0, 48.2 - RAMP_FREE_FLOW_S])
        assert table["free_flow_s"].to_list() == pytest.approx([40.0, RAMP_FREE_FLOW_S] * 2)

    def test_waiting_outside_is_delay(self, table):
        assert table["waiting_s"].to_list() == pytest.approx([1.0, 0.0, 2.0, 80.0])
        assert table["travel_s"].to_list()[:2] == pytest.approx([42.0, 48.2])

    def test_who_is_not_out_counts_up_to_the_cap(self, table):
        assert table["finished"].to_list() == [True, True, False, False]
        delays = table["delay_s"].to_list()[2:]
        assert delays == pytest.approx([100.0 - 10.0 - 40.0, 100.0 - 20.0 - RAMP_FREE_FLOW_S])
        assert table["travel_s"].to_list()[2:] == pytest.approx([88.0, 0.0])
        assert table["exit_s"].to_list()[2:] == [None, None]
        assert table["entry_s"].to_list()[3] is None

    def test_mean_speed_is_the_way_over_the_travel_time(self, table):
        assert table["mean_speed_mps"].to_list() == [
            pytest.approx(800.0 / 42.0),
            pytest.approx(800.0 / 48.2),
            None,
            None,
        ]

    def test_fuel_is_counted_between_entry_and_exit_or_cap(self, table):
        per_s = (0.1569 + 0.0245 * 20.0 - 7.415e-4 * 400.0 + 5.975e-5 * 8000.0) / 1000.0
        assert table["fuel_l"].to_list() == pytest.approx(
            [42.0 * per_s, 48.2 * per_s, 88.0 * per_s, 0.0]
        )

    def test_the_streams_figures_are_means_over_everybody(self, table):
        mainline, _ = tables_of(outcome_of(self.CARS, end_s=100.0), PAPER).streams
        assert (mainline["vehicles"], mainline["unserved"]) == (2, 1)
        assert mainline["delay_s"] == pytest.approx((3.0 + 50.0) / 2.0)
        assert mainline["waiting_s"] == pytest.approx(1.5)
        assert mainline["speed_mps"] == pytest.approx(800.0 / 42.0)

    def test_an_unserved_vehicle_makes_the_mean_worse_the_longer_it_is_left(self):
        means = [
            tables_of(outcome_of(self.CARS, end_s=end_s), PAPER).vehicles["delay_s"].mean()
            for end_s in (200.0, 300.0)
        ]
        assert means[1] - means[0] == pytest.approx(100.0 * 2 / 4)


def test_the_95th_percentile_lies_between_the_nearest_two():
    cars = [
        cruising(f"m{k:05d}", entry_s=0.0, exit_s=40.0 + delay)
        for k, delay in enumerate([0.0, 1.0, 2.0, 3.0, 10.0])
    ]
    outcome = outcome_of(cars, end_s=60.0)
    figures, _ = tables_of(outcome, PAPER).streams
    # 0.95 (5 - 1) = 3.8: eight tenths of the way from 3 to 10
    assert figures["delay_p95_s"] == pytest.approx(3.0 + 0.8 * 7.0)
    assert figures["delay_s"] == pytest.approx(3.2)


class TestSpeeds:
    CARS = (
        Car("m00001", ((0.0, -400.0, 10.0, 0.0),), exit_s=2.0),
        Car("m00002", ((1.0, -400.0, 20.0, 0.0),), entry_s=1.0, exit_s=2.0),
        Car("m00003", ((4.0, -400.0, 16.0, 0.0),), entry_s=4.0, exit_s=4.5),
        Car("r00001", ((1.0, -400.0, 8.0, 2.0),), entry_s=1.0, exit_s=2.0, merge_s=1.5),
    )

    @pytest.fixture
    def speeds(self):
        return tables_of(outcome_of(self.CARS, end_s=5.0), PAPER).speeds

    def test_bins_hold_the_space_mean_speed_and_empty_ones_are_left_out(self, speeds):
        assert dict(speeds.schema) == SPEEDS
        assert rows(speeds, "stream", "time_s", "mean_speed_mps", "vehicles") == [
            ("mainline", 0.0, 10.0, 1),
            ("mainline", 1.0, 15.0, 2),
            ("mainline", 4.0, 16.0, 1),
            ("ramp", 1.0, 9.0, 1),
        ]

    def test_fluctuation_is_the_standard_deviation_over_bins(self):
        mainline, ramp = tables_of(outcome_of(self.CARS, end_s=5.0), PAPER).streams
        mean = (10.0 + 15.0 + 16.0) / 3.0
        variance = ((10.0 - mean) ** 2 + (15.0 - mean) ** 2 + (16.0 - mean) ** 2) / 3.0
        assert mainline["speed_std_mps"] == pytest.approx(math.sqrt(variance))
        assert ramp["speed_std_mps"] == pytest.approx(0.0)


def test_a_stream_without_vehicles_has_counts_but_no_figures():
    outcome = outcome_of([cruising("m00001", 0.0, 41.0)], end_s=60.0)
    tables = tables_of(outcome, PAPER)
    ramp = tables.streams[1]
    assert (ramp["stream"], ramp["vehicles"], ramp["unserved"], ramp["fuel_l"]) == ("ramp", 0, 0, 0)
    for key in ("delay_s", "delay_p95_s", "waiting_s", "speed_mps", "speed_std_mps"):
        assert ramp[key] is None
        assert tables.streams[0][key] is not None


def test_a_run_without_vehicles_has_all_its_columns():
    tables = tables_of(outcome_of([], end_s=60.0), PAPER)
    assert set(tables.metrics) == set(RUN_METRICS)
    assert tables.vehicles.is_empty()
    assert tables.metrics["fuel_l"] == 0.0
    assert tables.metrics["mainline_delay_s"] is None
    assert tables.metrics["min_margin_m"] is None
    assert tables.metrics["safety_violations"] == 0


def test_a_runs_figures_are_those_of_its_streams():
    cars = [cruising("m00001", 0.0, 41.0), cruising("r00001", 0.0, 47.0, merge_s=45.0)]
    tables = tables_of(outcome_of(cars, end_s=60.0), PAPER)
    assert set(tables.metrics) == set(RUN_METRICS)
    assert tables.metrics["mainline_delay_s"] == pytest.approx(1.0)
    assert tables.metrics["ramp_delay_s"] == pytest.approx(47.0 - RAMP_FREE_FLOW_S)
    assert tables.metrics["fuel_l"] == pytest.approx(sum(s["fuel_l"] for s in tables.streams))
    for key in ("adjusted_vehicles", "rung_free", "rung_hold", "refused_plans"):
        assert tables.metrics[key] is None
    assert tables.trajectories is None
    assert tables.decisions is None


def test_trajectories_name_vehicle_and_lane_of_each_piece():
    cars = [
        Car("m00001", ((0.0, -400.0, 20.0, 0.0),)),
        Car("r00001", ((0.0, -400.0, 16.0, 0.0), (25.0, 0.0, 16.0, 2.0), (27.0, 36.0, 20.0, 0.0))),
    ]
    outcome = outcome_of(cars, end_s=60.0)
    table = trajectories_table(
        outcome.passages.vehicle_id,
        outcome.pieces.first,
        outcome.pieces.rows,
        np.array([2, 0, 1, 2]),
    )
    assert dict(table.schema) == TRAJECTORIES
    assert rows(table, "vehicle_id", "lane", "time_s", "accel_mps2") == [
        ("m00001", "mainline", 0.0, 0.0),
        ("r00001", "ramp", 0.0, 0.0),
        ("r00001", "acceleration", 25.0, 2.0),
        ("r00001", "mainline", 27.0, 0.0),
    ]


def explained(row, rung, scenario=0, front=-1, rear=-1, conflict=-1, **numbers):
    fields = dict.fromkeys(Explanation._fields, math.nan)
    places = {"conflict_row": conflict, "front_row": front, "rear_row": rear}
    return Explanation(
        **{**fields, "row": row, "rung": rung, "scenario": scenario, **places} | numbers
    )


DECISIONS = (
    DecisionRecord(3.0, explained(2, "hold"), (), math.nan),
    DecisionRecord(4.0, explained(2, "hold"), (), math.nan),
    DecisionRecord(
        5.0,
        explained(2, "create", 1, front=0, rear=1, conflict=1, gap_m=4.0, severity_before=math.inf),
        (0,),
        0.25,
    ),
    DecisionRecord(6.0, explained(3, "free", front=2), (), 0.5),
    DecisionRecord(7.0, explained(4, "create", 3, front=1, rear=0), (1, 0), 0.125),
)


def test_decisions_name_vehicles_and_leave_out_what_they_have_not():
    names = ["m2", "r1", "m1", "r2", "r3"]
    place_of_row = np.array([2, 0, 1, 3, 4])
    table = decisions_table(DECISIONS, names, place_of_row)
    assert rows(
        table, "time_s", "vehicle_id", "rung", "scenario", "front_vehicle_id", "rear_vehicle_id"
    ) == [
        (3.0, "r1", "hold", None, None, None),
        (4.0, "r1", "hold", None, None, None),
        (5.0, "r1", "create", 1, "m1", "m2"),
        (6.0, "r2", "free", None, "r1", None),
        (7.0, "r3", "create", 3, "m2", "m1"),
    ]
    assert table["adjusted_vehicle_ids"].to_list() == [[], [], ["m1"], [], ["m2", "m1"]]
    assert table["min_margin_m"].to_list() == [None, None, 0.25, 0.5, 0.125]
    assert table["gap_m"].to_list() == [None, None, 4.0, None, None]
    assert table["severity_before"].to_list() == [None, None, math.inf, None, None]


def test_rungs_count_vehicles_and_adjusted_vehicles_count_once():
    cars = [cruising(f"m{k:05d}", 10.0 * k, 10.0 * k + 40.0) for k in range(5)]
    outcome = outcome_of(
        cars,
        end_s=100.0,
        cooperative=True,
        decisions=DECISIONS,
        refusals=(Refusal(1.0, 2, "too near"),),
        vehicle_of_row=np.arange(5),
    )
    metrics = tables_of(outcome, PAPER).metrics
    rungs = {key: metrics[f"rung_{key}"] for key in ("free", "reach", "create", "delay", "hold")}
    assert rungs == {"free": 1, "reach": 0, "create": 2, "delay": 0, "hold": 1}
    assert metrics["adjusted_vehicles"] == 2
    assert metrics["refused_plans"] == 1


def test_the_largest_plan_error_counts_and_none_is_none():
    cars = [
        cruising("m00001", 0.0, 40.0, plan_error_m=0.01),
        cruising("m00002", 5.0, 45.0, plan_error_m=0.03),
        cruising("m00003", 10.0, 50.0),
    ]
    for some, largest in ((cars, 0.03), (cars[2:], None)):
        assert tables_of(outcome_of(some, end_s=60.0), PAPER).metrics["plan_error_m"] == largest


def test_no_number_in_a_table_is_nan():
    cars = [cruising("m00001", 0.0, 40.0), Car("r00001", scheduled_s=20.0, entry_s=NEVER)]
    outcome = outcome_of(
        cars,
        end_s=100.0,
        cooperative=True,
        decisions=DECISIONS[:1],
        vehicle_of_row=np.array([0] * 3),
    )
    tables = tables_of(outcome, PAPER)
    for frame in (tables.vehicles, tables.speeds, tables.trajectories, tables.decisions):
        assert not frame.select(pl.col(pl.Float64).is_nan().any()).transpose().to_series().any()
    figures = [*tables.metrics.values(), *(v for s in tables.streams for v in s.values())]
    assert not any(isinstance(value, float) and math.isnan(value) for value in figures)


def test_each_violation_is_told_with_its_pair_and_time():
    """At 20 m/s behind a vehicle at rest Eq. 1 asks for 0.04 m + 72^2 / (254 0.51) = 40.06 m."""
    cars = [
        Car("m00001", ((0.0, 0.0, 0.0, 0.0),), exit_s=NEVER),
        Car("m00002", ((0.0, -55.0, 20.0, -5.0), (4.0, -15.0, 0.0, 0.0)), exit_s=NEVER),
        Car("m00003", ((0.0, -200.0, 1.0, 0.0),), exit_s=NEVER),
    ]
    outcome = outcome_of(cars, end_s=20.0)
    table = tables_of(outcome, PAPER).violations
    assert dict(table.schema) == VIOLATIONS
    assert rows(table, "front_vehicle_id", "rear_vehicle_id") == []
    near = Car("m00002", ((0.0, -30.0, 20.0, -8.0), (2.5, -5.0, 0.0, 0.0)), exit_s=NEVER)
    nearer = [cars[0], near, cars[2]]
    tables = tables_of(outcome_of(nearer, end_s=20.0), PAPER)
    assert tables.metrics["safety_violations"] == 1
    [(front, rear, time_s, margin_m)] = rows(
        tables.violations, "front_vehicle_id", "rear_vehicle_id", "time_s", "margin_m"
    )
    assert (front, rear) == ("m00001", "m00002")
    assert time_s == pytest.approx(0.0)
    assert margin_m == pytest.approx(25.0 - 0.04 - 72.0**2 / (254 * 0.51), abs=1e-4)
    assert margin_m == tables.metrics["min_margin_m"]
