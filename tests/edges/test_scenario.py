import json
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from coramp import CorampError
from coramp.scenarios.checks import decision_station_range_m, is_multiple
from coramp.scenarios.loading import drivers_checked, load_scenario
from coramp.scenarios.model import Scenario
from coramp.scenarios.toml_files import (
    builtin_names,
    override_text,
    parse_overrides,
    with_overrides,
)
from tests.edges import built_in, edited

PAPER = load_scenario("paper")


def number_keys(data, prefix=""):
    for key, value in data.items():
        if isinstance(value, dict):
            yield from number_keys(value, f"{prefix}{key}.")
        elif isinstance(value, float):
            yield f"{prefix}{key}"


NUMBERS = sorted(number_keys(PAPER.model_dump(mode="json")))
ONE_OR_MANY = [key for key in NUMBERS if key.endswith(".tau_s")]


def problems(overrides, name="paper"):
    with pytest.raises(CorampError) as caught:
        load_scenario(name, overrides)
    return caught.value.messages


def test_the_paper_scenario_has_the_papers_road_and_free_flow_times():
    assert PAPER.mainline_free_flow_s == pytest.approx(40.0)
    # 400 m at 16 m/s, 2 s of 2 m/s2, then from 36 m to 400 m at 20 m/s
    assert PAPER.ramp_free_flow_s == pytest.approx(25.0 + 2.0 + 364.0 / 20.0)


def test_a_merge_leaves_a_step_and_half_a_metre_of_the_lane():
    assert PAPER.last_merge_station_m == pytest.approx(200.0 - 20.0 * 0.1 - 0.5)


def test_braking_towards_a_stop_is_comfortable_and_grips():
    assert PAPER.stop_mps2 == pytest.approx(0.3 * 9.8)
    icy = load_scenario("paper", {"safety.adhesion": 0.1})
    grip = 254.0 * (0.1 + 0.11) / (2.0 * 3.6**2)
    assert icy.stop_mps2 == pytest.approx(0.95 * grip)
    assert icy.stop_mps2 < PAPER.stop_mps2


def test_the_stop_moves_back_where_the_lane_is_too_short_to_start_from_the_nose():
    assert PAPER.stop_station_m == -1.0
    tight = {"ramp.acceleration_lane_m": 30.0, "motion.free_acceleration_mps2": 3.0}
    short = load_scenario("paper", tight)
    missing = (20.0**2 - 2.0 * 6.0 * (30.0 - 2.5)) / (2.0 * 1.5)
    assert short.run_up_m == pytest.approx(missing)
    assert short.stop_station_m == pytest.approx(-missing - 0.1)
    (message,) = problems({**tight, "ramp.stop_station_m": -2.0})
    assert message.startswith("--set: ramp.stop_station_m: -2 ")
    assert f"up to {-missing:g} m" in message


def test_how_slow_a_gap_maker_may_be_fits_the_time_gap():
    def slow(**overrides):
        overrides = {key.replace("__", "."): value for key, value in overrides.items()}
        return load_scenario("paper", overrides).rules().motion.slow_deviation

    assert slow() == 0.1
    assert slow(motion__speed_deviation=0.2) == 0.2
    assert slow(safety__time_gap_s=0.6) == pytest.approx(0.34)  # 0.1 (1 + 4 * 0.6)
    assert slow(safety__time_gap_s=1.0) == pytest.approx(0.5)
    assert slow(safety__time_gap_s=1.4) == 0.5
    assert slow(safety__time_gap_s=1.4, motion__speed_deviation=0.0) == 0.0
    assert slow(safety__time_gap_s=1.0, motion__slow_deviation=0.2) == 0.2
    assert slow(motion__slow_deviation=0.7) == 0.7


def test_decisions_wait_for_every_vehicle_that_matters():
    least = (20.0**2 - 16.0**2) / (2.0 * 197.5)
    lag = (20.0 - 16.0) ** 2 / (2.0 * least)
    distance = 0.04 + (3.6 * 20.0 * (1.0 - math.cos(math.pi / 6))) ** 2 / (254.0 * 0.51) + 0.1
    first = (-400.0 + lag + 5.0 + distance + 20.0 * 0.1) * 16.0 / 20.0
    last = -1.0 - 17.0**2 / (2.0 * 2.94) - 17.0 * 0.2
    assert decision_station_range_m(PAPER) == pytest.approx((first, last))
    for station, fine in ((first + 0.01, True), (first - 0.01, False)):
        overrides = {"ramp.decision_station_m": station}
        if fine:
            assert load_scenario("paper", overrides).ramp.decision_station_m == station
        else:
            (message,) = problems(overrides)
            assert "--set: ramp.decision_station_m: " in message
            assert f"{first:.1f} to {last:.1f} m" in message


