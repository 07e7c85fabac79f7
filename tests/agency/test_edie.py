"""Edie's flow, density and speed, worked by hand."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from coramp.agency.contour import cells_of, contour_table
from coramp.agency.edie import overlap_s, spent_in_cells
from tests.agency import motion_by_hand
from tests.metrics import Car


def spent(motion, edges_s, edges_m, weights=None):
    return spent_in_cells(motion, motion.on_mainline, np.array(edges_s), np.array(edges_m), weights)


def test_a_cell_has_the_time_and_the_way_of_who_is_in_it():
    # From -400 m at 20 m/s: past -200 m at 10 s, past 0 at 20 s.
    motion = motion_by_hand([Car("m1", [(0.0, -400.0, 20.0, 0.0)], exit_s=40.0)], 40.0)
    found = spent(motion, [0.0, 15.0, 30.0], [-200.0, 0.0, 200.0])
    assert found.time_s.tolist() == [[5.0, 0.0], [5.0, 10.0]]
    assert found.way_m.tolist() == [[100.0, 0.0], [100.0, 200.0]]


def test_edges_are_crossed_when_an_acceleration_says():
    # s = -400 + x^2: past -300 m at 10 s with 20 m/s, past -175 m at 15 s, at 0 m at 20 s.
    motion = motion_by_hand([Car("m1", [(0.0, -400.0, 0.0, 2.0)], exit_s=20.0)], 20.0)
    found = spent(motion, [0.0, 20.0], [-400.0, -300.0, -175.0, 0.0])
    assert found.time_s[0] == pytest.approx([10.0, 5.0, 5.0])
    assert found.way_m[0] == pytest.approx([100.0, 125.0, 175.0])


def test_who_stands_spends_time_and_no_way():
    pieces = [(0.0, -400.0, 20.0, -2.0), (10.0, -300.0, 0.0, 0.0)]
    motion = motion_by_hand([Car("m1", pieces)], 100.0)
    found = spent(motion, [0.0, 50.0, 100.0], [-400.0, -300.0, -200.0])
    assert found.time_s == pytest.approx(np.array([[10.0, 40.0], [0.0, 50.0]]))
    assert found.way_m == pytest.approx(np.array([[100.0, 0.0], [0.0, 0.0]]))


def test_flow_density_and_speed_are_edies():
    """Three at 20 m/s, 4 s apart: 900 veh/h, 12.5 veh/km. Where each is 50 m long for 2.5 s."""
    cars = [
        Car(
            f"m{k}",
            [(4.0 * k, -400.0, 20.0, 0.0)],
            scheduled_s=4.0 * k,
            entry_s=4.0 * k,
            exit_s=40.0 + 4.0 * k,
        )
        for k in range(3)
    ]
    table = contour_table(motion_by_hand(cars, 48.0))
    cell = table.filter(road="mainline", time_s=0.0, station_m=-400.0).row(0, named=True)
    assert cell["flow_veh_h"] == pytest.approx(3 * 50.0 / (30.0 * 50.0) * 3600.0)
    assert cell["density_veh_km"] == pytest.approx(3 * 2.5 / (30.0 * 50.0) * 1000.0)
    assert cell["mean_speed_mps"] == pytest.approx(20.0)
    quotient = table["flow_veh_h"] / table["density_veh_km"] / 3.6
    assert quotient.to_list() == pytest.approx(table["mean_speed_mps"].to_list())


def test_the_ramp_ends_where_its_lane_is_left():
    # On the ramp at 16 m/s for 400 m, merged at 30 s, 80 m behind the nose.
    car = Car("r1", [(0.0, -400.0, 16.0, 0.0)], merge_s=30.0, exit_s=50.0)
    motion = motion_by_hand([car], 50.0)
    ramp, mainline = cells_of(motion, "ramp"), cells_of(motion, "mainline")
    assert ramp.spent.time_s.sum() == pytest.approx(30.0)
    assert mainline.spent.time_s.sum() == pytest.approx(20.0)
    assert ramp.spent.way_m.sum() == pytest.approx(480.0)
    assert ramp.edges_m[-1] == motion.scenario.ramp.acceleration_lane_m


def test_weights_count_a_truck_twice():
    cars = [Car(f"m{k}", [(0.0, -400.0 + 50 * k, 20.0, 0.0)], exit_s=30.0) for k in range(2)]
    motion = motion_by_hand(cars, 30.0)
    found = spent(motion, [0.0, 10.0], [-400.0, 400.0], np.array([1.0, 2.0]))
    assert found.time_s.tolist() == [[30.0]]


@given(
    st.lists(
        st.tuples(st.floats(0.1, 20.0), st.floats(-2.0, 2.0), st.floats(0.0, 30.0)),
        min_size=1,
        max_size=6,
    )
)
def test_cells_sum_to_all_that_was_driven(legs):
    rows, time_s, station_m = [], 0.0, 0.0
    for lasts_s, accel_mps2, speed_mps in legs:
        forward_mps2 = max(accel_mps2, -speed_mps / lasts_s)
        rows.append((time_s, station_m, speed_mps, forward_mps2))
        station_m += (speed_mps + 0.5 * forward_mps2 * lasts_s) * lasts_s
        time_s += lasts_s
    motion = motion_by_hand([Car("m1", rows, exit_s=time_s)], time_s)
    found = spent(motion, np.arange(0.0, 140.0, 7.0), np.arange(0.0, 5000.0, 33.0))
    assert found.time_s.sum() == pytest.approx(time_s, abs=1e-6)
    assert found.way_m.sum() == pytest.approx(station_m, abs=1e-6)
    assert (found.time_s >= 0.0).all()


def test_overlaps_are_what_two_spans_share():
    found = overlap_s(np.array([2.0, 12.0]), np.array([15.0, 12.0]), np.array([0.0, 10.0, 20.0]))
    assert found.tolist() == [[8.0, 5.0], [0.0, 0.0]]
