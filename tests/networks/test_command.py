"""`coramp ramps`: tables, JSON, notes, pictures, and what it refuses."""

import json
from dataclasses import replace

import pytest

from coramp.cli.ramp_listing import KEPT, notes_on
from coramp.errors import CorampError
from coramp.networks.net_file import read_network
from coramp.networks.ramps import on_ramps
from coramp.report.ramps_figure import save_ramps_figure
from tests.edges import assert_refused, invoke
from tests.networks import A10KW, HIGHWAY, LINK, RAMP, ROAD, SHIPPED, made


@pytest.mark.parametrize("network", SHIPPED, ids=["highway", "A10KW", "ramp"])
def test_networks_of_sumo_are_listed_with_whether_they_are_coordinated(network):
    told, machine = invoke("ramps", network, "--wide"), invoke("ramps", network, "--json")
    rows = json.loads(machine.out)
    assert (told.code, machine.code) == (0, 0)
    assert told.err == machine.err
    lines = told.out.splitlines()
    assert lines[0] == f"{network}: {len(rows)} on-ramp{'s' if len(rows) > 1 else ''}"
    for row in rows:
        runs = row["merging"] == "acceleration lane"
        assert row["coordinated"] is runs
        assert (f"{row['id']} is not coordinated: {row['reason']}." in lines) is not runs
        cells = next(line.split() for line in lines if line.startswith(f" {row['id']}"))
        assert cells[-1] == ("yes" if runs else "no")


def test_lengths_and_speeds_are_in_the_units_that_are_asked_for():
    (row,) = json.loads(invoke("ramps", HIGHWAY, "--json").out)
    assert (row["acceleration_lane_m"], row["ramp_m"], row["mainline_m"]) == (212.55, 173.7, 827.07)
    assert row["mainline_limits_mps"] == [44.44] * 3
    assert "160.0" in invoke("ramps", HIGHWAY, "--wide", "--kmh").out
    assert "44.4" in invoke("ramps", HIGHWAY, "--wide").out


def test_a_narrow_terminal_keeps_what_counts_most(tmp_path):
    told = invoke("ramps", A10KW)
    header = next(line for line in told.out.splitlines() if "on-ramp " in line)
    for column in KEPT:
        assert column in header or f": {column} " in told.out or f", {column} " in told.out


def test_who_wrote_a_network_and_what_is_left_out_is_told():
    by = "written by netedit v1_14_1+8770-d8469bdc8ac in format 1.16; SUMO 1.28.0 writes 1.20"
    links = "153180756, 153189987, 201283198, 201963249"
    assert invoke("ramps", HIGHWAY).errors == [
        f"Note: {HIGHWAY}: {by} and reads it",
        f"Note: {HIGHWAY}: no on-ramp at {links}: links join each other there",
    ]


def test_a_note_names_a_few_edges_and_counts_the_others():
    network = read_network(HIGHWAY)
    found = replace(on_ramps(network), links=tuple("abcdefg"))
    assert list(notes_on(network, found))[1:] == [
        "no on-ramp at a, b, c, d, e and 2 other edges: links join each other there"
    ]


def test_a_network_of_a_later_version_is_told(tmp_path):
    file = made(tmp_path)
    assert invoke("ramps", file).err == ""
    text = file.read_text("utf-8")
    file.write_text(text.replace('version="1.20"', 'version="1.101"'), "utf-8")
    (line,) = invoke("ramps", file).errors
    assert line.endswith("format 1.101; SUMO 1.28.0 writes 1.20 and may not know all that is in it")


def test_left_hand_traffic_is_told(tmp_path):
    file = made(tmp_path, nodes={"south": (-400, 80)}, options=("--lefthand", "true"))
    told = invoke("ramps", file, "--json")
    assert told.errors == [f"Note: {file}: left-hand traffic; lane 0 is the leftmost"]
    (row,) = json.loads(told.out)
    assert (row["left_hand"], row["side"], row["coordinated"]) == (True, "left", False)