@pytest.mark.parametrize(
    ("given", "key", "allowed"),
    [
        # the mainline has (-200 20/16 + 400) m, less lag, length, a step, 2 L_1, clock, allowance
        ({"safety.time_gap_s": 8.0}, "safety.time_gap_s: 8 s", "6.045 s"),
        ({"safety.time_gap_s": 6.05}, "safety.time_gap_s: 6.05 s", "6.045 s"),
        (
            {"safety.time_gap_s": 6.0, "safety.standstill_gap_m": 20.0},
            "safety.time_gap_s: 6 s",
            "5.045 s",
        ),
        (
            {"safety.standstill_gap_m": 20.0, "ramp.decision_station_m": -290.0},
            "safety.standstill_gap_m: 20 m",
            "8.415 m",
        ),
    ],
)
def test_gaps_that_do_not_fit_the_road_are_refused_with_what_is_allowed(given, key, allowed):
    (message,) = problems(given)
    assert message.startswith(f"--set: {key} does not fit")
    assert message.endswith(f"allowed is up to {allowed}")
    changed, most = key.split(":")[0], float(allowed.split()[0])
    assert load_scenario("paper", {**given, changed: most})


def test_two_gaps_that_do_not_fit_either_are_both_refused():
    given = {
        "safety.time_gap_s": 0.8,
        "safety.standstill_gap_m": 15.0,
        "ramp.decision_station_m": -290.0,
    }
    first, second = problems(given)
    assert first.startswith("--set: safety.time_gap_s: 0.8 s does not fit")
    assert second.startswith("--set: safety.standstill_gap_m: 15 m does not fit")


def test_errors_too_wide_for_the_road_are_not_blamed_on_the_gaps():
    given = {"safety.positioning_error_m": 20.0, "mainline.start_m": -300.0}
    (message,) = problems({**given, "safety.time_gap_s": 1.0})
    assert message.startswith("paper: ramp.decision_station_m: ")


@pytest.mark.parametrize(
    ("value", "allowed"),
    [(-1.0, "at least 0"), (20.5, "at most 20"), (math.nan, "a finite number")],
)
def test_standstill_gaps_have_bounds(value, allowed):
    (message,) = problems({"safety.standstill_gap_m": value})
    assert message.startswith("--set: safety.standstill_gap_m: ")
    assert f"allowed is {allowed}" in message


@given(st.sampled_from(NUMBERS), st.sampled_from([math.nan, math.inf, -math.inf]))
def test_no_number_may_be_anything_but_finite(key, value):
    messages = problems({key: value})
    assert len(messages) == 1
    assert f"{key}: {value:g} is not finite; allowed is a finite number" in messages[0]


@given(
    st.sampled_from([key for key in NUMBERS if key not in ONE_OR_MANY]),
    st.sampled_from(["fast", True, [1.0], {"a": 1.0}]),
)
def test_no_number_may_be_anything_else(key, value):
    messages = problems({key: value})
    assert len(messages) == 1
    assert f" {key}: " in messages[0]
    assert "; allowed is" in messages[0]


@given(st.sampled_from(NUMBERS), st.text("abcdefgh_", min_size=1, max_size=8))
def test_unknown_keys_are_refused_wherever_they_stand(key, name):
    table = key.rpartition(".")[0]
    wrong = f"{table}.{name}x"
    (message,) = problems({wrong: 1.0})
    assert message.startswith(f"--set: {wrong}: unknown key; ")
    assert "allowed are" in message
    assert key.rpartition(".")[2] in message


@given(st.sampled_from(NUMBERS))
def test_a_misspelt_key_is_told_the_right_one(key):
    table, _, name = key.rpartition(".")
    (message,) = problems({f"{table}.{name[:2]}{name[3:]}": 1.0})
    assert f"did you mean {name}?" in message


def test_whole_numbers_count_as_numbers():
    scenario = load_scenario("paper", {"mainline.flow_veh_h": 900, "mainline.start_m": -500})
    assert scenario.mainline.flow_veh_h == 900.0
    assert isinstance(scenario.mainline.flow_veh_h, float)


def test_everything_that_is_wrong_is_told_at_once():
    messages = problems(
        {"mainline.start_m": 4.0, "ramp.speed_mps": math.nan, "control.step_s": -1.0, "x": 1}
    )
    assert [message.split(": ")[1] for message in messages] == [
        "mainline.start_m",
        "ramp.speed_mps",
        "control.step_s",
        "x",
    ]


def test_what_cannot_work_together_is_told_at_once():
    messages = problems(
        {
            "ramp.speed_mps": 21.0,
            "mainline.end_m": 150.0,
            "mainline.min_headway_s": 4.0,
            "control.actuation_delay_s": 0.13,
        }
    )
    told = " ".join(messages)
    for key in ("ramp.speed_mps", "mainline.end_m", "control.actuation_delay_s"):
        assert f"--set: {key}: " in told
    assert "paper: mainline.flow_veh_h: 1800 " in told
    assert "below 900 veh/h" in told


