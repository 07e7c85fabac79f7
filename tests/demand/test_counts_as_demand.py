"""From a file of counts to a run, and back from SUMO's own detectors."""

import hashlib
import json

import polars as pl
import pytest

import coramp
from coramp.demand.arrivals import arrivals_of
from coramp.demand.counts import read_counts
from coramp.errors import CorampError
from coramp.scenarios.loading import load_scenario
from coramp.worlds.sumo.detected import detected
from tests.edges import assert_refused, invoke

INTERVALS = 3
COUNTED = {
    ("M", "car"): (60, 95, 70),
    ("M", "truck"): (6, 9, 4),
    ("R", "car"): (12, 22, 15),
    ("R", "truck"): (1, 2, 0),
}
"""A peak, and trucks."""
ROAD = """
[mainline]
start_m = -400.0
end_m = 400.0
speed_mps = 27.78
lanes = 2
[ramp]
start_m = -300.0
speed_mps = 20.0
acceleration_lane_m = 200.0
[[demand]]
route = "mainline"
end_s = 60.0
vehicles = 1
"""
KEYS = ["begin_s", "end_s", "detector", "vehicle_class"]


def rows(detectors="MR", intervals=INTERVALS):
    lines = [
        f"{300 * k},{300 * k + 300},{name},{kind},{vehicles[k]}"
        for (name, kind), vehicles in COUNTED.items()
        for k in range(intervals)
        if name in detectors
    ]
    return "\n".join(["begin_s,end_s,detector,class,vehicles", *lines]) + "\n"


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "c.csv").write_text(rows())
    return tmp_path


def new(*more, name="s", file="c.csv"):
    detectors = ("--mainline-detector", "M", "--ramp-detector", "R")
    return invoke("new-scenario", name, "--counts", file, *detectors, *more)


def difference(found, asked):
    """Vehicles more than asked for, by interval, detector and class."""
    both = found.join(asked, on=KEYS, how="full", coalesce=True)
    return both.with_columns(
        more=pl.col("vehicles").fill_null(0) - pl.col("vehicles_right").fill_null(0)
    )


def test_detectors_in_sumo_see_the_counts_again(here):
    assert new("--detector", "M=-250", "--detector", "R=-200").code == 0
    coramp.run("s.toml", "uncontrolled", seed=4, out="r", keep_sumo=True)
    found = read_counts("r/sumo/detectors.csv").frame
    asked = read_counts("c.csv").frame
    inside = difference(found.filter(pl.col("begin_s") < 900.0), asked)
    assert inside["more"].abs().max() <= 1
    whole = difference(found, asked).group_by("detector", "vehicle_class").agg(pl.col("more").sum())
    assert whole["more"].to_list() == [0] * 4
    assert set(found["lane"]) == {0}
    speeds = found.filter(pl.col("vehicles") > 0)["mean_speed_mps"]
    assert speeds.null_count() == 0
    assert 10.0 < speeds.min() <= speeds.max() < 25.0


def test_what_the_detectors_saw_is_demand_again(here):
    assert new().code == 0
    coramp.run("s.toml", "uncontrolled", seed=4, horizon_s=600.0, out="r", keep_sumo=True)
    assert new(name="again", file="r/sumo/detectors.csv").code == 0
    scenario = load_scenario("again.toml")
    first = [part for part in scenario.demand if part.begin_s == 0.0]
    assert sum(part.vehicles for part in first) == 79
    command = (here / "r" / "sumo" / "command.txt").read_text()
    assert "--additional-files detectors.add.xml" in command


def test_without_keeping_sumo_s_files_there_are_no_loops(here):
    assert new().code == 0
    coramp.run("s.toml", "uncontrolled", seed=4, horizon_s=60.0, out="r")
    assert not (here / "r" / "sumo").exists()


def test_a_new_scenario_says_where_its_demand_is_from(here):
    told = new()
    assert told.out == "Written: s.toml; now coramp run s.toml\n"
    scenario = load_scenario("s.toml")
    digest = hashlib.sha256((here / "c.csv").read_bytes()).hexdigest()
    assert scenario.counts.sha256 == digest
    assert [(d.id, d.road, d.station_m, d.period_s) for d in scenario.detector] == [
        ("M", "mainline", -350.0, 300.0),
        ("R", "ramp", -350.0, 300.0),
    ]
    assert scenario.simulation.horizon_s == 900.0
    assert scenario.mainline.flow_veh_h == pytest.approx(4 * 244.0)
    assert [(k.name, k.mainline_share) for k in scenario.vehicle_types] == [
        ("car", 0.9221),
        ("truck", 0.0779),
    ]
    arrivals = arrivals_of(scenario, 1)
    assert len(arrivals) == 244 + 52


