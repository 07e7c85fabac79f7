"""What the commands print and leave behind, as promised to whoever builds on it."""

import json
import shlex
import subprocess
import sys
import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
import polars as pl
import pytest
import sumo

import coramp.api
import coramp.studies.runner
from coramp import CorampError
from coramp.records.schemas import MEASURED
from coramp.runs.running import broken_promises
from coramp.scenarios.model import Scenario
from tests.edges import SMALL_STUDY, edited, everything_below, invoke

VEHICLES = [
    "vehicle_id",
    "stream",
    "scheduled_s",
    "entry_s",
    "exit_s",
    "waiting_s",
    "travel_s",
    "free_flow_s",
    "delay_s",
    "mean_speed_mps",
    "fuel_l",
    "finished",
]
TRAJECTORIES = [
    "vehicle_id",
    "lane",
    "time_s",
    "station_m",
    "speed_mps",
    "accel_mps2",
]
DECISIONS = [
    "time_s",
    "vehicle_id",
    "rung",
    "scenario",
    "conflict_vehicle_id",
    "severity_before",
    "severity_after",
    "front_vehicle_id",
    "rear_vehicle_id",
    "gap_m",
    "required_gap_m",
    "accel_mps2",
    "merge_time_s",
    "merge_station_m",
    "adjusted_vehicle_ids",
    "largest_shift_m",
    "min_margin_m",
]
SPEEDS = [
    "stream",
    "time_s",
    "mean_speed_mps",
    "vehicles",
]
RUNS = [
    "run_id",
    "scenario",
    "drivers",
    "strategy",
    "engine",
    "mainline_veh_h",
    "ramp_veh_h",
    "seed",
    "status",
    "error",
    "vehicles_mainline",
    "vehicles_ramp",
    "unserved",
    "mainline_delay_s",
    "ramp_delay_s",
    "mainline_delay_p95_s",
    "ramp_delay_p95_s",
    "mainline_speed_mps",
    "ramp_speed_mps",
    "mainline_speed_std_mps",
    "ramp_speed_std_mps",
    "fuel_l",
    "collisions",
    "safety_violations",
    "min_margin_m",
    "min_ttc_s",
    "max_drac_mps2",
    "max_severity",
    "max_decel_mps2",
    "plan_error_m",
    "adjusted_vehicles",
    "rung_free",
    "rung_reach",
    "rung_create",
    "rung_delay",
    "rung_hold",
    "wall_s",
]
SUMO_FILES = [
    "collisions.xml",
    "command.txt",
    "fcd.parquet",
    "net.net.xml",
    "routes.rou.xml",
    "tripinfo.xml",
]
TABLES = {
    "vehicles": VEHICLES,
    "trajectories": TRAJECTORIES,
    "decisions": DECISIONS,
    "speeds": SPEEDS,
}
RUN = ("run", "paper", "--horizon", "60", "--seed", "3")
STUDY = edited(
    SMALL_STUDY,
    {
        "[[runs]]": (
            '[[runs]]\nstrategies = ["uncontrolled"]\ndrivers = ["paper", "fair"]\n'
            "flows_veh_h = [[800.0, 500.0], [600.0, 300.0]]\n\n[[runs]]"
        )
    },
)


class Made:
    """A folder that a command has made, and what the command printed."""

    def __init__(self, folder, *arguments):
        self.folder = folder
        self.told = invoke(*arguments, "--out", folder)
        assert self.told.code == 0, self.told.err

    def table(self, name):
        return pl.read_parquet(self.folder / f"{name}.parquet")

    @property
    def content(self):
        return json.loads((self.folder / "run.json").read_text())


@pytest.fixture(scope="module")
def kept(tmp_path_factory):
    return Made(tmp_path_factory.mktemp("kept") / "r", *RUN, "--keep-sumo", "--json")


@pytest.fixture(scope="module")
def uncontrolled(tmp_path_factory):
    folder = tmp_path_factory.mktemp("uncontrolled") / "r"
    return Made(folder, *RUN, "-s", "uncontrolled", "--keep-sumo")


