"""Free flow and figures by type, by routes of their own."""

import math

import numpy as np
import polars as pl
import pytest
from scipy.integrate import solve_ivp

from coramp.errors import CorampError
from coramp.kinematics.fuel import HEAVY_DUTY, PASSENGER_CAR
from coramp.metrics.tables import tables_of
from coramp.metrics.types import fuel_models_of, own_free_flow_s, type_figures
from coramp.records.schemas import TYPES
from coramp.road.rules import packed
from coramp.scenarios.loading import load_scenario
from coramp.vehicles.traits import Traits
from tests.mathematics import RULES, close, sized, truck
from tests.metrics import NEVER, Car, outcome_of

MIXED = load_scenario(
    "paper", {"vehicle": [{"name": "car", "share": 0.5}, {"name": "truck", "share": 0.5}]}
)


def test_free_flow_on_the_mainline_is_the_way_over_ones_own_cruise():
    assert own_free_flow_s(sized(top_speed_mps=16.0), False, packed(RULES)) == close(800.0 / 16.0)
    assert own_free_flow_s(truck(), False, packed(RULES)) == close(800.0 / 20.0)


def test_free_flow_by_the_ramp_by_hand():
    # 400 m at 16 m/s; 1 m/s2 from there to 18 m/s takes 2 s and 34 m; 366 m at 18 m/s
    own = sized(top_speed_mps=18.0, acceleration_mps2=1.0)
    assert own_free_flow_s(own, True, packed(RULES)) == close(25.0 + 2.0 + 366.0 / 18.0)
    # one that is slower than the ramp drives on
    slow = sized(top_speed_mps=10.0)
    assert own_free_flow_s(slow, True, packed(RULES)) == close(80.0)


def test_free_flow_of_a_truck_by_the_ramp_against_an_integration_at_full_power():
    def motion(_, state):
        speed = state[1]
        return [speed, min(1.0, 5.5 / speed) if speed < 20.0 else 0.0]

    passes = lambda _, state: state[0] - 400.0  # noqa: E731
    passes.terminal = True
    run = solve_ivp(motion, (0.0, 60.0), [0.0, 16.0], events=passes, rtol=1e-9, max_step=0.05)
    at_full_power_s = 25.0 + float(run.t_events[0][0])
    found_s = own_free_flow_s(truck(), True, packed(RULES))
    # bands of 1.5 m/s lose some tenths of a second
    assert at_full_power_s < found_s < at_full_power_s + 0.4


TRUCK = Traits(16.5, 0.02, 3e-9, 0.0, 16.0, 1.0, 5.5, 2.5, 40000.0)


def mixed_outcome():
    """A car and a truck on the mainline, of 800 m; a car that never left; types as told."""
    cars = (
        Car("m00001", ((0.0, -400.0, 20.0, 0.0),), exit_s=40.0),
        Car("m00002", ((5.0, -400.0, 16.0, 0.0),), scheduled_s=4.0, entry_s=5.0, exit_s=55.0),
        Car("m00003", ((9.0, -400.0, 20.0, 0.0),), scheduled_s=9.0, entry_s=9.0, exit_s=NEVER),
    )
    outcome = outcome_of(cars, end_s=60.0)
    passages = outcome.passages
    object.__setattr__(passages, "vehicle_type", ("car", "truck", "car"))
    object.__setattr__(passages, "traits", (None, TRUCK, None))
    return outcome


def test_delay_counts_against_ones_own_free_flow_and_fuel_by_ones_own_model():
    table = tables_of(mixed_outcome(), MIXED).vehicles
    assert table["vehicle_type"].to_list() == ["car", "truck", "car"]
    assert table["free_flow_s"].to_list() == close([40.0, 50.0, 40.0])
    assert table["delay_s"].to_list()[:2] == close([0.0, 1.0])  # it waited a second outside
    force_n = 40000.0 * 9.8 * 0.006 + 3.12 * 16.0**2
    rate_mlps = 0.8 + force_n * 16.0 / 14200.0
    assert table["fuel_l"][1] == pytest.approx(50.0 * rate_mlps / 1000.0)
    assert table["top_speed_mps"].to_list() == [None, 16.0, None]
    assert table["mass_kg"].to_list() == [1500.0, 40000.0, 1500.0]
    assert table["length_m"].to_list() == [5.0, 16.5, 5.0]


def test_vehicles_without_a_type_are_cars():
    cars = (Car("m00001", exit_s=1.0), Car("m00002", exit_s=1.0))
    outcome = outcome_of(cars, end_s=2.0)
    assert outcome.passages.types() == ("car", "car")
    assert tables_of(outcome, load_scenario("paper")).vehicles["vehicle_type"].to_list() == [
        *("car", "car")
    ]
    assert fuel_models_of(outcome.passages, MIXED).tolist() == [PASSENGER_CAR] * 2


def test_a_type_that_the_scenario_does_not_have_gets_nobodys_fuel():
    passages = mixed_outcome().passages
    assert fuel_models_of(passages, MIXED).tolist() == [PASSENGER_CAR, HEAVY_DUTY, PASSENGER_CAR]
    object.__setattr__(passages, "vehicle_type", ("car", "lorry", "car"))
    with pytest.raises(CorampError, match="vehicle type 'lorry' is not known"):
        fuel_models_of(passages, MIXED)


def test_figures_by_type_and_stream():
    tables = tables_of(mixed_outcome(), MIXED)
    frame, vehicles = tables.types, tables.vehicles
    assert dict(frame.schema) == TYPES
    assert frame.select("vehicle_type", "stream", "vehicles", "unserved").rows() == [
        ("car", "mainline", 2, 1),
        ("truck", "mainline", 1, 0),
    ]
    cars = vehicles.filter(pl.col("vehicle_type") == "car")
    assert frame["delay_s"].to_list() == close([cars["delay_s"].mean(), 1.0])
    assert frame["fuel_l"].sum() == pytest.approx(vehicles["fuel_l"].sum())


def test_where_all_are_alike_there_are_no_figures_by_type():
    cars = (Car("m00001", ((0.0, -400.0, 20.0, 0.0),), exit_s=40.0),)
    assert tables_of(outcome_of(cars, end_s=60.0), load_scenario("paper")).types is None


def test_streams_of_a_type_are_told_apart():
    cars = (Car("m00001", exit_s=1.0), Car("r00001", exit_s=1.0, merge_s=0.5), Car("r00002"))
    passages = outcome_of(cars, end_s=2.0).passages
    delays_s, fuels_l = np.array([1.0, 2.0, 4.0]), np.array([0.1, 0.2, 0.3])
    rows = type_figures(passages, delays_s, fuels_l, np.array([True, True, False]))
    assert [(row["stream"], row["vehicles"], row["unserved"]) for row in rows] == [
        ("mainline", 1, 0),
        ("ramp", 2, 1),
    ]
    assert [row["delay_s"] for row in rows] == close([1.0, 3.0])
    assert not math.isnan(rows[1]["fuel_l"])
