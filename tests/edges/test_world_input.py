"""What a world that fails refuses, in one line each, and how a scenario shows it."""

import pytest

from coramp.errors import CorampError
from coramp.runs.running import make_spec
from coramp.scenarios.loading import load_scenario
from coramp.scenarios.world_sections import PRESETS, TABLES, with_preset
from tests.edges import assert_refused, invoke

SMALL = ("--mainline", "1000", "--ramp", "400", "--horizon", "30")
HALF = ("--set", "traffic.automated_share=0.5")


def told_of(*settings, strategy="mixed-slots", words=HALF):
    sets = [word for setting in settings for word in ("--set", setting)]
    return invoke("run", "paper", "-s", strategy, *SMALL, *words, *sets)


@pytest.mark.parametrize(
    ("setting", "told"),
    [
        ("world.preset=sunny", "'sunny' is not known; allowed is 'mild', 'hard', 'rtk-5g',"),
        ("world.presett=mild", "unknown key; did you mean preset?"),
        ('world.preset=["mild"]', "['mild'] is not known; allowed is 'mild', 'hard',"),
        ("positioning.noise_m=-1.0", "-1 is too small; allowed is at least 0"),
        ("positioning.noise_m=nan", "nan is not finite; allowed is a finite number"),
        ("positioning.noise=1.0", "unknown key; did you mean noise_m?"),
        ("positioning.correlation_s=0.0", "0 is too small; allowed is above 0"),
        ("positioning.bias_m=2000.0", "2000 is too large; allowed is at most 1000"),
        ("clock.offset_s=inf", "inf is not finite; allowed is a finite number"),
        ("reports.loss=1.0", "1 is too large; allowed is below 1"),
        ("reports.delay_s=-0.1", "-0.1 is too small; allowed is at least 0"),
        ("reports.delay_shape=0.0", "0 is too small; allowed is above 0"),
        ("commands.valid_s=0.0", "0 is too small; allowed is above 0"),
        ("commands.delay_s=soon", "'soon' is not a number; allowed is a number"),
        ("actuators.lag_s=2.5", "2.5 is too large; allowed is at most 2"),
        ("actuators.lag=0.5", "unknown key; did you mean lag_s?"),
        ("road.adhesion=0.0", "0 is too small; allowed is above 0"),
        ("road.grade=0.02", "unknown key"),
        ("behaviour.lies_share=1.5", "1.5 is too large; allowed is at most 1"),
        ("behaviour.brake_mps2=20.0", "20 is too large; allowed is at most 9"),
        ("incidents.place=shoulder", "'shoulder' is not known; allowed is 'mainline' or 'ramp'"),
        ("incidents.lasts_s=0.0", "0 is too small; allowed is above 0"),
    ],
)
def test_what_cannot_be_in_a_table_is_told_with_its_key(setting, told):
    refused = told_of(setting)
    assert_refused(refused)
    (line,) = refused.errors
    assert f"{setting.split('=')[0]}: {told}" in line


@pytest.mark.parametrize(
    ("settings", "told"),
    [
        (
            ("commands.delay_s=0.5", "commands.valid_s=0.4"),
            (
                "commands.delay_s: 0.5 is not below commands.valid_s, so that every command has "
                "expired when it arrives; allowed is below 0.4 s"
            ),
        ),
        (
            ("reports.delay_s=3.0",),
            (
                "reports.delay_s: 3 is not below reports.stale_s, so that every report is stale "
                "when it arrives; allowed is below 3 s"
            ),
        ),
        (
            ("incidents.breakdown_s=5.0", "incidents.place=ramp", "incidents.station_m=250.0"),
            (
                "incidents.station_m: 250 is not on the ramp and acceleration lane; allowed is "
                "between -400 and 200 m"
            ),
        ),
        (
            ("incidents.breakdown_s=5.0", "incidents.station_m=-900.0"),
            "incidents.station_m: -900 is not on the mainline; allowed is between -400 and 400 m",
        ),
    ],
)
def test_tables_that_contradict_themselves_are_told(settings, told):
    refused = told_of(*settings)
    assert_refused(refused)
    (line,) = refused.errors
    assert line.endswith(told), line


def test_a_file_that_contradicts_itself_is_named(tmp_path):
    path = tmp_path / "own.toml"
    text = invoke("scenarios", "paper").out
    path.write_text(f"{text}\n[commands]\ndelay_s = 2.0\n")
    refused = invoke("run", path, "-s", "mixed-slots")
    assert_refused(refused)
    (line,) = refused.errors
    assert line.startswith(f"Error: {path}: commands.delay_s: 2 is not below commands.valid_s")


def test_latency_that_varies_may_be_long_on_average_and_an_incident_may_be_off():
    load_scenario("paper", {"commands.delay_s": 2.0, "commands.delay_shape": 1.0})
    load_scenario("paper", {"incidents.station_m": -900.0})


def test_a_preset_that_is_not_there_names_those_that_are():
    (line,) = told_of("world.preset=sunny").errors
    for preset in PRESETS:
        assert preset in line


def test_a_misspelt_table_is_told():
    (line,) = told_of("positionning.noise_m=1.0").errors
    assert "positionning: unknown key; did you mean positioning?" in line


