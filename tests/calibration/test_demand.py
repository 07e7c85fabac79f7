"""Arrivals by counts: as many as were counted, in platoons as by chance; a queue hides some."""

import itertools

import numpy as np
import pytest

from coramp.calibration.demand import arrivals_by_counts
from coramp.calibration.replayed import Replayed
from coramp.calibration.series import Series
from coramp.calibration.site import site_of
from coramp.scenarios.demand_sections import Detector
from coramp.scenarios.loading import load_scenario

LOOPS = (
    Detector(id="in", road="mainline", station_m=-380.0),
    Detector(id="up", road="mainline", station_m=-200.0),
    Detector(id="down", road="mainline", station_m=390.0),
    Detector(id="ramp", road="ramp", station_m=-384.0),
)


def test_as_many_come_as_were_counted_with_the_least_headway():
    paper = load_scenario("paper")
    counts, begins_s = np.array([20.0, 0.0, 35.0, 100.0]), 30.0 + 60.0 * np.arange(4)
    found = list(arrivals_by_counts(paper, False, begins_s, counts, 3))
    times_s = np.array([one.time_s for one in found])
    assert np.histogram(times_s, [*begins_s, 270.0])[0].tolist() == [20, 0, 35, 100]
    assert all(15.0 <= one.speed_mps <= 20.0 and one.stream == "mainline" for one in found)
    steps = np.rint(times_s / 0.1)
    assert steps * 0.1 == pytest.approx(times_s, abs=1e-9)
    early = times_s[times_s < 200.0]
    assert np.diff(early).min() >= 0.5 - 1e-9  # 0.6 s, and a step of rounding
    assert np.diff(times_s).min() > 0.05  # 100 a minute are more than the least headway lets in
    again = [one.time_s for one in arrivals_by_counts(paper, False, begins_s, counts, 3)]
    other = [one.time_s for one in arrivals_by_counts(paper, False, begins_s, counts, 4)]
    assert again == times_s.tolist() != other


def test_vehicles_come_in_platoons_as_by_chance():
    """Headways above the least one are exponential: their mean is their standard deviation."""
    counts = np.full(60, 20.0)
    found = arrivals_by_counts(load_scenario("paper"), True, 60.0 * np.arange(60), counts, 1)
    above_s = np.diff([one.time_s for one in found]) - 0.6
    assert above_s.mean() == pytest.approx(2.4, rel=0.05)
    assert above_s.std() == pytest.approx(2.4, rel=0.1)


def test_lanes_and_types_have_their_shares():
    types = [{"name": "car", "share": 0.8}, {"name": "truck", "share": 0.2}]
    lanes = {"mainline.lanes": 2, "mainline.lane_shares": [0.7, 0.3], "vehicle": types}
    scenario = load_scenario("paper", lanes)
    counts = np.full(30, 40.0)
    found = list(arrivals_by_counts(scenario, False, 60.0 * np.arange(30), counts, 1))
    assert len(found) == 1200
    assert np.mean([one.lane for one in found]) == pytest.approx(0.3, abs=0.04)
    assert np.mean([one.type == "truck" for one in found]) == pytest.approx(0.2, abs=0.04)
    for _, own in itertools.groupby(found, lambda one: one.lane):
        assert np.diff([one.time_s for one in own]).min() > 0.05


def test_a_queue_before_the_merge_hides_who_would_come():
    """The first detector counts 10 in place of 25, yet is not slow: vehicles enter behind it."""
    came = [25.0] * 5 + [10.0] * 5
    series = Series(
        0.0,
        60.0,
        {"in": np.array(came), "ramp": np.full(10, 6.0), **dict.fromkeys(("up", "down"), came)},
        {
            "in": np.full(10, 19.0),
            "up": np.array([19.0] * 5 + [4.0] * 5),
            "down": np.full(10, 19.0),
            "ramp": np.full(10, 15.0),
        },
    )
    replayed = Replayed(load_scenario("paper"), site_of(LOOPS, 200.0), series, (20.0, 16.0))
    arrivals = replayed.driven(1).arrivals
    for stream, way_s, count in (("mainline", 1.0, 25), ("ramp", 1.0, 6)):
        times_s = [one.time_s for one in arrivals if one.stream == stream]
        edges_s = 60.0 - way_s + 60.0 * np.arange(11)
        assert np.histogram(times_s, edges_s)[0].tolist() == [count] * 10
    assert replayed.driven(1).simulation.horizon_s == 660.0
