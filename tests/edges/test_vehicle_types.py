"""Types of vehicles in a scenario: what is drawn, what is refused in a line, what is warned of."""

import re

import numpy as np
import pytest

from coramp import CorampError
from coramp.demand.arrivals import arrivals_of, kinds_of
from coramp.runs.running import make_spec
from coramp.scenarios.loading import load_scenario
from coramp.scenarios.sections import Vehicle
from coramp.scenarios.vehicle_checks import slow_merge_warning
from coramp.scenarios.vehicle_types import BUILT_IN, VehicleType
from coramp.strategies.registry import strategies
from tests.edges import assert_refused, built_in, invoke

CAR = {"name": "car", "share": 0.88}
TRUCK = {"name": "truck", "share": 0.12}


def toml_of(tables):
    def shown(value):
        return f'"{value}"' if isinstance(value, str) else repr(value)

    lines = []
    for table in tables:
        lines += ["[[vehicle]]", *(f"{key} = {shown(value)}" for key, value in table.items()), ""]
    return "\n".join(lines)


def scenario_with(*tables, name="expressway", **overrides):
    return load_scenario(name, {"vehicle": list(tables), **overrides})


def problems(*tables, **overrides):
    with pytest.raises(CorampError) as caught:
        scenario_with(*tables, **overrides)
    return [line.removeprefix("--set: ") for line in caught.value.messages]


# refusals -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("tables", "line"),
    [
        (
            [{**CAR, "mainline_share": 0.8}, TRUCK],
            (
                "vehicle: shares of the mainline sum to 0.92 (car 0.8, truck 0.12); allowed is 1 "
                "(keys share and mainline_share)"
            ),
        ),
        (
            [{**CAR, "ramp_share": 1.0}, TRUCK],
            (
                "vehicle: shares of the ramp sum to 1.12 (car 1, truck 0.12); allowed is 1 "
                "(keys share and ramp_share)"
            ),
        ),
        (
            [CAR, {**TRUCK, "name": "car"}],
            "vehicle.1.name: 'car' is given twice; allowed is once",
        ),
        (
            [CAR, {**TRUCK, "top_speed_mps": [25.0, 22.0]}],
            "vehicle.1.top_speed_mps: [25, 22] falls; write the lower speed first",
        ),
        (
            [CAR, {**TRUCK, "top_speed_mps": 2.5}],
            "vehicle.1.top_speed_mps: 2.5 is too slow for any lane; allowed is at least 3 m/s",
        ),
        (
            [CAR, {**TRUCK, "braking_mps2": 0.7}],
            (
                "vehicle.1.braking_mps2: 0.7 does not stop before the nose from "
                "ramp.decision_station_m; allowed is at least 0.79 m/s2"
            ),  # 17.7^2 / (2 * 199)
        ),
        (
            [CAR, {**TRUCK, "length_m": 41.0}],
            "vehicle.1.length_m: 41 is too large; allowed is at most 40",
        ),
        (
            [CAR, {**TRUCK, "power_wpkg": 0.1}],
            "vehicle.1.power_wpkg: 0.1 is too small; allowed is at least 0.5",
        ),
        (
            [CAR, {**TRUCK, "mass_kg": float("nan")}],
            "vehicle.1.mass_kg: nan is not finite; allowed is a finite number",
        ),
        (
            [CAR, {**TRUCK, "fuel": "diesel"}],
            "vehicle.1.fuel: 'diesel' is not known; allowed is 'passenger-car' or 'heavy-duty'",
        ),
        ([{"share": 1.0}], "vehicle.0.name: is missing; it must be given"),
    ],
)
def test_what_does_not_fit_is_refused_in_one_line(tables, line):
    assert problems(*tables) == [line]


@pytest.mark.parametrize("name", [["car"], {"a": 1}, 3])
def test_a_name_that_is_no_text_is_refused(name):
    (line,) = problems({"name": name, "share": 1.0})
    assert line.startswith("vehicle.0.name: ")
    assert line.endswith("is not a text; allowed is one text in quotes")


def test_a_type_longer_than_the_acceleration_lane_is_refused():
    short = {"ramp.acceleration_lane_m": 35.0}
    found = problems(CAR, {**TRUCK, "length_m": 36.0}, **short)
    assert (
        "vehicle.1.length_m: 36 is longer than ramp.acceleration_lane_m; allowed is up to 35 m"
    ) in found


