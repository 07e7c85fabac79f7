"""Which on-ramps a network has, how long they are and how they merge."""

import math
import xml.etree.ElementTree as ET

import pytest

from coramp.networks.limits import SLOWS_MPS2, limits_along
from coramp.networks.net_file import read_network
from coramp.networks.ramps import on_ramps
from coramp.scenarios.loading import load_scenario
from coramp.scenarios.of_ramp import reason_against, scenario_data
from coramp.worlds.sumo.network import network_file, road_plan
from tests.networks import (
    A10KW,
    DOWN,
    HIGHWAY,
    LINK,
    MAIN,
    MERGE,
    RAMP,
    ROAD,
    found_in,
    made,
    only_ramp,
)


def lengths_m(file):
    return {
        lane.get("id"): float(lane.get("length")) for lane in ET.parse(file).getroot().iter("lane")
    }


def merges(ramp):
    return ramp.merging.how, ramp.merging.lane_m


@pytest.mark.parametrize(
    ("file", "ids", "mainline_lanes", "lane_m"),
    [
        (HIGHWAY, ["201283198.145.16@E0"], [3], [212.55]),
        (A10KW, ["24498409@4054057", "308396220@264308374"], [3, 3], [195.39, 173.18]),
        (RAMP, ["gneE14@gneE7", "gneE16@gneE18"], [2, 1], [110.73, None]),
    ],
    ids=["highway", "A10KW", "ramp"],
)
def test_the_networks_of_sumo_have_these_on_ramps(file, ids, mainline_lanes, lane_m):
    ramps = found_in(file).ramps
    assert [ramp.ramp_id for ramp in ramps] == ids
    assert [len(ramp.mainline_edge.lanes) for ramp in ramps] == mainline_lanes
    assert [ramp.merging.lane_m for ramp in ramps] == lane_m
    told = ["acceleration lane" if length_m else "give way" for length_m in lane_m]
    assert [ramp.merging.how for ramp in ramps] == told


def test_lengths_go_through_junctions_back_to_where_traffic_last_joined_or_left():
    ramp = only_ramp(HIGHWAY)
    edges = [edge.edge_id for edge in ramp.ramp.edges]
    assert edges == ["201283198", "201283198.145", "201283198.145.16"]
    of = lengths_m(HIGHWAY)
    way = [f"{edges[0]}_0", ":J2_0_0", f"{edges[1]}_0", ":J3_0_0", f"{edges[2]}_0", ":J1_0_0"]
    assert ramp.ramp_m == pytest.approx(sum(of[lane] for lane in way), abs=1e-9)
    way = ["145354574_0", ":2001841184_0_0", "189597495_0", ":J1_1_0"]
    assert ramp.mainline_m == pytest.approx(sum(of[lane] for lane in way), abs=1e-9)


@pytest.mark.parametrize("name", ["paper", "expressway", "motorway"])
def test_the_made_road_is_found_with_its_lengths_and_can_be_coordinated(name):
    plan = road_plan(load_scenario(name))
    ramp = only_ramp(network_file(plan))
    assert ramp.ramp_id == "ramp@merge"
    assert merges(ramp) == ("acceleration lane", pytest.approx(plan.acceleration_lane_m))
    assert ramp.ramp_m == pytest.approx(plan.ramp_m, abs=0.002)
    assert ramp.mainline_m == pytest.approx(plan.mainline_m, abs=0.002)
    assert (ramp.side, reason_against(ramp)) == ("right", None)


def test_an_acceleration_lane_of_one_lane_can_be_coordinated(tmp_path):
    file = made(tmp_path)
    ramp = only_ramp(file)
    assert ramp.ramp_id == "link@merge"
    assert merges(ramp) == ("acceleration lane", lengths_m(file)["merge_0"])
    assert reason_against(ramp) is None


def test_a_ramp_as_fast_as_the_mainline_or_with_a_short_lane_can_be_coordinated(tmp_path):
    short = MERGE.replace('to="end"', 'to="near"')
    edges = {**ROAD, "merge": short, "down": DOWN.replace("end", "near")}
    ramp = only_ramp(made(tmp_path, edges, nodes={"near": (60, 0)}))
    assert merges(ramp)[0] == "acceleration lane"
    assert reason_against(ramp) is None
    same = {**ROAD, "link": LINK.replace("22.22", "27.78")}
    assert reason_against(only_ramp(made(tmp_path, same))) is None
    same["link"] = LINK.replace("22.22", "33.33")
    assert scenario_data(only_ramp(made(tmp_path, same)))["ramp"]["speed_mps"] == 27.78