@pytest.fixture(scope="module")
def studied(tmp_path_factory):
    folder = tmp_path_factory.mktemp("studied")
    (folder / "s.toml").write_text(STUDY)
    return Made(folder / "o", "study", folder / "s.toml", "--jobs", "1")


UNCONTROLLED_FILES = [
    "positions.parquet",
    "run.json",
    "speeds.parquet",
    "vehicles.parquet",
    "violations.parquet",
]


def test_a_run_leaves_exactly_what_is_promised(kept, uncontrolled):
    sumo_files = ["sumo", *(f"sumo/{name}" for name in SUMO_FILES)]
    tables = [f"{name}.parquet" for name in TABLES]
    assert everything_below(kept.folder) == sorted(
        ["run.json", "attempts.parquet", "violations.parquet", *tables, *sumo_files]
    )
    assert everything_below(uncontrolled.folder) == sorted([*UNCONTROLLED_FILES, *sumo_files])


def test_tables_have_the_promised_columns(kept, uncontrolled):
    for name, columns in TABLES.items():
        assert kept.table(name).columns[: len(columns)] == columns
    for name in ("vehicles", "speeds"):
        assert uncontrolled.table(name).schema == kept.table(name).schema


def test_vehicles_are_named_by_scheduled_time(kept):
    vehicles = kept.table("vehicles")
    assert set(vehicles["stream"]) == {"mainline", "ramp"}
    for stream, letter in (("mainline", "m"), ("ramp", "r")):
        of_stream = vehicles.filter(stream=stream).sort("scheduled_s")
        names = [f"{letter}{k:05d}" for k in range(1, of_stream.height + 1)]
        assert of_stream["vehicle_id"].to_list() == names


def test_times_of_a_vehicle_add_up(kept, uncontrolled):
    for made in (kept, uncontrolled):
        vehicles = made.table("vehicles")
        assert vehicles["finished"].all()
        sums = vehicles.select(
            waiting=pl.col("entry_s") - pl.col("scheduled_s") - pl.col("waiting_s"),
            travel=pl.col("exit_s") - pl.col("entry_s") - pl.col("travel_s"),
            delay=pl.col("waiting_s")
            + pl.col("travel_s")
            - pl.col("free_flow_s")
            - pl.col("delay_s"),
            speed=800.0 / pl.col("travel_s") - pl.col("mean_speed_mps"),
        )
        assert np.abs(sums.to_numpy()).max() < 1e-9
        assert vehicles["waiting_s"].min() >= -1e-9


def test_trajectories_are_pieces_that_join(kept):
    vehicles = {row["vehicle_id"]: row for row in kept.table("vehicles").iter_rows(named=True)}
    pieces = kept.table("trajectories")
    assert set(pieces["vehicle_id"]) == set(vehicles)
    assert set(pieces["lane"]) == {"ramp", "acceleration", "mainline"}
    for (name,), own in pieces.group_by(["vehicle_id"], maintain_order=True):
        rows = own.select("time_s", "station_m", "speed_mps", "accel_mps2").to_numpy()
        step = np.diff(rows[:, 0])
        assert (step > 0.0).all()
        end_m = rows[:-1, 1] + rows[:-1, 2] * step + 0.5 * rows[:-1, 3] * step**2
        end_mps = rows[:-1, 2] + rows[:-1, 3] * step
        np.testing.assert_allclose(rows[1:, 1], end_m, atol=1e-6)
        np.testing.assert_allclose(rows[1:, 2], end_mps, atol=1e-6)
        assert rows[0, 0] == vehicles[name]["entry_s"]
        assert rows[0, 1] == -400.0
        left_s = vehicles[name]["exit_s"] - rows[-1, 0]
        last_m = rows[-1, 1] + rows[-1, 2] * left_s + 0.5 * rows[-1, 3] * left_s**2
        assert last_m == pytest.approx(400.0, abs=1e-6)