def test_what_a_run_needs_of_its_counts_is_kept_in_it(here):
    assert new().code == 0
    scenario = load_scenario("s.toml")
    again = type(scenario).model_validate(json.loads(json.dumps(scenario.model_dump(mode="json"))))
    (here / "c.csv").unlink()
    assert arrivals_of(again, 7) == arrivals_of(scenario, 7)


def test_counts_that_have_changed_are_refused(here):
    assert new().code == 0
    (here / "c.csv").write_text(rows().replace("M,car,60", "M,car,61"))
    with pytest.raises(CorampError, match=r"counts\.sha256: c\.csv has changed since"):
        load_scenario("s.toml")


def test_a_part_of_a_file(here):
    assert new().code == 0
    part = load_scenario("s.toml", {"counts.begin_s": 300.0, "counts.end_s": 600.0})
    assert part.simulation.horizon_s == 300.0
    assert sum(one.vehicles for one in part.demand) == 95 + 9 + 22 + 2
    with pytest.raises(CorampError) as caught:
        load_scenario("s.toml", {"counts.begin_s": 310.0})
    assert caught.value.messages == (
        (
            "s.toml: counts.begin_s: 310 is no interval's in c.csv; "
            "allowed are 0 to 600 s in steps of 300 s"
        ),
    )


@pytest.mark.parametrize(
    ("options", "line"),
    [
        *(
            (
                ("--detector", text),
                (
                    f"--detector: {text}: is not ID=STATION; "
                    "allowed are metres from the nose, as in M=-350"
                ),
            )
            for text in ("M", "M=x", "M=nan", "M=-0,35")
        ),
        (
            ("--detector", "M=-9", "--detector", "M=-8"),
            "--detector: M is given twice; allowed is once",
        ),
        (
            ("--detector", "M=300"),
            (
                "--detector: M=300: is not on the mainline upstream of the nose; "
                "allowed is above -400 to 0 m"
            ),
        ),
        (
            ("--detector", "R=-900"),
            "--detector: R=-900: is not on the ramp; allowed is above -400 to 0 m",
        ),
        (("--class", "bus=truck"), "--class: c.csv has no class 'bus'; allowed are car, truck"),
        (
            ("--class", "bus=coach"),
            "--class: bus=coach: is not CLASS=TYPE; allowed types are car, truck",
        ),
        (("--ramp", "x@y"), "--ramp: is an on-ramp of a network; allowed with --net or --osm"),
        (
            ("--detector", "M=-500"),
            "--detector: M=-500: is not on the mainline; allowed is above -400 to 0 m",
        ),
    ],
)
def test_options_that_cannot_be(here, options, line):
    told = new(*options)
    assert_refused(told)
    assert told.errors[0] == f"Error: {line}"
    assert not (here / "s.toml").exists()


def test_detectors_that_are_not_there(here):
    told = invoke("new-scenario", "s", "--counts", "c.csv", "--mainline-detector", "M",
                  "--ramp-detector", "X")  # fmt: skip
    assert told.errors == ["Error: --ramp-detector: c.csv has no detector 'X'; allowed are M, R"]
    told = invoke("new-scenario", "s", "--counts", "c.csv", "--mainline-detector", "M")
    assert told.errors == [
        "Error: --ramp-detector: is missing; give the id of a detector that coramp counts lists"
    ]
    told = invoke("new-scenario", "s", "--mainline-detector", "M")
    assert told.errors == ["Error: --mainline-detector: without --counts; give a file of counts"]
    assert invoke("new-scenario", "s").errors == [
        "Error: --net, --osm: allowed is one of them, or --counts alone; none is given"
    ]


def test_an_unknown_class_is_of_the_type_that_is_said(here):
    (here / "c.csv").write_text(rows().replace("truck", "bus"))
    told = new()
    assert told.errors == [
        (
            "Error: c.csv: class 'bus' is no type that is built in; allowed are car, truck: "
            "say by --class bus=TYPE which one it is of"
        )
    ]
    assert new("--class", "bus=truck").code == 0
    assert load_scenario("s.toml").counts.classes == {"bus": "truck"}


