"""Demand over time: counts are met exactly, seeds differ in when vehicles come."""

from collections import Counter

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from coramp.demand.arrivals import arrivals_of
from coramp.demand.measured import drawn_arrivals, groups_of, undisturbed_s
from coramp.demand.passing import FOLLOW_S
from coramp.errors import CorampError
from coramp.scenarios.loading import load_scenario

TYPES = [{"name": "car", "share": 0.9}, {"name": "truck", "share": 0.1}]
INTERVAL_S = 300.0
STATIONS_M = (None, -300.0, -50.0)
ROAD = """
[mainline]
start_m = -400.0
end_m = 400.0
speed_mps = 20.0
{mainline}
[ramp]
start_m = -400.0
speed_mps = 16.0
acceleration_lane_m = 200.0
{ramp}
"""


def part(route="mainline", begin=0.0, length=INTERVAL_S, **keys):
    return {"route": route, "begin_s": begin, "end_s": begin + length, **keys}


def road(tmp_path, text="", mainline="", ramp=""):
    path = tmp_path / "road.toml"
    path.write_text(ROAD.format(mainline=mainline, ramp=ramp) + text, encoding="utf-8")
    return str(path)


@pytest.fixture(scope="module")
def where(tmp_path_factory):
    return road(tmp_path_factory.mktemp("road"))


def loaded(where, *parts, **overrides):
    return load_scenario(where, {"demand": list(parts), "vehicle": TYPES, **overrides})


