"""Series of detectors: 5-minute means, breakdown and capacity by hand-computed numbers."""

import numpy as np
import polars as pl
import pytest

from coramp.calibration.breakdowns import windows_of
from coramp.calibration.demand import saturated
from coramp.calibration.desired_speeds import free_intervals, rough_free_mps
from coramp.calibration.fit import fit_of, geh
from coramp.calibration.free_speed import free_speed
from coramp.calibration.moments import Free, free_halves, moments_of, names_of_moments, onset_s
from coramp.calibration.series import (
    Series,
    breakdown_of,
    capacity_veh_h,
    queued,
    queues_of,
    series_of,
)
from coramp.calibration.site import site_of
from coramp.counts.table import SCHEMA
from coramp.errors import CorampError
from coramp.scenarios.demand_sections import Detector

NAN = float("nan")
DETECTORS = (
    Detector(id="in", road="mainline", station_m=-380.0),
    Detector(id="up", road="mainline", station_m=-200.0),
    Detector(id="down", road="mainline", station_m=300.0),
    Detector(id="ramp", road="ramp", station_m=-300.0),
)
SITE = site_of(DETECTORS, 200.0)


def five_minutes(up_mps, down):
    """Series of 5 min: speeds upstream and counts downstream are given, all else is alike."""
    count = len(up_mps)
    speeds = {"up": np.array(up_mps), "in": np.full(count, 20.0), "down": np.full(count, 18.0)}
    vehicles = {"down": np.array(down, float), "up": np.full(count, 100.0)}
    return Series(
        600.0,
        300.0,
        {**vehicles, "in": np.full(count, 90.0), "ramp": np.full(count, 30.0)},
        {**speeds, "ramp": np.full(count, 15.0)},
    )


BROKEN = five_minutes([20.0, 19.0, 14.9, 20.0, 14.0, NAN, 5.0, 4.0], [9, 10, 12, 11, 8, 7, 7, 7])


def test_lanes_and_classes_are_taken_together_by_vehicles():
    rows = [
        (0.0, 60.0, "a", 0, "car", 3, 20.0),
        (0.0, 60.0, "a", 1, "car", 1, 12.0),
        (0.0, 60.0, "a", 1, "truck", 2, None),
        (60.0, 120.0, "a", 0, "car", 0, None),
    ]
    series = series_of(pl.DataFrame(rows, schema=SCHEMA, orient="row"))
    assert series.vehicles["a"].tolist() == [6.0, 0.0]
    assert series.speed_mps["a"][0] == pytest.approx((3 * 20.0 + 12.0) / 4)
    assert np.isnan(series.speed_mps["a"][1])
    assert series.flow_veh_h("a")[0] == 360.0


def test_minutes_become_five_minutes_and_a_rest_is_dropped():
    fine = Series(0.0, 60.0, {"a": np.arange(11.0)}, {"a": np.array([NAN, *np.arange(10.0, 20.0)])})
    coarse = fine.coarse()
    assert coarse.interval_s == 300.0
    assert coarse.vehicles["a"].tolist() == [10.0, 35.0]
    assert coarse.speed_mps["a"][0] == pytest.approx((10 + 2 * 11 + 3 * 12 + 4 * 13) / 10)


def test_a_breakdown_lasts_15_minutes_below_three_quarters_of_free_speed():
    slow = queued(BROKEN, "up", 20.0).tolist()
    assert slow == [False, False, True, False, True, True, True, True]
    assert breakdown_of(BROKEN, "up", 20.0) == 4
    assert onset_s(BROKEN, SITE, 20.0) == 600.0 + 4 * 300.0
    assert breakdown_of(five_minutes([20.0, 14.0, 14.0, 20.0], [1] * 4), "up", 20.0) is None


