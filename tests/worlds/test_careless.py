"""What happens on the road by itself, in SUMO: breakdowns, braking for nothing, manners, grip."""

import xml.etree.ElementTree as ET

import numpy as np
import pytest

from coramp.demand.arrivals import arrivals_of
from coramp.runs.running import execute, make_spec
from coramp.scenarios.loading import load_scenario
from coramp.worlds.sumo.demand import driver_routes
from coramp.worlds.sumo.traits import traits_of, with_careless

DEMAND = {"mainline_veh_h": 1000.0, "ramp_veh_h": 300.0, "seed": 3, "horizon_s": 120.0}
G = 9.8


def driven(overrides, strategy="mixed-slots", share=0.5, **more):
    shares = {} if share is None else {"traffic.automated_share": share}
    spec = make_spec("paper", strategy, overrides={**shares, **overrides}, **{**DEMAND, **more})
    return execute(spec)


def motion_of(tables, vehicle_id):
    """Returns times, stations, speeds and lane changes of a vehicle."""
    outcome = tables.outcome
    k = list(outcome.passages.vehicle_id).index(vehicle_id)
    rows = outcome.driven.rows[outcome.driven.first[k] : outcome.driven.first[k + 1]]
    return rows[:, 0], rows[:, 1], rows[:, 2], outcome.passages.merge_s[k]


CASES = [
    ("mixed-slots", 1.0 - 1e-9, "mainline", -100.0),
    ("mixed-slots", 1.0 - 1e-9, "ramp", -60.0),
    ("mixed-slots", 1.0 - 1e-9, "ramp", 40.0),
    ("mixed-slots", 1e-9, "mainline", -100.0),
    ("mixed-slots", 1e-9, "ramp", -60.0),
    ("mixed-slots", 1e-9, "ramp", 40.0),
    ("uncontrolled", 0.5, "mainline", -100.0),
    ("uncontrolled", 0.5, "ramp", -60.0),
]


@pytest.mark.parametrize(("strategy", "share", "place", "station_m"), CASES)
def test_a_vehicle_breaks_down_where_and_when_it_is_said(strategy, share, place, station_m):
    tables, _ = driven(
        {
            "incidents.breakdown_s": 40.0,
            "incidents.place": place,
            "incidents.station_m": station_m,
            "incidents.lasts_s": 30.0,
        },
        strategy,
        share,
    )
    (event,) = tables.safety_events.filter(event="vehicle breaks down").rows(named=True)
    name = event["rear_vehicle_id"]
    assert name.startswith("m" if place == "mainline" else "r")
    time_s, at_m, speed_mps, merge_s = motion_of(tables, name)
    stands = speed_mps < 0.05
    assert event["time_s"] >= 40.0
    assert at_m[stands] == pytest.approx(station_m, abs=2.5)
    stood_s = time_s[stands][-1] - time_s[stands][0]
    assert stood_s == pytest.approx(30.0, abs=3.0)
    assert 0.0 <= time_s[stands][0] - event["time_s"] < 15.0
    if place == "ramp":
        assert merge_s > time_s[stands][-1]
    assert np.isfinite(tables.outcome.passages.exit_s).all()


def test_events_of_drivers_alone_are_recorded_too():
    """Nobody is automated; without a fault there is nothing to tell."""
    keys = {
        "incidents.breakdown_s": 40.0,
        "incidents.lasts_s": 10.0,
        "behaviour.brakes_for_nothing_per_h": 200.0,
    }
    tables, row = driven(keys, "uncontrolled", share=0.0)
    events = tables.safety_events["event"].to_list()
    assert events.count("vehicle breaks down") == 1
    assert events.count("driver brakes for nothing") >= 2
    assert row["automated_vehicles"] is None
    assert driven({}, "uncontrolled", share=0.0)[0].safety_events is None


def test_the_next_to_reach_the_station_is_the_one_that_breaks_down():
    keys = {"incidents.breakdown_s": 40.0, "incidents.station_m": -100.0}
    tables, _ = driven(keys, share=1e-9)
    (event,) = tables.safety_events.filter(event="vehicle breaks down").rows(named=True)
    near_m = {}
    for name in tables.outcome.passages.vehicle_id:
        time_s, at_m, speed_mps, _ = motion_of(tables, name)
        if name.startswith("m") and time_s[0] <= event["time_s"] <= time_s[-1]:
            k = np.searchsorted(time_s, event["time_s"] - 1e-6)
            left_m = -100.0 - at_m[k]
            if left_m >= speed_mps[k] ** 2 / 8.0:  # so near it could not stop
                near_m[name] = left_m
    assert event["rear_vehicle_id"] == min(near_m, key=near_m.get)