def test_decisions_name_vehicles_and_fit_the_trajectories(kept):
    names = set(kept.table("vehicles")["vehicle_id"])
    decisions, pieces = kept.table("decisions"), kept.table("trajectories")
    assert set(decisions["rung"]) <= {"free", "reach", "create", "delay", "hold"}
    ramp = {name for name in names if name.startswith("r")}
    assert set(decisions["vehicle_id"]) == ramp
    for column in ("conflict_vehicle_id", "front_vehicle_id", "rear_vehicle_id"):
        assert set(decisions[column].drop_nulls()) <= names
    for row in decisions.filter(pl.col("rung") != "hold").iter_rows(named=True):
        merged = pieces.filter(vehicle_id=row["vehicle_id"], lane="mainline").row(0, named=True)
        assert merged["time_s"] == pytest.approx(row["merge_time_s"], abs=1e-9)
        assert merged["station_m"] == pytest.approx(row["merge_station_m"], abs=1e-6)
        assert row["min_margin_m"] >= -1e-9


def test_speeds_come_in_bins_of_a_second(kept):
    speeds = kept.table("speeds")
    assert set(speeds["stream"]) == {"mainline", "ramp"}
    for stream in ("mainline", "ramp"):
        times_s = speeds.filter(stream=stream)["time_s"].to_numpy()
        assert (times_s == np.floor(times_s)).all()
        assert (np.diff(times_s) >= 1.0).all()
    assert speeds["vehicles"].min() >= 1
    assert 0.0 < speeds["mean_speed_mps"].min() <= speeds["mean_speed_mps"].max() <= 22.0


def test_json_is_what_the_file_holds(kept):
    assert json.loads(kept.told.out) == kept.content
    assert kept.told.err == ""


def test_the_description_of_a_run_is_enough_to_repeat_it(kept):
    content = kept.content
    assert content["kind"] == "run"
    assert {"coramp", "libsumo", "eclipse-sumo", "python"} <= set(content["versions"])
    assert content["versions"]["python"] == ".".join(map(str, sys.version_info[:3]))
    specification = content["specification"]
    scenario = Scenario.model_validate(specification, strict=False)
    assert scenario.model_dump(mode="json") == specification
    assert (content["strategy"], content["engine"], content["seed"]) == (
        "mainline-priority",
        "sumo",
        3,
    )
    assert specification["simulation"]["horizon_s"] == 60.0
    assert content["summary"]["run_id"] == content["run_id"]
    assert set(RUNS) <= set(content["summary"])


def test_the_same_command_leaves_the_same_records(kept, tmp_path):
    again = Made(tmp_path / "r", *RUN)
    for name in TABLES:
        assert again.table(name).equals(kept.table(name))
    one, other = kept.content, again.content
    for name in MEASURED:
        assert one["summary"].pop(name) > 0.0
        assert other["summary"].pop(name) > 0.0
    assert one == other


def test_a_second_run_takes_the_place_of_the_first(tmp_path):
    short = ("--horizon", "5")
    Made(tmp_path / "r", "run", "paper", *short, "--keep-sumo")
    second = Made(tmp_path / "r", "run", "paper", *short, "-s", "uncontrolled")
    assert everything_below(second.folder) == UNCONTROLLED_FILES
    assert everything_below(tmp_path) == [
        "r",
        *(f"r/{n}" for n in everything_below(tmp_path / "r")),
    ]


def test_the_road_has_the_promised_edges(kept):
    root = ET.parse(kept.folder / "sumo" / "net.net.xml").getroot()
    lanes = {
        lane.get("id"): float(lane.get("length"))
        for edge in root.iter("edge")
        if edge.get("function") != "internal"
        for lane in edge.iter("lane")
    }
    assert lanes == {
        "mainline_0": pytest.approx(400.0, abs=0.01),
        "ramp_0": pytest.approx(400.0, abs=0.01),
        "merge_0": pytest.approx(200.0, abs=0.01),
        "merge_1": pytest.approx(200.0, abs=0.01),
        "downstream_0": pytest.approx(200.0, abs=0.01),
    }


