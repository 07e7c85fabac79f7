"""From SUMO's positions to stations and back, also against what SUMO drives."""

import csv
import os
import subprocess
from functools import cache

import pytest
import sumo
from hypothesis import given
from hypothesis import strategies as st

from coramp.errors import CorampError
from coramp.networks.net_file import read_network
from coramp.networks.ramps import on_ramps
from coramp.networks.stations import Place, stations_of
from coramp.road.lanes import ACCELERATION_LANE, MAINLINE, RAMP
from coramp.scenarios.loading import load_scenario
from coramp.worlds.sumo.lanes import laned_spans
from coramp.worlds.sumo.network import network_file, road_plan, sumo_binary
from tests.networks import A10KW, HIGHWAY, MERGE, ROAD, SHIPPED, made, only_ramp
from tests.networks import RAMP as RAMP_NETWORK

NEAR_M = 0.01


@cache
def sites():
    """The stations of every on-ramp of the networks that come with SUMO, by its id."""
    return {
        ramp.ramp_id: stations_of(ramp)
        for file in SHIPPED
        for ramp in on_ramps(read_network(file)).ramps
    }


@st.composite
def positions(draw):
    stations = sites()[draw(st.sampled_from(sorted(sites())))]
    stretch = draw(st.sampled_from(stations.stretches))
    return stations, stretch, draw(st.floats(0.0, stretch.lane_m))


@given(positions())
def test_a_position_comes_back_from_its_station_within_a_centimetre(drawn):
    stations, stretch, position_m = drawn
    place = stations.place(stretch.lane_id, position_m)
    lane_id, back_m = stations.position(place)
    again = stations.place(lane_id, back_m)
    assert again.station_m == pytest.approx(place.station_m, abs=1e-9)
    if 1e-6 < position_m < stretch.lane_m - 1e-6:
        assert lane_id == stretch.lane_id
        assert abs(back_m - position_m) < NEAR_M
        assert again == Place(again.station_m, place.code, place.lane)


@given(positions(), st.floats(0.0, 1.0))
def test_a_station_comes_back_from_its_position_within_a_centimetre(drawn, share):
    stations, stretch, _ = drawn
    station_m = stretch.start_m + share * (stretch.end_m - stretch.start_m)
    lane_id, position_m = stations.position(Place(station_m, stretch.code, stretch.lane))
    assert abs(stations.place(lane_id, position_m).station_m - station_m) < NEAR_M


@pytest.mark.parametrize("lanes", [1, 4])
def test_lanes_lie_where_the_plan_of_the_made_road_has_them(lanes):
    plan = road_plan(load_scenario("paper", {"mainline.lanes": lanes}))
    spans = laned_spans(only_ramp(network_file(plan)))
    planned = plan.spans()
    assert set(planned) - set(spans) == {":stopline_0_0", "gore_0"}
    for lane_id, span in spans.items():
        own = planned[lane_id]
        assert (own.lane, own.changes) == (span.lane, span.changes)
        assert own.start_m == pytest.approx(span.start_m, abs=0.002)
        assert own.end_m == pytest.approx(span.end_m, abs=0.002)


def test_stations_are_those_of_the_made_road():
    plan = road_plan(load_scenario("paper"))
    stations = stations_of(only_ramp(network_file(plan)))
    codes = {stretch.lane_id: stretch.code for stretch in stations.stretches}
    assert codes == {
        "ramp_0": RAMP,
        ":nose_1_0": RAMP,
        "merge_0": ACCELERATION_LANE,
        "mainline_0": MAINLINE,
        ":nose_0_0": MAINLINE,
        "merge_1": MAINLINE,
        ":end_0_0": MAINLINE,
        "downstream_0": MAINLINE,
    }


def test_lanes_count_from_the_one_beside_the_ramp():
    stations = sites()["201283198.145.16@E0"]
    at_nose = {f"E0_{lane}": stations.place(f"E0_{lane}", 0.0) for lane in range(4)}
    assert [(place.code, place.lane) for place in at_nose.values()] == [
        (ACCELERATION_LANE, -1),
        (MAINLINE, 0),
        (MAINLINE, 1),
        (MAINLINE, 2),
    ]
    assert {place.station_m for place in at_nose.values()} == {0.0}
    before = stations.place("189597495_2", 1.0)
    assert (before.code, before.lane) == (MAINLINE, 2)
    assert before.station_m == pytest.approx(1.0 - 274.64 - 4.48)
    assert stations.place("201283198.145.16_0", 34.94).station_m == pytest.approx(-3.92)


def test_lanes_count_from_a_ramp_on_the_left_too(tmp_path):
    wide = {
        "main": ROAD["main"].replace('"1"', '"2"'),
        "down": ROAD["down"].replace('"1"', '"2"'),
        "merge": MERGE.replace('"2"', '"3"'),
    }
    on = "".join(
        f'<connection from="merge" to="down" fromLane="{lane}" toLane="{lane}"/>' for lane in (0, 1)
    )
    file = made(tmp_path, {**ROAD, **wide}, nodes={"south": (-400, 80)}, connections=on)
    stations = stations_of(only_ramp(file))
    lanes = [stations.place(f"merge_{lane}", 0.0) for lane in range(3)]
    assert [(place.code, place.lane) for place in lanes] == [
        (MAINLINE, 1),
        (MAINLINE, 0),
        (ACCELERATION_LANE, -1),
    ]
    assert [stations.place(f"main_{lane}", 0.0).lane for lane in range(2)] == [1, 0]


