"""Populations of drivers: what SUMO is told of each vehicle, and what it makes of it."""

import xml.etree.ElementTree as ET

import numpy as np
import polars as pl
import pytest
from hypothesis import given
from hypothesis import strategies as st

import coramp
from coramp import CorampError
from coramp.demand.arrivals import arrivals_of
from coramp.scenarios.loading import load_scenario
from coramp.worlds.sumo.demand import driver_routes
from coramp.worlds.sumo.network import driver_road_plan, road_plan
from coramp.worlds.sumo.traits import traits_of


def told(population, seed=1, **overrides):
    """Returns what a route file says: each vehicle's attributes with those of its type."""
    scenario = load_scenario("paper", {key.replace("__", "."): v for key, v in overrides.items()})
    arrivals = arrivals_of(scenario, seed)
    drivers = scenario.drivers[population]
    routes = driver_routes(scenario, drivers, arrivals, traits_of(drivers, arrivals, seed))
    root = ET.fromstring(routes)
    types = {kind.get("id"): dict(kind.attrib) for kind in root.iter("vType")}
    return types, [dict(vehicle.attrib) for vehicle in root.iter("vehicle")]


def test_a_population_of_old_is_told_word_for_word_as_ever():
    scenario = load_scenario("paper")
    arrivals = arrivals_of(scenario, 1)
    drivers = scenario.drivers["fair"]
    lines = driver_routes(scenario, drivers, arrivals, traits_of(drivers, arrivals, 1)).splitlines()
    assert lines[1] == (
        '  <vType id="driver-5.0" length="5.0" maxSpeed="20.0" speedFactor="1" speedDev="0" '
        'sigma="0.5" tau="1.0" minGap="2.5" lcCooperative="1.0"/>'
    )
    assert sum("<vType" in line for line in lines) == 1
    first = arrivals[0]
    assert f'  <vehicle id="{first.vehicle_id}" type="driver-5.0"' in lines[4]
    assert lines[4].endswith('"/>')
    assert "speedFactor" not in lines[4]


def test_credible_drivers_are_told_their_time_gaps_acceleration_and_wishes():
    types, vehicles = told("credible")
    assert {kind["tau"] for kind in types.values()} == {"0.9", "1.05", "1.2", "1.35", "1.5"}
    assert len(types) == 5
    for kind in types.values():
        assert kind["accel"] == "1.5"
        assert float(kind["maxSpeed"]) == pytest.approx(1.15 * 20.0)
        assert "speedFactor" not in kind
    for vehicle in vehicles:
        factor = float(vehicle["speedFactor"])
        common_mps = 16.0 if vehicle["route"] == "ramp" else 20.0
        assert 0.85 <= factor <= 1.15
        assert float(vehicle["departSpeed"]) <= factor * common_mps
    capped = [v for v in vehicles if float(v["speedFactor"]) < 0.9 and v["route"] == "ramp"]
    assert capped
    for vehicle in capped:
        assert float(vehicle["departSpeed"]) == float(vehicle["speedFactor"]) * 16.0


def test_an_acceleration_and_another_model_are_passed_on():
    types, _ = told("fair", drivers__fair__accel_mps2=1.6, drivers__fair__car_following="EIDM")
    (kind,) = types.values()
    assert (kind["accel"], kind["carFollowModel"]) == ("1.6", "EIDM")
    assert "sigma" not in kind


def test_a_wish_by_factor_is_a_factor_of_the_limits():
    scenario = load_scenario("paper", {"mainline.limit_mps": 25.0})
    credible = driver_road_plan(scenario, scenario.drivers["credible"])
    assert (credible.mainline_limit_mps, credible.ramp_limit_mps) == (20.0, 16.0)
    fair = driver_road_plan(scenario, scenario.drivers["fair"])
    assert (fair.mainline_limit_mps, fair.ramp_limit_mps) == (25.0, 16.0)
    assert driver_road_plan(scenario, scenario.drivers["paper"]) == road_plan(scenario)
    assert driver_road_plan(scenario, scenario.drivers["fair"], metered=True).gore_m == 60.0


def drawn(seed, population="credible", **overrides):
    settings = {key.replace("__", "."): v for key, v in overrides.items()}
    scenario = load_scenario("paper", settings)
    arrivals = arrivals_of(scenario, seed)
    traits = traits_of(scenario.drivers[population], arrivals, seed)
    return dict(zip((a.vehicle_id for a in arrivals), traits, strict=True))


def test_a_vehicle_keeps_its_traits_whatever_the_other_stream_does():
    one = drawn(5)
    assert drawn(5) == one
    other = drawn(5, mainline__flow_veh_h=900.0, simulation__horizon_s=900.0)
    shared = one.keys() & other.keys()
    assert len(shared) > 250
    assert all(one[name] == other[name] for name in shared)
    assert drawn(6) != one


def test_a_longer_list_of_time_gaps_does_not_shift_the_speed_factors():
    one, other = drawn(5), drawn(5, drivers__credible__tau_s=1.2)
    assert [t.speed_factor for t in one.values()] == [t.speed_factor for t in other.values()]
    assert {t.tau_s for t in other.values()} == {1.2}


def test_draws_are_as_likely_as_said():
    traits = [t for seed in range(10) for t in drawn(seed).values()]
    taus, counts = np.unique([t.tau_s for t in traits], return_counts=True)
    assert taus.tolist() == [0.9, 1.05, 1.2, 1.35, 1.5]
    assert counts / len(traits) == pytest.approx([0.2] * 5, abs=0.015)
    factors = np.array([t.speed_factor for t in traits])
    # a normal distribution cut off 0.15 / 0.07 deviations from its mean
    assert factors.mean() == pytest.approx(1.0, abs=0.003)
    assert factors.std() == pytest.approx(0.07 * 0.907, rel=0.02)
    assert np.quantile(factors, 0.8) == pytest.approx(1.0 + 0.07 * 0.808, abs=0.004)
    assert abs(np.corrcoef(factors, [t.tau_s for t in traits])[0, 1]) < 0.03


