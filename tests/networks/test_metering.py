"""ALINEA on roads of several lanes: signal, stop line and loops, judged from SUMO's own files."""

import xml.etree.ElementTree as ET

import polars as pl
import pytest

import coramp
from coramp.scenarios.loading import load_scenario
from coramp.worlds.sumo.metered_road import metering_problem, room_veh, speed_at_end_mps
from tests.edges import invoke
from tests.networks.audit import overlaps
from tests.networks.test_runs import THREE, new_scenario

STRICT = {
    "strategy.alinea.target_occupancy_percent": 3.0,
    "strategy.alinea.queue_occupancy_percent": 100.0,
    "strategy.alinea.update_s": 10.0,
}
"""As strict as it can be: 240 an hour once the road has filled."""


@pytest.fixture(scope="module", params=["A10KW", "made"])
def metered(request, tmp_path_factory):
    """A run of a strictly metered ramp, with SUMO's files and all messages."""
    folder = tmp_path_factory.mktemp(request.param)
    file = folder / "made.toml"
    if request.param == "A10KW":
        file = new_scenario(folder, "A10KW")
    else:
        file.write_text(THREE)
    told = []
    run = coramp.run(
        str(file),
        "alinea",
        drivers="credible",
        mainline_veh_h=4200.0,
        ramp_veh_h=700.0,
        horizon_s=80.0,
        overrides=STRICT,
        out=folder / "r",
        keep_sumo=True,
        keep_messages=True,
        notice=told.append,
    )
    return run, folder / "r", load_scenario(str(file)), told


def test_ramp_vehicles_wait_at_the_stop_line_and_nobody_collides(metered):
    run, folder, _, _ = metered
    assert run.summary["collisions"] == run.summary["unserved"] == 0
    assert overlaps(folder) == []
    fcd = pl.read_parquet(folder / "sumo" / "fcd.parquet").drop_nulls("vehicle_id")
    before = fcd.filter(pl.col("vehicle_lane").str.ends_with("-before-stopline_0"))
    waiting = before.filter(pl.col("vehicle_speed") < 0.05)
    assert waiting["vehicle_id"].n_unique() >= 2
    network = next((folder / "sumo").glob("*.net.xml"))
    lane_m = next(
        float(lane.get("length"))
        for lane in ET.parse(network).iter("lane")
        if lane.get("id") == before["vehicle_lane"][0]
    )
    assert lane_m - waiting["vehicle_pos"].max() < 3.0


def test_the_stop_line_is_where_the_scenario_has_it(metered):
    run, _, scenario, _ = metered
    waiting = run.positions.filter(pl.col("speed_mps") < 0.05, pl.col("lane") == "ramp")
    assert waiting["station_m"].max() == pytest.approx(scenario.signal_station_m - 1.0, abs=2.0)


def test_the_occupancy_is_the_mean_over_the_lanes(metered):
    """It agrees with who is on the loops in SUMO's positions, at its steps.

    SUMO tells of a step for which part of it who is on the loop at its end has been there.
    """
    run, folder, _, _ = metered
    loops = [
        loop
        for loop in ET.parse(folder / "sumo" / "loops.add.xml").iter("inductionLoop")
        if loop.get("id").startswith("mainline")
    ]
    assert len(loops) == 3
    fcd = pl.read_parquet(folder / "sumo" / "fcd.parquet").drop_nulls("vehicle_id")
    steps = 0.0
    for loop in loops:
        beyond_m = pl.col("vehicle_pos") - float(loop.get("pos"))
        seen = fcd.filter(pl.col("vehicle_lane") == loop.get("lane"), beyond_m.is_between(0.0, 5.0))
        since = beyond_m / (0.1 * pl.col("vehicle_speed")).clip(0.001)
        steps += seen.select(since.clip(0.0, 1.0).sum()).item()
    readings = run.messages.filter(kind="reading")["mainline_occupancy"]
    assert readings.sum() * 10.0 == pytest.approx(steps / 3.0, rel=0.03)


def test_what_room_it_has_is_said(metered):
    _, _, scenario, told = metered
    assert len(told) == 1
    cars = f"{room_veh(scenario):.0f} cars can queue"
    assert cars in told[0]
    assert "the signal stands 60 m before the nose" in told[0]


def test_room_by_hand():
    """400 m of ramp: 340 m to the line, the loop at 100 m: 240 m for 32 cars of 7.5 m.

    Who starts at the line with 1.5 m/s2 goes 260 m: sqrt(2 * 1.5 * 260) is 27.9 m/s.
    """
    scenario = load_scenario("paper", {"mainline.lanes": 3})
    assert room_veh(scenario) == pytest.approx(32.0)
    credible = scenario.drivers["credible"]
    reached_mps = min(scenario.mainline.speed_mps, (2 * 1.5 * 260.0) ** 0.5)
    assert speed_at_end_mps(scenario, credible) == pytest.approx(reached_mps)
    assert metering_problem(scenario, credible) == ""


def test_a_ramp_without_room_is_refused_in_one_line(tmp_path):
    file = new_scenario(tmp_path, "ramp")
    refused = invoke("run", file, "--strategy", "alinea")
    assert refused.code == 1
    (line,) = refused.errors
    assert "ramp.start_m: the ramp is 44.67 m long, and who enters it takes" in line
    assert "; allowed is a ramp of" in line


def test_a_signal_from_which_nobody_gets_up_to_speed_is_refused(tmp_path):
    file = tmp_path / "made.toml"
    file.write_text(THREE)
    short = ("--set", "ramp.signal_station_m=-20", "--set", "ramp.acceleration_lane_m=30")
    refused = invoke("run", file, "-s", "alinea", "--drivers", "credible", *short)
    assert refused.code == 1
    (line,) = refused.errors
    # sqrt(2 * 1.5 * 50) is 12.2 m/s; 20 m/s take 133.3 m, of which 30 are the lane
    assert "reaches 12.2 m/s where the acceleration lane of 30 m ends" in line
    assert line.endswith("allowed is -103.3 m or before")