def test_all_vehicles_are_in_sumos_files(kept, uncontrolled):
    for made in (kept, uncontrolled):
        names = set(made.table("vehicles")["vehicle_id"])
        seen = pl.read_parquet(made.folder / "sumo" / "fcd.parquet")["vehicle_id"].drop_nulls()
        assert set(seen) == names
        trips = ET.parse(made.folder / "sumo" / "tripinfo.xml").getroot().iter("tripinfo")
        assert {trip.get("id") for trip in trips} == names
        routes = ET.parse(made.folder / "sumo" / "routes.rou.xml").getroot().iter("vehicle")
        assert [route.get("id") for route in routes] == made.table("vehicles")[
            "vehicle_id"
        ].to_list()


def plain_sumo(folder, trips):
    words = shlex.split((folder / "sumo" / "command.txt").read_text())
    assert words[0] == "sumo"
    program = Path(sumo.SUMO_HOME) / "bin" / "sumo"
    subprocess.run(
        [program, *words[1:], "--tripinfo-output", trips],
        cwd=folder / "sumo",
        check=True,
        capture_output=True,
        timeout=300,
    )
    return {
        trip.get("id"): (float(trip.get("depart")), float(trip.get("arrival")))
        for trip in ET.parse(trips).getroot().iter("tripinfo")
    }


def test_plain_sumo_repeats_an_uncontrolled_run(uncontrolled, tmp_path):
    trips = plain_sumo(uncontrolled.folder, tmp_path / "trips.xml")
    kept_trips = ET.parse(uncontrolled.folder / "sumo" / "tripinfo.xml").getroot()
    ours = {
        trip.get("id"): (float(trip.get("depart")), float(trip.get("arrival")))
        for trip in kept_trips.iter("tripinfo")
    }
    assert set(trips) == set(ours)
    assert all(trips[name] == pytest.approx(times, abs=0.011) for name, times in ours.items())


def test_plain_sumo_runs_the_demand_of_a_cooperative_run(kept, tmp_path):
    trips = plain_sumo(kept.folder, tmp_path / "trips.xml")
    assert set(trips) == set(kept.table("vehicles")["vehicle_id"])


def test_tables_go_to_stdout_and_nothing_else_does(uncontrolled):
    told = uncontrolled.told
    assert told.err == ""
    assert "mainline delay (s)" in told.out
    assert "paper: uncontrolled, fair drivers, 1800 + 500 veh/h, seed 3" in told.out
    assert f"Records are in {uncontrolled.folder}" in told.out


ABOVE = ("run", "paper", "--engine", "exact", "--mainline", "2000", "--ramp", "700")
GAPS = ("--set", "safety.time_gap_s=1.0", "--set", "safety.standstill_gap_m=2.5")


def test_demand_above_the_lanes_limit_is_said_beforehand():
    told = invoke(*ABOVE, *GAPS, "--horizon", "30")
    line = (
        "Note: 2,700 veh/h arrive, and the lane carries 2,605 at most (time gap 1 s, standstill "
        "gap 2.5 m): queues will grow\n"
    )
    assert told.err == line
    assert "2605" in told.out
    as_json = invoke(*ABOVE, *GAPS, "--horizon", "30", "--json")
    assert as_json.err == line
    assert json.loads(as_json.out)["summary"]["lane_limit_veh_h"] == pytest.approx(2604.92)


@pytest.mark.parametrize(
    "arguments",
    [
        (*ABOVE, "--set", "safety.time_gap_s=1.0"),  # 2,864 veh/h
        ("run", "paper", "-s", "uncontrolled", "--mainline", "2000", "--ramp", "700"),
    ],
)
def test_demand_is_not_spoken_of_below_the_limit_or_with_drivers(arguments):
    assert invoke(*arguments, "--horizon", "10").err == ""


