"""The tables over intervals, worked by hand, and what they must sum to."""

import numpy as np
import polars as pl
import pytest

import coramp
from coramp.agency.emissions import DIESEL_KG_L, PETROL_KG_L, emissions_table
from coramp.agency.intervals import edges_of, intervals_table
from coramp.agency.level_of_service import (
    MERGE_INFLUENCE_M,
    level_of_service,
    levels_table,
    segments_of,
)
from coramp.agency.motion import motion_of, passings
from coramp.agency.queues import queues_table
from coramp.agency.travel_times import travel_times_table
from tests.agency import motion_by_hand
from tests.metrics import PAPER, Car

V0 = 20.0
KINDS = {
    "drivers": {"strategy": "uncontrolled", "drivers": "credible"},
    "plans": {"engine": "exact"},
    "plans in SUMO": {},
    "mixed": {
        "strategy": "mixed-slots",
        "drivers": "credible",
        "overrides": {"traffic.automated_share": 0.5},
    },
}


@pytest.fixture(scope="module", params=KINDS)
def run(request):
    return coramp.run(
        "paper", mainline_veh_h=1500.0, ramp_veh_h=400.0, horizon_s=150.0, **KINDS[request.param]
    )


def test_intervals_sum_to_the_run(run):
    motion, vehicles = motion_of(run), run.vehicles
    table = intervals_table(motion, 40.0)
    spent_s = vehicles["travel_s"].sum() + vehicles["waiting_s"].sum()
    assert table["time_spent_s"].sum() == pytest.approx(spent_s)
    assert table["waiting_s"].sum() == pytest.approx(vehicles["waiting_s"].sum())
    assert vehicles["finished"].all()
    assert table["delay_s"].sum() == pytest.approx(vehicles["delay_s"].sum())
    assert table["fuel_l"].sum() == pytest.approx(vehicles["fuel_l"].sum())
    for name in ("arrivals", "entries", "exits"):
        assert table[name].sum() == vehicles.height
    weighed = (table["due_delay_s"].fill_null(0.0) * table["arrivals"]).sum()
    assert weighed == pytest.approx(vehicles["delay_s"].sum())
    driven_km = emissions_table(motion)["vehicle_km"].sum()
    assert table["vehicle_km"].sum() == pytest.approx(driven_km)
    assert driven_km == pytest.approx(0.8 * vehicles.height, rel=1e-3)
    assert emissions_table(motion)["fuel_l"].sum() == pytest.approx(vehicles["fuel_l"].sum())


def test_pieces_are_of_who_drives_and_end_when_it_leaves(run):
    motion = motion_of(run)
    assert motion.duration_s.sum() == pytest.approx(run.vehicles["travel_s"].sum(), rel=1e-3)
    assert motion.automated.sum() == run.vehicles["automated"].sum()


def test_everybody_passes_a_station_of_the_mainline_once(run):
    motion = motion_of(run)
    found = passings(motion, True, PAPER.ramp.acceleration_lane_m + 10.0)
    assert sorted(found.vehicle.tolist()) == list(range(len(motion)))
    before = passings(motion, False, -10.0)
    assert sorted(before.vehicle.tolist()) == np.flatnonzero(motion.on_ramp).tolist()


def test_a_vehicle_is_counted_where_it_is_due_enters_and_leaves():
    # Due at 8 s, in at 12 s, out at 52 s: 2 + 38 s of the 40 s on the road in the second interval.
    car = Car("m1", [(12.0, -400.0, V0, 0.0)], scheduled_s=8.0, entry_s=12.0, exit_s=52.0)
    table = intervals_table(motion_by_hand([car], 52.0), 10.0).filter(stream="mainline")
    assert table["from_s"].to_list() == [0.0, 10.0, 20.0, 30.0, 40.0, 50.0]
    assert table["to_s"].to_list()[-1] == 52.0
    assert table["arrivals"].to_list() == [1, 0, 0, 0, 0, 0]
    assert table["entries"].to_list() == [0, 1, 0, 0, 0, 0]
    assert table["exits"].to_list() == [0, 0, 0, 0, 0, 1]
    assert table["flow_veh_h"].to_list()[-1] == pytest.approx(3600.0 / 2.0)
    assert table["time_spent_s"].to_list() == pytest.approx([2.0, 10.0, 10.0, 10.0, 10.0, 2.0])
    assert table["waiting_s"].to_list() == pytest.approx([2.0, 2.0, 0.0, 0.0, 0.0, 0.0])
    assert table["vehicle_km"].to_list() == pytest.approx([0.0, 0.16, 0.2, 0.2, 0.2, 0.04])
    assert table["delay_s"].to_list() == pytest.approx([2.0, 2.0, 0.0, 0.0, 0.0, 0.0])
    assert table["due_delay_s"].to_list()[0] == pytest.approx(4.0)


