import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import coramp
from coramp.demand.arrivals import (
    arrival_times_s,
    arrivals_of,
    changing_arrival_times_s,
    generator,
)
from coramp.scenarios.loading import load_scenario

STEP_S = 0.1


def arrivals(seed=1, **overrides):
    return arrivals_of(
        load_scenario("paper", {key.replace("__", "."): v for key, v in overrides.items()}), seed
    )


def of_stream(found, on_ramp):
    return [(a.vehicle_id, a.step, a.speed_mps, a.length_m) for a in found if a.on_ramp == on_ramp]


flows = st.floats(1.0, 2500.0)
headway_steps = st.integers(1, 12)
seeds = st.integers(0, 2**31 - 1)


@given(flows, headway_steps, seeds)
def test_headways_keep_their_minimum_on_the_step_grid(flow_veh_h, steps, seed):
    times_s = arrival_times_s(
        flow_veh_h, steps * STEP_S, 900.0, STEP_S, generator(seed, "arrivals/x")
    )
    on_grid = times_s / STEP_S
    assert np.abs(on_grid - np.round(on_grid)).max(initial=0.0) < 1e-6
    assert np.diff(np.round(on_grid)).min(initial=np.inf) >= steps
    if len(times_s):
        assert times_s[0] >= steps * STEP_S - 1e-9
        assert times_s[-1] < 900.0


@given(flows, seeds, st.floats(50.0, 900.0))
def test_a_longer_horizon_only_adds_later_arrivals(flow_veh_h, seed, horizon_s):
    short, long = (
        arrival_times_s(flow_veh_h, 0.6, until_s, STEP_S, generator(seed, "arrivals/x"))
        for until_s in (horizon_s, 4.0 * horizon_s)
    )
    assert len(long) >= len(short)
    np.testing.assert_array_equal(long[: len(short)], short)
    assert (long[len(short) :] >= horizon_s - 1e-9).all()


def test_no_flow_is_no_arrivals():
    assert arrivals(mainline__flow_veh_h=0.0, ramp__flow_veh_h=0.0) == []
    assert not of_stream(arrivals(ramp__flow_veh_h=0.0), on_ramp=True)


def test_vehicles_are_named_by_scheduled_time_in_their_stream():
    found = arrivals()
    steps = [a.step for a in found]
    assert steps == sorted(steps)
    for on_ramp, letter in ((False, "m"), (True, "r")):
        names = [name for name, *_ in of_stream(found, on_ramp)]
        assert names == [f"{letter}{k:05d}" for k in range(1, len(names) + 1)]


@pytest.mark.parametrize(
    ("on_ramp", "low_mps", "high_mps"), [(False, 15.0, 20.0), (True, 15.0, 17.0)]
)
def test_entry_speeds_fill_their_range_evenly(on_ramp, low_mps, high_mps):
    speeds = np.array([v for seed in range(10) for *_, v, _ in of_stream(arrivals(seed), on_ramp)])
    assert low_mps <= speeds.min() < low_mps + 0.05
    assert high_mps - 0.05 < speeds.max() <= high_mps
    assert speeds.mean() == pytest.approx(0.5 * (low_mps + high_mps), abs=0.05)
    assert speeds.std() == pytest.approx((high_mps - low_mps) / 12.0**0.5, rel=0.03)


@pytest.mark.parametrize("flow_veh_h", [200.0, 800.0, 1800.0, 3600.0])
def test_as_many_arrive_as_the_flow_says(flow_veh_h):
    counts = [
        len(arrival_times_s(flow_veh_h, 0.6, 18000.0, STEP_S, generator(seed, "arrivals/x")))
        for seed in range(40)
    ]
    assert np.mean(counts) == pytest.approx(5.0 * flow_veh_h, rel=0.03)


def test_headways_are_exponential_beyond_their_minimum():
    times_s = arrival_times_s(1800.0, 0.6, 80000.0, 0.01, generator(7, "arrivals/x"))
    extra_s = np.diff(times_s) - 0.6
    assert extra_s.mean() == pytest.approx(1.4, rel=0.03)
    assert extra_s.std() == pytest.approx(1.4, rel=0.05)
    assert np.quantile(extra_s, 0.5) == pytest.approx(1.4 * np.log(2.0), rel=0.05)