def test_a_study_says_once_that_demand_is_above_the_limit(tmp_path):
    path = tmp_path / "s.toml"
    path.write_text(SMALL_STUDY + 'set = { "safety.time_gap_s" = [0.0, 3.0, 4.0] }\n')
    told = invoke("study", str(path), "--engine", "exact", "--out", str(tmp_path / "out"))
    (line,) = [line for line in told.err.splitlines() if "lane" in line]
    assert line == (
        "Note: in 2 of 3 runs more vehicles arrive than one lane can carry, so that queues grow; "
        "in the first of them 1,300 veh/h arrive, and the lane carries 1,105 at most (time gap 3 s)"
    )


def test_what_is_printed_is_what_was_measured(kept):
    told = invoke(*RUN)
    summary = kept.content["summary"]
    (line,) = [line for line in told.out.splitlines() if "mainline delay" in line]
    assert f"{summary['mainline_delay_s']:.2f}, {summary['mainline_delay_p95_s']:.2f}" in line
    (line,) = [line for line in told.out.splitlines() if "by rung" in line]
    assert f"free {summary['rung_free']}, reach {summary['rung_reach']}," in line


def test_a_study_leaves_exactly_what_is_promised(studied):
    runs = studied.table("runs")
    parts = [f"parts/{run_id}.json" for run_id in runs["run_id"]]
    found = everything_below(studied.folder)
    shown = [name for name in found if name.startswith("shown/")]
    assert [name for name in found if name not in shown] == sorted(
        ["parts", *parts, "runs.parquet", "shown", "streams.parquet", "study.json", "tables.md"]
    )
    assert {name.split("/")[1] for name in shown} <= set(runs["run_id"])
    assert set(RUNS) <= set(runs.columns)
    order = [column for column in runs.columns if column in RUNS]
    assert order == RUNS
    streams = studied.table("streams")
    assert streams.columns[:2] == ["run_id", "stream"]
    assert streams["run_id"].to_list() == [i for i in runs["run_id"] for _ in range(2)]
    assert streams["stream"].to_list() == ["mainline", "ramp"] * runs.height


def test_runs_of_a_study_are_sorted_by_their_keys(studied):
    runs = studied.table("runs")
    keys = ["scenario", "drivers", "strategy", "engine", "mainline_veh_h", "ramp_veh_h", "seed"]
    assert runs.height == 5
    assert runs.sort(keys, nulls_last=False).equals(runs)
    assert runs["drivers"].to_list() == [None, "fair", "fair", "paper", "paper"]
    assert set(runs["status"]) == {"ok"}
    assert runs["error"].null_count() == runs.height


def test_streams_of_a_study_say_what_its_runs_say(studied):
    runs, streams = studied.table("runs"), studied.table("streams")
    for run in runs.iter_rows(named=True):
        for stream in ("mainline", "ramp"):
            (row,) = streams.filter(run_id=run["run_id"], stream=stream).iter_rows(named=True)
            assert row["flow_veh_h"] == run[f"{stream}_veh_h"]
            assert row["vehicles"] == run[f"vehicles_{stream}"]
            assert row["delay_s"] == run[f"{stream}_delay_s"]
            assert row["speed_std_mps"] == run[f"{stream}_speed_std_mps"]


def test_a_study_prints_tables_and_tells_progress_apart(studied):
    told = studied.told
    assert "All runs" in told.out
    assert "Promises" in told.out
    assert "of 5 runs" not in told.out
    assert "5 of 5 runs" in told.err
    text = (studied.folder / "tables.md").read_text()
    assert text.startswith("# Study small\n")
    assert "## All runs" in text
    assert "## Promises" in text


def test_a_finished_study_prints_the_same_again_as_json_too(studied):
    definition = studied.folder.parent / "s.toml"
    again = invoke("study", definition, "--jobs", "1", "--out", studied.folder)
    assert again.code == 0
    assert again.out == studied.told.out
    assert "5 of 5 runs are there already" in again.err
    machine = invoke("study", definition, "--jobs", "1", "--out", studied.folder, "--json")
    data = json.loads(machine.out)
    assert data["runs"] == studied.table("runs").to_dicts()
    assert [table["title"] for table in data["tables"]] == ["All runs", "Promises"]


