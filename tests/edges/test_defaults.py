"""What a scenario of one's own may leave out, and speeds in km/h."""

import re
import tomllib
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

import coramp
from coramp import CorampError
from coramp.runs.beforehand import faults_that_reach_nobody, without_effect_on_drivers
from coramp.runs.running import make_spec
from coramp.scenarios.checks import decision_station_range_m
from coramp.scenarios.loading import load_scenario
from coramp.scenarios.toml_files import builtin_names
from tests.edges import assert_refused, built_in, edited, invoke

BARE = """
[mainline]
start_m = -700.0
end_m = 500.0
speed_kmh = 110
flow_veh_h = 1500

[ramp]
start_m = -400.0
speed_kmh = 65
flow_veh_h = 400
acceleration_lane_m = 250.0
"""


@pytest.fixture
def bare(tmp_path):
    def written(changes=(), extra=""):
        path = tmp_path / "bare.toml"
        path.write_text(edited(BARE, dict(changes)) + extra)
        return str(path)

    return written


def test_road_and_flows_are_enough(bare):
    found = load_scenario(bare())
    assert found.name == "bare"
    assert found.mainline.speed_mps == pytest.approx(110.0 / 3.6)
    assert found.mainline.limit_mps == found.mainline.speed_mps
    assert found.mainline.entry_speed_mps == pytest.approx((27.5, 110.0 / 3.6))
    assert found.ramp.limit_mps == pytest.approx(1.1 * 65.0 / 3.6)
    assert found.ramp.entry_speed_mps == pytest.approx((0.9 * 65.0 / 3.6, 1.1 * 65.0 / 3.6))
    assert found.drivers == load_scenario("paper").drivers
    first_m, last_m = decision_station_range_m(found)
    assert found.decision_station_m == pytest.approx(first_m + 0.25 * (last_m - first_m), abs=1.0)


@pytest.mark.parametrize("strategy", ["mainline-priority", "slots", "uncontrolled", "alinea"])
def test_such_a_scenario_runs_with_every_kind_of_strategy(bare, strategy):
    run = coramp.run(bare(), strategy, horizon_s=60.0)
    assert run.broken_promises == []
    assert run.summary["unserved"] == 0


@given(
    kmh=st.floats(60.0, 150.0),
    share=st.floats(0.4, 0.9),
    lane_m=st.floats(60.0, 400.0),
    time_gap_s=st.floats(0.0, 2.0),
)
def test_the_chosen_station_is_one_that_the_checks_allow(
    tmp_path_factory, kmh, share, lane_m, time_gap_s
):
    path = tmp_path_factory.getbasetemp() / "drawn.toml"
    text = BARE.replace("= 110", f"= {kmh!r}").replace("= 65", f"= {share * kmh!r}")
    path.write_text(text.replace("= 250.0", f"= {lane_m!r}"))
    try:
        found = load_scenario(str(path), {"safety.time_gap_s": time_gap_s})
    except CorampError as error:
        if any("ramp.decision_station_m: at" in line for line in error.messages):
            raise  # the station itself is to blame, not a lane too short or gaps too long
        return
    first_m, last_m = decision_station_range_m(found)
    assert first_m <= found.decision_station_m <= last_m
    given = {"safety.time_gap_s": time_gap_s, "ramp.decision_station_m": found.decision_station_m}
    assert load_scenario(str(path), given).rules() == found.rules()


def test_what_is_given_stays_and_the_rest_follows_it(bare):
    limits = {"speed_kmh = 110": "speed_kmh = 110\nlimit_kmh = 130"}
    found = load_scenario(bare(limits))
    assert found.mainline.limit_mps == pytest.approx(130.0 / 3.6)
    assert found.mainline.entry_speed_mps[1] == found.mainline.speed_mps
    entries = {"speed_kmh = 65": "speed_kmh = 65\nentry_speed_kmh = [60, 80]"}
    found = load_scenario(bare(entries))
    assert found.ramp.entry_speed_mps == pytest.approx((60.0 / 3.6, 80.0 / 3.6))
    assert found.ramp.limit_mps == pytest.approx(80.0 / 3.6)
    own = load_scenario(bare(extra='\n[drivers.fair]\nwish = "free-flow"\nsigma = 0.3\n'))
    assert own.drivers["fair"].sigma == 0.3
    assert own.drivers["paper"] == load_scenario("paper").drivers["paper"]