def test_times_are_rounded_up_to_the_grid():
    times_s = arrival_times_s(900.0, 0.6, 600.0, STEP_S, generator(7, "arrivals/x"))
    extra_s = generator(7, "arrivals/x").exponential(4.0 - 0.6, len(times_s))
    drawn_s = np.cumsum(0.6 + extra_s)
    assert (times_s >= drawn_s - 1e-9).all()
    assert (times_s < drawn_s + STEP_S).all()


def test_how_fast_a_vehicle_comes_says_nothing_of_when():
    pairs = []
    for seed in range(300):
        found = of_stream(arrivals(seed, simulation__horizon_s=60.0), on_ramp=False)
        steps = np.array([0, *(step for _, step, *_ in found)])
        pairs += zip(np.diff(steps), [v for *_, v, _ in found], strict=True)
    headways, speeds = np.argsort(np.argsort(np.array(pairs), axis=0), axis=0).T
    assert abs(np.corrcoef(headways, speeds)[0, 1]) < 0.05


def test_a_seed_says_who_comes_and_another_seed_says_otherwise():
    assert arrivals(seed=5) == arrivals(seed=5)
    for on_ramp in (False, True):
        one, other = of_stream(arrivals(seed=5), on_ramp), of_stream(arrivals(seed=6), on_ramp)
        assert [step for _, step, *_ in one] != [step for _, step, *_ in other]


def test_the_two_streams_are_not_the_same_numbers():
    found = arrivals(
        mainline__flow_veh_h=600.0, ramp__flow_veh_h=600.0, mainline__entry_speed_mps=[15.0, 17.0]
    )
    mainline, ramp = of_stream(found, on_ramp=False), of_stream(found, on_ramp=True)
    assert [step for _, step, *_ in mainline] != [step for _, step, *_ in ramp]
    assert [v for *_, v, _ in mainline][:20] != [v for *_, v, _ in ramp][:20]


@pytest.mark.parametrize(
    "change",
    [
        {"ramp__flow_veh_h": 900.0},
        {"ramp__flow_veh_h": 0.0},
        {"ramp__entry_speed_mps": [10.0, 12.0]},
        {"ramp__min_headway_s": 2.0},
        {"safety__time_gap_s": 1.0},
        {"ramp__decision_station_m": -250.0},
    ],
)
def test_nothing_of_the_ramp_or_the_control_shifts_the_mainlines_arrivals(change):
    assert of_stream(arrivals(**change), on_ramp=False) == of_stream(arrivals(), on_ramp=False)


def test_nothing_of_the_mainline_shifts_the_ramps_arrivals():
    changed = arrivals(mainline__flow_veh_h=900.0, mainline__entry_speed_mps=[18.0, 19.0])
    assert of_stream(changed, on_ramp=True) == of_stream(arrivals(), on_ramp=True)


def test_entry_speeds_do_not_shift_times():
    slower = arrivals(mainline__entry_speed_mps=[10.0, 12.0])
    assert [(a.vehicle_id, a.step) for a in slower] == [(a.vehicle_id, a.step) for a in arrivals()]


@given(st.text("abc/ ", max_size=8), st.text("abc/ ", max_size=8), seeds)
def test_every_purpose_has_random_numbers_of_its_own(one, other, seed):
    alike = np.array_equal(generator(seed, one).random(4), generator(seed, other).random(4))
    assert alike == (one == other)


def test_given_arrivals_are_taken_as_they_are():
    given_ones = [
        {"stream": "ramp", "time_s": 2.0, "speed_mps": 15.5, "length_m": 12.0},
        {"stream": "mainline", "time_s": 3.3, "speed_mps": 19.0},
        {"stream": "mainline", "time_s": 2.0, "speed_mps": 18.0},
    ]
    given_ones[1], given_ones[2] = given_ones[2], given_ones[1]
    found = arrivals(arrivals=given_ones, vehicle__length_m=4.0)
    assert [(a.vehicle_id, a.on_ramp, a.step, a.speed_mps, a.length_m) for a in found] == [
        ("m00001", False, 20, 18.0, 4.0),
        ("r00001", True, 20, 15.5, 12.0),
        ("m00002", False, 33, 19.0, 4.0),
    ]
    assert arrivals(seed=9, arrivals=given_ones, vehicle__length_m=4.0) == found


