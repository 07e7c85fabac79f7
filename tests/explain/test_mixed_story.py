"""The story of a vehicle of mixed traffic: what it did and why, from what was noted on board."""

import itertools
import json

import pytest

from coramp.explain.mixed_gaps import Drove
from coramp.explain.mixed_story import mixed_story_in
from coramp.records.run_folder import read_run
from coramp.road.streams import STREAMS
from tests.edges import invoke

RUN = ("run", "paper", "--strategy", "mixed-slots", "--mainline", "1800", "--ramp", "500")
SETTINGS = (
    *("traffic.automated_share=0.5", "safety.time_gap_s=0.5", "safety.standstill_gap_m=2"),
    *("reports.loss=0.3", "reports.burst_s=1", "commands.loss=0.3", "commands.burst_s=1"),
    *("actuators.lag_s=0.4", "traffic.connected_share=0.7", "incidents.breakdown_s=30"),
)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("told") / "run"
    settings = [word for setting in SETTINGS for word in ("--set", setting)]
    kept = ("--keep-messages", "--out", folder, "--seed", "3", "--horizon", "90")
    done = invoke(*RUN, *settings, *kept)
    assert done.code == 0, done.err
    assert f"coramp explain {folder} VEHICLE" in done.out
    return folder


def beside(run):
    """Returns what was noted of automated vehicles on the acceleration lane, past its start."""
    rows = run.on_board.filter(run.on_board["lane"] == "ramp", run.on_board["law"].is_not_null())
    return rows.filter(rows["station_m"] > 1.0).rows(named=True)


def test_a_lane_change_is_made_exactly_where_the_gaps_asked_for_are_there(folder):
    run = read_run(folder)
    drove, rows = Drove(run), beside(run)
    for row in rows:
        sides = [side for side in ("front", "rear") if row[f"{side}_vehicle_id"] is not None]
        there = all(row[f"{side}_gap_m"] >= drove.asked_m(row, side) - 0.01 for side in sides)
        assert there == row["changes_lane"], row
    assert sum(row["changes_lane"] for row in rows) > 3


def test_the_story_tells_what_was_assumed_known_and_done(folder):
    run = read_run(folder)
    told = {name: invoke("explain", folder, name) for name in run.vehicles["vehicle_id"].to_list()}
    assert {t.code for t in told.values()} == {0}
    every = "\n".join(t.out for t in told.values())
    for words in (
        "Whoever is ahead brakes at 6 m/s2 at most; it reacts after 0.3 s",
        "Behind an automated vehicle it keeps 2 m + 0.65 s",
        "A command acts 0.35 s late (dead time 0 s, lag 0.4 s)",
        "for 3 s at most; a command counts for 1.5 s",
        "makes room for r0",
        "falls in behind m0",
        "keeps its distance to ",
        "follows ",
        "slows down so that it could stop before the acceleration lane ends",
        "fallback, its command of ",
        "changes to the mainline behind m0",
        "a driver who is not connected; the coordinator does not know of him",
        "not known to the coordinator",
        "vehicle breaks down",
        "s ago, taken to be ",
        "a change asks for ",
    ):
        assert words in every, words


def test_every_decision_of_an_automated_vehicle_is_told_once_and_in_order(folder):
    run = read_run(folder)
    for name in run.vehicles.filter("automated")["vehicle_id"]:
        own = run.on_board.filter(vehicle_id=name)
        chapters = [c for c in mixed_story_in(run, name).chapters if c.known]
        assert chapters[0].from_s == own["time_s"].min()
        assert chapters[-1].until_s == pytest.approx(own["time_s"].max() + 0.2)
        for one, other in itertools.pairwise(chapters):
            assert one.until_s == pytest.approx(other.from_s)
        merges = own.filter("changes_lane").height
        assert sum("changes to the mainline" in c.text for c in chapters) == merges


def test_the_story_as_data_has_what_is_printed(folder):
    name = read_run(folder).vehicles.filter("automated", stream=STREAMS[1])["vehicle_id"][0]
    data = json.loads(invoke("explain", folder, name, "--json").out)
    assert data["kind"] == "story"
    assert data["vehicle"]["vehicle_id"] == name
    printed = invoke("explain", folder, name).out
    assert all(line in printed for line in data["assumed"])
    assert all(chapter["text"] in printed for chapter in data["chapters"])