def row(**changes):
    whole = {
        "status": "ok",
        "drivers": None,
        "collisions": 0,
        "safety_violations": 0,
        "plan_error_m": 0.05,
    }
    return {**whole, **changes}


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({}, []),
        ({"plan_error_m": None}, []),
        ({"collisions": 2}, ["2 collisions in SUMO"]),
        ({"safety_violations": 1}, ["1 pairs nearer than the safe distance"]),
        ({"plan_error_m": 0.0511}, ["driven 0.051 m off plan"]),
        (
            {"collisions": 1, "plan_error_m": 1.0},
            ["1 collisions in SUMO", "driven 1.000 m off plan"],
        ),
        ({"collisions": 2, "drivers": "fair"}, []),
        ({"collisions": None, "safety_violations": None, "status": "failed"}, []),
    ],
)
def test_a_promise_is_broken_by_collisions_nearness_and_departing_from_the_plan(changes, told):
    assert broken_promises(row(**changes)) == told


def unsafe(execute):
    def run(*arguments):
        tables, summary = execute(*arguments)
        return tables, {**summary, "collisions": 2}

    return run


def test_an_unsafe_run_exits_with_3_and_still_leaves_its_records(tmp_path, monkeypatch):
    monkeypatch.setattr(coramp.runs.running, "execute", unsafe(coramp.runs.running.execute))
    short = ("run", "paper", "--horizon", "5", "--out", tmp_path / "r")
    told = invoke(*short)
    assert told.code == 3
    assert told.err == "Unsafe: 2 collisions in SUMO\n"
    assert "mainline delay" in told.out
    assert json.loads((tmp_path / "r" / "run.json").read_text())["summary"]["collisions"] == 2
    machine = invoke(*short, "--json")
    assert machine.code == 3
    assert json.loads(machine.out)["summary"]["collisions"] == 2
    assert invoke(*short, "-s", "uncontrolled").code == 0


@pytest.mark.parametrize(("collide", "code"), [(True, 3), (False, 1)])
def test_an_unsafe_run_of_a_study_counts_more_than_a_failed_one(
    tmp_path, monkeypatch, collide, code
):
    execute = coramp.studies.runner.execute

    def run(spec):
        if spec.strategy == "uncontrolled":
            raise CorampError("SUMO: out of petrol")
        return unsafe(execute)(spec) if collide else execute(spec)

    monkeypatch.setattr(coramp.studies.runner, "execute", run)
    (tmp_path / "s.toml").write_text(STUDY)
    told = invoke("study", tmp_path / "s.toml", "--jobs", "1", "--out", tmp_path / "o")
    assert told.code == code
    runs = pl.read_parquet(tmp_path / "o" / "runs.parquet")
    assert runs["status"].to_list() == ["ok", "failed", "failed", "failed", "failed"]
    assert set(runs["error"].drop_nulls()) == {"SUMO: out of petrol"}
    if collide:
        unsafe_line = "Unsafe: mainline-priority, 800 + 500 veh/h, seed 1: 2 collisions in SUMO"
        assert unsafe_line in told.errors
    else:
        assert told.errors[-1].startswith("Error: 4 runs failed; see the error column of ")
        assert "Unsafe" not in told.err


@pytest.mark.parametrize(
    ("name", "magic"), [("p.png", b"\x89PNG\r\n"), ("p.svg", b"<?xml"), ("p.pdf", b"%PDF-")]
)
def test_a_plan_is_drawn(tmp_path, name, magic):
    told = invoke("plan", "example", "--plot", tmp_path / name)
    assert (told.code, told.err) == (0, "")
    content = (tmp_path / name).read_bytes()
    assert content.startswith(magic)
    assert len(content) > 5000
    if name.endswith("svg"):
        text = content.decode()
        assert ET.fromstring(text).tag.endswith("svg")
        for word in ("time (s)", "acceleration lane", "m4", "r1"):
            assert word in text
    assert everything_below(tmp_path) == [name]


