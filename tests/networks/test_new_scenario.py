"""`coramp new-scenario`: what it writes, what a scenario in a network is refused for."""

import tomllib

import pytest

from coramp.errors import CorampError
from coramp.networks.limits import SLOWS_MPS2, Limits
from coramp.scenarios.loading import load_scenario
from tests.edges import assert_refused, everything_below, invoke
from tests.networks import A10KW, HIGHWAY, RAMP, made

OSM = """<osm version="0.6">
  <node id="1" lat="52.0" lon="13.000"/> <node id="2" lat="52.0" lon="13.010"/>
  <node id="3" lat="52.0" lon="13.020"/> <node id="4" lat="51.999" lon="13.005"/>
  <way id="10"><nd ref="1"/><nd ref="2"/><tag k="highway" v="motorway"/>
    <tag k="lanes" v="2"/><tag k="maxspeed" v="100"/></way>
  <way id="11"><nd ref="2"/><nd ref="3"/><tag k="highway" v="motorway"/>
    <tag k="lanes" v="2"/><tag k="maxspeed" v="100"/></way>
  <way id="12"><nd ref="4"/><nd ref="2"/><tag k="highway" v="motorway_link"/>
    <tag k="oneway" v="yes"/><tag k="maxspeed" v="80"/></way>
</osm>
"""


@pytest.mark.parametrize(
    ("network", "ramp", "lanes", "measures"),
    [
        (HIGHWAY, "201283198.145.16@E0", 3, (-827.07, 1966.03, -173.7, 212.55)),
        (A10KW, "308396220@264308374", 3, (-148.24, 1383.05, -165.09, 173.18)),
        (RAMP, "gneE14@gneE7", 2, (-218.26, 1330.31, -44.67, 110.73)),
    ],
    ids=["highway", "A10KW", "ramp"],
)
def test_a_scenario_has_the_lengths_lanes_and_limits_of_its_network(
    tmp_path, network, ramp, lanes, measures
):
    told = invoke("new-scenario", tmp_path / "mine", "--net", network, "--ramp", ramp)
    assert (told.code, told.err) == (0, "")
    assert everything_below(tmp_path) == ["mine.toml"]
    scenario = load_scenario(str(tmp_path / "mine.toml"))
    mainline, own = scenario.mainline, scenario.ramp
    assert (mainline.lanes, mainline.flow_veh_h) == (lanes, 1000.0 * lanes)
    assert (mainline.start_m, mainline.end_m, own.start_m, own.acceleration_lane_m) == measures
    assert mainline.speed_mps == mainline.limit_mps
    assert own.entry_speed_mps[1] <= own.limit_mps
    assert scenario.name == "mine"
    again = invoke("new-scenario", tmp_path / "mine", "--net", network, "--ramp", ramp)
    assert_refused(again)
    assert "mine.toml: is there already" in again.err


def test_a_ramp_enters_no_faster_than_what_lets_it_slow_down_for_its_bends(tmp_path):
    invoke("new-scenario", tmp_path / "mine", "--net", RAMP, "--ramp", "gneE14@gneE7")
    scenario = load_scenario(str(tmp_path / "mine.toml"))
    # 33.33 m/s, and 13.89 m/s after 16.8 m and the 0.29 m of a junction
    allowed_mps = (13.89**2 + 2.0 * SLOWS_MPS2 * (16.8 + 0.29)) ** 0.5
    assert scenario.ramp.entry_speed_mps[1] == pytest.approx(allowed_mps, abs=0.01)


def test_limits_ahead_bind_before_they_begin():
    limits = Limits((-100.0, 0.0, 50.0), (30.0, 10.0, 20.0))
    assert limits.allowed_mps(-100.0) == pytest.approx((100.0 + 3.0 * 100.0) ** 0.5)
    assert limits.allowed_mps(-1e-9) == pytest.approx(10.0)
    assert limits.allowed_mps(-48.0) == pytest.approx((100.0 + 3.0 * 48.0) ** 0.5)
    assert limits.allowed_mps(0.0) == 10.0
    assert limits.allowed_mps(49.0) == 10.0
    assert limits.allowed_mps(50.0) == limits.allowed_mps(1e6) == 20.0
    far = Limits((-1000.0, 0.0), (30.0, 10.0))
    assert far.allowed_mps(-900.0) == 30.0


def test_the_path_counts_from_the_scenario_s_folder(tmp_path, monkeypatch):
    made(tmp_path)
    told = invoke("new-scenario", tmp_path / "mine", "--net", tmp_path / "made.net.xml")
    assert told.code == 0, told.err
    data = tomllib.loads((tmp_path / "mine.toml").read_text("utf-8"))
    assert data["network"]["file"] == "made.net.xml"
    assert data["network"]["ramp"] == "link@merge"
    monkeypatch.chdir("/")
    assert load_scenario(str(tmp_path / "mine.toml")).network is not None
    shown = invoke("scenarios", tmp_path / "mine.toml")
    assert shown.code == 0, shown.err
    assert tomllib.loads(shown.out)["network"]["ramp"] == "link@merge"


