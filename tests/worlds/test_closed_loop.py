"""What SUMO drove, seen from outside: no overlap, no broken distance, the delays that we report."""

import subprocess

import polars as pl
import pytest

import coramp
from coramp.worlds.sumo.network import sumo_binary
from tests.outside import JUNCTION_M, POSITION_ROUNDING_M, examine

DRIVERS_GAPS = {"safety.time_gap_s": 1.0, "safety.standstill_gap_m": 2.5}
CASES = [
    ("paper", "mainline-priority", 1500, 700, 77, {}),
    ("paper", "ramp-priority", 1300, 600, 5, {}),
    ("paper", "mainline-priority", 3600, 1500, 8, {}),
    ("paper", "ramp-priority", 3000, 1200, 9, {}),
    ("expressway", "mainline-priority", 2000, 800, 3, {}),
    ("expressway", "ramp-priority", 1800, 500, 4, {}),
    ("paper", "mainline-priority", 1800, 800, 6, {"safety.time_gap_s": 0.6}),
    ("paper", "fifo-optimal-control", 1800, 500, 7, DRIVERS_GAPS),
    ("paper", "slots", 2000, 600, 10, {"safety.time_gap_s": 1.0}),
    ("expressway", "slots", 1500, 600, 11, DRIVERS_GAPS),
    ("paper", "mainline-priority", 2400, 900, 2, {"safety.positioning_error_m": 0.5}),
    ("paper", "mainline-priority", 1800, 600, 1, {"control.gap_position": "front"}),
    ("paper", "mainline-priority", 1800, 600, 1, {"control.gap_creation_start": "nose"}),
    ("paper", "mainline-priority", 1800, 600, 1, {"safety.adhesion": 0.1}),
    ("paper", "mainline-priority", 1800, 600, 1, {"vehicle.length_m": 12.0}),
]


@pytest.fixture(scope="module", params=CASES, ids=lambda case: "-".join(map(str, case[:5])))
def driven(request, tmp_path_factory):
    scenario, strategy, mainline, ramp, seed, overrides = request.param
    folder = tmp_path_factory.mktemp("run") / "out"
    run = coramp.run(
        scenario,
        strategy,
        mainline_veh_h=mainline,
        ramp_veh_h=ramp,
        seed=seed,
        overrides=overrides,
        horizon_s=300.0,
        out=folder,
        keep_sumo=True,
    )
    return run, folder, examine(folder)


def test_everyone_is_there_and_nobody_too_near(driven):
    run, _, seen = driven
    assert seen.vehicles == run.vehicles.height
    assert seen.smallest_gap_m > 0.0
    assert seen.smallest_margin_m >= -POSITION_ROUNDING_M
    assert seen.smallest_merge_margin_m >= -POSITION_ROUNDING_M


def test_merges_end_before_the_built_lane_does(driven):
    run, _, seen = driven
    rules = run.spec.scenario.rules()
    assert 0.0 < seen.last_merge_station_m <= rules.road.acceleration_lane_m


def test_reported_delays_are_the_ones_driven(driven):
    run, _, seen = driven
    for stream, delay_s in seen.delays_s.items():
        assert delay_s == pytest.approx(run.summary[f"{stream}_delay_s"], abs=0.01)


def test_reported_margin_is_the_one_driven(driven):
    run, _, seen = driven
    assert run.summary["min_margin_m"] <= seen.smallest_margin_m + JUNCTION_M
    assert run.summary["min_margin_m"] == pytest.approx(seen.smallest_margin_m, abs=0.01)


def test_every_promise_is_kept(driven):
    run, _, _ = driven
    assert run.broken_promises == []
    assert run.summary["collisions"] == 0
    assert run.summary["safety_violations"] == 0
    assert run.summary["unserved"] == 0
    assert run.summary["refused_plans"] == 0
    assert run.summary["plan_error_m"] <= 0.05


def test_nobody_exceeds_v0_but_to_make_a_gap(driven):
    run, _, _ = driven
    limit_mps = run.spec.scenario.mainline.speed_mps
    fast = run.trajectories.filter(pl.col("speed_mps") > limit_mps + 1e-6)
    moved = set(run.decisions["adjusted_vehicle_ids"].explode().drop_nulls())
    assert set(fast["vehicle_id"]) <= moved
    assert run.trajectories["speed_mps"].max() <= 1.1 * limit_mps + 1e-6


