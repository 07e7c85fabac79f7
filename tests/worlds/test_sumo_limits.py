"""What SUMO cannot do by default, and what it cannot do well enough."""

import pytest

from coramp.errors import CorampError
from coramp.runs.running import execute, make_spec


def test_vehicles_may_enter_faster_than_sumos_own_limit_of_200_km_h():
    fast = {"mainline.limit_mps": 60.0, "mainline.entry_speed_mps": [56.0, 60.0]}
    tables, row = execute(make_spec("expressway", horizon_s=60, overrides=fast))
    assert (row["unserved"], row["safety_violations"]) == (0, 0)
    assert tables.outcome.driven.rows[:, 2].max() > 56.0
    assert row["plan_error_m"] < 0.05


def with_step(step_s, time_gap_s, allowance_m=0.1, engine="sumo"):
    settings = {
        "control.step_s": step_s,
        "control.actuation_delay_s": step_s,
        "safety.time_gap_s": time_gap_s,
        "safety.execution_allowance_m": allowance_m,
    }
    return make_spec("paper", engine=engine, overrides=settings)


@pytest.mark.parametrize(("step_s", "time_gap_s", "needed_m"), [(0.2, 2.0, 0.4), (0.25, 1.0, 0.25)])
def test_an_allowance_that_does_not_cover_sumos_drift_is_refused(step_s, time_gap_s, needed_m):
    with pytest.raises(CorampError) as refused:
        with_step(step_s, time_gap_s)
    (line,) = refused.value.messages
    assert line.startswith("safety.execution_allowance_m: 0.1 does not cover what SUMO drifts at ")
    assert f"control.step_s {step_s:g} and safety.time_gap_s {time_gap_s:g}; " in line
    assert line.endswith(f"allowed is at least {needed_m:g} m, or a step of up to 0.1 s")
    assert with_step(step_s, time_gap_s, needed_m)
    assert with_step(step_s, time_gap_s, engine="exact")


def test_steps_of_a_tenth_and_no_time_gap_need_no_more():
    assert with_step(0.1, 3.0)
    assert with_step(0.25, 0.0)


@pytest.mark.parametrize("strategy", ["slots", "virtual-platoon"])
def test_the_allowance_asked_for_is_enough(strategy):
    settings = {
        "control.step_s": 0.2,
        "control.actuation_delay_s": 0.2,
        "safety.time_gap_s": 2.0,
        "safety.execution_allowance_m": 0.4,
    }
    spec = make_spec(
        "paper", strategy, mainline_veh_h=1800, ramp_veh_h=700, horizon_s=120, overrides=settings
    )
    _, row = execute(spec)
    assert row["safety_violations"] == 0