def test_an_unknown_key_names_the_keys_of_a_type():
    (line,) = problems(CAR, {**TRUCK, "lenght_m": 12.0})
    assert line == (
        "vehicle.1.lenght_m: unknown key; did you mean length_m? allowed are acceleration_mps2, "
        "automated_share, braking_mps2, clock_error_s, fuel, length_m, mainline_share, mass_kg, "
        "name, positioning_error_m, power_wpkg, ramp_share, share, sumo_class, time_gap_s, "
        "top_speed_mps"
    )


def test_an_unknown_key_of_the_one_vehicle_names_the_keys_of_that():
    with pytest.raises(CorampError) as caught:
        load_scenario("paper", {"vehicle.lenght_m": 4.0})
    (line,) = caught.value.messages
    assert line == (
        "--set: vehicle.lenght_m: unknown key; did you mean length_m? allowed are length_m"
    )


def test_a_table_without_types_is_refused():
    (line,) = problems()
    assert line.startswith("vehicle: ")


def written(tmp_path, *parts, name="expressway"):
    path = tmp_path / "s.toml"
    path.write_text("\n".join([built_in("scenarios", name), *parts]))
    return path


def test_an_arrival_of_an_unknown_type_is_refused(tmp_path):
    arrival = '[[arrivals]]\nstream = "ramp"\ntime_s = 1.0\nspeed_mps = 16.0\ntype = "bus"\n'
    path = written(tmp_path, toml_of([CAR, TRUCK]), arrival)
    path.write_text(re.sub(r"flow_veh_h = .*\n", "", path.read_text()))
    told = invoke("run", path, "--horizon", "10", "--engine", "exact")
    assert_refused(told)
    assert told.errors == [
        f"Error: {path}: arrivals.0.type: there is no type 'bus'; allowed are car, truck"
    ]


def test_an_arrival_that_is_too_slow_for_any_lane_is_refused():
    arrival = {"stream": "mainline", "time_s": 1.0, "speed_mps": 20.0, "top_speed_mps": 2.0}
    assert problems(CAR, TRUCK, arrivals=[arrival]) == [
        "arrivals.0.top_speed_mps: 2 is too slow for any lane; allowed is at least 3 m/s"
    ]


def test_keys_of_one_vehicle_and_types_at_once_are_no_toml(tmp_path):
    path = written(tmp_path, "[vehicle]\nlength_m = 4.0\n", toml_of([CAR, TRUCK]))
    told = invoke("run", path, "--horizon", "10", "--engine", "exact")
    assert_refused(told)
    (line,) = told.errors
    assert line.startswith(f"Error: {path}: Cannot ")
    assert line.endswith("; allowed is TOML")


def test_keys_of_one_vehicle_set_over_types_are_refused(tmp_path):
    path = written(tmp_path, toml_of([CAR, TRUCK]))
    told = invoke("run", path, "--horizon", "10", "--set", "vehicle.length_m=4.0")
    assert_refused(told)
    (line,) = told.errors
    assert line.startswith("Error: --set: vehicle.length_m: vehicle is ")


# defaults -----------------------------------------------------------------------------------


def test_the_built_in_truck_is_as_documented():
    _, kind = scenario_with(CAR, TRUCK).vehicle_types
    assert (kind.length_m, kind.mass_kg) == (16.5, 40000.0)
    assert (kind.acceleration_mps2, kind.power_wpkg, kind.braking_mps2) == (1.0, 5.5, 2.5)
    assert kind.top_speeds_mps == pytest.approx((80.0 / 3.6, 90.0 / 3.6))
    assert (kind.fuel, kind.sumo_class) == ("heavy-duty", "trailer")
    heavier = scenario_with(CAR, {**TRUCK, "mass_kg": 44000.0}).vehicle_types[1]
    assert (heavier.mass_kg, heavier.length_m) == (44000.0, 16.5)


def test_what_a_type_leaves_out_is_a_cars():
    kind = VehicleType(name="van")
    assert {key: getattr(kind, key) for key in BUILT_IN["car"]} == BUILT_IN["car"]
    assert (kind.length_m, kind.mass_kg) == (5.0, 1500.0)
    assert (kind.fuel, kind.sumo_class) == ("passenger-car", "passenger")
    assert VehicleType(name="car").model_dump() == kind.model_dump() | {"name": "car"}
    assert Vehicle().length_m == kind.length_m