@given(
    st.floats(0.5, 1.5),
    st.floats(0.01, 0.5),
    st.floats(0.0, 0.5),
    st.floats(0.0, 0.5),
)
def test_factors_lie_within_their_range(mean, deviation, below, above):
    low, high = max(0.01, mean - below), min(2.0, mean + above)
    factor = {"mean": mean, "deviation": deviation, "low": low, "high": high}
    traits = drawn(3, simulation__horizon_s=60.0, drivers__credible__speed_factor=factor)
    assert all(low <= t.speed_factor <= high for t in traits.values())


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        ("drivers.fair.tau_s", 0.0, "drivers.fair.tau_s: 0 is too small; allowed is above 0"),
        ("drivers.fair.tau_s", [1.0, 11.0], "drivers.fair.tau_s.1: 11 is too large; allowed is"),
        ("drivers.fair.tau_s", [], "drivers.fair.tau_s: [] has the wrong shape; allowed is a list"),
        ("drivers.fair.tau_s", "long", "drivers.fair.tau_s: 'long' is not a number; allowed is"),
        ("drivers.fair.tau_s", [1.0, np.nan], "drivers.fair.tau_s.1: nan is not finite"),
        ("drivers.fair.accel_mps2", 0.0, "drivers.fair.accel_mps2: 0 is too small"),
        (
            "drivers.credible.speed_factor.low",
            1.1,
            "drivers.credible.speed_factor: 1 is not between low and high; allowed are low <= mean",
        ),
        (
            "drivers.credible.wish",
            "entry-speed",
            "drivers.credible.speed_factor: each wishes the speed that it entered with; allowed ",
        ),
        ("drivers.credible.speed_factor", 1.0, "drivers.credible.speed_factor: 1 is not a table"),
        ("ramp.flow_to_veh_h", 6000.0, "ramp.flow_to_veh_h: 6000 cannot arrive with headways of"),
    ],
)
def test_what_is_wrong_is_one_line(key, value, message):
    with pytest.raises(CorampError) as caught:
        load_scenario("paper", {key: value})
    assert len(caught.value.messages) == 1
    assert message in caught.value.messages[0]


def test_a_name_with_a_dot_can_be_set():
    key = "drivers.automated-0.6.lc_cooperative"
    scenario = load_scenario("paper", {key: 0.0})
    assert scenario.drivers["automated-0.6"].lc_cooperative == 0.0
    with pytest.raises(CorampError, match=r"--set: drivers\.automated-0\.6\.sigma: 2 is too large"):
        load_scenario("paper", {"drivers.automated-0.6.sigma": 2.0})
    run = coramp.run(
        "paper", "uncontrolled", drivers="automated-0.6", overrides={key: 0.0}, horizon_s=10.0
    )
    assert run.summary["overrides"] == f"{key}=0.0"
    same = coramp.run(
        "paper", "uncontrolled", drivers="automated-0.6", overrides={key: 1.0}, horizon_s=10.0
    )
    assert same.summary["overrides"] is None


@pytest.fixture(scope="module")
def alone():
    """Credible drivers of whom each has the road to himself."""
    arrivals = [
        {"stream": stream, "time_s": 100.0 * k + 50.0 * (stream == "ramp"), "speed_mps": 16.0}
        for stream in ("mainline", "ramp")
        for k in range(1, 9)
    ]
    arrivals.sort(key=lambda arrival: arrival["time_s"])
    settings = {"arrivals": arrivals, "drivers.credible.sigma": 0.0}
    run = coramp.run("paper", "uncontrolled", drivers="credible", overrides=settings, seed=4)
    scenario = load_scenario("paper", settings)
    given_ones = arrivals_of(scenario, 4)
    traits = traits_of(scenario.drivers["credible"], given_ones, 4)
    return run, {a.vehicle_id: t for a, t in zip(given_ones, traits, strict=True)}


def test_sumos_drivers_reach_their_own_wish_at_their_acceleration(alone):
    run, traits = alone
    positions = run.positions
    wishes = {name: 20.0 * own.speed_factor for name, own in traits.items()}
    assert min(wishes.values()) < 19.5
    assert max(wishes.values()) > 20.5
    for name, wish_mps in wishes.items():
        own = positions.filter(vehicle_id=name)
        end = own.filter(pl.col("station_m") > 300.0)["speed_mps"]
        assert end.max() == pytest.approx(wish_mps, abs=0.02)
        assert own["accel_mps2"].max() == pytest.approx(1.5, abs=0.1)


def test_on_the_ramp_the_wish_is_a_factor_of_the_ramps_speed(alone):
    run, traits = alone
    for name, own in traits.items():
        if name.startswith("r"):
            ramp = run.positions.filter(pl.col("vehicle_id") == name, pl.col("lane") == "ramp")
            assert ramp["speed_mps"].max() == pytest.approx(16.0 * own.speed_factor, abs=0.02)


def test_automated_followers_keep_their_time_gap_without_noise():
    settings = {"simulation.horizon_s": 120.0}
    run = coramp.run(
        "paper",
        "uncontrolled",
        drivers="automated-0.6",
        overrides=settings,
        mainline_veh_h=3200.0,
        ramp_veh_h=0.0,
    )
    exits_s = run.vehicles["exit_s"].sort().to_numpy()
    # 0.6 s and 7.5 m at 20 m/s are 0.975 s
    assert np.diff(exits_s).min() == pytest.approx(0.975, abs=0.06)
