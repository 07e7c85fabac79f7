"""The two priorities with following distances that people accept."""

import pytest

import coramp


@pytest.mark.parametrize("strategy", ["mainline-priority", "ramp-priority"])
@pytest.mark.parametrize(
    ("time_gap_s", "mainline", "ramp"),
    [(0.6, 2400.0, 800.0), (1.0, 1000.0, 1000.0), (1.0, 1800.0, 500.0), (1.4, 1200.0, 500.0)],
)
def test_nobody_loses_much_well_below_the_limit_of_the_lane(strategy, time_gap_s, mainline, ramp):
    run = coramp.run(
        "paper",
        strategy,
        engine="exact",
        mainline_veh_h=mainline,
        ramp_veh_h=ramp,
        seed=2,
        horizon_s=600.0,
        overrides={"safety.time_gap_s": time_gap_s},
    )
    assert run.summary["mainline_delay_s"] < 5.0
    assert run.summary["ramp_delay_s"] < 5.0
    assert run.summary["unserved"] == run.summary["safety_violations"] == 0
    assert run.summary["refused_plans"] == 0
    assert run.trajectories["speed_mps"].max() <= 22.0 + 1e-6


@pytest.mark.parametrize("strategy", ["mainline-priority", "ramp-priority"])
def test_a_queue_on_the_ramp_does_not_wait_until_the_mainline_is_empty(strategy):
    # one vehicle every 1.4 s on each road are more than the lane takes at 1.26 s each, so that one
    # or the other stands; with the whole mainline first the ramp would lose 31 s
    arrivals = [
        {"stream": "ramp", "time_s": round(1.4 * k, 1), "speed_mps": 16.0} for k in range(20)
    ]
    block = [
        {"stream": "mainline", "time_s": round(1.4 * k, 1), "speed_mps": 20.0} for k in range(24)
    ]
    run = coramp.run(
        "paper",
        strategy,
        engine="exact",
        overrides={"safety.time_gap_s": 1.0, "arrivals": arrivals + block},
    )
    assert run.summary["vehicles_ramp"] == 20
    assert run.summary["unserved"] == 0
    assert run.summary["ramp_delay_s"] < 20.0
