"""Explanations are read from the records of a run: what was tried, and the numbers behind it."""

import json
import shutil

import numpy as np
import polars as pl
import pytest

from coramp.checker.reasons import REASONS, TOO_HARD, TOO_NEAR, TOO_NEAR_AT_MERGE
from coramp.coordination.coordinator import Coordinator
from coramp.coordination.plant import Arrival
from coramp.equations.printed import EQUATIONS
from coramp.explain import words
from coramp.explain.case import chosen_of
from coramp.explain.story import story_in, tried_in
from coramp.messages.feed import RequestFeed
from coramp.metrics.attempts import REFUSED_BY_CHECKER, attempts_table
from coramp.records.run_folder import read_run
from coramp.records.schemas import ATTEMPTS
from coramp.report.page.shown import page_data
from coramp.scenarios.loading import load_scenario
from coramp.strategies import attempts as a
from coramp.strategies.registry import strategy_named
from coramp.vehicles import trace as t
from tests.edges import invoke
from tests.situations import named

RUN = ("run", "paper", "--engine", "exact", "--mainline", "1800", "--ramp", "700")
TRUCKS = 'vehicle=[{name="car", share=0.6}, {name="truck", share=0.4}]'
SETTINGS = {
    "time-gap": ("--set", "safety.time_gap_s=1.4"),
    "nose": ("--set", "control.gap_creation_start=nose", "-s", "ramp-priority"),
    "slots": ("-s", "slots"),
    "fifo": ("-s", "fifo-optimal-control"),
    "trucks": ("--set", TRUCKS),
}


@pytest.fixture(scope="module")
def folders(tmp_path_factory):
    """Returns a folder with a run of each of the settings."""
    root = tmp_path_factory.mktemp("runs")
    for name, settings in SETTINGS.items():
        done = invoke(*RUN, "--horizon", "60", *settings, "--out", root / name)
        assert done.code == 0
    return root


def ramp_vehicles(folder):
    decisions = pl.read_parquet(folder / "decisions.parquet")
    return decisions["vehicle_id"].unique(maintain_order=True).to_list()


@pytest.mark.parametrize("name", SETTINGS)
def test_every_attempt_of_a_decision_is_in_a_line(folders, name):
    run = read_run(folders / name)
    for vehicle_id in ramp_vehicles(folders / name):
        story = story_in(run, vehicle_id)
        told = invoke("explain", folders / name, vehicle_id)
        assert (told.code, told.err) == (0, "")
        for chapter in story.chapters:
            attempts = run.attempts.filter(vehicle_id=vehicle_id, time_s=chapter.decision["time_s"])
            assert numbers_in(chapter.tried) == attempts["attempt"].to_list()
            chosen = [line for line in chapter.tried if ": chosen" in line]
            assert len(chosen) == (chapter.decision["rung"] != "hold")
            for line in chapter.tried:
                assert f"  {line}\n" in told.out


def numbers_in(lines):
    """Returns the numbers of the attempts that the lines tell, in order."""
    found = []
    for line in lines:
        for part in line.partition(". ")[0].split(", "):
            first, _, last = part.partition(" to ")
            found += range(int(first), int(last or first) + 1)
    return sorted(found)


def test_the_equations_are_shown_as_printed(folders):
    folder = folders / "time-gap"
    told = invoke("explain", folder, "r00001")
    data = json.loads(invoke("explain", folder, "r00001", "--json").out)
    used = set()
    for decision in data["decisions"]:
        for quantity in decision["quantities"]:
            parts = [int(number) for number in quantity["equation"].split(", ") if number]
            assert len(quantity["printed"]) == len(parts)
            for number, text in zip(parts, quantity["printed"], strict=True):
                assert text.startswith(EQUATIONS[number].printed)
            used |= set(parts)
    assert {1, 15, 17, 18, 22, 24} <= used
    for number in used:
        assert f"  Eq. {number}: {EQUATIONS[number].printed}" in told.out


NOT_NEEDED = {
    ("control", "actuation_delay_s"): 0.2,
    ("control", "retry_s"): 3.0,
    ("control", "gap_creation_start"): "decision",
    ("motion", "free_acceleration_mps2"): 1.0,
    ("motion", "comfort_mps2"): 2.0,
    ("motion", "speed_deviation"): 0.0,
    ("ramp", "decision_station_m"): -190.0,
    ("mainline", "flow_veh_h"): 1.0,
    ("safety", "execution_allowance_m"): 0.5,
}


