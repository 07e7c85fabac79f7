"""Commands that take effect later than they are given, while others enter and leave."""

import numpy as np
import polars as pl
import pytest

from coramp.runs.running import execute, make_spec
from coramp.scenarios.loading import load_scenario

SLOW_RAMP = {"ramp.entry_speed_mps": [1.0, 12.0]}


def run_of(strategy="mainline-priority", **settings):
    return execute(make_spec("paper", strategy, engine="exact", **settings))


@pytest.mark.parametrize(
    ("delay_s", "seed", "others"), [(3.0, 2, {}), (0.5, 13, {"simulation.drain_s": 400.0})]
)
def test_who_enters_keeps_its_distance_from_what_is_driven_until_a_command_acts(
    delay_s, seed, others
):
    settings = {"control.actuation_delay_s": delay_s, **SLOW_RAMP, **others}
    _, row = run_of(
        mainline_veh_h=900, ramp_veh_h=2500, seed=seed, horizon_s=120, overrides=settings
    )
    assert row["safety_violations"] == 0
    assert row["min_margin_m"] >= 0.1 - 1e-6  # the execution allowance


@pytest.mark.parametrize("strategy", ["virtual-platoon", "ocbf"])
@pytest.mark.parametrize("delay_s", [0.1, 1.0])
def test_a_command_that_acts_after_the_exit_does_not_move_it(strategy, delay_s):
    tables, row = run_of(
        strategy,
        mainline_veh_h=1200,
        ramp_veh_h=300,
        horizon_s=60,
        overrides={"control.actuation_delay_s": delay_s},
    )
    assert row["unserved"] == 0
    end_m = load_scenario("paper").mainline.end_m
    last = tables.trajectories.group_by("vehicle_id").agg(pl.all().sort_by("time_s").last())
    joined = tables.vehicles.join(last, on="vehicle_id")
    assert joined.height == row["vehicles_mainline"] + row["vehicles_ramp"]
    x = (joined["exit_s"] - joined["time_s"]).to_numpy()
    v, a = joined["speed_mps"].to_numpy(), joined["accel_mps2"].to_numpy()
    np.testing.assert_allclose(joined["station_m"] + v * x + a * x * x / 2, end_m, atol=1e-6)
