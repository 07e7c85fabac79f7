"""What ``coramp explain`` says of a vehicle that makes way on a road of three lanes."""

import polars as pl
import pytest

from coramp.records.run_folder import read_run
from tests.edges import invoke
from tests.networks.test_made_roads import ROAD


def test_it_is_told_for_whom_where_and_what_it_is_spared(tmp_path):
    file, folder = tmp_path / "road.toml", tmp_path / "r"
    file.write_text(ROAD.format(lanes=3, flow=5400.0, share=1.0))
    rest = ("--horizon", 40, "--seed", 3, "--out", folder, "--keep-messages")
    assert invoke("run", file, "--strategy", "mixed-slots", *rest).code == 0
    run = read_run(folder)
    ways = run.on_board.filter(pl.col("changes_lane"), lane="mainline")
    assert ways.height == run.summary["made_way"] > 0
    row = ways.filter(pl.col("after_vehicle_id").is_not_null()).row(0, named=True)
    assert row["after_vehicle_id"].startswith("r")
    assert row["told_mps2"] <= -0.2
    near = {"behind": row["front_vehicle_id"], "ahead of": row["rear_vehicle_id"]}
    between = " and ".join(f"{word} {name}" for word, name in near.items() if name)
    told = invoke("explain", folder, row["vehicle_id"])
    assert told.code == 0
    assert (
        f"makes way for {row['after_vehicle_id']}, which is to merge ahead of it: changes to the "
        f"lane further in {between or 'where nobody is near'}, at station {row['station_m']:.1f} m "
        f"and {row['speed_mps']:.1f} m/s, and need not slow down by {-row['told_mps2']:.2f} m/s2"
    ) in " ".join(told.out.split())
    # it is told on: in the lane further in, behind who is ahead of it there
    further_in = run.on_board.filter(vehicle_id=row["vehicle_id"], lane="mainline 2").sort("time_s")
    assert further_in["time_s"][0] == pytest.approx(row["time_s"] + 0.2)
    assert "in lane 2 from the ramp: " in told.out
    ramp = run.vehicles.filter(stream="ramp")["vehicle_id"]
    assert "makes way" not in invoke("explain", folder, ramp[0]).out
