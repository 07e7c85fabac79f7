"""Counts in a network of several lanes: what may drive there, in runs, studio and environments."""

import json
import tomllib
from contextlib import closing

import gymnasium
import pytest

import coramp.gym
from coramp.errors import CorampError
from coramp.records.run_folder import read_run
from coramp.report.page.asked import asked_table
from coramp.report.writing import _repeat
from coramp.runs.running import make_spec
from coramp.studio.answers import Answers
from coramp.studio.dials import studio_of
from tests.edges import invoke
from tests.networks import A10KW

SITE = "24498409@4054057"
COUNTED = """begin_s,end_s,detector,class,vehicles
0,60,M,car,30
0,60,M,truck,3
0,60,R,car,4
0,60,R,truck,1
60,120,M,car,48
60,120,M,truck,5
60,120,R,car,6
60,120,R,truck,0
"""


@pytest.fixture(scope="module")
def a10(tmp_path_factory):
    """A scenario of trucks and cars that were counted, all automated."""
    folder = tmp_path_factory.mktemp("a10")
    (folder / "c.csv").write_text(COUNTED)
    detectors = ("--mainline-detector", "M", "--ramp-detector", "R")
    told = invoke("new-scenario", folder / "a10", "--net", A10KW, "--ramp", SITE, "--counts",
                  folder / "c.csv", *detectors)  # fmt: skip
    assert told.code == 0, told.err
    return str(folder / "a10.toml")


@pytest.mark.parametrize("share", [0.5, 1.0])
def test_trucks_and_cars_may_all_be_automated(a10, share):
    spec = make_spec(a10, "mixed-slots", overrides={"traffic.automated_share": share})
    assert spec.is_mixed
    assert {kind.name for kind in spec.scenario.vehicle_types} == {"car", "truck"}


def test_who_plans_for_one_lane_is_refused_for_that_reason(a10):
    for strategy in ("slots", "mainline-priority"):
        with pytest.raises(
            CorampError, match=f"{strategy} cannot run where the road lies in a net"
        ):
            make_spec(a10, strategy)


def test_the_studio_offers_what_can_be_set_and_driven(a10):
    studio = studio_of(a10)
    names = [dial.name for dial in studio.dials]
    assert {"gap", "share", "seed"} <= set(names)
    assert not {"mainline", "ramp", "lane", "mainline_speed", "ramp_speed"} & set(names)
    assert "mixed-slots" in studio.choices
    assert "slots" not in studio.choices
    one, other = studio.specs({"horizon": "30"})
    assert (one.strategy, other.strategy) == ("mixed-slots", "uncontrolled")
    assert one.engine == other.engine == "sumo"
    with pytest.raises(CorampError, match="mainline: cannot be set here; allowed are gap, share"):
        studio.specs({"mainline": "2000"})


def test_a_scenario_that_the_studio_saves_has_the_same_counts(a10, tmp_path):
    with closing(Answers(studio_of(a10))) as answers:
        text = answers.scenario_toml({"share": "50"})
    assert not {"demand", "arrivals"} & tomllib.loads(text).keys()
    (tmp_path / "saved.toml").write_text(text)
    spec = make_spec(str(tmp_path / "saved.toml"), "mixed-slots")
    assert spec.scenario.demand == make_spec(a10, "mixed-slots").scenario.demand
    assert spec.scenario.traffic.automated_share == 0.5


def test_the_studio_shows_no_corridor(tmp_path):
    sites = ("--ramp", SITE, "--ramp", "308396220@264308374")
    assert invoke("new-scenario", tmp_path / "c", "--net", A10KW, *sites).code == 0
    with pytest.raises(CorampError, match="has several merge sites, which the studio does not"):
        studio_of(str(tmp_path / "c.toml"))


@pytest.mark.parametrize("version", ["v0", "v1"])
def test_environments_that_plan_for_one_lane_refuse_other_roads(tmp_path, version):
    assert invoke("new-scenario", tmp_path / "n", "--net", A10KW, "--ramp", SITE).code == 0
    make = gymnasium.spec(f"coramp/Merge-{version}")
    with pytest.raises(CorampError) as caught:
        gymnasium.make(make, scenario=str(tmp_path / "n.toml"))
    assert str(caught.value) == (
        "network: the environment plans for coramp's own road of one mainline lane; "
        "allowed is such a scenario, or coramp/MixedMerge-v0"
    )


def test_the_report_says_what_was_counted_and_how_to_repeat_it(a10, tmp_path):
    coramp.run(a10, "uncontrolled", horizon_s=20.0, out=tmp_path / "r")
    run = read_run(tmp_path / "r")
    rows = dict(asked_table(run).rows)
    assert rows["network"] == f"{SITE} in osm.net.xml"
    assert rows["mainline"].startswith("3 lanes, -229.29 to 1193.53 m, ")
    assert rows["ramp"] == "420.05 m, 22.58 m/s"
    assert rows["demand"].endswith("c.csv, at M and R; highest 3180 + 360 veh/h in an interval")
    command, _ = _repeat([run])
    assert "--mainline" not in command
    assert "--horizon 20" in command
    assert json.loads((tmp_path / "r" / "run.json").read_text())["specification"]["demand"]
