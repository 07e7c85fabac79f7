"""Vehicles that do not get through are never passed over in silence."""

import coramp
from coramp.scenarios.loading import load_scenario
from tests.edges import assert_refused, invoke

CUT_OFF = {"safety.time_gap_s": 1.0, "simulation.drain_s": 5.0}
SETTINGS = [word for key, value in CUT_OFF.items() for word in ("--set", f"{key}={value}")]


def test_a_run_that_leaves_vehicles_unserved_says_so_on_stderr():
    told = invoke("run", "paper", "--engine", "exact", "--horizon", "60", *SETTINGS, "--json")
    assert told.code == 0
    assert told.errors[-1].startswith("Note: ")
    assert "vehicles are unserved at 65 s, when the run was cut off: 0 wait outside" in told.err


def test_the_notice_is_given_to_python_as_well():
    lines = []
    result = coramp.run(
        "paper", engine="exact", horizon_s=60, overrides=CUT_OFF, notice=lines.append
    )
    assert lines[-1].startswith(f"{result.summary['unserved']} of ")


def test_nothing_is_said_where_everyone_gets_through():
    told = invoke("run", "paper", "--engine", "exact", "--horizon", "20")
    assert (told.code, told.err) == (0, "")


def test_comfort_below_what_all_plans_use_is_refused():
    for key in ("slow_down", "speed_up"):
        settings = ["--set", f"motion.{key}_mps2=1.8", "--set", "motion.comfort_mps2=1.7"]
        if key == "speed_up":
            settings += ["--set", "motion.slow_down_mps2=1.0"]
        told = invoke("run", "paper", "--engine", "exact", *settings)
        assert_refused(told)
        (line,) = told.errors
        assert line.startswith(f"Error: --set: motion.comfort_mps2: 1.7 is below motion.{key}_mps2")
        assert line.endswith("which all plans use; allowed is 1.8 to 10 m/s2")
    same = {"motion.comfort_mps2": 2.0, "motion.slow_down_mps2": 2.0}
    assert load_scenario("paper", same).motion.comfort_mps2 == 2.0