@pytest.mark.parametrize("preset", PRESETS)
def test_every_preset_is_a_scenario(preset):
    scenario = load_scenario("paper", {"world.preset": preset})
    for table, values in PRESETS[preset].items():
        for key, value in values.items():
            assert getattr(getattr(scenario, table), key) == value
    for table in set(TABLES) - {"world", *PRESETS[preset]}:
        assert getattr(scenario, table).is_perfect


def test_keys_of_ones_own_win_over_a_preset():
    own = {"world.preset": "hard", "reports.loss": 0.05, "clock.offset_s": 0.1}
    scenario = load_scenario("paper", own)
    assert scenario.reports.loss == 0.05
    assert scenario.reports.delay_s == 0.5
    assert scenario.clock.offset_s == 0.1
    assert with_preset({"positioning": {"noise_m": 3.0}}) == {"positioning": {"noise_m": 3.0}}


def test_a_scenario_is_shown_with_what_a_preset_set_and_its_own_keys(tmp_path):
    own = tmp_path / "own.toml"
    text = invoke("scenarios", "paper").out
    own.write_text(text + '\n[world]\npreset = "hard"\n\n[reports]\nloss = 0.05\n')
    shown = invoke("scenarios", own).out
    assert '[world]\npreset = "hard"\n' in shown
    assert "# delay_s = 0.5  # follows from world.preset hard\n" in shown
    assert "\nloss = 0.05\n" in shown
    assert "# noise_m = 1.0  # follows from world.preset hard\n" in shown
    assert "correlation_s = 10.0  # default\n" in shown
    assert "[incidents]" not in shown
    again = tmp_path / "again.toml"
    again.write_text(shown)
    one, two = load_scenario(str(own)), load_scenario(str(again))
    for table in TABLES:
        assert getattr(one, table) == getattr(two, table)
    own.write_text(text)
    assert "[world]" not in invoke("scenarios", own).out


def test_a_strategy_and_an_engine_that_cannot_name_the_tables():
    refused = told_of("reports.loss=0.1", "actuators.lag_s=0.3", strategy="slots", words=())
    assert_refused(refused)
    assert refused.errors == [
        (
            "Error: strategy: slots cannot run where the world is not perfect ([reports], "
            "[actuators]); allowed are mixed-slots, alinea, uncontrolled, or none of these tables"
        )
    ]
    refused = told_of("world.preset=mild", words=("--engine", "exact"))
    assert_refused(refused)
    (line,) = refused.errors
    assert line.startswith(
        "Error: engine: exact cannot run where the world is not perfect ([world]"
    )


SHORT = {"traffic.automated_share": 0.5, "ramp.acceleration_lane_m": 110.0}


def test_a_lag_that_no_plan_can_absorb_is_refused_with_the_largest_that_can_be():
    """On 110 m: (107 - 16^2 / 3.3) / 16 - 0.3 = 1.539 s, by hand."""
    for dead_time_s, lag_s in ((0.8, 0.75), (0.75, 0.8), (2.0, 2.0)):
        key = "dead_time_s" if dead_time_s > lag_s else "lag_s"
        late = {"actuators.dead_time_s": dead_time_s, "actuators.lag_s": lag_s}
        with pytest.raises(CorampError) as refused:
            make_spec("paper", "mixed-slots", overrides={**SHORT, **late})
        (line,) = refused.value.messages
        assert line == (
            f"actuators.{key}: who reacts {dead_time_s + lag_s:g} s late and passes the nose at "
            "ramp.speed_mps 16 cannot stop before ramp.acceleration_lane_m 110 ends; allowed are "
            "dead_time_s and lag_s of up to 1.53 s together"
        )
    for late in ({"actuators.lag_s": 1.5}, {"actuators.dead_time_s": 0.8, "actuators.lag_s": 0.73}):
        make_spec("paper", "mixed-slots", overrides={**SHORT, **late})


def test_who_is_commanded_rarely_can_absorb_less():
    """Each 0.5 s on 110 m: (107 - 16^2 / 3.3) / 16 - 0.5 = 1.339 s, by hand."""
    rarely = {**SHORT, "strategy.mixed-slots.decision_s": 0.5}
    with pytest.raises(CorampError, match=r"lag_s of up to 1\.33 s together"):
        make_spec("paper", "mixed-slots", overrides={**rarely, "actuators.lag_s": 1.4})
    make_spec("paper", "mixed-slots", overrides={**rarely, "actuators.lag_s": 1.33})
    make_spec("paper", "mixed-slots", overrides={**SHORT, "actuators.lag_s": 1.4})


def test_on_the_papers_lane_every_lag_that_can_be_given_can_be_absorbed():
    late = {"actuators.dead_time_s": 2.0, "actuators.lag_s": 2.0}
    make_spec("paper", "mixed-slots", overrides={"traffic.automated_share": 0.5, **late})


def test_a_run_tells_what_became_of_its_messages_and_what_happened(tmp_path):
    keys = ("reports.loss=0.3", "incidents.breakdown_s=10.0", "incidents.lasts_s=5.0")
    told = told_of(*keys)
    assert told.code == 0
    (line,) = [line for line in told.out.splitlines() if line.startswith("The world: ")]
    assert " reports lost" in line
    assert line.endswith("1 vehicle broke down.")
    assert "The world" not in told_of().out