def test_a_mainline_that_loses_a_lane_cannot_be_coordinated(tmp_path):
    wide = {name: rest.replace('"1"', '"2"') for name, rest in ROAD.items() if name != "link"}
    edges = {**ROAD, **wide, "merge": MERGE.replace('"2"', '"3"'), "down": DOWN}
    ways = "".join(
        f'<connection from="merge" to="down" fromLane="{lane}" toLane="0"/>' for lane in (1, 2)
    )
    ramp = only_ramp(made(tmp_path, edges, kinds={"end": "zipper"}, connections=ways))
    assert "1 lanes on down and 2 before the nose" in reason_against(ramp)
    edges["main"] = MAIN.replace('numLanes="1"', 'numLanes="5"')
    edges["merge"] = MERGE.replace('numLanes="2"', 'numLanes="6"')
    edges["down"] = DOWN.replace('numLanes="1"', 'numLanes="5"')
    told = reason_against(only_ramp(made(tmp_path, edges)))
    assert told == "5 mainline lanes: coramp coordinates up to 4"


ONE = {"merge": MERGE.replace('numLanes="2"', 'numLanes="1"')}


@pytest.mark.parametrize(
    ("kind", "how"),
    [("zipper", "zipper"), ("priority", "give way"), ("unregulated", "no rule")],
)
def test_into_a_lane_of_the_mainline_it_merges_as_the_junction_says(tmp_path, kind, how):
    ramp = only_ramp(made(tmp_path, {**ROAD, **ONE}, kinds={"nose": kind}))
    assert merges(ramp) == (how, None)
    assert ramp.side == "right"
    assert reason_against(ramp) == f"{how}: coramp needs an acceleration lane that ends"


def test_a_lane_that_goes_on_is_gained(tmp_path):
    edges = {**ROAD, "down": DOWN.replace('numLanes="1"', 'numLanes="2"')}
    assert merges(only_ramp(made(tmp_path, edges))) == ("lane gain", None)
    no_more = {name: edges[name] for name in ("main", "link", "merge")}
    ramp = only_ramp(made(tmp_path, no_more))
    assert merges(ramp) == ("lane gain", None)
    assert reason_against(ramp) == "lane gain: coramp needs an acceleration lane that ends"


def test_a_lane_that_goes_on_while_that_of_the_mainline_ends_is_gained(tmp_path):
    ways = '<connection from="merge" to="down" fromLane="0" toLane="0"/>'
    assert merges(only_ramp(made(tmp_path, connections=ways))) == ("lane gain", None)


def test_a_lane_that_leaves_by_the_next_exit_weaves(tmp_path):
    exit_edge = 'from="end" to="exit" numLanes="1" speed="22.22"'
    file = made(tmp_path, {**ROAD, "off": exit_edge})
    ramp = only_ramp(file)
    assert merges(ramp) == ("weaving lane", lengths_m(file)["merge_0"])
    assert [edge.edge_id for edge in ramp.downstream.edges] == ["merge"]


def test_a_lane_weaves_where_the_lane_beside_it_may_leave_too(tmp_path):
    exit_edge = 'from="end" to="exit" numLanes="2" speed="33.3"'
    ways = "".join(
        f'<connection from="merge" to="{to}" fromLane="{lane}" toLane="{onto}"/>'
        for to, lane, onto in (("down", 1, 0), ("off", 0, 0), ("off", 1, 1))
    )
    for through, link in ((' priority="2"', ""), ("", ' type="highway.motorway_link"')):
        edges = {**ROAD, "down": DOWN + through, "off": exit_edge + link}
        file = made(tmp_path, edges, connections=ways)
        assert merges(only_ramp(file)) == ("weaving lane", lengths_m(file)["merge_0"])


def test_a_lane_that_ends_in_the_lane_beside_it_is_an_acceleration_lane(tmp_path):
    both = "".join(
        f'<connection from="merge" to="down" fromLane="{lane}" toLane="0"/>' for lane in (0, 1)
    )
    file = made(tmp_path, kinds={"end": "zipper"}, connections=both)
    assert merges(only_ramp(file)) == ("acceleration lane", lengths_m(file)["merge_0"])


def test_an_acceleration_lane_runs_through_the_junctions_on_its_way(tmp_path):
    edges = {
        **ROAD,
        "merge": MERGE.replace('to="end"', 'to="mid"'),
        "more": MERGE.replace("nose", "mid"),
    }
    file = made(tmp_path, edges, nodes={"mid": (90, 0)})
    of = lengths_m(file)
    total_m = of["merge_0"] + of[":mid_0_0"] + of["more_0"]
    assert of[":mid_0_0"] > 0.0
    ramp = only_ramp(file)
    assert merges(ramp) == ("acceleration lane", pytest.approx(total_m))
    assert [edge.edge_id for edge in ramp.downstream.edges] == ["merge", "more", "down"]


