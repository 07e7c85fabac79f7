import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from coramp import CorampError
from coramp.runs.planning import plan_snapshot
from coramp.scenarios.snapshots import Snapshot, load_snapshot
from coramp.scenarios.toml_files import validated
from tests.edges import built_in, edited

EXAMPLE = built_in("snapshots", "example")
FASTEST = "27.77777777777778"


def problems(tmp_path, changes):
    path = tmp_path / "mine.toml"
    path.write_text(edited(EXAMPLE, changes))
    with pytest.raises(CorampError) as caught:
        load_snapshot(str(path))
    prefix = f"{path}: "
    assert all(message.startswith(prefix) for message in caught.value.messages)
    return [message.removeprefix(prefix) for message in caught.value.messages]


def snapshot(*vehicles, scenario="paper", **rest):
    data = {
        "name": "made",
        "scenario": scenario,
        "vehicles": [
            {"id": name, "stream": stream, "station_m": station, "speed_mps": speed}
            for name, stream, station, speed in vehicles
        ],
        **rest,
    }
    return validated(Snapshot, data, "made")


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({"speed_mps =": "sped_mps ="}, ["vehicles.0.sped_mps: unknown"]),
        ({"name =": "nam ="}, ["nam: unknown key; did you mean name?"]),
        ({'id = "m2"': 'id = "m1"'}, ["vehicles.1.id: 'm1' is taken"]),
        ({'id = "m2"': 'id = ""'}, ["vehicles.1.id: ''"]),
        (
            {"station_m = -196.0": "station_m = -186.0"},
            ["vehicles: m4 overlaps m3 by 3 m; allowed is a distance of 0.040 m or more"],
        ),
        (
            {"station_m = -196.0": "station_m = -189.05"},
            ["vehicles: m4 is 0.05 m behind m3, nearer than planning allows; allowed is 0.140 m"],
        ),
        (
            {"station_m = -196.0": "station_m = nan"},
            ["vehicles.3.station_m: nan is not finite; allowed is a finite number"],
        ),
        (
            {"station_m = -196.0": "station_m = inf"},
            ["vehicles.3.station_m: inf is not finite; allowed is a finite number"],
        ),
        (
            {"station_m = -336.0": "station_m = -1900.0"},
            ["vehicles.6.station_m: -1900 is outside the mainline; allowed is -700 to 400 m"],
        ),
        (
            {"station_m = -104.0": "station_m = 401.0"},
            ["vehicles.0.station_m: 401 is outside the mainline; allowed is -700 to 400 m"],
        ),
        (
            {"station_m = -100.0": "station_m = -10.0"},
            ["vehicles.7.station_m: -10 is outside the ramp; allowed is -400 to -49.9078 m"],
        ),
        (
            {"station_m = -100.0": "station_m = -401.0"},
            ["vehicles.7.station_m: -401 is outside the ramp"],
        ),
        (
            {f"speed_mps = {FASTEST}": "speed_mps = 100.0"},
            ["vehicles.0.speed_mps: 100 is too large; allowed is at most 60 m/s (if 100 is meant"],
        ),
        (
            {f"speed_mps = {FASTEST}": "speed_mps = 30.0"},
            ["vehicles.0.speed_mps: 30 is above mainline.limit_mps; allowed is up to 27.7778 m/s"],
        ),
        (
            {f"speed_mps = {FASTEST}": "speed_mps = -3.0"},
            ["vehicles.0.speed_mps: -3 is too small; allowed is above 0"],
        ),
        (
            {f"speed_mps = {FASTEST}": 'speed_mps = "fast"'},
            ["vehicles.0.speed_mps: 'fast' is not a number; allowed is a number"],
        ),
        (
            {'stream = "ramp"': 'stream = "rmp"'},
            ["vehicles.7.stream: 'rmp' is not known; allowed is 'mainline' or 'ramp'"],
        ),
        (
            {'stream = "ramp"\nstation_m = -100.0': 'stream = "mainline"\nstation_m = -50.0'},
            ["vehicles: none is on the ramp; at least one ramp vehicle is needed"],
        ),
        (
            {"station_m = -100.0": "station_m = -100.0\nlength_m = -5.0"},
            ["vehicles.7.length_m: -5 is too small; allowed is above 0"],
        ),
    ],
)
def test_what_is_wrong_in_a_snapshot_is_told_in_one_line_each(tmp_path, changes, expected):
    told = problems(tmp_path, changes)
    assert len(told) == len(expected)
    for message, beginning in zip(told, expected, strict=True):
        assert message.startswith(beginning)


def test_several_errors_are_told_at_once(tmp_path):
    told = problems(
        tmp_path,
        {
            'id = "m3"': 'id = "m1"',
            "station_m = -256.0": "station_m = -200.0",
            "station_m = -100.0": "station_m = -20.0",
        },
    )
    assert [message.split(":")[0] for message in told] == [
        "vehicles.2.id",
        "vehicles.7.station_m",
        "vehicles",
    ]


@pytest.mark.parametrize("vehicles", ["vehicles = []", "vehicles = 3", 'vehicles = "m1"'])
def test_a_snapshot_without_a_list_of_vehicles_is_refused(tmp_path, vehicles):
    path = tmp_path / "mine.toml"
    path.write_text(f'name = "x"\nscenario = "paper"\n{vehicles}\n')
    with pytest.raises(CorampError) as caught:
        load_snapshot(str(path))
    (message,) = caught.value.messages
    assert message.startswith(f"{path}: vehicles: ")