def test_the_origin_of_a_wrong_value_is_told(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text(edited(built_in("scenarios", "paper"), {"end_m = 400.0": "end_m = 100.0"}))
    (message,) = problems({}, str(path))
    assert message.startswith(f"{path}: mainline.end_m: 100 ")
    assert load_scenario(str(path), {"mainline.end_m": 300.0}).mainline.end_m == 300.0


def test_scenarios_do_not_change():
    with pytest.raises(ValidationError):
        PAPER.mainline.start_m = -500.0


@pytest.mark.parametrize("name", builtin_names("scenarios"))
def test_a_built_in_scenario_survives_being_written_and_read(name):
    scenario = load_scenario(name)
    text = json.dumps(scenario.model_dump(mode="json"))
    assert Scenario.model_validate(json.loads(text), strict=False) == scenario
    for population in ("paper", "fair", "paper-sigma0", "fair-sigma0"):
        assert drivers_checked(scenario, population) == population


def arrivals(*given):
    return [{"stream": s, "time_s": t, "speed_mps": v} for s, t, v in given]


@pytest.mark.parametrize(
    ("given_arrivals", "key", "allowed"),
    [
        (arrivals(("mainline", 1.0, 25.0)), "arrivals.0.speed_mps: 25 ", "up to 20 m/s"),
        (arrivals(("ramp", 1.0, 18.0)), "arrivals.0.speed_mps: 18 ", "up to 17 m/s"),
        (arrivals(("ramp", 1.05, 16.0)), "arrivals.0.time_s: 1.05 ", "multiples of 0.1 s"),
        (arrivals(("ramp", -1.0, 16.0)), "arrivals.0.time_s: -1 ", "at least 0"),
        (
            arrivals(("ramp", 5.0, 16.0), ("mainline", 1.0, 16.0), ("ramp", 5.0, 16.0)),
            "arrivals.2.time_s: 5 ",
            "above 5 s",
        ),
        (arrivals(("side", 5.0, 16.0)), "arrivals.0.stream: 'side' ", "'mainline' or 'ramp'"),
        ([{"stream": "ramp", "time_s": 5.0}], "arrivals.0.speed_mps: ", "must be given"),
        (
            [{"stream": "ramp", "time_s": 5.0, "speed_mps": 16.0, "length_m": 0.0}],
            "arrivals.0.length_m: 0 ",
            "above 0",
        ),
        ([7], "arrivals.0: 7 ", "a TOML table"),
    ],
)
def test_explicit_arrivals_are_checked(given_arrivals, key, allowed):
    (message,) = problems({"arrivals": given_arrivals})
    assert f"--set: {key}" in message
    assert allowed in message


@pytest.mark.parametrize(
    ("text", "key", "value"),
    [
        ("control.step_s=0.05", "control.step_s", 0.05),
        ("a=1", "a", 1),
        ("a=[1.5, 2.5]", "a", [1.5, 2.5]),
        ("a=true", "a", True),
        (" a = x ", "a", "x"),
        ("control.gap_position=front", "control.gap_position", "front"),
        ('a="x=y"', "a", "x=y"),
        ("a=", "a", ""),
    ],
)
def test_settings_are_toml_or_plain_text(text, key, value):
    assert parse_overrides([text]) == {key: value}


@given(st.floats(allow_nan=False, allow_infinity=False))
def test_settings_keep_every_digit(value):
    assert parse_overrides([f"k={value!r}"]) == {"k": value}


settings_given = st.recursive(
    st.booleans()
    | st.integers(-(2**63), 2**63 - 1)
    | st.floats(allow_nan=False, allow_infinity=False)
    | st.text(st.characters(codec="utf-8", exclude_characters="\x7f")),
    lambda inner: (
        st.lists(inner, max_size=3) | st.dictionaries(st.text("ab .-"), inner, max_size=3)
    ),
    max_leaves=5,
)


@given(settings_given)
def test_a_setting_is_read_back_from_its_text(value):
    text = override_text("a.b", value)
    assert "\n" not in text
    assert parse_overrides([text]) == {"a.b": value}


def test_the_text_of_a_setting_is_as_one_would_write_it():
    assert override_text("a.b", [16.0, 19.0]) == "a.b=[16.0, 19.0]"
    assert override_text("control.gap_position", "front") == "control.gap_position=front"
    assert override_text("name", "1.0") == 'name="1.0"'


def test_overriding_leaves_the_original_alone():
    data = {"a": {"b": {"c": 1}}, "d": 2}
    changed = with_overrides(data, {"a.b.c": 5, "a.b.e": 6, "f.g": 7}, {})
    assert changed == {"a": {"b": {"c": 5, "e": 6}}, "d": 2, "f": {"g": 7}}
    assert data == {"a": {"b": {"c": 1}}, "d": 2}


@given(st.integers(0, 10**6), st.sampled_from([0.01, 0.05, 0.1, 0.25, 1.0]))
def test_multiples_are_seen_through_rounding(count, unit):
    assert is_multiple(count * unit, unit)
    assert not is_multiple((count + 0.5) * unit, unit)