def test_of_two_ramp_lanes_the_one_that_ends_first_tells(tmp_path):
    edges = {
        "main": MAIN + ' priority="2"',
        "link": LINK.replace('numLanes="1"', 'numLanes="2"') + ' priority="1"',
        "merge": MERGE.replace('numLanes="2"', 'numLanes="3"'),
        "down": DOWN.replace('numLanes="1"', 'numLanes="2"'),
    }
    file = made(tmp_path, edges)
    ramp = only_ramp(file)
    assert merges(ramp) == ("acceleration lane", lengths_m(file)["merge_0"])
    assert ramp.merging.lanes == (0, 1)
    assert "2 ramp lanes: coramp coordinates one lane so far" in reason_against(ramp)


def test_a_ramp_may_join_from_the_left(tmp_path):
    ramp = only_ramp(made(tmp_path, nodes={"south": (-400, 80)}))
    assert (ramp.side, ramp.is_from_outside) == ("left", False)
    assert ramp.merging.lanes == (1,)
    assert reason_against(ramp).startswith("it joins from the left: ")
    beside = only_ramp(made(tmp_path, {**ROAD, **ONE}, nodes={"south": (-400, 80)}))
    assert beside.side == "left"


def test_left_hand_traffic_is_told(tmp_path):
    nodes, options = {"south": (-400, 80)}, ("--lefthand", "true")
    ramp = only_ramp(made(tmp_path, nodes=nodes, options=options))
    assert (ramp.is_left_hand, ramp.side, ramp.is_from_outside) == (True, "left", True)
    assert merges(ramp)[0] == "acceleration lane"
    assert reason_against(ramp) == "left-hand traffic: coramp knows right-hand traffic so far"
    beside = only_ramp(made(tmp_path, {**ROAD, **ONE}, nodes=nodes, options=options))
    assert beside.side == "left"


def test_limits_are_those_of_each_lane(tmp_path):
    wide = {name: rest.replace('"1"', '"2"') for name, rest in ROAD.items() if name != "link"}
    edges = {**ROAD, **wide, "merge": MERGE.replace('"2"', '"3"')}
    slow = '<lane index="0" speed="22.22"/>'
    ramp = only_ramp(made(tmp_path, edges, lanes={"main": slow}))
    assert [lane.limit_mps for lane in ramp.mainline_edge.lanes] == [22.22, 27.78]
    told = reason_against(ramp)
    assert told is None
    assert limits_along(ramp, on_ramp=False).limit_mps[0] == 22.22


def test_lanes_that_cars_may_not_use_do_not_count(tmp_path):
    edges = {**ROAD, "main": MAIN.replace('numLanes="1"', 'numLanes="2"')}
    bus = '<lane index="0" allow="bus"/>'
    ways = '<connection from="main" to="merge" fromLane="1" toLane="1"/>'
    ramp = only_ramp(made(tmp_path, edges, lanes={"main": bus}, connections=ways))
    assert [lane.index for lane in ramp.mainline_edge.lanes] == [1]
    assert reason_against(ramp) is None


def test_a_lane_more_than_come_from_before_the_nose_cannot_be_coordinated(tmp_path):
    edges = {**ROAD, "merge": MERGE.replace('"2"', '"3"')}
    ways = (
        '<connection from="main" to="merge" fromLane="0" toLane="2"/>'
        '<connection from="link" to="merge" fromLane="0" toLane="0"/>'
        '<connection from="merge" to="down" fromLane="2" toLane="0"/>'
    )
    ramp = only_ramp(made(tmp_path, edges, connections=ways))
    assert reason_against(ramp).startswith("3 lanes behind the nose: ")


@pytest.mark.parametrize(
    ("main", "link"),
    [
        ('type="highway.motorway" priority="1"', 'type="highway.motorway_link" priority="9"'),
        ('priority="9"', 'priority="1" speed="33.33" numLanes="2"'),
        ('numLanes="2" speed="22.22"', 'numLanes="1" speed="33.33"'),
        ('speed="27.78"', 'speed="22.22"'),
        ("", ""),
    ],
    ids=["type", "priority", "lanes", "speed", "straight on"],
)
def test_the_through_road_is_told_from_the_link(tmp_path, main, link):
    def edge(start, attributes):
        ends = f'from="{start}" to="nose" '
        return ends + (attributes or 'numLanes="1" speed="25"')

    for main_from, link_from in (("west", "south"), ("south", "west")):
        if not main and main_from == "south":
            continue
        edges = {
            **ROAD,
            "main": edge(main_from, main),
            "link": edge(link_from, link),
            "merge": MERGE.replace('numLanes="2"', 'numLanes="3"'),
        }
        ramp = only_ramp(made(tmp_path, edges))
        assert (ramp.ramp_edge.edge_id, ramp.mainline_edge.edge_id) == ("link", "main")