def test_delay_arises_where_a_vehicle_is_slow():
    # 200 m at 20 m/s, 200 m at 10 m/s, 400 m at 20 m/s: 10 s are lost from 10 s on, until 30 s.
    pieces = [(0.0, -400.0, V0, 0.0), (10.0, -200.0, 10.0, 0.0), (30.0, 0.0, V0, 0.0)]
    motion = motion_by_hand([Car("m1", pieces, exit_s=50.0)], 50.0)
    table = intervals_table(motion, 10.0).filter(stream="mainline")
    assert table["delay_s"].to_list() == pytest.approx([0.0, 5.0, 5.0, 0.0, 0.0])


def test_who_never_got_out_loses_time_until_the_end():
    motion = motion_by_hand([Car("m1", [(0.0, -400.0, 0.0, 0.0)])], 100.0)
    table = intervals_table(motion, 50.0).filter(stream="mainline")
    assert table["delay_s"].to_list() == pytest.approx([50.0, 50.0])
    assert table["exits"].sum() == 0


def test_a_breakdown_is_that_of_the_run():
    """Mainline vehicles that pass the loop at 10 m/s for 20 minutes; the summary has the time."""
    cars = [
        Car(f"m{k:05}", [(t, -400.0, 10.0, 0.0)], scheduled_s=t, entry_s=t, exit_s=t + 80.0)
        for k, t in enumerate(np.arange(300.0, 1500.0, 20.0).tolist())
    ]
    cars.insert(0, Car("m0", [(0.0, -400.0, V0, 0.0)], exit_s=40.0))
    scenario = PAPER.model_copy(
        update={"simulation": PAPER.simulation.model_copy(update={"horizon_s": 1500.0})}
    )
    motion = motion_by_hand(cars, 1580.0, scenario)
    table = intervals_table(motion).filter(stream="mainline")
    broken = table.filter(pl.col("broken_down"))
    assert broken["from_s"][0] == 300.0
    assert table["broken_down"].to_list() == [False, True, True, True, True, True]
    assert table["loop_speed_mps"].to_list()[:3] == pytest.approx([20.0, 10.0, 10.0])
    letters = levels_table(motion).filter(segment="merge influence area")["level_of_service"]
    assert letters.to_list() == ["A", "F", "F", "F", "F", "F"]


@pytest.mark.parametrize(
    ("density", "basic", "merge"),
    [
        (0.0, "A", "A"),
        (10.5, "A", "B"),
        (11.0, "A", "B"),
        (11.1, "B", "B"),
        (18.1, "C", "B"),
        (20.1, "C", "C"),
        (26.1, "D", "C"),
        (28.1, "D", "D"),
        (35.0, "D", "D"),
        (35.1, "E", "E"),
        (45.1, "F", "E"),
    ],
)
def test_letters_are_those_of_the_manual(density, basic, merge):
    assert level_of_service(density, "basic") == basic
    assert level_of_service(density, "merge") == merge
    assert level_of_service(density, "merge", above_capacity=True) == "F"


def test_densities_count_lanes_and_trucks():
    """One vehicle stands upstream, one on the acceleration lane: 1 / 0.4 km, 1 / (0.4 + 0.15)."""
    lane_m = PAPER.ramp.acceleration_lane_m
    cars = [
        Car("m1", [(0.0, -200.0, 0.0, 0.0)]),
        Car("r1", [(0.0, 0.5 * lane_m, 0.0, 0.0)]),
    ]
    table = levels_table(motion_by_hand(cars, 60.0))
    upstream = table.filter(segment="upstream").row(0, named=True)
    merge = table.filter(segment="merge influence area").row(0, named=True)
    assert upstream["density_pc_km_ln"] == pytest.approx(2.5)
    assert upstream["density_pc_mi_ln"] == pytest.approx(2.5 * 1.609344)
    assert merge["density_pc_km_ln"] == pytest.approx(1000.0 / (400.0 + lane_m))
    assert merge["mean_speed_mps"] == 0.0