@pytest.mark.parametrize("name", ["time-gap", "nose", "slots", "fifo"])
def test_nothing_is_planned_again(folders, tmp_path, name):
    """What the scenario says of how to plan makes no difference to what is told."""
    folder = tmp_path / "r"
    shutil.copytree(folders / name, folder)
    vehicles = ramp_vehicles(folder)
    before = [invoke("explain", folder, vehicle) for vehicle in vehicles]
    content = json.loads((folder / "run.json").read_text())
    for (section, key), value in NOT_NEEDED.items():
        assert content["specification"][section][key] != value or key == "gap_creation_start"
        content["specification"][section][key] = value
    (folder / "run.json").write_text(json.dumps(content))
    assert [invoke("explain", folder, vehicle) for vehicle in vehicles] == before


def test_the_numbers_are_those_of_the_attempt_that_was_chosen(folders):
    run = read_run(folders / "nose")
    made = run.decisions.filter(rung="create").row(0, named=True)
    story = story_in(run, made["vehicle_id"])
    chapter = next(c for c in story.chapters if c.decision["time_s"] == made["time_s"])
    chosen = chosen_of(run.attempts_of[made["vehicle_id"], made["time_s"]])
    values = {(q.equation, q.symbol): q.value for q in chapter.quantities}
    window_s = made["merge_time_s"] - chosen["moves_from_s"]
    assert chosen["moves_from_s"] == pytest.approx(chosen["nose_time_s"])
    assert values["", "T"] == pytest.approx(window_s)
    shift_m = chosen["ahead_m"] or -chosen["back_m"]
    assert values["42", "a_acc"] == pytest.approx(4.0 * shift_m / window_s**2)
    severities = {q.meaning: q.value for q in chapter.quantities if q.symbol == "J"}
    assert severities["severity, as planned"] == made["severity_after"]
    assert severities["severity, free movement"] == made["severity_before"]


def test_a_run_of_before_says_in_one_line_that_nothing_was_kept(folders, tmp_path):
    folder = tmp_path / "r"
    shutil.copytree(folders / "time-gap", folder)
    (folder / "attempts.parquet").unlink()
    told = invoke("explain", folder, "r00001")
    assert (told.code, told.err) == (0, "")
    assert told.out.count(words.NOT_KEPT) == told.out.count("tried at")
    assert "Eq." not in told.out
    run = read_run(folder)
    decision = run.decisions.row(0, named=True)
    assert tried_in(run, decision) == [words.NOT_KEPT]
    for command in ("report", "replay"):
        assert invoke(command, folder).code == 0


def test_an_attempts_table_that_was_edited_is_refused(folders, tmp_path):
    folder = tmp_path / "r"
    shutil.copytree(folders / "time-gap", folder)
    frame = pl.read_parquet(folder / "attempts.parquet")
    frame.drop("missing_m").write_parquet(folder / "attempts.parquet")
    told = invoke("explain", folder, "r00001")
    assert (told.code, told.out) == (1, "")
    (line,) = told.errors
    assert "attempts.parquet: has no column missing_m" in line


def test_pages_are_given_the_lines(folders):
    run = read_run(folders / "time-gap")
    told = [decision["tried"] for decision in page_data(run)["decisions"]]
    assert told == [tried_in(run, row) for row in run.decisions.iter_rows(named=True)]
    assert all(told)


def loop_of(bounds, *arrivals, until=600):
    """Runs arrivals (stream, time, speed) past a checker with other bounds than planners use."""
    listed = [Arrival("", s == "r", round(at_s / 0.1), v, 5.0) for s, at_s, v in arrivals]
    loop = Coordinator(
        strategy_named("ramp-priority")(),
        load_scenario("paper").rules(),
        RequestFeed(named(listed)),
        20.0,
    )
    examiner = loop._commitments.examiner
    examiner.bounds = examiner.bounds._replace(**bounds)
    loop.expect_arrivals()
    loop.run(until)
    return loop


def table_of(loop, count):
    names = [f"v{k}" for k in range(count)]
    return attempts_table(loop.decisions, loop.refusals, names, np.arange(count))