def test_two_ramps_may_join_at_one_nose(tmp_path):
    edges = {**ROAD, "other": LINK.replace("south", "north"), "merge": MERGE.replace('"2"', '"3"')}
    ramps = found_in(made(tmp_path, edges, nodes={"north": (-400, 80)})).ramps
    assert [(ramp.ramp_id, ramp.side) for ramp in ramps] == [
        ("link@merge", "right"),
        ("other@merge", "left"),
    ]


def test_no_ramp_is_where_nothing_joins_or_neither_road_is_a_link(tmp_path):
    exit_edge = 'from="end" to="exit" numLanes="1" speed="22.22"'
    through = {"main": MAIN, "merge": MERGE, "down": DOWN, "off": exit_edge}
    assert found_in(made(tmp_path, through)).ramps == ()
    links = {
        name: rest + ' type="highway.motorway_link"' if name in ("main", "link") else rest
        for name, rest in ROAD.items()
    }
    found = found_in(made(tmp_path, links))
    assert (found.ramps, found.links, found.equals) == ((), ("merge",), ())
    mirrored = {"west": (-600, 80), "south": (-600, -80)}
    alike = {**ROAD, **ONE, "link": MAIN.replace("west", "south")}
    found = found_in(made(tmp_path, alike, nodes=mirrored))
    assert (found.ramps, found.links, found.equals) == ((), (), ("merge",))


def test_no_ramp_is_at_signals_where_roads_cross_or_at_a_roundabout(tmp_path):
    signalled = made(tmp_path, kinds={"nose": "traffic_light"})
    assert 'tl="nose"' in signalled.read_text("utf-8")
    assert found_in(signalled).ramps == ()
    off = 'from="nose" to="exit" numLanes="1" speed="22.22"'
    assert found_in(made(tmp_path, {**ROAD, "off": off})).ramps == ()
    ring = [("a", 0, 0), ("b", 40, 0), ("c", 40, 40), ("d", 0, 40)]
    nodes = {name: (x, y) for name, x, y in ring} | {"ina": (-200, -20), "outc": (240, 60)}
    names = [name for name, *_ in ring]
    slow = 'numLanes="1" speed="8.3" priority="5"'
    edges = {
        f"{p}{q}": f'from="{p}" to="{q}" {slow}'
        for p, q in zip(names, [*names[1:], names[0]], strict=True)
    }
    circle = " ".join(edges)
    edges |= {
        "in": 'from="ina" to="a" numLanes="1" speed="13.9"',
        "out": 'from="c" to="outc" numLanes="1" speed="13.9"',
    }
    marked = f'<roundabout nodes="a b c d" edges="{circle}"/>'
    file = made(tmp_path, edges, nodes=nodes, more=marked)
    assert "<roundabout" in file.read_text("utf-8")
    assert found_in(file).ramps == ()
    open_ring = file.read_text("utf-8").replace("<roundabout", "<ring")
    (tmp_path / "ring.net.xml").write_text(open_ring, "utf-8")
    assert len(found_in(tmp_path / "ring.net.xml").ramps) == 1


def test_a_metered_ramp_is_a_ramp(tmp_path):
    file = made(tmp_path, {**ROAD, **ONE}, kinds={"nose": "traffic_light"})
    text = file.read_text("utf-8")
    lines = [
        line.replace('tl="nose" ', "") if 'from="main"' in line else line
        for line in text.splitlines()
    ]
    assert lines != text.splitlines()
    file.write_text("\n".join(lines), "utf-8")
    ramp = only_ramp(file)
    assert ramp.ramp_id == "link@merge"
    assert "a signal" not in reason_against(ramp)


def test_a_bend_that_slows_down_is_a_limit(tmp_path):
    ramp = only_ramp(made(tmp_path, nodes={"south": (-300, -400)}))
    slow_mps = ramp.ramp_way.inside[0].limit_mps
    assert slow_mps < ramp.ramp_edge.highest_limit_mps
    assert reason_against(ramp) is None
    limits = limits_along(ramp, on_ramp=True)
    assert limits.allowed_mps(-0.5 * ramp.ramp_way.length_m) == slow_mps
    assert scenario_data(ramp)["ramp"]["speed_mps"] == math.floor(100.0 * slow_mps) / 100.0
    before_m = ramp.ramp_way.length_m + 20.0
    expected = math.sqrt(slow_mps**2 + 2.0 * SLOWS_MPS2 * 20.0)
    assert limits.allowed_mps(-before_m) == pytest.approx(expected)


def test_a_network_of_netgenerate_without_ramps_has_none():
    network = read_network(A10KW.parents[1] / "square" / "square.net.xml")
    found = on_ramps(network)
    assert network.edges
    assert (found.ramps, found.links, found.equals) == ((), (), ())