def test_one_wrong_vehicle_is_one_error(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text('name = "x"\nscenario = "paper"\nvehicles = [3]\n')
    with pytest.raises(CorampError) as caught:
        load_snapshot(str(path))
    (message,) = caught.value.messages
    assert message.startswith(f"{path}: vehicles.0: 3 ")


@pytest.mark.parametrize(
    ("changes", "key", "what"),
    [
        ({'scenario = "expressway"': 'scenario = "expresway"'}, "scenario", "expressway?"),
        (
            {"[[vehicles]]": 'set = { "control.stp_s" = 0.1 }\n[[vehicles]]'},
            "control.stp_s",
            "did you mean step_s?",
        ),
        (
            {"[[vehicles]]": 'set = { "control.step_s" = nan }\n[[vehicles]]'},
            "control.step_s",
            "nan is not finite",
        ),
    ],
)
def test_errors_of_a_snapshots_scenario_name_the_snapshot(tmp_path, changes, key, what):
    (message,) = problems(tmp_path, changes)
    assert f"{key}: " in message
    assert what in message


def test_what_a_snapshot_sets_is_what_is_planned_with():
    made = snapshot(
        ("m1", "mainline", -200.0, 20.0),
        ("r1", "ramp", -150.0, 16.0),
        set={"ramp.acceleration_lane_m": 150.0, "control.step_s": 0.05},
    )
    assert made.road().ramp.acceleration_lane_m == 150.0
    assert plan_snapshot(made, "mainline-priority").scenario.control.step_s == 0.05


def test_a_vehicles_own_length_counts_before_the_scenarios():
    long = {"id": "m1", "stream": "mainline", "station_m": -100.0, "speed_mps": 20.0}
    near = {"id": "m2", "stream": "mainline", "station_m": -106.0, "speed_mps": 20.0}
    ramp = {"id": "r1", "stream": "ramp", "station_m": -150.0, "speed_mps": 16.0}
    data = {"name": "made", "scenario": "paper", "vehicles": [long, near, ramp]}
    made = validated(Snapshot, data, "made")
    assert made.length_m(made.vehicles[0]) == 5.0
    data["vehicles"][0]["length_m"] = 12.0
    with pytest.raises(CorampError, match="m2 overlaps m1 by 6 m"):
        validated(Snapshot, data, "made")


@given(
    st.floats(1.0, 20.0),
    st.floats(1.0, 20.0),
    st.floats(-0.05, 0.05).filter(lambda slack: abs(slack) > 1e-4),
)
def test_vehicles_must_keep_eq_1_and_the_allowance_from_the_start(front, rear, slack):
    closing_km_h = 3.6 * max(0.0, rear - front)
    eq_1 = 0.04 + 3e-9 * (front + rear) + closing_km_h**2 / (254.0 * 0.51)
    behind = -100.0 - 5.0 - eq_1 - 0.1 - slack
    vehicles = [
        ("m1", "mainline", -100.0, front),
        ("m2", "mainline", behind, rear),
        ("r1", "ramp", -150.0, 16.0),
    ]
    if slack > 0.0:
        assert len(snapshot(*vehicles).vehicles) == 3
    else:
        with pytest.raises(CorampError, match=r"m2 .* m1"):
            snapshot(*vehicles)


def test_the_order_of_vehicles_in_the_file_does_not_matter(tmp_path):
    blocks = EXAMPLE.split("[[vehicles]]")
    path = tmp_path / "mine.toml"
    path.write_text("[[vehicles]]".join([blocks[0], *reversed(blocks[1:])]))
    one, other = load_snapshot("example"), load_snapshot(str(path))
    assert one.vehicles != other.vehicles
    plans = [plan_snapshot(s, "mainline-priority") for s in (one, other)]
    assert plans[0].decisions.equals(plans[1].decisions)
    assert plans[0].after.equals(plans[1].after)


def test_a_situation_that_is_lost_already_is_told():
    with pytest.raises(CorampError, match="m2 can no longer keep its distance"):
        plan_snapshot(
            snapshot(
                ("m1", "mainline", -100.0, 0.5),  # as near as Eq. 3 allows at 0.51 g
                ("m2", "mainline", -111.0, 8.0),  # but comfortable braking is 0.3 g
                ("r1", "ramp", -150.0, 16.0),
                set={"motion.speed_up_mps2": 0.01},
            ),
            "mainline-priority",
        )


def test_every_ramp_vehicle_is_planned_front_first():
    plan = plan_snapshot(
        snapshot(
            ("m1", "mainline", -150.0, 20.0),
            ("r9", "ramp", -100.0, 16.0),
            ("r1", "ramp", -200.0, 16.0),
        ),
        "mainline-priority",
    )
    assert plan.decisions["vehicle_id"].to_list() == ["r9", "r1"]
    assert plan.decisions["time_s"].to_list() == [0.0, 0.0]
    merges = plan.decisions["merge_time_s"].to_list()
    assert merges[0] < merges[1] < math.inf
