"""Runs in networks of the user's own, judged from SUMO's own positions."""

import json
import xml.etree.ElementTree as ET

import polars as pl
import pytest

from coramp.scenarios.loading import load_scenario
from coramp.worlds.sumo.lanes import road_of
from tests.edges import invoke
from tests.networks import A10KW, HIGHWAY, RAMP
from tests.networks.audit import lane_changes, lanes_of, lengths_m, overlaps, positions

SITES = {
    "highway": (HIGHWAY, "201283198.145.16@E0"),
    "A10KW": (A10KW, "24498409@4054057"),
    "ramp": (RAMP, "gneE14@gneE7"),
}


def new_scenario(folder, name):
    network, ramp = SITES[name]
    told = invoke("new-scenario", folder / name, "--net", network, "--ramp", ramp)
    assert told.code == 0, told.err
    return folder / f"{name}.toml"


def run(folder, name, *options, out="r"):
    """Runs a scenario for a short while and returns its summary; SUMO's files are kept."""
    file = folder / f"{name}.toml"
    file = file if file.exists() else new_scenario(folder, name)
    rest = ("--out", folder / out, "--keep-sumo", "--json")
    short = () if "--horizon" in options else ("--horizon", 40, "--seed", 5)
    told = invoke("run", file, "--drivers", "credible", *options, *short, *rest)
    assert told.code == 0, told.err
    return json.loads(told.out)["summary"]


@pytest.mark.parametrize("name", SITES)
def test_drivers_go_all_the_way_on_the_lane_on_which_they_are_said_to_enter(tmp_path, name):
    row = run(tmp_path, name, "--strategy", "uncontrolled")
    assert row["unserved"] == row["collisions"] == 0
    assert overlaps(tmp_path / "r") == []
    vehicles = pl.read_parquet(tmp_path / "r" / "vehicles.parquet")
    first = (
        positions(tmp_path / "r")
        .group_by("vehicle_id")
        .agg(pl.col("vehicle_lane").sort_by("timestep_time").first())
    )
    mainline = first.filter(pl.col("vehicle_id").str.starts_with("m"))["vehicle_lane"]
    lanes = load_scenario(str(tmp_path / f"{name}.toml")).mainline.lanes
    assert len({lane.rsplit("_", 1)[0] for lane in mainline}) == 1
    assert {int(lane.rsplit("_", 1)[1]) for lane in mainline} == set(range(lanes))
    assert vehicles["finished"].all()
    # a signal that stays red, and a second lane that ends before the nose, hold nobody up
    assert vehicles.filter(stream="ramp")["delay_s"].max() < 20.0
    ramp = first.filter(pl.col("vehicle_id").str.starts_with("r"))["vehicle_lane"]
    assert {int(lane.rsplit("_", 1)[1]) for lane in ramp} == {0}


@pytest.mark.parametrize("share", [0.5, 1.0])
@pytest.mark.parametrize("name", SITES)
def test_automated_vehicles_cause_no_collision_and_drive_as_told(tmp_path, name, share):
    flows = ("--mainline", 1600 * (2 if name == "ramp" else 3), "--ramp", 600)
    shares = ("--set", f"traffic.automated_share={share}")
    row = run(tmp_path, name, "--strategy", "mixed-slots", *flows, *shares)
    assert row["unserved"] == row["collisions_by_automated"] == row["automated_violations"] == 0
    assert row["plan_error_m"] < 0.05
    assert overlaps(tmp_path / "r") == []
    vehicles = pl.read_parquet(tmp_path / "r" / "vehicles.parquet")
    automated = set(vehicles.filter("automated")["vehicle_id"])
    assert (len(automated) == len(vehicles)) is (share == 1.0)
    changes = [change for change in lane_changes(tmp_path / "r") if change[1] in automated]
    merge_edge = SITES[name][1].split("@")[1]
    merges = [c for c in changes if c[1].startswith("r") and c[2:] == (merge_edge, 0, 1)]
    on_ramp = {v for v in automated if v.startswith("r")}
    assert {c[1] for c in merges} == on_ramp
    assert len(merges) == len(on_ramp)
    others = [c for c in changes if c not in merges]
    # they keep their lane but for making way, from the outermost lane to the next
    outermost = [(c[3], c[4]) for c in others]
    assert set(outermost) <= {(0, 1), (1, 2)}
    assert all((c[3] == 1) is (c[2] == merge_edge) for c in others)
    assert row["made_way"] == len(others)