@pytest.mark.parametrize(
    ("kmh", "mps", "there"),
    [
        ("speed_kmh = 110", "speed_mps = 30", "mainline.speed_kmh: stands beside mainline.speed_m"),
        ("speed_kmh = 65", "speed_mps = 18", "ramp.speed_kmh: stands beside ramp.speed_mps"),
    ],
)
def test_both_units_of_a_speed_are_refused_in_one_line(bare, kmh, mps, there):
    told = invoke("run", bare({kmh: f"{kmh}\n{mps}"}))
    assert_refused(told)
    (line,) = told.errors
    assert there in line
    assert line.endswith("allowed is one of the two")


def test_a_misspelt_speed_is_one_error_that_names_the_key_in_kmh(bare):
    told = invoke("run", bare({"speed_kmh = 110": "speed_kph = 110"}))
    assert_refused(told)
    (line,) = told.errors
    assert "mainline.speed_kph: unknown key; did you mean speed_kmh? allowed are " in line
    assert "limit_kmh" in line


def test_a_speed_that_is_missing_is_one_error(bare):
    told = invoke("run", bare({"speed_kmh = 65\n": ""}))
    assert_refused(told)
    (line,) = told.errors
    assert line.endswith(
        "bare.toml: ramp.speed_mps: is missing; give ramp.speed_kmh or "
        "ramp.speed_mps, the speed at which vehicles drive; the limit follows from it"
    )


def test_populations_that_every_scenario_has_can_be_set(bare):
    scenario = load_scenario(bare(), {"drivers.fair.tau_s": 1.4})
    paper = load_scenario("paper", {"drivers.fair.tau_s": 1.4})
    assert scenario.drivers["fair"] == paper.drivers["fair"]
    assert scenario.drivers["credible"] == load_scenario("paper").drivers["credible"]


def test_gaps_of_coordinated_vehicles_are_said_to_bind_no_drivers(bare):
    notes = []
    overrides = {"safety.time_gap_s": 1.4, "drivers.fair.sigma": 0.0}
    coramp.run(bare(), "uncontrolled", overrides=overrides, horizon_s=20.0, notice=notes.append)
    assert notes == [
        (
            "safety.time_gap_s: for coordinated vehicles only; drivers keep "
            "drivers.fair.tau_s and drivers.fair.min_gap_m instead"
        )
    ]


def test_a_note_says_how_to_vary_drivers_along_and_is_left_out_where_that_is_done(bare):
    def specs(*settings):
        return [make_spec(bare(), "uncontrolled", overrides=given) for given in settings]

    gap, tau_s = "safety.time_gap_s", "drivers.fair.tau_s"
    alone = without_effect_on_drivers(specs({gap: 1.4}, {gap: 0.6}))
    assert alone.endswith("to vary both, set both in one [[runs]] block for each value")
    along = specs({gap: 1.4, tau_s: 1.4}, {gap: 0.6, tau_s: 0.6})
    assert without_effect_on_drivers(along) is None
    crossed = specs(*({gap: a, tau_s: b} for a in (0.6, 1.4) for b in (0.6, 1.4)))
    assert without_effect_on_drivers(crossed) is not None


def test_faults_that_reach_nobody_are_told(bare):
    def specs(strategy, **traffic):
        faults = {"reports.loss": 0.3, "actuators.lag_s": 0.2, "behaviour.never_yields_share": 0.5}
        given = faults | {f"traffic.{key}": value for key, value in traffic.items()}
        return [make_spec(bare(), strategy, overrides=given)]

    of_drivers = "[reports], [actuators]: for coordinated vehicles only; here nobody is coordinated"
    assert faults_that_reach_nobody(specs("uncontrolled")) == of_drivers
    none, half = (specs("mixed-slots", automated_share=share) for share in (0.0, 0.5))
    assert faults_that_reach_nobody(none) == of_drivers
    assert faults_that_reach_nobody(half) is None
    assert faults_that_reach_nobody([*none, *half]) is None
    assert faults_that_reach_nobody([make_spec(bare(), "uncontrolled")]) is None