def test_repairs_are_told_and_done_again_when_the_scenario_is_loaded(here):
    (here / "c.csv").write_text(rows().replace("M,car,95", "M,car,-1"))
    assert new().errors == ["Error: c.csv: row 3: -1 vehicles; allowed are whole numbers from 0 on"]
    told = new("--repair")
    assert told.code == 0
    assert told.errors == ["Repaired: c.csv: row 3: -1 vehicles: taken as not counted"]
    scenario = load_scenario("s.toml")
    assert [p.vehicles for p in scenario.demand if (p.route, p.type) == ("mainline", "car")] == [
        60, 65, 70
    ]  # fmt: skip


def test_counts_lists_what_a_file_holds(here):
    told = invoke("counts", "c.csv")
    assert told.code == 0
    assert "c.csv: 2 detectors" in told.out
    machine = json.loads(invoke("counts", "c.csv", "--json").out)
    assert machine["adds_up"]
    assert [(r["detector"], r["class"], r["vehicles"]) for r in machine["detectors"]] == [
        ("M", "car", 225),
        ("M", "truck", 19),
        ("R", "car", 49),
        ("R", "truck", 3),
    ]
    assert machine["detectors"][0]["peak_veh_h"] == 95 * 12


def test_counts_tells_what_does_not_add_up(here):
    (here / "c.csv").write_text(rows().replace("M,car,95", "M,car,-1"))
    told = invoke("counts", "c.csv", "--json")
    assert told.code == 1
    assert told.errors == ["Error: c.csv: row 3: -1 vehicles; allowed are whole numbers from 0 on"]
    machine = json.loads(told.out)
    assert machine["problems"] == [
        {"row": 3, "what": "-1 vehicles", "allowed": "are whole numbers from 0 on"}
    ]
    assert invoke("counts", "c.csv", "--repair").code == 0
    assert_refused(invoke("counts", "none.csv"))
    assert_refused(invoke("counts", "c.csv", "--downstream", "M"))


def test_a_scenario_with_counts_is_printed_as_it_is_taken(here):
    assert new().code == 0
    lines = invoke("scenarios", "s.toml").out.splitlines()
    assert "# horizon_s = 900.0  # follows from the end of the demand" in lines
    assert "# [[vehicle]]: car, truck, listed in the file" in lines
    assert "# [[detector]]: M, R, listed in the file" in lines
    assert any(line.startswith("# [counts]: c.csv, at M and ") for line in lines)


def test_a_detector_of_both_roads_and_one_with_a_blank(here):
    told = invoke("new-scenario", "s", "--counts", "c.csv", "--mainline-detector", "M",
                  "--ramp-detector", "M")  # fmt: skip
    assert told.errors == [
        "Error: --ramp-detector: M is the --mainline-detector; allowed is another one"
    ]
    (here / "c.csv").write_text(rows().replace(",M,", ",M 1,"))
    told = invoke("new-scenario", "s", "--counts", "c.csv", "--mainline-detector", "M 1",
                  "--ramp-detector", "R")  # fmt: skip
    assert told.errors == [
        (
            "Error: s.toml: counts.mainline: 'M 1' cannot be; "
            "allowed is a name without spaces and without < > & \" ' , ;"
        )
    ]
    assert not (here / "s.toml").exists()


def test_what_detectors_have_wrong_is_told_by_road_and_once(here):
    assert new().code == 0
    text = (here / "s.toml").read_text().replace("station_m = -350.0", "station_m = 100.0", 1)
    (here / "s.toml").write_text(text)
    with pytest.raises(CorampError) as caught:
        load_scenario("s.toml")
    assert caught.value.messages == (
        "s.toml: counts.mainline: station_m: 100 is not on the mainline; allowed is -400 to 0 m",
    )
    lanes = [line + (",1" if ",R," in line else ",0") for line in rows().splitlines()[1:]]
    (here / "c.csv").write_text("begin_s,end_s,detector,class,vehicles,lane\n" + "\n".join(lanes))
    told = new(name="t")
    assert told.errors == [
        "Error: t.toml: counts.ramp: lane: the ramp has no lane 1; allowed is up to 0"
    ]


def test_a_first_interval_that_ends_before_anybody_can_pass(here):
    (here / "road.toml").write_text(ROAD.replace("start_m = -400.0", "start_m = -2000.0"))
    lines = [f"{60 * k},{60 * k + 60},{d},3" for k in range(3) for d in "MR"]
    (here / "c.csv").write_text("\n".join(["begin_s,end_s,detector,vehicles", *lines]))
    assert new("--road", "road.toml", "--detector", "M=-1000").code == 0
    told = new("--road", "road.toml", "--detector", "M=-100", name="t")
    (line,) = told.errors
    assert line.startswith(
        "Error: t.toml: counts.mainline: 2 vehicles are to pass -100 m by 60 s, and the first "
    )
    assert line.endswith("allowed are a station nearer to the entry, or a longer first interval")
    assert not (here / "t.toml").exists()