def passed(scenario, seed, on_ramp=False):
    """Counts by interval and type at the station, as an undisturbed vehicle passes it."""
    found = Counter()
    arrivals = [a for a in arrivals_of(scenario, seed) if a.on_ramp == on_ramp]
    parts = [p for p in scenario.demand if p.route == ("ramp" if on_ramp else "mainline")]
    start_m = (scenario.ramp if on_ramp else scenario.mainline).start_m
    station_m = parts[0].station_m
    for arrival in arrivals:
        way_s = 0.0
        if station_m is not None:
            way_m = np.array([station_m - start_m + arrival.length_m])
            top = arrival.traits.top_speed_mps if arrival.traits else np.inf
            entry = np.array([arrival.speed_mps])
            (way_s,) = undisturbed_s(scenario, on_ramp, way_m, entry, np.array([top]))
        time_s = arrival.step * scenario.control.step_s + way_s
        found[int(time_s // INTERVAL_S), arrival.vehicle_type] += 1
    return found


counts = st.lists(st.tuples(st.integers(0, 180), st.integers(0, 25)), min_size=1, max_size=5)


@settings(deadline=None, max_examples=60)
@given(counts=counts, seed=st.integers(0, 2**31 - 1), station=st.sampled_from(STATIONS_M))
def test_any_counts_are_met_exactly(where, counts, seed, station):
    parts = [
        part(begin=INTERVAL_S * k, vehicles=n, type=kind, station_m=station)
        for k, of_types in enumerate(counts)
        for kind, n in zip(("car", "truck"), of_types, strict=True)
    ]
    scenario = loaded(where, *parts)
    asked = Counter(
        {
            (k, kind): n
            for k, of_types in enumerate(counts)
            for kind, n in zip(("car", "truck"), of_types, strict=True)
        }
    )
    assert passed(scenario, seed) == +asked


@settings(deadline=None, max_examples=40)
@given(count=st.integers(1, 150), seed=st.integers(0, 2**31 - 1))
def test_arrivals_are_sorted_and_apart(where, count, seed):
    scenario = loaded(where, part(vehicles=count, type="car"), part("ramp", vehicles=10))
    steps = [a.step for a in arrivals_of(scenario, seed) if not a.on_ramp]
    assert steps == sorted(steps)
    headways_s = np.diff(steps) * scenario.control.step_s
    assert (headways_s >= scenario.mainline.min_headway_s - 0.1).all()
    if count <= 100:  # there is room for what SUMO's drivers ask for
        assert (headways_s >= FOLLOW_S).all()


def test_seeds_differ_in_pattern_and_not_in_counts(where):
    scenario = loaded(where, part(vehicles=100), part("ramp", vehicles=30))
    one, two = arrivals_of(scenario, 1), arrivals_of(scenario, 2)
    assert [a.step for a in one] != [a.step for a in two]
    kinds = [Counter((a.on_ramp, a.vehicle_type) for a in found) for found in (one, two)]
    assert kinds[0] == kinds[1]
    assert kinds[0] == {(False, "car"): 90, (False, "truck"): 10, (True, "car"): 27,
                        (True, "truck"): 3}  # fmt: skip
    assert arrivals_of(scenario, 1) == one


def test_a_flow_keeps_its_sum_over_intervals(where):
    parts = [part(begin=60.0 * k, length=60.0, flow_veh_h=630.0) for k in range(20)]
    scenario = loaded(where, *parts, part("ramp", vehicles=1))
    groups = groups_of(scenario, False)
    assert sum(sum(group.counts.values()) for group in groups) == 210  # 10.5 a minute
    assert {sum(group.counts.values()) for group in groups} == {10, 11}
    assert sum(group.counts.get("truck", 0) for group in groups) == 21


def test_a_peak_comes_when_it_is_asked_for(where):
    parts = [part(begin=300.0 * k, flow_veh_h=f) for k, f in enumerate((600.0, 1800.0, 900.0))]
    scenario = loaded(where, *parts, part("ramp", flow_veh_h=240.0, type="car"))
    assert scenario.simulation.horizon_s == 900.0
    assert scenario.mainline.flow_veh_h == pytest.approx(1100.0)
    steps = np.array([a.step for a in arrivals_of(scenario, 5) if not a.on_ramp])
    assert np.histogram(steps, [0, 3000, 6000, 9000])[0].tolist() == [50, 150, 75]


def test_the_horizon_that_is_given_counts(where):
    scenario = loaded(where, part(vehicles=100), part("ramp", vehicles=30),
                      **{"simulation.horizon_s": 150.0})  # fmt: skip
    times = [a.step * 0.1 for a in arrivals_of(scenario, 1)]
    assert max(times) < 150.0
    assert scenario.mainline.flow_veh_h == pytest.approx(1200.0)


def test_a_slower_one_enters_earlier(where):
    scenario = loaded(where, part(vehicles=30, type="car", station_m=0.0),
                      part(vehicles=6, type="truck", station_m=0.0), part("ramp", vehicles=1),
                      **{"mainline.speed_mps": 30.0, "mainline.entry_speed_mps": [30.0, 30.0],
                         "mainline.limit_mps": 30.0})  # fmt: skip
    drawn = drawn_arrivals(scenario, False, 3)
    cars = {one.speed_mps for one in drawn if one.kind.name == "car"}
    assert cars == {30.0}
    assert len(drawn) == 36
    assert [one.step for one in drawn] == sorted({one.step for one in drawn})


@pytest.mark.parametrize(
    ("parts", "line"),
    [
        (
            [part(vehicles=10, flow_veh_h=10.0)],
            "demand.0.flow_veh_h: it and vehicles are given; allowed is one of the two",
        ),
        (
            [part()],
            ("demand.0.flow_veh_h: neither it nor vehicles is given; allowed is one of the two"),
        ),
        ([part(length=0.0, vehicles=1)], "demand.0.end_s: 0 is too small; allowed is above 0"),
        (
            [part(begin=10.0, length=-5.0, vehicles=1)],
            "demand.0.end_s: 5 is not after begin_s; allowed is above 10 s",
        ),
        (
            [part(vehicles=1, type="bus")],
            "demand.0.type: there is no 'bus'; allowed are car, truck",
        ),
        (
            [part(vehicles=1, shares={"car": 0.5})],
            "demand.0.shares: they sum to 0.5; allowed is 1",
        ),
        (
            [part(vehicles=1, lane=1)],
            "demand.0.lane: the mainline has no lane 1; allowed is up to 0",
        ),
        (
            [part(vehicles=1, station_m=-500.0)],
            "demand.0.station_m: -500 is not on the mainline; allowed is -400 to 400 m",
        ),
        (
            [part(vehicles=1), part(begin=100.0, vehicles=1)],
            (
                "demand.1.begin_s: 100 lies within demand.0, which has another interval; "
                "allowed is 300 s or later, or the same interval"
            ),
        ),
        (
            [part(vehicles=400), part(vehicles=101)],
            (
                "demand.1: 501 vehicles in 300 s cannot come with headways of 0.6 s or more; "
                "allowed are up to 500"
            ),
        ),
        ([part(route="exit", vehicles=1)], "demand.0.route: 'exit' is not known"),
        ([part(vehicles=1, flow=3.0)], "demand.0.flow: unknown key"),
    ],
)
def test_what_cannot_be_is_told(where, parts, line):
    with pytest.raises(CorampError) as caught:
        loaded(where, *parts)
    (told,) = caught.value.messages
    assert told.removeprefix("--set: ").startswith(line)


def test_neither_flows_nor_a_list_beside_demand(tmp_path):
    text = '[[demand]]\nroute = "mainline"\nend_s = 60.0\nvehicles = 10\n'
    flows = road(tmp_path, text, ramp="flow_veh_h = 100.0")
    with pytest.raises(CorampError) as caught:
        load_scenario(flows)
    assert caught.value.messages == (
        (
            f"{flows}: ramp.flow_veh_h: beside [[demand]], which already says how many come when; "
            "allowed is one of the two"
        ),
    )
    listed = road(tmp_path, text + '[[arrivals]]\nstream="ramp"\ntime_s=1.0\nspeed_mps=16.0\n')
    with pytest.raises(CorampError, match=r"arrivals: beside \[\[demand\]\]"):
        load_scenario(listed)


def test_a_scenario_without_demand_is_written_as_before():
    data = load_scenario("paper").model_dump(mode="json")
    assert not {"demand", "counts", "detector"} & data.keys()