def test_drivers_are_given_once(bare):
    with pytest.raises(CorampError, match=r"traffic.drivers by --drivers and by --set: given tw"):
        make_spec(bare(), "uncontrolled", drivers="fair", overrides={"traffic.drivers": "fair"})


def test_settings_may_be_in_kmh_and_take_the_place_of_the_files(bare):
    spec = make_spec(bare(), overrides={"mainline.speed_kmh": 90})
    assert spec.scenario.mainline.speed_mps == 25.0
    assert spec.overrides == (("mainline.speed_mps", 25.0),)
    assert make_spec("paper", overrides={"mainline.speed_kmh": 72}).overrides == ()
    with pytest.raises(CorampError, match=r"^--set: ramp.limit_kmh: stands beside ramp.limit_mps"):
        make_spec(bare(), overrides={"ramp.limit_kmh": 72, "ramp.limit_mps": 20.0})


def test_a_wrong_speed_in_kmh_is_told_as_it_was_given(bare):
    told = invoke("run", bare({"speed_kmh = 110": "speed_kmh = 300"}))
    assert_refused(told)
    assert "bare.toml: mainline.speed_kmh = 300: mainline.speed_mps: 83.3333 is too la" in told.err
    assert "'fast' is not a number" in invoke("run", bare({"= 110": '= "fast"'})).err


def test_listed_arrivals_may_be_in_kmh(bare):
    changes = {"flow_veh_h = 1500": "", "flow_veh_h = 400": ""}
    text = '\n[[arrivals]]\nstream = "ramp"\ntime_s = 2.0\nspeed_kmh = 63\n'
    assert load_scenario(bare(changes, text)).arrivals[0].speed_mps == 17.5


@pytest.mark.parametrize("name", builtin_names("scenarios"))
def test_nothing_is_chosen_for_what_comes_with_coramp(name):
    given = tomllib.loads(built_in("scenarios", name))
    found = load_scenario(name)
    assert found.decision_station_m == given["ramp"]["decision_station_m"]
    for stream in ("mainline", "ramp"):
        for key, value in given[stream].items():
            there = getattr(getattr(found, stream), key)
            assert there == (tuple(value) if isinstance(value, list) else value)
    assert list(found.drivers) == list(given["drivers"])


def test_what_was_chosen_is_shown_as_toml_of_the_same_scenario(bare, tmp_path):
    told = invoke("scenarios", bare())
    assert told.code == 0
    assert (
        "# decision_station_m = -296.0  # follows from the range that is possible, -370.4 to -72.1"
        in (told.out)
    )
    assert "speed_mps = 30.555555555555554  # 110 km/h\n" in told.out
    assert "#   credible\n" in told.out
    assert re.search(
        r"^# limit_mps = .* follows from speed_mps \(1 times\)$", told.out, re.MULTILINE
    )
    assert re.search(r"^min_headway_s = 0\.6  # default$", told.out, re.MULTILINE)
    given = set(re.findall(r"^(\w+) = [^#\n]*(?:# [\d.]+ km/h)?$", told.out, re.MULTILINE))
    assert {"start_m", "speed_mps", "acceleration_lane_m"} <= given
    assert not {"limit_mps", "entry_speed_mps", "slow_deviation"} & given
    shown = tmp_path / "shown.toml"
    shown.write_text(told.out)
    one, other = load_scenario(bare()), load_scenario(str(shown))
    assert other.rules() == one.rules()
    assert other.mainline == one.mainline
    assert invoke("scenarios", "paper").out == built_in("scenarios", "paper")
    assert_refused(invoke("scenarios", Path(tmp_path) / "nowhere.toml"))


def test_the_description_is_shown_too(bare):
    told = invoke(
        "scenarios", bare({"\n[mainline]": '\ndescription = "A \\"short\\" lane"\n[mainline]'})
    )
    assert 'description = "A \\"short\\" lane"\n' in told.out
