"""Made roads of several lanes, in a perfect world and in one that fails, judged from outside."""

import json

import polars as pl
import pytest

from tests.edges import invoke
from tests.networks.audit import lane_changes, overlaps, too_near

ROAD = """
[mainline]
start_m = -400.0
end_m = 500.0
speed_mps = 27.78
lanes = {lanes}
flow_veh_h = {flow}

[ramp]
start_m = -300.0
speed_mps = 20.0
acceleration_lane_m = 200.0
flow_veh_h = 900.0

[safety]
time_gap_s = 1.0
standstill_gap_m = 2.0

[traffic]
automated_share = {share}
"""
HARD = ("--set", "world.preset=hard")


@pytest.mark.parametrize("world", [(), HARD], ids=["perfect", "hard"])
@pytest.mark.parametrize("share", [0.5, 1.0])
@pytest.mark.parametrize("lanes", [2, 3, 4])
def test_automated_vehicles_keep_clear_and_drive_as_told(tmp_path, lanes, share, world):
    file, folder = tmp_path / "road.toml", tmp_path / "r"
    file.write_text(ROAD.format(lanes=lanes, flow=1800.0 * lanes, share=share))
    rest = ("--horizon", 40, "--seed", 3, "--out", folder, "--keep-sumo", "--json")
    told = invoke("run", file, "--strategy", "mixed-slots", "--drivers", "credible", *world, *rest)
    assert told.code == 0, told.err
    row = json.loads(told.out)["summary"]
    assert row["collisions_by_automated"] == row["automated_violations"] == 0
    assert row["plan_error_m"] < 0.05
    vehicles = pl.read_parquet(folder / "vehicles.parquet")
    automated = set(vehicles.filter("automated")["vehicle_id"])
    hit = [pair for pair in overlaps(folder) if automated & set(pair[1:])]
    assert row["collisions"] > 0 or hit == []
    assert share < 1.0 or (hit == [] and row["unserved"] == 0)
    assert share < 1.0 or too_near(folder, automated, braking_mps2=6.0) == []
    changes = [change for change in lane_changes(folder) if change[1] in automated]
    merges = [c for c in changes if c[1].startswith("r") and c[2:] == ("merge", 0, 1)]
    # from the outermost lane to the next, and no other one
    ways = [c[2:] for c in changes if c not in merges]
    assert {(edge == "merge", *moved) for edge, *moved in ways} <= {(True, 1, 2), (False, 0, 1)}
    assert row["made_way"] == len(ways)