def test_each_breakdown_is_a_window_of_its_own():
    up = [20.0] * 3 + [5.0] * 4 + [20.0] * 4 + [5.0, 5.0, 20.0] + [4.0] * 3 + [20.0] * 3
    series = five_minutes(up, range(len(up)))
    assert queues_of(series, "up", 20.0) == [(3, 7), (14, 17)]
    windows = windows_of(series, SITE, 20.0)
    assert [(w.begin_s, w.end_s) for w in windows] == [(600.0, 2700.0), (2700.0, 6000.0)]
    assert [onset_s(window, SITE, 20.0) for window in windows] == [1500.0, 4800.0]
    assert windows_of(five_minutes([20.0] * 4, [1] * 4), SITE, 20.0) == []
    soon = windows_of(five_minutes([20.0, 5.0, 5.0, 5.0], [1] * 4), SITE, 20.0)
    assert [(w.begin_s, w.end_s) for w in soon] == [(600.0, 1800.0)]
    at_once = five_minutes([5.0, 5.0, 5.0, 20.0], [1] * 4)
    assert windows_of(at_once, SITE, 20.0) == []


def test_the_onset_is_told_by_the_minute():
    minutes = np.repeat([20.0, 20.0, 14.0, 3.0, 3.0, 3.0], 5)
    minutes[10:12] = 19.0  # the first two minutes of the queue's first 5 min are free
    fine = Series(0.0, 60.0, {"up": np.ones(30)}, {"up": minutes})
    assert breakdown_of(fine.coarse(), "up", 20.0) == 3  # 16 m/s is no queue yet
    assert onset_s(fine, SITE, 20.0) == 12 * 60.0


def test_capacity_is_the_highest_flow_before():
    assert capacity_veh_h(BROKEN, "up", "down", 20.0) == 12 * 12.0
    free = five_minutes([20.0] * 4, [5, 6, 7, 8])
    assert capacity_veh_h(free, "up", "down", 20.0) is None


def told_of(series, free=None):
    halves = free_halves(series, SITE, 20.0) if free is None else free
    names = names_of_moments(SITE)
    return dict(zip(names, moments_of(series, SITE, 20.0, halves), strict=True))


def test_moments_of_a_breakdown():
    found = told_of(BROKEN)
    speeds = {name.split()[2] for name in found if name.startswith("speed")}
    assert speeds == {"up", "down"}  # where vehicles have just entered they tell little of drivers
    assert found["breakdown time (s)"] == 1800.0
    assert found["highest flow before (veh/h)"] == 144.0
    assert found["highest flow of 10 min before (veh/h)"] == (12 + 11) / 2 * 12.0
    assert found["discharge (veh/h)"] == 84.0
    assert found["ramp's share of the discharge"] == 0.25
    assert found["speed at up after (m/s)"] == pytest.approx(4.5)
    free = told_of(five_minutes([20.0] * 4, [5, 6, 7, 8]))
    assert free["breakdown time (s)"] == 600.0 + 1200.0
    assert free["highest flow before (veh/h)"] == 8 * 12.0
    assert free["highest flow of 10 min before (veh/h)"] == 7.5 * 12.0
    assert free["flow that comes in the 10 min before (veh/h)"] == 130 * 12.0
    assert np.isnan(free["discharge (veh/h)"])


def test_free_traffic_is_told_by_flow_and_without_queues():
    counts = np.array([80.0, 90.0, 70.0, 100.0, 60.0, 60.0, 60.0, 60.0])
    vehicles = {**BROKEN.vehicles, "in": counts}
    series = Series(BROKEN.begin_s, BROKEN.interval_s, vehicles, BROKEN.speed_mps)
    halves = free_halves(series, SITE, 20.0)
    # of the four intervals before the breakdown the third has a queue; the median is 90
    assert halves.little.tolist() == [1, 1, 0, 0, 0, 0, 0, 0]
    assert halves.more.tolist() == [0, 0, 0, 1, 0, 0, 0, 0]
    found = told_of(series, halves)
    assert found["speed at up with little traffic (m/s)"] == pytest.approx(19.5)
    assert found["speed at up with more traffic (m/s)"] == pytest.approx(20.0)
    assert np.isnan(found["at up: logarithm of the spread"])  # of three intervals
    # of a run that breaks down earlier its own free intervals count alone
    early = five_minutes([20.0, 5.0, 5.0, 5.0, 5.0, 5.0, 5.0, 5.0], [9] * 8)
    found = told_of(early, halves)
    assert found["speed at up with little traffic (m/s)"] == 20.0
    assert np.isnan(found["speed at up with more traffic (m/s)"])
    many = Free(np.ones(8, np.bool_), np.zeros(8, np.bool_))
    waves = five_minutes([19.0, 21.0] * 4, [9] * 8)  # s^2 = 100 * 8 / 7 with 100 vehicles each
    spread = told_of(waves, many)["at up: logarithm of the spread"]
    assert spread == pytest.approx(0.5 * np.log(800.0 / 7.0))