def test_a_type_is_found_by_its_name_and_an_unknown_one_is_refused():
    scenario = scenario_with(CAR, TRUCK)
    assert [scenario.type_named(name).name for name in ("car", "truck", None)] == [
        *("car", "truck"),
        "car",
    ]
    with pytest.raises(CorampError, match="vehicle type 'bus' is not known; allowed is car, truck"):
        scenario.type_named("bus")


def test_a_type_that_differs_in_size_alone_needs_no_planners_of_its_own():
    long = {"name": "bus", "share": 0.12, "length_m": 18.0, "mass_kg": 18000.0}
    assert not scenario_with(CAR, long).vehicles_differ
    for key, value in (("time_gap_s", 1.5), ("clock_error_s", 0.01), ("braking_mps2", 2.5)):
        assert scenario_with(CAR, {**long, key: value}).vehicles_differ


def test_an_arrival_with_a_top_speed_of_its_own_makes_vehicles_differ():
    arrival = {"stream": "mainline", "time_s": 1.0, "speed_mps": 12.0, "top_speed_mps": 12.0}
    for vehicle in ({"length_m": 5.0}, [{"name": "car", "share": 1.0}]):
        scenario = load_scenario("paper", {"vehicle": vehicle, "arrivals": [arrival]})
        assert scenario.vehicles_differ


# draws --------------------------------------------------------------------------------------


def names(scenario, on_ramp, count=4000, seed=1):
    return [kind.name for kind, _ in kinds_of(scenario, on_ramp, count, seed)]


def test_shares_are_met_on_each_stream():
    scenario = scenario_with(
        {"name": "car", "mainline_share": 0.7, "ramp_share": 1.0},
        {"name": "van", "mainline_share": 0.2, "ramp_share": 0.0, "length_m": 7.0},
        {"name": "truck", "mainline_share": 0.1, "ramp_share": 0.0},
    )
    drawn = names(scenario, on_ramp=False)
    for name, share in (("car", 0.7), ("van", 0.2), ("truck", 0.1)):
        # four standard deviations of a share of 4000 draws
        assert abs(drawn.count(name) / 4000 - share) < 4.0 * (share * (1.0 - share) / 4000) ** 0.5
    assert set(names(scenario, on_ramp=True)) == {"car"}


def test_a_truck_at_10_per_cent_stays_one_at_20_with_the_same_top_speed():
    few, many = (
        kinds_of(scenario_with({**CAR, "share": 1.0 - share}, {**TRUCK, "share": share}), *rest)
        for share in (0.1, 0.2)
        for rest in [(False, 2000, 3)]
    )
    trucks = [k for k, (kind, _) in enumerate(few) if kind.name == "truck"]
    assert 150 < len(trucks) < 250
    for k in trucks:
        assert many[k][0].name == "truck"
        assert many[k][1] == few[k][1]
    assert sum(kind.name == "truck" for kind, _ in many) > 1.7 * len(trucks)


def test_top_speeds_fill_their_range():
    drawn = [top for kind, top in kinds_of(scenario_with(TRUCK | {"share": 1.0}), True, 2000, 1)]
    low, high = 80.0 / 3.6, 90.0 / 3.6
    assert low <= min(drawn) < low + 0.01
    assert high - 0.01 < max(drawn) <= high
    assert np.mean(drawn) == pytest.approx((low + high) / 2.0, abs=0.06)


def test_top_speeds_have_nothing_to_do_with_who_is_a_truck():
    drawn = [top for kind, top in kinds_of(scenario_with(CAR, TRUCK), False, 8000, 1)]
    trucks = [top for top in drawn if np.isfinite(top)]
    assert 800 < len(trucks) < 1120
    assert np.mean(trucks) == pytest.approx(85.0 / 3.6, abs=0.11)  # four deviations of the mean


def test_draws_are_the_seeds_and_the_streams_own():
    scenario = scenario_with({**CAR, "share": 0.5}, {**TRUCK, "share": 0.5})
    assert kinds_of(scenario, False, 50, 1) == kinds_of(scenario, False, 50, 1)
    assert kinds_of(scenario, False, 50, 1) == kinds_of(scenario, False, 90, 1)[:50]
    assert names(scenario, False, 50) != names(scenario, True, 50)
    assert names(scenario, False, 50, 1) != names(scenario, False, 50, 2)