def test_given_arrivals_are_driven():
    result = coramp.run(
        "paper",
        overrides={
            "arrivals": [
                {"stream": "mainline", "time_s": 1.0, "speed_mps": 20.0},
                {"stream": "ramp", "time_s": 2.5, "speed_mps": 16.0},
            ]
        },
    )
    assert result.vehicles.select("vehicle_id", "scheduled_s", "entry_s").rows() == [
        ("m00001", 1.0, 1.0),
        ("r00001", 2.5, 2.5),
    ]
    assert result.vehicles["delay_s"].to_list() == pytest.approx([0.0, 0.0], abs=1e-6)


def test_every_strategy_meets_the_same_vehicles():
    runs = {
        strategy: coramp.run("paper", strategy, seed=3, horizon_s=40.0)
        for strategy in ("mainline-priority", "ramp-priority", "uncontrolled")
    }
    scheduled = [
        result.vehicles.select("vehicle_id", "stream", "scheduled_s").rows()
        for result in runs.values()
    ]
    assert scheduled[0] == scheduled[1] == scheduled[2]
    expected = {a.vehicle_id: a.speed_mps for a in arrivals(seed=3, simulation__horizon_s=40.0)}
    assert len(expected) == len(scheduled[0])
    for strategy in ("mainline-priority", "ramp-priority"):
        pieces = runs[strategy].trajectories
        entered = pieces.sort("time_s").unique("vehicle_id", keep="first")
        assert dict(entered.select("vehicle_id", "speed_mps").rows()) == expected


RISING = {"ramp__flow_veh_h": 300.0, "ramp__flow_to_veh_h": 1500.0}


def test_a_rising_flow_shifts_nothing_of_the_other_stream():
    changed = arrivals(**RISING)
    assert of_stream(changed, on_ramp=False) == of_stream(arrivals(), on_ramp=False)
    assert arrivals(**RISING) == changed


@given(flows, flows, headway_steps, seeds)
def test_headways_of_a_changing_flow_keep_their_minimum_on_the_grid(one, other, steps, seed):
    times_s = changing_arrival_times_s(
        (one, other), steps * STEP_S, 900.0, STEP_S, generator(seed, "arrivals/x")
    )
    on_grid = times_s / STEP_S
    assert np.abs(on_grid - np.round(on_grid)).max(initial=0.0) < 1e-6
    assert np.diff(np.round(on_grid)).min(initial=np.inf) >= steps
    if len(times_s):
        assert times_s[0] >= steps * STEP_S - 1e-9
        assert times_s[-1] < 900.0


def test_a_flow_that_changes_to_itself_has_the_headways_of_a_constant_one():
    times_s = changing_arrival_times_s(
        (1800.0, 1800.0), 0.6, 80000.0, 0.05, generator(7, "arrivals/x")
    )
    extra_s = np.diff(times_s) - 0.6
    assert extra_s.mean() == pytest.approx(1.4, rel=0.02)
    assert extra_s.std() == pytest.approx(1.4, rel=0.03)
    assert np.quantile(extra_s, 0.5) == pytest.approx(1.4 * np.log(2.0), rel=0.05)


@pytest.mark.parametrize("ends", [(0.0, 1800.0), (300.0, 2700.0), (2400.0, 0.0)])
def test_a_changing_flow_is_at_each_time_what_the_line_says(ends):
    horizon_s, parts, draws = 3600.0, 6, 60
    counts = np.zeros(parts)
    for seed in range(draws):
        times_s = changing_arrival_times_s(
            ends, 0.6, horizon_s, STEP_S, generator(seed, "arrivals/x")
        )
        counts += np.histogram(times_s, parts, (0.0, horizon_s))[0]
    middles = (np.arange(parts) + 0.5) / parts
    expected = (ends[0] + (ends[1] - ends[0]) * middles) * horizon_s / parts / 3600.0
    assert counts / draws == pytest.approx(expected, rel=0.04, abs=2.0)


def test_nobody_comes_of_a_flow_that_stays_at_nothing():
    assert not of_stream(arrivals(ramp__flow_veh_h=0.0, ramp__flow_to_veh_h=0.0), on_ramp=True)