def test_a_plan_is_told_and_given_as_json():
    plain, machine = invoke("plan", "example"), invoke("plan", "example", "--json")
    assert (plain.code, plain.err, machine.code, machine.err) == (0, "", 0, "")
    data = json.loads(machine.out)
    assert (data["kind"], data["snapshot"], data["strategy"]) == (
        "plan",
        "example",
        "mainline-priority",
    )
    (decision,) = data["decisions"]
    assert (decision["front_vehicle_id"], decision["rear_vehicle_id"]) == ("m4", "m5")
    assert "between m4 and m5" in plain.out
    for quantity in decision["quantities"]:
        assert quantity["meaning"] in plain.out
    equations = {part for q in decision["quantities"] for part in q["equation"].split(", ")}
    assert {"1", "4", "15", "16", "17", "18", "20", "22", "24", "30", "31"} <= equations
    assert {piece["vehicle_id"] for piece in data["trajectories"]} == {
        *(f"m{k}" for k in range(1, 8)),
        "r1",
    }


def test_every_vehicle_of_a_run_can_be_explained(kept):
    vehicles = kept.table("vehicles")
    chosen = [*vehicles["vehicle_id"][:3], *vehicles.filter(stream="ramp")["vehicle_id"]]
    for name in chosen:
        told = invoke("explain", kept.folder, name)
        assert (told.code, told.err) == (0, "")
        assert told.out.startswith(f"{name} (")
        assert "leaves; delay" in told.out
        assert ("decision at" in told.out) == name.startswith("r")


def test_an_explanation_is_given_as_json(kept):
    told = invoke("explain", kept.folder, "r00001", "--json")
    data = json.loads(told.out)
    assert data["kind"] == "story"
    assert data["vehicle"]["vehicle_id"] == "r00001"
    assert data["run"]["run_id"] == kept.content["run_id"]
    decided = kept.table("decisions").filter(vehicle_id="r00001")
    assert len(data["decisions"]) == decided.height
    assert data["decisions"][-1]["merge_time_s"] == decided["merge_time_s"][-1]
    assert data["decisions"][-1]["quantities"]


@pytest.mark.parametrize(
    "arguments",
    [
        (),
        ("run",),
        ("study",),
        ("plan",),
        ("explain",),
        ("figures",),
        ("scenarios",),
        ("strategies",),
    ],
)
def test_help_is_printed_and_has_an_example(arguments):
    told = invoke(*arguments, "--help")
    assert (told.code, told.err) == (0, "")
    assert told.out.startswith("Usage: ")
    assert "Example: coramp " in told.out
    assert invoke(*arguments, "-h").out == told.out


@pytest.mark.parametrize(
    ("arguments", "light"),
    [
        (["--help"], {"pydantic"}),
        (["run", "--help"], set()),  # for options typer itself asks pydantic
        (["study", "--help"], set()),
    ],
)
def test_help_is_quick_because_it_imports_nothing_heavy(arguments, light):
    heavy = {"numba", "numpy", "polars", "scipy", "libsumo", "matplotlib", "rich.table", *light}
    code = (
        "import sys\n"
        "from coramp.cli.entry import main\n"
        "try:\n"
        f"    main({arguments!r})\n"
        "finally:\n"
        f"    print('loaded', sorted({heavy!r} & set(sys.modules)))\n"
    )
    result = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=False, timeout=300
    )
    assert result.returncode == 0, result.stderr
    assert result.stdout.startswith("Usage: ")
    assert result.stdout.endswith("loaded []\n")


def test_the_installed_command_answers(tmp_path):
    command = Path(sys.executable).with_name("coramp")

    def call(*arguments):
        return subprocess.run(
            [command, *arguments],
            cwd=tmp_path,
            capture_output=True,
            text=True,
            check=False,
            timeout=300,
        )

    helped = call("--help")
    assert (helped.returncode, helped.stderr) == (0, "")
    assert helped.stdout.startswith("Usage: coramp ")
    run = call("run", "paper", "--horizon", "5", "--out", "r", "--json")
    assert (run.returncode, run.stderr) == (0, "")
    assert json.loads(run.stdout) == json.loads((tmp_path / "r" / "run.json").read_text())