@pytest.mark.parametrize(("adhesion", "hardest"), [(None, 8.0), (0.35, 0.35 * G)])
def test_a_driver_brakes_for_nothing_as_hard_and_long_as_said(adhesion, hardest):
    overrides = {"behaviour.brakes_for_nothing_per_h": 200.0, "behaviour.brake_s": 1.5}
    if adhesion is not None:
        overrides["road.adhesion"] = adhesion
    tables, _ = driven(overrides)
    events = tables.safety_events.filter(event="driver brakes for nothing").rows(named=True)
    assert len(events) >= 3
    for event in events:
        time_s, at_m, speed_mps, _ = motion_of(tables, event["rear_vehicle_id"])
        begin = np.searchsorted(time_s, event["time_s"] - 1e-6)
        assert -300.0 < at_m[begin] < 150.0
        end = np.searchsorted(time_s, event["time_s"] + 1.0 - 1e-6)
        assert speed_mps[begin] - speed_mps[end] == pytest.approx(hardest, rel=0.12)
    automated = set(tables.vehicles.filter("automated")["vehicle_id"])
    assert automated.isdisjoint(event["rear_vehicle_id"] for event in events)


def test_drivers_brake_for_nothing_as_often_as_said():
    tables, _ = driven(
        {"behaviour.brakes_for_nothing_per_h": 120.0, "behaviour.brake_mps2": 1.0}, horizon_s=900.0
    )
    count = tables.safety_events.filter(event="driver brakes for nothing").height
    assert abs(count - 30.0) < 4.0 * np.sqrt(30.0)


def routes_of(overrides, drivers="fair"):
    scenario = load_scenario(
        "paper",
        {"simulation.horizon_s": 900.0, "mainline.flow_veh_h": 1800.0, **overrides},
    )
    population = scenario.drivers[drivers]
    arrivals = arrivals_of(scenario, 3)
    traits = with_careless(traits_of(population, arrivals, 3), scenario.behaviour, 3)
    root = ET.fromstring(driver_routes(scenario, population, arrivals, traits))
    kinds = {kind.get("id"): kind for kind in root.iter("vType")}
    return {v.get("id"): kinds[v.get("type")].attrib for v in root.iter("vehicle")}


@pytest.mark.parametrize("drivers", ["fair", "credible"])
def test_the_share_that_never_yields_has_that_in_sumos_routes(drivers):
    kinds = routes_of({"behaviour.never_yields_share": 0.3}, drivers).values()
    never = [float(kind["lcCooperative"]) == 0.0 for kind in kinds]
    assert np.mean(never) == pytest.approx(0.3, abs=0.06)


@pytest.mark.parametrize("drivers", ["fair", "credible"])
def test_the_share_that_is_inattentive_has_that_in_sumos_routes(drivers):
    overrides = {"behaviour.inattentive_share": 0.3, "behaviour.inattentive_s": 1.5}
    kinds = routes_of(overrides, drivers).values()
    late = [kind.get("actionStepLength") for kind in kinds]
    assert set(late) == {None, "1.5"}
    assert np.mean([own is not None for own in late]) == pytest.approx(0.3, abs=0.06)


@pytest.mark.parametrize(("strategy", "share"), [("uncontrolled", 0.0), ("mixed-slots", 0.5)])
def test_who_looks_rarely_leaves_all_in_euler_steps(strategy, share):
    """SUMO itself would take ballistic steps then: other drivers, and automated ones off plan."""
    rarely = {"behaviour.inattentive_share": 0.3, "behaviour.inattentive_s": 1.5}
    tables, row = driven(rarely, strategy, share, mainline_veh_h=1800.0)
    rows, first = tables.outcome.driven.rows, tables.outcome.driven.first
    drivers = np.ones(len(first) - 1, np.bool_)
    if share:
        drivers = ~tables.outcome.passages.automated
        assert row["plan_error_m"] < 0.01
    off_m = []
    for k in np.flatnonzero(drivers).tolist():
        time_s, station_m, speed_mps = rows[first[k] : first[k + 1], :3].T
        steps = np.diff(time_s) < 0.1 + 1e-6
        off_m += np.abs(np.diff(station_m) - speed_mps[1:] * np.diff(time_s))[steps].tolist()
    assert np.quantile(off_m, 0.99) < 0.005  # but for lane changes, at which lanes begin


