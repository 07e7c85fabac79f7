"""The worked example: 100 and 60 km/h, the ramp vehicle 100 m before the nose (Fig. 6 to 11)."""

import matplotlib.colors
import pytest

from coramp.report.plan_figure import plan_figure
from coramp.report.worked_example import free_movement, positions_figure, time_space_figure
from coramp.runs.planning import plan_snapshot
from coramp.scenarios.snapshots import load_snapshot

V0, VR0 = 100.0 / 3.6, 60.0 / 3.6


@pytest.fixture(scope="module")
def mainline():
    return plan_snapshot(load_snapshot("example"), "mainline-priority")


@pytest.fixture(scope="module")
def ramp():
    return plan_snapshot(load_snapshot("example"), "ramp-priority")


@pytest.fixture(scope="module")
def time_space(mainline):
    return time_space_figure(mainline)


def lines_of(axes):
    return {line.get_gid(): line.get_data() for line in axes.get_lines()}


def boxes_of(axes):
    return {box.get_gid(): box for box in axes.patches if box.get_gid()}


def test_free_movement_is_the_papers(mainline):
    free = free_movement(mainline)
    assert free.vehicle_id == "r1"
    assert free.merge_s == pytest.approx(100.0 / VR0 + (V0 - VR0) / 2.0)  # 11.556 s
    assert free.merge_m == pytest.approx((V0**2 - VR0**2) / 4.0)  # 123.457 m


def test_every_vehicle_has_its_line_before_and_after(time_space):
    names = {*(f"m{k}" for k in range(1, 8)), "r1"}
    for axes in time_space.axes:
        assert set(lines_of(axes)) == names
        assert axes.get_xlabel() == "time (s)"
        assert axes.get_ylabel() == "station of the front bumper (m)"


def test_mainline_vehicles_are_drawn_at_100_km_h_from_their_stations(time_space):
    for axes in time_space.axes:
        times_s, stations_m = lines_of(axes)["m4"]
        assert stations_m[0] == -196.0
        assert stations_m == pytest.approx(-196.0 + V0 * times_s)


def test_the_ramp_vehicle_meets_m4_before_and_not_after(time_space):
    before, after = time_space.axes[:2]
    for axes, meets in ((before, True), (after, False)):
        lines = lines_of(axes)
        times_s, ramp_m = lines["r1"]
        on_mainline = times_s > 12.46
        distance_m = lines["m4"][1][on_mainline] - ramp_m[on_mainline]
        assert (distance_m < 5.0).all() == meets
        assert (distance_m < 5.0).any() == meets


def test_the_enlarged_diagrams_surround_the_conflict(time_space):
    for axes in time_space.axes[2:]:
        (left_s, right_s), (low_m, high_m) = axes.get_xlim(), axes.get_ylim()
        assert left_s < 11.556 < right_s < left_s + 5.0
        assert low_m < 123.457 < high_m < low_m + 120.0


def test_positions_are_those_of_the_snapshot_and_of_the_merges(mainline, ramp):
    figure = positions_figure(mainline, ramp)
    first, conflict, reached, made = (boxes_of(axes) for axes in figure.axes)
    fronts_m = {name: box.get_x() + box.get_width() for name, box in first.items()}
    assert fronts_m == pytest.approx(
        {v.id: v.station_m for v in mainline.snapshot.vehicles}, abs=1e-9
    )
    assert {box.get_width() for box in first.values()} == {5.0}
    assert conflict["m4"].get_x() < conflict["r1"].get_x() + 5.0 < conflict["m4"].get_x() + 5.0
    for boxes in (reached, made):
        ahead_m = boxes["m4"].get_x() - boxes["r1"].get_x() - 5.0
        assert ahead_m > 1.4256  # L_r-X of Eq. 15 at 100 km/h
        assert ahead_m < 2.0
    moved_m = made["m4"].get_x() - conflict["m4"].get_x()
    assert moved_m == pytest.approx(4.9947, abs=1e-3)  # as `coramp plan` tells
    assert made["m4"].get_facecolor() != made["m3"].get_facecolor()
    assert figure.axes[-1].get_xlabel() == "station (m)"


def test_the_plan_figure_stops_the_ramp_vehicle_before_the_nose_and_merges_it_after(mainline):
    before, after = plan_figure(mainline).axes[:2]
    stopped_m, merged_m = lines_of(before)["r1"][1], lines_of(after)["r1"][1]
    assert stopped_m[-1] == pytest.approx(-1.0)
    assert merged_m[-1] > 200.0
    (merge,) = [c for c in after.collections if c.get_gid() != "merged"]
    assert merge.get_offsets().tolist()[0] == pytest.approx(
        [
            mainline.decisions["merge_time_s"].item(),
            mainline.decisions["merge_station_m"].item(),
        ]
    )
    assert {text.get_text() for text in after.texts} == {*(f"m{k}" for k in range(1, 8)), "r1"}


def test_the_plan_figure_tells_lanes_apart(mainline):
    before, after, road_before, road_after = plan_figure(mainline).axes
    assert not [c for c in before.collections if c.get_gid() == "merged"]
    (merged,) = [c for c in after.collections if c.get_gid() == "merged"]
    (points,) = merged.get_segments()
    merge_s = mainline.decisions["merge_time_s"].item()
    assert points[0, 0] == pytest.approx(merge_s, abs=0.1)
    grey = next(line for line in after.get_lines() if line.get_gid() == "m4").get_color()
    assert matplotlib.colors.to_hex(merged.get_colors()[0]) == grey
    for road in (road_before, road_after):
        boxes = boxes_of(road)
        assert boxes["r1-from-above"].get_y() < -1.0 < boxes["m4-from-above"].get_y()
    # while the lines of r1 and m4 cross, r1 is beside it on the acceleration lane
    assert 0.0 < boxes["r1-from-above"].get_x() < 200.0