def test_what_comes_in_the_last_10_min_before_the_breakdown():
    vehicles = {**BROKEN.vehicles, "up": np.arange(8.0), "ramp": np.arange(0.0, 80.0, 10.0)}
    series = Series(BROKEN.begin_s, BROKEN.interval_s, vehicles, BROKEN.speed_mps)
    found = told_of(series)
    assert found["flow that comes in the 10 min before (veh/h)"] == (2 + 3 + 20 + 30) / 2 * 12.0
    short = told_of(BROKEN.between(600.0, 900.0))
    assert np.isnan(short["highest flow of 10 min before (veh/h)"])
    assert np.isnan(short["flow that comes in the 10 min before (veh/h)"])


def test_spread_of_drivers_shows_in_means_of_few():
    # 4 vehicles at 19 on average and 4 at 21: v = 20, s^2 = (4 + 4) / 1
    series = Series(0.0, 60.0, {"a": np.array([4.0, 4.0])}, {"a": np.array([19.0, 21.0])})
    found = free_speed(series, ["a"], np.ones(2, np.bool_))
    assert (found.mean_mps, found.deviation_mps, found.vehicles) == (20.0, None, 8)
    many = Series(0.0, 60.0, {"a": np.full(6, 4.0)}, {"a": np.array([19.0, 21.0] * 3)})
    found = free_speed(many, ["a"], np.ones(6, np.bool_))
    assert found.deviation_mps == pytest.approx(np.sqrt(6 * 4.0 / 5))


def test_free_speed_is_told_however_long_the_queue_stands():
    """The fastest 5 min are 20 m/s; the median of what is at least 15 m/s is 19 m/s."""
    up = [20.0, 19.0, 18.0, *([5.0] * 20)]
    assert rough_free_mps(five_minutes(up, [9] * 23), "up") == 19.0
    lone = five_minutes([40.0, 20.0, 18.0, 5.0], [9] * 4)
    lone.vehicles["up"][0] = 1.0  # one fast driver is not all of them
    assert rough_free_mps(lone, "up") == 20.0
    lone.vehicles["up"][:] = 1.0
    assert rough_free_mps(lone, "up") == 40.0


def test_free_is_not_much_traffic_without_a_queue():
    before = BROKEN.between(600.0, 1800.0)
    # the most is 12, so that up to 10.2 is not much; the median is 10.5
    assert free_intervals(before, SITE, 20.0, broke=True).tolist() == [1, 1, 0, 0]
    assert free_intervals(before, SITE, 20.0, broke=False).tolist() == [1, 1, 0, 1]


def test_a_queue_at_an_entry_hides_demand():
    counts = np.array([8.0, 10.0, 12.0, 5.0, 14.0, 11.0])
    queue = np.array([False, False, False, True, True, False])
    assert saturated(counts, queue).tolist() == [8, 10, 12, 10, 14, 11]
    assert saturated(counts[:1], np.array([True])).tolist() == [8]


def test_geh_of_known_flows():
    found = geh(np.array([1000.0, 0.0, 500.0]), np.array([1100.0, 0.0, 500.0]))
    assert found == pytest.approx([np.sqrt(2 * 100.0**2 / 2100.0), 0.0, 0.0])


def test_data_fits_itself():
    fit = fit_of([(BROKEN, BROKEN)] * 2, SITE, 20.0)
    assert (fit.geh, fit.good_geh_share, fit.speed_rmse_mps) == (0.0, 1.0, 0.0)
    assert fit.breakdown_s == (1800.0, 1800.0)
    assert fit.capacity_veh_h == (144.0, 144.0)
    assert (fit.broke_down, fit.runs) == (2, 2)


def test_a_site_needs_detectors_at_three_places():
    assert (SITE.mainline_entry.id, SITE.upstream.id, SITE.downstream.id) == ("in", "up", "down")
    with pytest.raises(CorampError, match="none lies on the ramp before the nose") as error:
        site_of(DETECTORS[:3], 200.0)
    assert len(error.value.messages) == 1