def test_driven_positions_follow_the_plan_at_every_step(driven):
    run, folder, _ = driven
    spec = run.spec.scenario
    starts_m = {
        "ramp": spec.ramp.start_m,
        "mainline": spec.mainline.start_m,
        "merge": 0.0,
        "downstream": spec.ramp.acceleration_lane_m,
    }
    fcd = (
        pl.read_parquet(folder / "sumo" / "fcd.parquet")
        .drop_nulls("vehicle_id")
        .filter(~pl.col("vehicle_lane").str.starts_with(":"))
        .select(
            "vehicle_id",
            time_s=pl.col("timestep_time") + 1e-6,  # so that a piece from this step on is found
            driven_m=pl.col("vehicle_lane")
            .str.replace(r"_\d+$", "")
            .replace_strict(starts_m, return_dtype=pl.Float64)
            + pl.col("vehicle_pos"),
        )
        .sort("time_s")
    )
    plan = run.trajectories.select(
        "vehicle_id", "station_m", "speed_mps", "accel_mps2", time_s="time_s", start_s="time_s"
    ).sort("time_s")
    both = fcd.join_asof(
        plan, on="time_s", by="vehicle_id", strategy="backward", check_sortedness=False
    )
    x = pl.col("time_s") - pl.col("start_s")
    planned_m = pl.col("station_m") + pl.col("speed_mps") * x + 0.5 * pl.col("accel_mps2") * x**2
    assert both["start_s"].null_count() == 0
    assert both.select((pl.col("driven_m") - planned_m).abs().max()).item() <= 0.05


def test_fair_drivers_alone_on_the_road_lose_little():
    for flows in ((800.0, 0.0), (0.0, 200.0)):
        run = coramp.run(
            "paper",
            "uncontrolled",
            mainline_veh_h=flows[0],
            ramp_veh_h=flows[1],
            drivers="fair",
            seed=12,
            horizon_s=900.0,
        )
        stream = "mainline" if flows[0] else "ramp"
        assert run.summary[f"{stream}_delay_s"] < 0.5
        assert run.summary["collisions"] == 0


def test_drivers_who_keep_their_entry_speed_lose_much_without_any_ramp():
    run = coramp.run(
        "paper",
        "uncontrolled",
        mainline_veh_h=800,
        ramp_veh_h=0,
        drivers="paper",
        seed=12,
        horizon_s=900.0,
    )
    assert 5.0 < run.summary["mainline_delay_s"] < 10.0


def test_plain_sumo_runs_on_the_kept_files(tmp_path):
    folder = tmp_path / "run"
    coramp.run("paper", "uncontrolled", seed=3, horizon_s=60.0, out=folder, keep_sumo=True)
    command = (folder / "sumo" / "command.txt").read_text().split()
    done = subprocess.run(
        [sumo_binary(command[0]), *command[1:], "--tripinfo-output", "again.xml"],
        cwd=folder / "sumo",
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    trips = (folder / "sumo" / "again.xml").read_text()
    vehicles = pl.read_parquet(folder / "vehicles.parquet")
    assert trips.count("<tripinfo id=") == vehicles.height


def test_two_runs_of_one_specification_are_alike():
    settings = {"mainline_veh_h": 2000, "ramp_veh_h": 800, "seed": 21, "horizon_s": 120.0}
    one, other = (coramp.run("paper", **settings) for _ in range(2))
    assert one.vehicles.equals(other.vehicles)
    assert one.decisions.equals(other.decisions)
    uncontrolled = [coramp.run("paper", "uncontrolled", **settings) for _ in range(2)]
    assert uncontrolled[0].vehicles.equals(uncontrolled[1].vehicles)


def test_every_strategy_meets_the_same_arrivals():
    settings = {"mainline_veh_h": 1500, "ramp_veh_h": 500, "seed": 4, "horizon_s": 120.0}
    scheduled = [
        coramp.run("paper", strategy, **settings).vehicles.select("vehicle_id", "scheduled_s")
        for strategy in ("mainline-priority", "ramp-priority", "uncontrolled")
    ]
    assert scheduled[0].equals(scheduled[1])
    assert scheduled[0].equals(scheduled[2])


def test_a_window_without_a_screen_is_a_clear_error(monkeypatch):
    monkeypatch.delenv("DISPLAY", raising=False)
    with pytest.raises(coramp.CorampError, match="no screen"):
        coramp.run("paper", horizon_s=30.0, gui=True)


@pytest.mark.parametrize(
    "overrides",
    [
        {"ramp.merge_angle_deg": 80.0},
        {"control.step_s": 0.25, "control.actuation_delay_s": 0.25, "ramp.merge_angle_deg": 60.0},
    ],
    ids=["steep angle", "long step"],
)
def test_promises_hold_at_the_edges_of_what_is_allowed(overrides):
    run = coramp.run(
        "paper",
        "ramp-priority",
        mainline_veh_h=2500,
        ramp_veh_h=1200,
        seed=25,
        horizon_s=150.0,
        overrides={"mainline.min_headway_s": 0.75, "ramp.min_headway_s": 0.75, **overrides},
    )
    assert run.broken_promises == []
    assert run.summary["plan_error_m"] <= 0.05
