"""What a corridor refuses, each in one line: where, which key, what is wrong, what is allowed."""

import re
import shutil

import pytest

import coramp
from coramp.scenarios.corridors import load_corridor
from coramp.scenarios.loading import load_scenario
from tests.corridors import written
from tests.edges import assert_refused, invoke

WRONG = {
    "out of order": (
        {"sites": ["on2@merge2", "on1@merge1"]},
        (
            "corridor.sites: on1@merge1 lies upstream of on2@merge2; allowed are the sites of a "
            "road one after the other, in the order of driving"
        ),
    ),
    "unknown site": (
        {"sites": ["on1@merge1", "on3@merge3"]},
        "corridor.sites: there is no on-ramp 'on3@merge3'; allowed are on1@merge1, on2@merge2",
    ),
    "a site twice": (
        {"sites": ["on1@merge1", "on1@merge1"]},
        "corridor.sites: on1@merge1 stands twice; allowed is each site once",
    ),
    "unknown exit": (
        {"exits": [{"edge": "of", "share": 0.1}]},
        "corridor.exits: there is no exit 'of'; allowed are off",
    ),
    "an exit twice": (
        {"exits": [{"edge": "off", "share": 0.1}] * 2},
        "corridor.exits: off stands twice; allowed is each exit once",
    ),
    "a share above 1": (
        {"exits": [{"edge": "off", "share": 1.5}]},
        "corridor.exits.0.share: 1.5 is too large; allowed is at most 1",
    ),
    "too few ramp flows": (
        {"ramp_flow_veh_h": [300.0]},
        "corridor.ramp_flow_veh_h: has 1 flows for 2 sites; allowed is one flow a site",
    ),
    "a flow a road too many": (
        {"mainline_flow_veh_h": [3000.0, 2000.0]},
        (
            "corridor.mainline_flow_veh_h: has 2 flows; the sites lie on 1 roads (on1@merge1, "
            "on2@merge2); allowed is a number, or one flow a road"
        ),
    ),
    "another hash": (
        {"sha256": "0" * 64},
        (
            "corridor.sha256: {network} has changed: it is {sha256} now; allowed is the file of "
            "that hash, or a new scenario by coramp new-scenario"
        ),
    ),
}


@pytest.mark.parametrize(("keys", "line"), WRONG.values(), ids=WRONG)
def test_each_is_told_in_one_line(tmp_path, network, keys, line):
    sha256 = load_corridor(written(tmp_path, network)).section.sha256
    path = written(tmp_path, network, **keys)
    with pytest.raises(coramp.CorampError) as caught:
        load_corridor(path)
    assert caught.value.messages == (f"{path}: {line.format(network=network, sha256=sha256)}",)


def test_zones_that_overlap_are_told_with_by_how_much(tmp_path, without_exit):
    """Between the noses lie 1200 m: 160 m of acceleration lane, and what is asked for here."""
    path = written(tmp_path, without_exit, exits=[], upstream_m=600.0, downstream_m=600.0)
    with pytest.raises(coramp.CorampError) as caught:
        load_corridor(path)
    told = r"corridor\.upstream_m: the zones of on1@merge1 and on2@merge2 overlap by \d+ m; allowed"
    assert re.match(f"{re.escape(path)}: {told}", str(caught.value))
    apart = written(tmp_path, without_exit, exits=[], upstream_m=500.0, downstream_m=450.0)
    first, second = load_corridor(apart).zones
    assert (first.from_m, second.from_m) == (-500.0, -500.0)
    assert first.to_m == pytest.approx(160.0 + 450.0, abs=30.0)


def test_what_the_network_tells_is_not_told_twice(tmp_path, network):
    path = written(tmp_path, network, tables={"mainline": {"flow_veh_h": 1000.0}})
    with pytest.raises(
        coramp.CorampError, match=r"road\.toml: mainline: stands beside \[corridor\]"
    ):
        load_corridor(path)


def test_a_flow_beyond_what_a_lane_takes_names_the_corridors_key(tmp_path, network):
    path = written(tmp_path, network, mainline_flow_veh_h=90000.0)
    with pytest.raises(coramp.CorampError) as caught:
        load_corridor(path)
    assert str(caught.value).startswith(f"{path}: corridor.mainline_flow_veh_h: ")


def test_what_is_for_one_merge_site_says_so(tmp_path, network):
    path = written(tmp_path, network)
    with pytest.raises(
        coramp.CorampError, match=r"road\.toml: \[corridor\]: has several merge sites"
    ):
        load_scenario(path)
    for arguments, line in (
        ((path, "--ramp", "300"), f"--ramp: is for one merge site; {path}"),
        ((path, "-s", "mixed-slots", "--processes", "0"), "--processes: 0 cannot be"),
        ((path,), "strategy: mainline-priority cannot run"),
        (("paper", "--processes", "2"), "--processes: paper has one merge site"),
    ):
        told = invoke("run", *arguments)
        assert (told.code, told.out) == (1, "")
        found = [own for own in told.errors if not own.startswith("Compiling")]
        assert len(found) == 1
        assert found[0].startswith(f"Error: {line}")


def test_a_folder_that_holds_a_corridor_is_replaced_and_not_audited(tmp_path, network):
    path, out = written(tmp_path, network, horizon_s=20.0), tmp_path / "out"
    for _ in range(2):
        told = invoke("run", path, "-s", "mixed-slots", "--out", out)
        assert told.code == 0
        assert "on2@merge2" in told.out
    told = invoke("audit", out)
    assert_refused(told)
    assert "holds the run of a corridor" in told.errors[0]


def test_a_network_that_has_gone_is_told(tmp_path, network):
    copy = tmp_path / "copy.net.xml"
    shutil.copy(network, copy)
    path = written(tmp_path, copy)
    copy.unlink()
    with pytest.raises(coramp.CorampError, match="cannot be read"):
        load_corridor(path)