def test_an_acceleration_lane_keeps_its_code_through_a_junction_and_no_further(tmp_path):
    edges = {
        **ROAD,
        "merge": MERGE.replace('to="end"', 'to="mid"'),
        "more": MERGE.replace("nose", "mid"),
    }
    stations = stations_of(only_ramp(made(tmp_path, edges, nodes={"mid": (90, 0)})))
    own = [s.lane_id for s in stations.stretches if s.code == ACCELERATION_LANE]
    assert own == ["merge_0", ":mid_0_0", "more_0"]


def test_lanes_of_other_length_inside_a_junction_are_stretched(tmp_path):
    wide = {name: rest.replace('"1"', '"2"') for name, rest in ROAD.items() if name != "link"}
    edges = {**ROAD, **wide, "merge": MERGE.replace('"2"', '"3"'), "before": wide["main"]}
    edges["before"] = edges["before"].replace('to="nose"', 'to="bend"')
    edges["main"] = edges["main"].replace('from="west"', 'from="bend"')
    nodes = {"west": (-300, 400), "bend": (-300, 0)}
    stations = stations_of(only_ramp(made(tmp_path, edges, nodes=nodes)))
    inner = [s for s in stations.stretches if s.lane_id.startswith(":bend")]
    lengths_m = {stretch.lane_m for stretch in inner}
    assert len(lengths_m) == len(inner) == 2
    assert len({(stretch.start_m, stretch.end_m) for stretch in inner}) == 1
    beside = next(stretch for stretch in inner if stretch.lane == 0)
    assert beside.metres_per_metre == pytest.approx(1.0)


def test_where_there_is_no_lane_it_says_so():
    stations = sites()["24498409@4054057"]
    with pytest.raises(CorampError, match="nowhere_0: is no lane of this merge site"):
        stations.place("nowhere_0", 0.0)
    for wrong_m in (-0.1, 195.40, float("nan")):
        with pytest.raises(CorampError, match=r"not on the lane; allowed is 0 to 195\.39 m"):
            stations.place("4054057_0", wrong_m)
    for place in (
        Place(-1e4, MAINLINE, 0),
        Place(1e4, MAINLINE, 0),
        Place(1.0, RAMP, 0),
        Place(300.0, ACCELERATION_LANE, -1),
        Place(1.0, MAINLINE, 7),
        Place(float("nan"), MAINLINE, 0),
    ):
        with pytest.raises(CorampError, match="there is no lane"):
            stations.position(place)


def driven(folder, network, first, last):
    """Yields where one vehicle was, step by step, and how far it had driven, as SUMO says."""
    (folder / "one.rou.xml").write_text(
        '<routes><vType id="car" sigma="0" speedFactor="0.5" speedDev="0"/>'
        f'<trip id="one" type="car" depart="0" from="{first}" to="{last}" departSpeed="max"/>'
        "</routes>",
        "utf-8",
    )
    command = [
        *(sumo_binary("sumo"), "--net-file", str(network), "--route-files", "one.rou.xml"),
        *(
            "--step-length",
            "0.5",
            "--end",
            "1000",
            "--no-step-log",
            "true",
            "--no-warnings",
            "true",
        ),
        *("--fcd-output", "fcd.csv", "--fcd-output.attributes", "lane,pos,odometer"),
        *("--precision", "6", "--tls.all-off", "true", "--time-to-teleport", "-1"),
    ]
    environment = {**os.environ, "SUMO_HOME": sumo.SUMO_HOME}
    done = subprocess.run(
        command, cwd=folder, env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    with (folder / "fcd.csv").open(encoding="utf-8", newline="") as lines:
        for row in csv.DictReader(lines, delimiter=";"):
            if row["vehicle_lane"]:
                yield (
                    row["vehicle_lane"],
                    float(row["vehicle_pos"]),
                    float(row["vehicle_odometer"]),
                )


@pytest.mark.parametrize(
    ("network", "ramp_id", "first"),
    [
        (HIGHWAY, "201283198.145.16@E0", "201283198"),
        (HIGHWAY, "201283198.145.16@E0", "145354574"),
        (A10KW, "24498409@4054057", "-24498410#1"),
        (RAMP_NETWORK, "gneE14@gneE7", "gneE13"),
        (RAMP_NETWORK, "gneE14@gneE7", "gneE3"),
    ],
)
def test_stations_grow_by_what_sumo_says_was_driven(tmp_path, network, ramp_id, first):
    ramp = next(r for r in on_ramps(read_network(network)).ramps if r.ramp_id == ramp_id)
    stations = stations_of(ramp)
    last = ramp.downstream.edges[-1].edge_id
    seen = [
        (stations.place(lane, position_m), odometer_m)
        for lane, position_m, odometer_m in driven(tmp_path, network, first, last)
    ]
    places = [place for place, _ in seen]
    assert places[0].station_m < -30.0
    assert places[-1].station_m > ramp.downstream.length_m - 60.0
    start_m = places[0].station_m - seen[0][1]
    worst_m = max(abs(place.station_m - odometer_m - start_m) for place, odometer_m in seen)
    assert worst_m < NEAR_M