def test_a_network_that_is_gone_or_has_changed_is_refused(tmp_path):
    network = made(tmp_path)
    assert invoke("new-scenario", tmp_path / "mine", "--net", network).code == 0
    file = str(tmp_path / "mine.toml")
    load_scenario(file)
    network.write_text(network.read_text("utf-8") + "<!-- changed -->", "utf-8")
    with pytest.raises(CorampError, match=r"^\S+: network\.sha256: \S+ has changed: it is "):
        load_scenario(file)
    network.unlink()
    with pytest.raises(CorampError, match=r"made\.net\.xml: cannot be read: No such file") as error:
        load_scenario(file)
    assert len(error.value.messages) == 1


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"network.ramp": "gone@merge"}, "there is no on-ramp 'gone@merge'; allowed are link@merg"),
        ({"mainline.end_m": 300.0}, "mainline.end_m: 300 is not what link@merge has; allowed is "),
        ({"ramp.acceleration_lane_m": 90.0}, "ramp.acceleration_lane_m: 90 is not what "),
        ({"mainline.lanes": 2}, "mainline.lanes: 2 is not what link@merge has; allowed is 1"),
        ({"network.sha256": "0"}, "network.sha256: "),
    ],
)
def test_what_is_not_the_network_s_is_refused(tmp_path, changes, told):
    invoke("new-scenario", tmp_path / "mine", "--net", made(tmp_path))
    with pytest.raises(CorampError) as error:
        load_scenario(str(tmp_path / "mine.toml"), changes)
    (line,) = error.value.messages
    assert told in line


def test_a_ramp_that_is_not_there_or_cannot_run_leaves_nothing(tmp_path):
    mine = tmp_path / "mine"
    for options, told in (
        (
            ("--net", A10KW, "--ramp", "nowhere"),
            "there is no on-ramp 'nowhere'; allowed are ",
        ),
        (("--net", A10KW), "there are 2 on-ramps; choose one by --ramp: 24498409@4054057, 3083962"),
        (
            ("--net", RAMP, "--ramp", "gneE16@gneE18"),
            "cannot be coordinated: it joins from",
        ),
        (("--net", tmp_path / "none.net.xml"), "none.net.xml: cannot be read: No such file"),
        (("--osm", tmp_path / "none.osm"), "none.osm: no such file; allowed is an extract"),
        ((), "--net, --osm: allowed is one of them"),
        (("--net", A10KW, "--osm", A10KW), "--net, --osm: allowed is one of them"),
    ):
        refused = invoke("new-scenario", mine, *options)
        assert_refused(refused)
        assert len(refused.errors) == 1
        assert told in refused.errors[0]
        assert everything_below(tmp_path) == []


def test_left_hand_traffic_is_refused(tmp_path):
    options = ("--lefthand", "true")
    network = made(tmp_path, nodes={"south": (-400, 80)}, options=options)
    refused = invoke("new-scenario", tmp_path / "mine", "--net", network)
    assert "left-hand traffic: coramp knows right-hand traffic so far" in refused.err


def test_a_file_of_openstreetmap_goes_through_netconvert_and_keeps_the_command(tmp_path):
    osm = tmp_path / "extract.osm.xml"
    osm.write_text(OSM, "utf-8")
    refused = invoke("new-scenario", tmp_path / "mine", "--osm", osm, "--ramp", "nowhere")
    assert_refused(refused)
    assert everything_below(tmp_path) == ["extract.osm.xml"]
    told = invoke("new-scenario", tmp_path / "mine", "--osm", osm)
    assert told.code == 0, told.err
    names = ["extract.osm.xml", "mine.net.xml", "mine.netconvert.txt", "mine.toml"]
    assert everything_below(tmp_path) == names
    command = (tmp_path / "mine.netconvert.txt").read_text("utf-8")
    for option in ("--ramps.guess", "--geometry.remove", "--junctions.join"):
        assert option in command.split()
    scenario = load_scenario(str(tmp_path / "mine.toml"))
    assert scenario.mainline.lanes == 2
    assert scenario.ramp.acceleration_lane_m == pytest.approx(94.26)
    osm.write_text("no xml", "utf-8")
    broken = invoke("new-scenario", tmp_path / "other", "--osm", osm)
    assert_refused(broken)
    assert everything_below(tmp_path) == names


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        (
            {"mainline.lane_shares": [0.5, 0.5]},
            "there are 2 for mainline.lanes 3; allowed is one a",
        ),
        ({"mainline.lane_shares": [0.5, 0.4, 0.2]}, "they sum to 1.1; allowed is a sum of 1"),
        ({"mainline.lanes": 5}, "mainline.lanes: "),
        ({"mainline.flow_veh_h": 20000.0}, "allowed is below 18000 veh/h"),
    ],
)
def test_lanes_and_shares_must_fit(changes, told):
    with pytest.raises(CorampError) as error:
        load_scenario("paper", {"mainline.lanes": 3, **changes})
    assert told in str(error.value)