def test_a_scenario_may_be_named_as_its_file(here):
    assert new(name="s.toml").code == 0
    assert load_scenario("s.toml").name == "s"
    assert new(name="").errors == [
        "Error: name: '' is none; allowed is the name of a file, like a10"
    ]


def test_counts_by_lane_are_seen_again_on_their_lanes(here):
    (here / "road.toml").write_text(ROAD)
    by_lane = {("M", 0): (40, 60), ("M", 1): (55, 85), ("R", 0): (12, 20)}
    (here / "c.csv").write_text(
        "begin_s,end_s,detector,lane,class,vehicles\n"
        + "".join(
            f"{300 * k},{300 * k + 300},{d},{lane},{kind},{n}\n"
            for (d, lane), counts in by_lane.items()
            for k, total in enumerate(counts)
            for kind, n in (("car", total - total // 10), ("truck", total // 10))
        )
    )
    assert new("--road", "road.toml").code == 0
    scenario = load_scenario("s.toml")
    assert scenario.detector[0].station_m == -399.0  # nobody changes lanes before it
    found = detected(scenario, scenario.drivers["credible"], seed=77)
    keys = ["begin_s", "detector", "lane", "vehicle_class"]
    both = read_counts("c.csv").frame.join(found, on=keys)
    assert both.height == 12
    assert (both["vehicles"] - both["vehicles_right"]).abs().max() <= 1
    assert both["vehicles"].sum() == both["vehicles_right"].sum() == 272


def test_a_detector_of_its_own_on_each_lane(here):
    (here / "road.toml").write_text(ROAD)
    lines = [
        f"{300 * k},{d},{n + k}" for k in range(2) for d, n in (("A", 50), ("B", 70), ("R", 9))
    ]
    (here / "c.csv").write_text("\n".join(["begin_s,detector,vehicles", *lines]))
    given = (
        "new-scenario",
        "s",
        "--road",
        "road.toml",
        "--counts",
        "c.csv",
        "--ramp-detector",
        "R",
    )
    assert invoke(*given, "--mainline-detector", "A+B", "--detector", "A+B=-200").code == 0
    scenario = load_scenario("s.toml")
    found = [(p.lane, p.begin_s, p.vehicles) for p in scenario.demand if p.route == "mainline"]
    assert found == [(0, 0.0, 50), (1, 0.0, 70), (0, 300.0, 51), (1, 300.0, 71)]
    assert {p.station_m for p in scenario.demand if p.route == "mainline"} == {-200.0}
    assert scenario.detector[0].id == "A+B"
    told = invoke("new-scenario", "t", *given[2:], "--mainline-detector", "A+X")
    assert told.errors == [
        "Error: --mainline-detector: c.csv has no detector 'A+X'; allowed are A, B, R"
    ]


def test_lanes_that_were_not_counted(here):
    (here / "road.toml").write_text(ROAD)
    lines = [f"{300 * k},{d},0,9" for k in range(2) for d in "MR"]
    (here / "c.csv").write_text("\n".join(["begin_s,detector,lane,vehicles", *lines]))
    assert new("--road", "road.toml").errors == [
        (
            "Error: s.toml: counts.mainline: c.csv has lane 0 at M, and the mainline has 2 lanes; "
            "allowed are counts of each lane, or of all together"
        )
    ]


def test_detectors_beside_each_other_are_upstream_together(here):
    lines = [f"{300 * k},{d},{n}" for k in range(2) for d, n in (("A", 50), ("B", 70), ("D", 60))]
    (here / "c.csv").write_text("\n".join(["begin_s,detector,vehicles", *lines]))
    told = invoke("counts", "c.csv", "--upstream", "A+B", "--downstream", "D")
    assert told.errors == [
        (
            "Error: c.csv: row 4: up to 300 s D has 60 vehicles less than A and B upstream of it; "
            "allowed are up to 50 on the way"
        ),
        (
            "Error: c.csv: row 7: up to 600 s D has 60 vehicles less than A and B upstream of it; "
            "allowed are up to 50 on the way"
        ),
    ]
