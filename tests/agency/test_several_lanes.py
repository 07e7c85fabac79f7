"""What agencies read of a mainline of several lanes: each lane, and all together."""

import numpy as np
import pytest

from coramp.agency.contour import contour_table
from coramp.agency.detectors import detectors_of, detectors_table
from coramp.agency.level_of_service import Segment, density_of, segments_of
from coramp.agency.motion import motion_of
from coramp.agency.queues import queues_table
from coramp.agency.tables import agency_tables
from coramp.scenarios.loading import load_scenario
from tests.agency import motion_by_hand
from tests.metrics import Car
from tests.networks.test_runs import new_scenario
from tests.report.lanes import THREE, three_lanes


@pytest.fixture(scope="module")
def motion():
    return motion_of(three_lanes())


def test_who_is_on_a_lane_further_in_is_on_the_mainline(motion):
    assert motion.lane.tolist() == [0, 1, 1, 2, -1, 0]
    assert motion.on_mainline.tolist() == [True, True, True, True, False, True]


def test_flows_of_lanes_add_up_to_that_of_the_mainline(motion):
    table = contour_table(motion)
    assert table["road"].unique(maintain_order=True).to_list() == [
        "mainline",
        "ramp",
        "mainline 1",
        "mainline 2",
        "mainline 3",
    ]
    cell = table.filter(time_s=0.0, station_m=-200.0)
    flows = dict(cell.select("road", "flow_veh_h").rows())
    assert flows["mainline 1"] == flows["mainline 2"] == flows["mainline 3"] == pytest.approx(120.0)
    assert flows["mainline"] == pytest.approx(360.0)
    behind = dict(table.filter(time_s=0.0, station_m=100.0).select("road", "flow_veh_h").rows())
    assert behind["mainline 2"] == pytest.approx(240.0)  # m1 has changed to it
    assert "mainline 3" not in behind


def test_density_is_that_of_a_lane(motion):
    edges_s = np.array([0.0, 20.0])
    upstream, merge, *_ = segments_of(THREE)
    density_pc_km_ln, _ = density_of(motion, upstream, edges_s)
    assert density_pc_km_ln[0] == pytest.approx(3 / 3 / 0.4)  # three cars all the time
    # From 20 s on m1 and m2 drive on lane 2, m3 on lane 3 does not come to the merge by 25 s.
    density_pc_km_ln, speed_mps = density_of(motion, merge, np.array([20.0, 25.0]))
    lane_m = 2 * (merge.end_m - merge.start_m) + THREE.ramp.acceleration_lane_m
    assert density_pc_km_ln[0] == pytest.approx((2 * 5.0 + 5.0) / 5.0 / lane_m * 1000.0)
    assert speed_mps[0] == pytest.approx((2 * 100.0 + 75.0) / 15.0)
    # From 45 s on m3 alone is there, on the third lane, which is not of the merge influence area.
    assert density_of(motion, merge, np.array([47.0, 50.0]))[0][0] == 0.0
    basic = Segment("all", "basic", merge.start_m, merge.end_m)
    assert density_of(motion, basic, np.array([47.0, 50.0]))[0][0] > 0.0


def test_each_lane_has_its_loops(motion):
    table = detectors_table(motion)
    counted = {row["detector"]: row["vehicles"] for row in table.iter_rows(named=True)}
    assert {k: v for k, v in counted.items() if k.startswith("mainline_in")} == {
        "mainline_in_1": 1,
        "mainline_in_2": 1,
        "mainline_in_3": 1,
    }
    assert [counted[f"mainline_out_{lane}"] for lane in (1, 2, 3)] == [1, 2, 1]
    assert counted["ramp_in"] == 0  # the one on the ramp begins behind it


def test_loops_of_a_made_road_lie_in_sumos_network():
    found = {d.name: (d.lane, round(d.position_m, 2)) for d in detectors_of(THREE)}
    assert found["mainline_in_1"] == ("mainline_0", 10.0)
    assert found["mainline_in_3"] == ("mainline_2", 10.0)
    assert found["mainline_merge_1"] == ("merge_1", 150.0)
    assert found["mainline_merge_3"] == ("merge_3", 150.0)
    assert found["mainline_out_2"] == ("downstream_1", 170.0)
    assert found["ramp_in"] == ("ramp_0", 10.0)


def test_loops_of_a_network_lie_in_it(tmp_path):
    scenario = load_scenario(str(new_scenario(tmp_path, "A10KW")))
    found = {d.name: (d.lane, round(d.position_m, 2)) for d in detectors_of(scenario)}
    assert len(found) == 4 * 3 + 1
    assert found["mainline_in_1"] == ("264308383_0", 10.0)
    assert found["mainline_merge_3"] == ("4054057_3", 146.54)
    assert found["ramp_in"] == ("-24498410#1_0", 10.0)


def test_queues_of_lanes_are_not_one_behind_the_other():
    # Two stand side by side on two lanes: two queue, and the longest queue is a car long.
    cars = [Car(name, [(0.0, -100.0, 0.0, 0.0)], exit_s=20.0) for name in ("m1", "m2")]
    one = motion_by_hand(cars, 20.0)
    object.__setattr__(one, "lane", np.array([0, 1]))
    row = queues_table(one).filter(road="mainline").row(0, named=True)
    assert (row["queued"], row["queue_m"]) == (2, 5.0)


def test_all_tables_are_made(motion):
    tables = agency_tables(motion)
    intervals = tables["intervals"].filter(stream="mainline")
    assert intervals["vehicle_km"].sum() == pytest.approx(3 * 0.8)