def test_who_is_careless_at_a_share_is_so_at_a_larger_one_and_whatever_else_is_on():
    def never(share, **more):
        found = routes_of({"behaviour.never_yields_share": share, **more})
        return {name for name, kind in found.items() if float(kind["lcCooperative"]) == 0.0}

    assert never(0.0) == set()
    assert never(0.2) < never(0.5)
    assert never(0.2) == never(0.2, **{"behaviour.inattentive_share": 0.5})


def test_adhesion_limits_what_sumos_drivers_brake():
    assert all("decel" not in kind for kind in routes_of({}).values())
    for adhesion, decel, emergency in ((0.8, 4.5, 0.8 * G), (0.35, 0.35 * G, 0.35 * G)):
        for kind in routes_of({"road.adhesion": adhesion}).values():
            assert float(kind["decel"]) == pytest.approx(decel)
            assert float(kind["emergencyDecel"]) == pytest.approx(emergency)


def test_adhesion_limits_what_is_driven_and_assumed_adhesion_keeps_the_distance():
    keys = {"road.adhesion": 0.35, "road.assumed_adhesion": 0.3}
    flows = {"mainline_veh_h": 1800.0, "ramp_veh_h": 500.0, "horizon_s": 200.0}
    tables, row = driven(keys, **flows)
    assert row["collisions_by_automated"] == row["automated_violations"] == 0
    speed_mps, first = tables.outcome.driven.rows[:, 2], tables.outcome.driven.first
    steps = np.diff(speed_mps) / np.diff(tables.outcome.driven.rows[:, 0])
    inside = np.ones(len(steps), np.bool_)
    inside[first[1:-1] - 1] = False
    inside &= np.diff(tables.outcome.driven.rows[:, 0]) > 0.0
    assert steps[inside].min() > -0.35 * G - 0.2
    _, careless = driven({"road.adhesion": 0.12}, **flows)
    assert careless["automated_violations"] > 0


def test_tables_of_faults_that_are_off_change_no_row():
    """Written out with their defaults they are what they are if left out."""
    off = {
        "positioning.noise_m": 0.0,
        "positioning.correlation_s": 10.0,
        "clock.offset_s": 0.0,
        "reports.delay_s": 0.0,
        "commands.loss": 0.0,
        "actuators.lag_s": 0.0,
        "behaviour.silent_share": 0.0,
        "incidents.lasts_s": 60.0,
    }
    names = {"run_id", "overrides", "settings", "wall_s", "planning_median_s", "planning_p95_s"}
    (one, row), (two, other) = driven({}), driven(off)
    assert {k: v for k, v in row.items() if k not in names} == {
        k: v for k, v in other.items() if k not in names
    }
    for name, frame in one.frames().items():
        assert frame.equals(two.frames()[name]), name


def test_a_fault_that_never_acts_changes_no_row():
    """The loop with links, and that with looks at what happens, drive as the plain one does."""
    for idle in ({"commands.duplicates": 0.5}, {"incidents.breakdown_s": 80000.0}):
        one, _ = driven({})
        two, _ = driven(idle)
        assert one.vehicles.equals(two.vehicles), idle


def test_a_run_that_fails_is_the_same_twice():
    overrides = {"world.preset": "urban-canyon", "behaviour.brakes_for_nothing_per_h": 60.0}
    one, two = driven(overrides)[0], driven(overrides)[0]
    for name, frame in one.frames().items():
        assert frame.equals(two.frames()[name]), name


@pytest.mark.parametrize(
    "preset", ["mild", "hard", "rtk-5g", "gnss-its-g5", "urban-canyon", "winter"]
)
def test_no_preset_lets_an_automated_vehicle_collide(preset):
    _, row = driven(
        {"world.preset": preset}, mainline_veh_h=1800.0, ramp_veh_h=500.0, horizon_s=300.0
    )
    assert row["collisions_by_automated"] == row["automated_violations"] == 0
    assert row["reports_sent"] > 0
    assert row["plan_error_m"] < 0.05
