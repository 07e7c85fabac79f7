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
def test_a_ramp_that_starts_as_a_queue_lets_a_vehicle_go_in_less_than_four_seconds(strategy):
    # while both streams enter every 1.4 s the lane cannot serve the ramp, so that a queue stands
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
    merges_s = run.decisions["merge_time_s"].drop_nulls().drop_nans().sort()
    assert len(merges_s) == 20
    assert run.summary["unserved"] == 0
    assert (merges_s[-1] - merges_s[0]) / 19 < 4.0