def test_one_that_can_be_coordinated_has_no_reason(tmp_path):
    (row,) = json.loads(invoke("ramps", made(tmp_path), "--json").out)
    assert (row["coordinated"], row["reason"]) == (True, None)
    told = invoke("ramps", made(tmp_path))
    assert (told.code, told.err) == (0, "")
    assert "not coordinated" not in told.out


def test_no_ramps_are_no_error(tmp_path):
    file = made(tmp_path, {name: ROAD[name] for name in ("main", "merge", "down")})
    told, machine = invoke("ramps", file), invoke("ramps", file, "--json")
    line = f"{file}: no on-ramp; nowhere do a link and a through road join into one edge\n"
    assert told == type(told)(0, line, "")
    assert (machine.code, machine.out, machine.err) == (0, "[]\n", "")


def test_roads_that_are_alike_are_told(tmp_path):
    link = LINK.replace("22.22", "27.78")
    edges = {**ROAD, "link": link, "merge": ROAD["merge"].replace('"2"', '"1"')}
    nodes = {"west": (-600, 80), "south": (-600, -80)}
    told = invoke("ramps", made(tmp_path, edges, nodes=nodes))
    assert told.errors[0].endswith("no on-ramp at merge: the roads that join there are alike")


def test_every_on_ramp_is_drawn_the_same_each_time(tmp_path):
    pictures = [tmp_path / f"{name}.svg" for name in ("one", "two")]
    for picture in pictures:
        assert invoke("ramps", RAMP, "--plot", picture).code == 0
    one, two = (picture.read_text("utf-8") for picture in pictures)
    assert one == two
    assert "gneE14@gneE7: acceleration lane, 110.7 m" in one
    assert "gneE16@gneE18: give way" in one


def test_what_cannot_be_listed_or_drawn_is_one_line(tmp_path):
    assert_refused(invoke("ramps", tmp_path / "none.net.xml"))
    assert_refused(invoke("ramps"), code=2)
    routes = RAMP.with_name("ramp.rou.xml")
    told = invoke("ramps", routes)
    assert_refused(told)
    assert "holds <" in told.err
    assert "and no network" in told.err
    told = invoke("ramps", RAMP, "--plot", tmp_path / "ramps.txt")
    assert_refused(told)
    assert "the ending says no format" in told.err
    without = made(tmp_path, {name: ROAD[name] for name in ("main", "merge", "down")})
    told = invoke("ramps", without, "--plot", tmp_path / "ramps.png")
    assert told.errors == ["Error: --plot: there is no on-ramp to draw"]
    assert not (tmp_path / "ramps.png").exists()


def test_one_on_ramp_may_be_chosen_by_its_id():
    (row,) = json.loads(invoke("ramps", A10KW, "--ramp", "24498409@4054057", "--json").out)
    assert row["id"] == "24498409@4054057"
    told = invoke("ramps", A10KW, "--ramp", "gone@4054057")
    assert_refused(told)
    allowed = "24498409@4054057, 308396220@264308374"
    assert told.errors == [
        f"Error: {A10KW}: there is no on-ramp 'gone@4054057'; allowed are {allowed}"
    ]


def test_one_of_a_network_without_any_is_refused(tmp_path):
    file = made(tmp_path, {name: ROAD[name] for name in ("main", "merge", "down")})
    told = invoke("ramps", file, "--ramp", "link@merge")
    assert_refused(told)
    assert told.err.endswith("allowed are none: there is no on-ramp\n")


def test_more_on_ramps_than_a_figure_holds_are_refused(tmp_path):
    found = on_ramps(read_network(RAMP))
    many = replace(found, ramps=found.ramps * 7)
    with pytest.raises(CorampError, match=r"14 on-ramps are too many for a figure; .*by --ramp"):
        save_ramps_figure(read_network(RAMP), many, tmp_path / "many.png")


def test_help_has_an_example():
    told = invoke("ramps", "--help")
    assert told.code == 0
    assert "Example: coramp ramps city.net.xml.gz" in told.out