def test_stations_are_those_of_sumo_s_lanes(tmp_path):
    run(tmp_path, "highway", "--strategy", "uncontrolled")
    scenario = load_scenario(str(tmp_path / "highway.toml"))
    road = road_of(scenario, scenario.drivers["credible"])
    length_m = lanes_of(HIGHWAY)
    way = ("145354574_0", ":2001841184_0_0", "189597495_0", ":J1_1_0", "E0_1", ":2024041878_0_0")
    at_m = scenario.mainline.start_m
    for lane in way:
        span = road.lanes[lane]
        assert (span.start_m, span.lane) == (pytest.approx(at_m, abs=1e-6), 0)
        assert span.per_m == pytest.approx(1.0)
        at_m += length_m[lane]
    assert road.lanes["E0_0"].lane == -1
    assert [road.lanes[f"E0_{k}"].changes for k in range(4)] == [True, True, True, False]
    assert road.closed == ("201283198_1", "201283198.145_1")
    told = pl.read_parquet(tmp_path / "r" / "positions.parquet")
    assert set(told["lane"]) == {"ramp", "mainline", "mainline 2", "mainline 3"}
    names = {-1: "ramp", 0: "mainline", 1: "mainline 2", 2: "mainline 3"}
    rows = positions(tmp_path / "r").filter(vehicle_id="m00001").sort("timestep_time")
    of_vehicle = told.filter(vehicle_id="m00001").sort("time_s")
    for time_s, station_m, lane in of_vehicle.select("time_s", "station_m", "lane").rows():
        row = rows.filter((pl.col("timestep_time") - time_s).abs() < 0.01).row(0, named=True)
        span = road.lanes[row["vehicle_lane"]]
        assert station_m == pytest.approx(span.start_m + row["vehicle_pos"], abs=0.06)
        assert lane == names[span.lane]


def test_the_kept_files_run_in_plain_sumo(tmp_path):
    run(tmp_path, "highway", "--strategy", "uncontrolled")
    command = (tmp_path / "r" / "sumo" / "command.txt").read_text("utf-8")
    assert "--tls.all-off true" in command
    assert "--additional-files loops.add.xml" in command
    lengths = set(lengths_m(tmp_path / "r" / "sumo" / "routes.rou.xml").values())
    assert lengths == {5.0}
    closed = ET.parse(tmp_path / "r" / "sumo" / "loops.add.xml").getroot()
    lanes = [lane.get("id") for lane in closed.iter("closingLaneReroute")]
    assert lanes == ["201283198_1", "201283198.145_1"]


@pytest.mark.parametrize(
    ("options", "told"),
    [
        (("--strategy", "slots"), "slots cannot run where the road lies in a network"),
        (
            ("--strategy", "hero"),
            "hero coordinates the meters of several ramps; allowed is a corridor of two or more",
        ),
        (("--strategy", "mixed-slots", "--engine", "exact"), "exact cannot run where the road"),
        (("--set", "mainline.start_m=-500.0"), "-500 is not what 24498409@4054057 has"),
        (("--set", "mainline.lanes=2"), "mainline.lanes: 2 is not what"),
    ],
)
def test_what_cannot_run_in_a_network_is_one_line(tmp_path, options, told):
    file = new_scenario(tmp_path, "A10KW")
    refused = invoke("run", file, *options)
    assert refused.code == 1
    assert len(refused.errors) == 1
    assert told in refused.errors[0]


THREE = """
[mainline]
start_m = -600.0
end_m = 600.0
speed_mps = 27.78
lanes = 3
flow_veh_h = 5400.0
[ramp]
start_m = -400.0
speed_mps = 20.0
acceleration_lane_m = 200.0
flow_veh_h = 900.0
[safety]
time_gap_s = 1.0
standstill_gap_m = 2.0
"""


def test_on_a_made_road_of_three_lanes_making_way_halves_the_delay_at_least(tmp_path):
    (tmp_path / "three.toml").write_text(THREE, "utf-8")
    last = ("--horizon", 120, "--seed", 1)
    drivers = run(tmp_path, "three", "--strategy", "uncontrolled", *last, out="u")
    own = run(tmp_path, "three", "--strategy", "mixed-slots", *last, out="c")
    assert own["collisions"] == own["automated_violations"] == own["unserved"] == 0
    assert overlaps(tmp_path / "c") == []
    assert own["vehicles_ramp"] == drivers["vehicles_ramp"]
    assert own["made_way"] > 0

    def outer_delay_s(row):
        outer = row["vehicles_mainline"] / 3
        total = outer * row["outer_lane_delay_s"] + row["vehicles_ramp"] * row["ramp_delay_s"]
        return total / (outer + row["vehicles_ramp"])

    assert outer_delay_s(own) <= 0.5 * outer_delay_s(drivers)