def test_types_change_neither_when_vehicles_come_nor_how_fast_cars_enter():
    plain, mixed = (
        arrivals_of(scenario, 1)
        for scenario in (load_scenario("expressway"), scenario_with(CAR, TRUCK))
    )
    assert [(a.vehicle_id, a.step) for a in plain] == [(a.vehicle_id, a.step) for a in mixed]
    for before, after in zip(plain, mixed, strict=True):
        if after.vehicle_type == "truck":
            assert after.speed_mps == min(before.speed_mps, after.traits.top_speed_mps)
            assert after.length_m == after.traits.length_m == 16.5
        else:
            assert after.speed_mps == before.speed_mps


def test_explicit_arrivals_have_the_type_length_and_top_speed_that_they_say():
    arrival = {"stream": "mainline", "time_s": 1.0, "speed_mps": 27.0}
    told = [
        arrival,
        {**arrival, "time_s": 5.0, "type": "truck"},
        {**arrival, "time_s": 9.0, "type": "truck", "top_speed_mps": 20.0, "length_m": 12.0},
    ]
    car, usual, slow = arrivals_of(scenario_with(CAR, TRUCK, arrivals=told), 1)
    assert (car.vehicle_type, car.length_m, car.speed_mps) == ("car", 5.0, 27.0)
    assert usual.traits.top_speed_mps == pytest.approx(85.0 / 3.6)  # the middle of its range
    assert usual.speed_mps == usual.traits.top_speed_mps
    assert (slow.length_m, slow.traits.length_m, slow.speed_mps) == (12.0, 12.0, 20.0)


# warnings and strategies --------------------------------------------------------------------


def test_the_warning_says_what_lane_would_do():
    # 16.667 to 25 m/s by 5.5 W/kg: (25^3 - 16.667^3) / 16.5 m, and 3.28 m before the lane's end
    need_m = (25.0**3 - (60.0 / 3.6) ** 3) / 16.5 + 200.0 - (200.0 - 100.0 / 36.0 - 0.5)
    assert slow_merge_warning(scenario_with(CAR, TRUCK)) == (
        "truck: an acceleration lane of 200 m is too short to reach its cruising speed of "
        f"25.0 m/s; {need_m:.0f} m would do. It merges at the speed that it reaches"
    )
    long = {"ramp.acceleration_lane_m": 680.0, "mainline.end_m": 900.0}
    assert slow_merge_warning(scenario_with(CAR, TRUCK, **long)) is None
    assert slow_merge_warning(load_scenario("expressway")) is None


def test_no_warning_for_a_type_that_never_comes_by_the_ramp():
    only_mainline = {**TRUCK, "share": 0.12, "ramp_share": 0.0}
    assert slow_merge_warning(scenario_with({**CAR, "ramp_share": 1.0}, only_mainline)) is None


def test_a_constant_acceleration_binds_below_the_power():
    # 10 m/s at first: 1 m/s2 up to 5.5 m/s only; 0.2 m/s2 up to 27.5 m/s: 16.667^2 to 20^2 over 0.4
    weak = {"name": "weak", "share": 1.0, "acceleration_mps2": 0.2, "power_wpkg": 5.5}
    scenario = scenario_with({**weak, "top_speed_mps": 20.0})
    need_m = (400.0 - (60.0 / 3.6) ** 2) / 0.4 + 100.0 / 36.0 + 0.5
    assert f"; {need_m:.0f} m would do" in slow_merge_warning(scenario)


@pytest.mark.parametrize("name", sorted(strategies()))
def test_strategies_for_equal_vehicles_are_refused_where_they_differ(name):
    overrides = {"vehicle": [CAR, TRUCK]}
    engine = "exact" if strategies()[name].cooperative else "sumo"
    if name in ("mainline-priority", "ramp-priority", "uncontrolled", "alinea"):
        assert make_spec("expressway", name, engine=engine, overrides=overrides).strategy == name
        return
    with pytest.raises(CorampError) as caught:
        make_spec("expressway", name, engine=engine, overrides=overrides)
    if name == "hero":
        assert "coordinates the meters of several ramps" in str(caught.value)
        return
    assert caught.value.messages == (
        (
            f"strategy: {name} plans for vehicles that are alike but for their length and mass; "
            "with these types of vehicles allowed are mainline-priority, ramp-priority, alinea, "
            "uncontrolled"
        ),
    )


def test_the_warning_is_one_note_and_no_refusal(tmp_path):
    path = written(tmp_path, toml_of([CAR, TRUCK]))
    told = invoke("run", path, "--horizon", "5", "--engine", "exact", "--json")
    assert told.code == 0
    (line,) = told.errors
    assert line.startswith("Note: truck: an acceleration lane of 200 m is too short ")