def test_the_merge_influence_area_reaches_1500_feet():
    longer = PAPER.model_copy(
        update={"mainline": PAPER.mainline.model_copy(update={"end_m": 900.0})}
    )
    assert pytest.approx(1500 * 0.3048) == MERGE_INFLUENCE_M
    assert [(s.kind, s.start_m, s.end_m) for s in segments_of(longer)] == [
        ("basic", PAPER.mainline.start_m, 0.0),
        ("merge", 0.0, 457.2),
        ("basic", 457.2, 900.0),
    ]
    assert [s.end_m for s in segments_of(PAPER)] == [0.0, PAPER.mainline.end_m]


def test_queues_are_who_stand_and_hang_together():
    # On the ramp: three 5 m cars stand 5 m apart behind -10 m, and a fourth 45 m further back.
    stands = {"r1": -10.0, "r2": -20.0, "r3": -30.0, "r4": -80.0}
    cars = [Car(name, [(0.0, m, 0.0, 0.0)]) for name, m in stands.items()]
    cars.append(Car("m1", [(0.0, -400.0, V0, 0.0)], exit_s=40.0))
    cars.append(Car("m2", scheduled_s=10.0, entry_s=np.nan))
    table = queues_table(motion_by_hand(cars, 60.0))
    ramp = table.filter(road="ramp").row(0, named=True)
    assert (ramp["queued"], ramp["queue_m"], ramp["waiting"]) == (4, 4 * 5.0 + 2 * 5.0, 0)
    mainline = table.filter(road="mainline")
    assert mainline["queued"].to_list() == [0, 0]
    assert mainline["waiting"].to_list() == [1, 1]


def test_a_queue_begins_at_5_and_ends_at_10_km_h():
    # Brakes from 2 m/s to 1 m/s (3.6 km/h) at 10 s, then speeds up past 2.78 m/s at 47.8 s.
    pieces = [(0.0, -300.0, 2.0, 0.0), (9.0, -282.0, 1.0, 0.0), (30.0, -261.0, 1.0, 0.1)]
    table = queues_table(motion_by_hand([Car("r1", pieces)], 90.0)).filter(road="ramp")
    assert table["queued"].to_list() == [1, 1, 0]


def test_congestion_is_where_the_mainline_is_slow():
    # 100 m at 10 m/s, half of v0; all the rest at v0.
    pieces = [(0.0, -400.0, V0, 0.0), (10.0, -200.0, 10.0, 0.0), (20.0, -100.0, V0, 0.0)]
    table = queues_table(motion_by_hand([Car("m1", pieces, exit_s=45.0)], 45.0))
    assert table.filter(road="mainline")["congested_m"].to_list() == [100.0, 0.0]


def test_percentiles_are_of_whole_trips():
    cars = [Car(f"m{k}", [(0.0, -400.0, V0, 0.0)], entry_s=0.0, exit_s=40.0 + k) for k in range(21)]
    table = travel_times_table(motion_by_hand(cars, 61.0)).filter(stream="mainline")
    whole, first = table.rows(named=True)
    assert whole["vehicles"] == first["vehicles"] == 21
    assert (whole["p15_s"], whole["p50_s"], whole["p95_s"]) == pytest.approx((43.0, 50.0, 59.0))
    assert whole["free_flow_s"] == pytest.approx(40.0)
    assert whole["planning_time_index"] == pytest.approx(59.0 / 40.0)


def test_co2_is_that_of_the_fuel_burnt():
    assert pytest.approx((2.348, 2.689), abs=5e-4) == (PETROL_KG_L, DIESEL_KG_L)
    kinds = [{"name": "car", "share": 0.5}, {"name": "truck", "share": 0.5}]
    run = coramp.run(
        "expressway",
        engine="exact",
        mainline_veh_h=900.0,
        ramp_veh_h=200.0,
        horizon_s=60.0,
        overrides={"vehicle": kinds},
    )
    table = emissions_table(motion_of(run))
    expected = table["fuel_l"] * pl.Series(
        [DIESEL_KG_L if name == "truck" else PETROL_KG_L for name in table["vehicle_type"]]
    )
    assert table["co2_kg"].to_list() == pytest.approx(expected.to_list())
    assert {"car", "truck"} <= set(table["vehicle_type"])


def test_nobody_gives_empty_tables():
    motion = motion_by_hand([], 0.0)
    assert edges_of(motion).tolist() == [0.0, 300.0]
    assert intervals_table(motion)["time_spent_s"].sum() == 0.0
    assert queues_table(motion)["queued"].sum() == 0
    assert set(levels_table(motion)["level_of_service"]) == {"A"}
    assert emissions_table(motion).is_empty()
    assert travel_times_table(motion)["vehicles"].sum() == 0