def test_what_the_checker_refuses_ends_its_attempts_once():
    # the checker allows a ramp vehicle only 1 m/s2, the plan takes 2
    loop = loop_of({"ramp_acceleration_mps2": 1.0}, ("r", 0.0, 16.0))
    assert len(loop.refusals) > 5
    assert loop.decisions == []
    (row,) = table_of(loop, 1).rows(named=True)
    assert (row["vehicle_id"], row["attempt"], row["rung"]) == ("v0", 1, "free")
    assert (row["reason"], row["checker_reason"]) == (REFUSED_BY_CHECKER, REASONS[TOO_HARD])
    assert row["merge_station_m"] > 0.0


def test_what_is_too_near_for_the_checker_is_named():
    # the ramp vehicle merges at 36 m after 27 s, 12 m ahead of one that comes by 5.8 s later
    arrivals = (("r", 0.0, 16.0), ("m", 5.8, 20.0))
    loop = loop_of({"allowance_m": 30.0}, *arrivals, until=260)
    row = table_of(loop, 2).row(0, named=True)
    assert (row["vehicle_id"], row["other_vehicle_id"]) == ("v0", "v1")
    assert row["checker_reason"] in (REASONS[TOO_NEAR], REASONS[TOO_NEAR_AT_MERGE])
    assert words.reason_in_words(row).startswith(f"{REFUSED_BY_CHECKER}: comes nearer than")


def attempt(number, rung="reach", scenario=None, reason=a.CHOSEN, **others):
    nothing = dict.fromkeys(ATTEMPTS)
    return {
        **nothing,
        "attempt": number,
        "rung": rung,
        "scenario": scenario,
        "reason": reason,
        "rear_vehicle_id": f"m{number}",
        **others,
    }


def test_many_attempts_that_fail_for_one_reason_share_a_line():
    small = a.REASONS[t.GAP_TOO_SMALL]
    missing = (2.0, 1.0, 3.0, 0.4, 3.2, 1.1)
    rows = [attempt(k + 1, reason=small, missing_m=m) for k, m in enumerate(missing)]
    rows.insert(4, attempt(9, reason=a.REASONS[t.TOO_NEAR], other_vehicle_id="m7", missing_m=0.25))
    for number, row in enumerate(rows, start=1):
        row["attempt"] = number
    assert words.tried_lines([*rows, attempt(8, "create", 1)]) == [
        "1. another acceleration ahead of m1: the gap is too small by 2.00 m",
        "2. another acceleration ahead of m2: the gap is too small by 1.00 m",
        "3. another acceleration ahead of m3: the gap is too small by 3.00 m",
        "4, 6 to 7. another acceleration, 3 further gaps: the gap is too small, by 0.40 to 3.20 m",
        "5. another acceleration ahead of m9: it would come too near to m7 by 0.25 m",
        "8. X moves ahead ahead of m8: chosen",
    ]


@pytest.mark.parametrize(
    ("code", "others", "text"),
    [
        (t.TOO_NEAR, {"moved_vehicle_id": "m1"}, "m1 would come too near to m2 by 1.50 m"),
        (t.AHEAD_OF_REACH, {}, "the gap lies 1.50 m ahead of what it can reach"),
        (t.BEHIND_REACH, {"missing_m": 1e-4}, "the gap lies 1.0e-04 m behind what it can reach"),
        (
            t.SHIFT_TOO_FAR,
            {},
            "m2 cannot move so far within its bounds of speed and acceleration, 1.50 m too far",
        ),
        (t.SHIFT_TOO_FAST, {"missing_m": None}, "m2 would leave the bounds of speed as it moves"),
        (t.NO_LATE_WAY, {"missing_m": None}, "no later way to the nose"),
        (t.FOLLOWERS_CANNOT_BRAKE, {"missing_m": None}, "m2 behind it on the ramp cannot brake"),
        (t.CANNOT_FALL_BACK, {"other_vehicle_id": None, "missing_m": None}, "a vehicle behind it"),
    ],
)
def test_reasons_name_vehicles_and_distances(code, others, text):
    row = attempt(
        1, reason=a.REASONS[code], **{"other_vehicle_id": "m2", "missing_m": 1.5, **others}
    )
    assert words.reason_in_words(row).startswith(text)


def test_a_reason_of_a_strategy_of_ones_own_is_told_as_it_is():
    row = attempt(1, reason="I did not like it", missing_m=2.0)
    assert words.reason_in_words(row) == "I did not like it by 2.00 m"
    assert words.tried_lines([]) == []
