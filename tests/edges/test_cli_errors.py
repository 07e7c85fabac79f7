"""Wrong input: one line an error on stderr, the right exit code, and nothing left behind."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from coramp import CorampError
from coramp.cli.entry import main
from tests.edges import (
    SMALL_STUDY,
    assert_refused,
    built_in,
    edited,
    everything_below,
    invoke,
)

COMMAND = Path(sys.executable).with_name("coramp")
PAPER = built_in("scenarios", "paper")


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def refused(here, *arguments, code=1):
    """Returns the lines of a call that must be refused and leave nothing behind."""
    before = everything_below(here)
    told = invoke(*arguments)
    assert_refused(told, code)
    assert everything_below(here) == before
    return told.errors


@pytest.mark.parametrize(
    ("setting", "told"),
    [
        ("control.stp_s=0.1", "control.stp_s: unknown key; did you mean step_s? allowed are "),
        ("nonsense=0.1", "nonsense: unknown key; allowed are "),
        ("ramp.length.m=0.1", "ramp.length: unknown key; "),
        ("drivers.fair.sigm=0.1", "drivers.fair.sigm: unknown key; did you mean sigma? "),
        ("name.first=1", "name.first: name is not a table; "),
        ("control=0.1", "control: 0.1 is not a table; allowed is a TOML table"),
        ("control.step_s=nan", "control.step_s: nan is not finite; allowed is a finite number"),
        ("mainline.limit_mps=inf", "mainline.limit_mps: inf is not finite; "),
        ("ramp.start_m=-inf", "ramp.start_m: -inf is not finite; "),
        ("control.step_s=", "control.step_s: '' is not a number; allowed is a number"),
        ("mainline.speed_mps=fast", "mainline.speed_mps: 'fast' is not a number; "),
        ("mainline.speed_mps=true", "mainline.speed_mps: True is not a number; "),
        ("vehicle.length_m=-5", "vehicle.length_m: -5 is too small; allowed is above 0"),
        ("vehicle.length_m=0", "vehicle.length_m: 0 is too small; allowed is above 0"),
        ("vehicle.length_m=50", "vehicle.length_m: 50 is too large; allowed is at most 40"),
        ("mainline.min_headway_s=-1", "mainline.min_headway_s: -1 is too small; allowed is"),
        ("mainline.min_headway_s=0", "mainline.min_headway_s: 0 is too small; allowed is above 0"),
        ("safety.adhesion=0", "safety.adhesion: 0 is too small; allowed is above 0"),
        ("drivers.fair.sigma=1.5", "drivers.fair.sigma: 1.5 is too large; allowed is at most 1"),
        ("drivers.fair.wish=speed", "drivers.fair.wish: 'speed' is not known; allowed is "),
        ("control.gap_position=rear", "control.gap_position: 'rear' is not known; allowed is "),
        (
            "mainline.limit_mps=130",
            (
                "mainline.limit_mps: 130 is too large; allowed is at most 60 m/s "
                "(if 130 is meant in km/h, write 36.11)"
            ),
        ),
        (
            "mainline.speed_mps=100.0",
            (
                "mainline.speed_mps: 100 is too large; allowed is at most 60 m/s "
                "(if 100 is meant in km/h, write 27.78)"
            ),
        ),
        ("mainline.speed_mps=21", "mainline.speed_mps: 21 is above mainline.limit_mps; "),
        (
            "ramp.speed_mps=17.5",
            "ramp.speed_mps: 17.5 is above ramp.limit_mps; ",
        ),
        (
            "ramp.acceleration_lane_m=10",
            (
                "ramp.acceleration_lane_m: 10 is too short: Eq. 22 asks for 9.60 m/s2, more than "
                "motion.ramp_acceleration_mps2; allowed is above 14.5 m"
            ),
        ),
        (
            "ramp.acceleration_lane_m=2",
            "ramp.acceleration_lane_m: 2 is too short to merge in; allowed is above 2.5 m",
        ),
        ("ramp.acceleration_lane_m=-2", "ramp.acceleration_lane_m: -2 is too small; "),
        (
            "ramp.decision_station_m=-390",
            (
                "ramp.decision_station_m: at -390 m not every vehicle that matters has entered, "
                "or it is too late to stop; allowed is -296.2 to -53.5 m"
            ),
        ),
        ("ramp.decision_station_m=-500", "ramp.decision_station_m: -500 is not on the ramp before"),
        (
            "ramp.decision_station_m=10",
            "ramp.decision_station_m: 10 is too large; ",
        ),
        ("mainline.entry_speed_mps=[20, 15]", "mainline.entry_speed_mps: [20, 15] falls; "),
        ("mainline.entry_speed_mps=15", "mainline.entry_speed_mps: 15 has the wrong shape; "),
        ("mainline.entry_speed_mps=[15]", "mainline.entry_speed_mps.1: is missing; "),
        (
            "mainline.end_m=100",
            "mainline.end_m: 100 is not far enough beyond the acceleration lane; ",
        ),
        ("mainline.start_m=400", "mainline.start_m: 400 is too large; allowed is below 0"),
        ("control.actuation_delay_s=0.15", "control.actuation_delay_s: 0.15 is not on the control"),
        (
            "motion.free_acceleration_mps2=0.1",
            (
                "motion.free_acceleration_mps2: 0.1 does not get a vehicle from 16 to 20 m/s "
                "within ramp.acceleration_lane_m 200 (Eq. 22); allowed is 0.365 to 6 m/s2, or a "
                "lane above 722.5 m"
            ),
        ),
        (
            "motion.free_acceleration_mps2=7",
            (
                "motion.free_acceleration_mps2: 7 is above motion.ramp_acceleration_mps2; "
                "allowed is 0.365 to 6 m/s2"
            ),
        ),
        (
            "ramp.acceleration_lane_m=35",
            (
                "ramp.acceleration_lane_m: 35 is too short to get from 16 to 20 m/s with "
                "motion.free_acceleration_mps2 2; allowed is above 38.5 m, or "
                "motion.free_acceleration_mps2 of 2.216 to 6 m/s2 (Eq. 22)"
            ),
        ),
        ("mainline.flow_veh_h=-1", "mainline.flow_veh_h: -1 is too small; allowed is at least 0"),
        ("ramp.flow_veh_h=6000", "ramp.flow_veh_h: 6000 cannot arrive with headways of 0.6 s"),
        ("simulation.horizon_s=0", "simulation.horizon_s: 0 is too small; allowed is above 0"),
    ],
)
def test_a_wrong_setting_is_told_with_its_key_its_value_and_what_is_allowed(here, setting, told):
    (line,) = refused(here, "run", "paper", "--set", setting, "--out", "out/r")
    assert line.startswith(f"Error: --set: {told}")
    assert "; " in line.removeprefix(f"Error: --set: {told.split(';', maxsplit=1)[0]}")


@pytest.mark.parametrize("text", ["control.step_s", "=0.1", " =0.1", ""])
def test_a_setting_must_be_a_key_and_a_value(here, text):
    (line,) = refused(here, "run", "paper", "--set", text, "--out", "r")
    assert line.startswith(f"Error: --set: {text.strip()}")
    assert line.endswith(": is not KEY=VALUE; an example is control.step_s=0.05")


@pytest.mark.parametrize("speed", [20.0, 25.0])
def test_a_ramp_as_fast_as_the_mainline_is_refused(here, speed):
    settings = ("--set", f"ramp.speed_mps={speed}", "--set", "ramp.limit_mps=30.0")
    (line,) = refused(here, "run", "paper", *settings, "--out", "r")
    assert line == (
        f"Error: --set: ramp.speed_mps: {speed:g} is not below mainline.speed_mps; "
        "the method needs a ramp slower than 20 m/s"
    )


@pytest.mark.parametrize(
    ("option", "value", "told"),
    [
        ("--mainline", "-1", "mainline.flow_veh_h: -1 is too small; allowed is at least 0"),
        ("--mainline", "nan", "mainline.flow_veh_h: nan is not finite; allowed is a finite number"),
        ("--mainline", "inf", "mainline.flow_veh_h: inf is not finite; allowed is a finite number"),
        (
            "--mainline",
            "9000",
            (
                "mainline.flow_veh_h: 9000 cannot arrive with headways of 0.6 s or more; "
                "allowed is below 6000 veh/h"
            ),
        ),
        (
            "--ramp",
            "6000",
            (
                "ramp.flow_veh_h: 6000 cannot arrive with headways of 0.6 s or more; "
                "allowed is below 6000 veh/h"
            ),
        ),
        ("--horizon", "0", "simulation.horizon_s: 0 is too small; allowed is above 0"),
        ("--horizon", "-5", "simulation.horizon_s: -5 is too small; allowed is above 0"),
        ("--horizon", "nan", "simulation.horizon_s: nan is not finite; allowed is a finite number"),
        ("--horizon", "1e6", "simulation.horizon_s: 1e+06 is too large; allowed is at most 86400"),
    ],
)
def test_a_wrong_option_is_told_by_its_name(here, option, value, told):
    assert refused(here, "run", "paper", option, value, "--out", "r") == [
        f"Error: {option}: {told}"
    ]


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (("--seed", "-1"), "seed: -1 is out of range; allowed is 0 to 2147483647"),
        (("--seed", "2147483648"), "seed: 2147483648 is out of range; allowed is 0 to 2147483647"),
        (("--engine", "exactly"), "engine: there is no 'exactly'; allowed are sumo"),
        (("--strategy", "mainline"), "strategy: there is no 'mainline'; allowed are "),
        (
            ("-s", "uncontrolled", "--drivers", "fast"),
            "drivers: there is no 'fast' in paper; allowed are paper, fair, paper-sigma0, ",
        ),
        (("--drivers", "fast"), "drivers: there is no 'fast' in paper; allowed are "),
    ],
)
def test_unknown_names_and_seeds_are_refused(here, arguments, told):
    (line,) = refused(here, "run", "paper", *arguments, "--horizon", "5", "--out", "r")
    assert line.removeprefix("Error: ").removeprefix("--").startswith(told)


@pytest.mark.parametrize(
    ("arguments", "option"),
    [
        (("run", "paper", "--mainline", "many"), "--mainline"),
        (("run", "paper", "--seed", "1.5"), "--seed"),
        (("study", "paper", "--seeds", "x", "--out", "o"), "--seeds"),
        (("study", "paper", "--jobs", "two", "--out", "o"), "--jobs"),
    ],
)
def test_an_option_that_is_no_number_is_a_wrong_value(here, arguments, option):
    (line,) = refused(here, *arguments)
    assert option in line
    assert "valid" in line


@pytest.mark.parametrize("command", ["run", "plan", "study"])
class TestFiles:
    def test_there_must_be_a_file_or_a_built_in(self, here, command):
        (line,) = refused(here, command, "nowhere.toml", *self.out(command))
        assert line.startswith("Error: nowhere.toml: no such file or built-in; built in are ")

    def test_a_near_name_is_suggested(self, here, command):
        name = {"run": "papr", "plan": "exmple", "study": "sensitivty"}[command]
        right = {"run": "paper", "plan": "example", "study": "sensitivity"}[command]
        (line,) = refused(here, command, name, *self.out(command))
        assert line.startswith(f"Error: {name}: ")
        assert f"did you mean {right}?" in line

    @pytest.mark.parametrize("content", [b"", b"\n", b"# a comment\n"])
    def test_an_empty_file_is_refused(self, here, command, content):
        Path("e.toml").write_bytes(content)
        (line,) = refused(here, command, "e.toml", *self.out(command))
        assert line.startswith("Error: e.toml: the file is empty; allowed is TOML that ")

    @pytest.mark.parametrize("content", [bytes(range(256)), b"\xff\xfe\x00", b'name = "\xe9"'])
    def test_a_file_that_is_not_text_is_refused(self, here, command, content):
        Path("b.toml").write_bytes(content)
        (line,) = refused(here, command, "b.toml", *self.out(command))
        assert line == "Error: b.toml: cannot be read: not UTF-8 text; allowed is a TOML file"

    @pytest.mark.parametrize("content", ["name = ", "[a\n", "a = 1\na = 2\n", 'a = "\0"', "{}"])
    def test_a_file_that_is_not_toml_is_refused_with_its_line(self, here, command, content):
        Path("b.toml").write_text(content)
        (line,) = refused(here, command, "b.toml", *self.out(command))
        assert line.startswith("Error: b.toml: ")
        assert "(at " in line
        assert line.endswith("; allowed is TOML")

    def test_a_folder_is_no_file(self, here, command):
        Path("folder.toml").mkdir()
        (line,) = refused(here, command, "folder.toml", *self.out(command))
        assert line.startswith("Error: folder.toml: cannot be read: ")
        assert line.endswith("; allowed is a TOML file")

    def test_a_file_of_another_kind_is_refused(self, here, command):
        Path("x.toml").write_text('[tool]\nkind = "other"\n')
        lines = refused(here, command, "x.toml", *self.out(command))
        assert any(line.startswith("Error: x.toml: tool: unknown key; ") for line in lines)
        assert any("is missing" in line for line in lines)

    @staticmethod
    def out(command):
        return () if command == "plan" else ("--out", "out/r")


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        (
            {"limit_mps = 20.0": "limt_mps = 20.0"},
            ["mainline.limt_mps: unknown key; did you mean limit_mps?"],
        ),
        (
            {"[mainline]": "[mainlin]"},
            ["mainlin: unknown key; did you mean mainlin"],
        ),
        (
            {"start_m = -400.0": "start_m = 400.0", "speed_mps = 16.0": "speed_mps = nan"},
            ["mainline.start_m: 400 is too large; ", "ramp.speed_mps: nan is not finite; "],
        ),
        (
            {"speed_mps = 20.0": "speed_mps = 72.0"},
            ["mainline.speed_mps: 72 is too large; "],
        ),
        ({'name = "paper"': 'name = ""'}, ["name: ''"]),
    ],
)
def test_errors_of_a_scenario_file_name_the_file_all_of_them(here, changes, expected):
    Path("mine.toml").write_text(edited(PAPER, changes))
    lines = refused(here, "run", "mine.toml", "--out", "out/r")
    assert len(lines) == len(expected)
    for line, told in zip(lines, expected, strict=True):
        assert line.startswith(f"Error: mine.toml: {told}")


def test_errors_of_file_and_options_are_told_together(here):
    Path("mine.toml").write_text(edited(PAPER, {"end_m = 400.0": "end_m = -400.0"}))
    lines = refused(here, "run", "mine.toml", "--ramp", "-2", "--set", "control.step=1")
    assert [line.split(": ")[1:3] for line in lines] == [
        ["mine.toml", "mainline.end_m"],
        ["--ramp", "ramp.flow_veh_h"],
        ["--set", "control.step"],
    ]


def test_an_unknown_key_and_what_does_not_fit_together_are_told_at_once(here):
    settings = ("ramp.acceleration_lane_m=10", "ramp.merge_angle=20", "strange=1")
    told = invoke("run", "paper", *(word for text in settings for word in ("--set", text)))
    assert_refused(told)
    assert {line.split(": ")[2] for line in told.errors} == {
        "ramp.merge_angle",
        "strange",
        "ramp.acceleration_lane_m",
    }


def test_errors_of_a_snapshot_name_the_file(here):
    text = built_in("snapshots", "example")
    Path("mine.toml").write_text(
        edited(text, {'id = "m2"': 'id = "m1"', "station_m = -196.0": "station_m = -186.0"})
    )
    assert refused(here, "plan", "mine.toml", "--plot", "p.png") == [
        "Error: mine.toml: vehicles.1.id: 'm1' is taken; every vehicle needs its own",
        (
            "Error: mine.toml: vehicles: m4 overlaps m3 by 3 m; "
            "allowed is a distance of 0.040 m or more"
        ),
    ]


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ("seeds =", "seds =", "seds: unknown key; did you mean seeds?"),
        ("seeds = 1", "seeds = 0", "seeds: 0 is too small; allowed is at least 1"),
        ("seeds = 1", "seeds = 1.5", "seeds: 1.5 is not a number; "),
        ("horizon_s = 20.0", "horizon_s = -1.0", "horizon_s: -1 is too small; allowed is above 0"),
        ("horizon_s = 20.0", "horizon_s = inf", "horizon_s: inf is not finite; "),
        (
            "seeds = 1",
            'layout = "wide"',
            "layout: 'wide' is not known; allowed is 'plain'",
        ),
        ("ramp_veh_h =", "rmp_veh_h =", "runs.0.rmp_veh_h: unknown key; did you mean ramp_veh_h?"),
        (
            "[800.0]",
            "[-800.0]",
            "runs.0.mainline_veh_h.0: -800 is too small; ",
        ),
        ("[800.0]", "[nan]", "runs.0.mainline_veh_h.0: nan is not finite; "),
        ("[800.0]", "800.0", "runs.0.mainline_veh_h: 800 has the wrong shape; "),
        ("[800.0]", "[]", "runs: flows are missing or given twice; allowed is either "),
        (
            "[800.0]",
            "[800.0]\nflows_veh_h = [[1.0, 2.0]]",
            "runs: flows are missing or given twice; allowed is either ",
        ),
        (
            "[800.0]",
            '[800.0]\nset = { "control.step_s" = 0.1 }',
            "runs.0.set.control.step_s: 0.1 has the wrong shape; ",
        ),
        (
            "[800.0]",
            '[800.0]\nset = { "control.step_s" = [] }',
            "runs.0.set.control.step_s: [] has the wrong shape; ",
        ),
    ],
)
def test_errors_of_a_study_are_told_in_one_line_each(here, old, new, told):
    Path("s.toml").write_text(edited(SMALL_STUDY, {old: new}))
    lines = refused(here, "study", "s.toml", "--out", "o")
    (line,) = lines
    assert line.startswith(f"Error: s.toml: {told}")


@pytest.mark.parametrize(
    ("old", "new", "key", "told"),
    [
        ('["mainline-priority"]', '["mainline"]', "strateg", "there is no 'mainline'; allowed are"),
        (
            '["mainline-priority"]',
            '["drivers"]',
            "strateg",
            "uncontrolled; drivers whom nobody controls are 'uncontrolled'",
        ),
        ('["mainline-priority"]', '["uncontrolled"]\ndrivers = ["fast"]', "drivers", "no 'fast'"),
        ('scenario = "paper"', 'scenario = "papr"', "scenario", "did you mean paper?"),
        ("[800.0]", '[800.0]\nengine = "exactly"', "engine", "there is no 'exactly'; allowed are"),
        ("[800.0]", "[8000.0]", "mainline", "8000 cannot arrive with headways of 0.6 s or more"),
        (
            "[800.0]",
            '[800.0]\nset = { "control.stp_s" = [0.1] }',
            "control.stp_s",
            "unknown key; did you mean step_s?",
        ),
        (
            "[800.0]",
            '[800.0]\nset = { "safety.adhesion" = [0.4, 9.0] }',
            "safety.adhesion",
            "9 is too large; allowed is at most 2",
        ),
    ],
)
def test_runs_of_a_study_that_cannot_be_are_told_with_the_studys_file(here, old, new, key, told):
    Path("s.toml").write_text(edited(SMALL_STUDY, {old: new}))
    (line,) = refused(here, "study", "s.toml", "--out", "o")
    assert line.startswith("Error: s.toml: ")
    assert key in line
    assert told in line
    assert "--set" not in line
    assert "--mainline" not in line


@pytest.mark.parametrize(
    ("option", "value"), [("--seeds", 0), ("--seeds", -3), ("--jobs", 0), ("--jobs", -1)]
)
def test_a_study_needs_seeds_and_processes(here, option, value):
    assert refused(here, "study", "paper", option, value, "--out", "o") == [
        f"Error: {option}: {value} is too small; allowed is at least 1"
    ]


class TestFolders:
    @pytest.fixture
    def taken(self, here):
        Path("s.toml").write_text(SMALL_STUDY)
        Path("foreign").mkdir()
        Path("foreign/letter.txt").write_text("dear")
        Path("file").write_text("text")
        return here

    @pytest.mark.parametrize(
        "command", [("run", "paper", "--horizon", "5"), ("study", "s.toml", "--jobs", "1")]
    )
    def test_foreign_files_are_left_alone(self, taken, command):
        (line,) = refused(taken, *command, "--out", "foreign")
        assert line.startswith("Error: foreign: holds other files")
        assert line.endswith("; give another or an empty folder")
        assert Path("foreign/letter.txt").read_text() == "dear"

    @pytest.mark.parametrize(
        "command", [("run", "paper", "--horizon", "5"), ("study", "s.toml", "--jobs", "1")]
    )
    @pytest.mark.parametrize("out", ["file", "file/below"])
    def test_a_file_is_no_folder(self, taken, command, out):
        (line,) = refused(taken, *command, "--out", out)
        assert "file" in line
        assert "folder" in line
        assert Path("file").read_text() == "text"

    def test_the_folder_of_a_study_is_for_that_study(self, taken):
        assert invoke("study", "s.toml", "--jobs", "1", "--out", "o").code == 0
        Path("t.toml").write_text(edited(SMALL_STUDY, {"seeds = 1": "seeds = 2"}))
        (line,) = refused(taken, "study", "t.toml", "--jobs", "1", "--out", "o")
        assert line == (
            "Error: o: holds another study ('small' with another definition); give another folder"
        )
        (line,) = refused(taken, "run", "paper", "--horizon", "5", "--out", "o")
        assert line == "Error: o: holds a study; give another or an empty folder"

    def test_the_folder_of_a_run_is_for_runs(self, taken):
        assert invoke("run", "paper", "--horizon", "5", "--out", "r").code == 0
        (line,) = refused(taken, "study", "s.toml", "--jobs", "1", "--out", "r")
        assert line.startswith("Error: r: holds other files and no study; give another")

    @pytest.mark.parametrize("content", ["[]", '{"kind": "run"}'])
    def test_a_damaged_mark_of_a_study_is_told(self, taken, content):
        Path("o").mkdir()
        Path("o/study.json").write_text(content)
        (line,) = refused(taken, "study", "s.toml", "--jobs", "1", "--out", "o")
        assert line.startswith("Error: o/study.json: ")
        assert Path("o/study.json").read_text() == content

    @pytest.mark.parametrize("content", ["", "{", "\x00", None])
    def test_an_unreadable_or_lost_mark_is_written_again_and_no_run_is_lost(self, taken, content):
        arguments = ("study", "s.toml", "--jobs", "1", "--out", "o")
        assert invoke(*arguments).code == 0
        mark, before = Path("o/study.json"), Path("o/study.json").read_text()
        parts = {p: p.stat().st_mtime_ns for p in Path("o/parts").iterdir()}
        mark.unlink() if content is None else mark.write_text(content)
        assert invoke(*arguments).code == 0
        assert mark.read_text() == before
        assert {p: p.stat().st_mtime_ns for p in Path("o/parts").iterdir()} == parts

    def test_results_of_another_version_are_not_mixed(self, taken, monkeypatch):
        assert invoke("study", "s.toml", "--jobs", "1", "--out", "o").code == 0
        monkeypatch.setattr("coramp.studies.store.RESULT_VERSION", 99)
        (line,) = refused(taken, "study", "s.toml", "--jobs", "1", "--out", "o")
        assert line.startswith("Error: o: was written by another version of coramp")


@pytest.mark.parametrize("what", [("run", "paper", "--horizon", "5"), ("study", "paper")])
def test_a_folder_whose_name_is_too_long_is_told(here, what):
    (line,) = refused(here, *what, "--out", 300 * "a")
    assert line.startswith("Error: ")
    assert line.endswith("aaa: File name too long")


def test_keeping_sumos_files_needs_a_folder(here):
    assert refused(here, "run", "paper", "--horizon", "5", "--keep-sumo") == [
        "Error: --keep-sumo: there is no folder to keep files in; give --out DIR"
    ]


@pytest.mark.parametrize("strategy", ["mainline-priority", "uncontrolled"])
def test_a_window_needs_a_screen(here, monkeypatch, strategy):
    monkeypatch.delenv("DISPLAY", raising=False)
    arguments = ("-s", strategy, "--horizon", "5", "--gui", "--out", "r")
    assert refused(here, "run", "paper", *arguments) == [
        "Error: --gui: there is no screen (DISPLAY is not set); run without --gui"
    ]


def test_a_run_that_fails_leaves_no_folder_and_keeps_the_one_before(here, monkeypatch):
    assert invoke("run", "paper", "--horizon", "5", "--out", "r").code == 0
    before = Path("r/run.json").read_text()

    def broken(*_):
        raise CorampError("SUMO: out of petrol")

    monkeypatch.setattr("coramp.runs.running.execute", broken)
    for out in ("r", "new"):
        assert refused(here, "run", "paper", "--horizon", "5", "--out", out) == [
            "Error: SUMO: out of petrol"
        ]
    assert Path("r/run.json").read_text() == before


@pytest.mark.parametrize("strategy", ["mainline-priority", "uncontrolled"])
def test_a_run_in_which_nobody_arrives_is_no_error(here, strategy):
    flows = ("--mainline", "0", "--ramp", "0", "--horizon", "5")
    told = invoke("run", "paper", "-s", strategy, *flows)
    assert (told.code, told.err) == (0, "")
    assert "0, 0, 0" in told.out


def test_vehicles_cut_off_by_the_end_of_a_run_never_count_as_early(here):
    arguments = ("--horizon", "10", "--set", "simulation.drain_s=5", "--out", "r")
    told = invoke("run", "paper", *arguments)
    if told.code == 0:
        import polars as pl

        assert pl.read_parquet("r/vehicles.parquet")["delay_s"].min() >= -1e-9
    else:
        assert_refused(told)


class TestExplain:
    @pytest.fixture
    def run(self, here):
        assert invoke("run", "paper", "--horizon", "10", "--out", "r").code == 0
        return here

    @pytest.mark.parametrize("folder", ["nowhere", "empty", "foreign", "file"])
    def test_a_folder_without_a_run_is_told(self, here, folder):
        Path("empty").mkdir()
        Path("foreign").mkdir()
        Path("foreign/x").write_text("")
        Path("file").write_text("")
        assert refused(here, "explain", folder, "r00001") == [
            f"Error: {folder}: holds no run; give a folder that coramp run --out has written"
        ]

    def test_a_missing_vehicle_is_told(self, run):
        (line,) = refused(run, "explain", "r", "r99999")
        assert line.startswith("Error: r: there is no vehicle 'r99999'; allowed are m00001 to r")

    def test_a_run_without_vehicles_is_told(self, here):
        flows = ("--mainline", "0", "--ramp", "0", "--horizon", "5")
        assert invoke("run", "paper", *flows, "--out", "r").code == 0
        (line,) = refused(here, "explain", "r", "r00001")
        assert line.startswith("Error: r: there is no vehicle 'r00001'; ")

    def test_a_run_of_ordinary_drivers_has_nothing_to_explain(self, here):
        uncontrolled = ("-s", "uncontrolled", "--horizon", "5", "--out", "r")
        assert invoke("run", "paper", *uncontrolled).code == 0
        (line,) = refused(here, "explain", "r", "m00001")
        assert line.startswith("Error: r: no vehicle was coordinated in this run; ")

    @pytest.mark.parametrize("content", ["{", "[]", "{}", "\x00", '{"kind": "study"}'])
    def test_a_damaged_description_is_told(self, run, content):
        Path("r/run.json").write_text(content)
        (line,) = refused(run, "explain", "r", "r00001")
        assert line.startswith("Error: r")

    @pytest.mark.parametrize("name", ["vehicles", "decisions"])
    def test_a_damaged_table_is_told(self, run, name):
        Path(f"r/{name}.parquet").write_bytes(b"PAR1 and nothing more PAR1")
        (line,) = refused(run, "explain", "r", "r00001")
        assert line.startswith(f"Error: r/{name}.parquet: cannot be read: ")

    def test_a_lost_table_is_told(self, run):
        Path("r/vehicles.parquet").unlink()
        (line,) = refused(run, "explain", "r", "r00001")
        assert line == "Error: r: is not complete; run again with the same --out"


class TestPlan:
    @pytest.mark.parametrize("name", ["p.txt", "p.toml", "p", "folder", "nowhere/p.png"])
    def test_a_diagram_needs_a_place_and_an_ending_that_is_known(self, here, name):
        Path("folder").mkdir()
        (line,) = refused(here, "plan", "example", "--plot", name)
        assert line.startswith(f"Error: --plot: {name}: ")
        assert line.endswith("; allowed are png, svg and pdf files")

    def test_strategies_that_plan_nothing_are_refused(self, here):
        (line,) = refused(here, "plan", "example", "-s", "uncontrolled")
        assert line == "Error: strategy: uncontrolled plans nothing; choose a cooperative one"
        (line,) = refused(here, "plan", "example", "-s", "ramp")
        assert line.startswith("Error: strategy: there is no 'ramp'; allowed are mainline-priority")


@pytest.mark.parametrize(
    ("arguments", "told", "page"),
    [
        (("drive",), "No such command 'drive'", "--help"),
        (("--loud",), "No such option: --loud", "--help"),
        (("run",), "Missing argument", "run --help"),
        (("run", "paper", "--loud"), "No such option: --loud", "run --help"),
        (("run", "paper", "again"), "unexpected extra argument", "run --help"),
        (("run", "paper", "--seed"), "--seed", "--help"),
        (("explain", "r"), "Missing argument", "explain --help"),
        (("study", "paper", "--seed", "3"), "No such option: --seed", "study --help"),
    ],
)
def test_what_is_no_command_or_option_is_a_mistake_of_usage(here, arguments, told, page):
    (line,) = refused(here, *arguments, code=2)
    assert told in line
    assert page in line


def test_without_arguments_the_help_is_shown_as_it_is(here):
    told = invoke()
    shown = told.out + told.err
    assert told.code in (0, 2)
    assert "Error" not in shown
    assert len(shown.splitlines()) > 10


def test_stopping_a_run_by_hand_is_told(here, monkeypatch):
    def stopped(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr("coramp.runs.running.execute", stopped)
    (line,) = refused(here, "run", "paper", "--out", "r", code=130)
    assert line.startswith("Error: stopped")


def test_an_error_of_coramp_itself_is_one_line_too(here, monkeypatch):
    def broken(*_):
        raise ZeroDivisionError("a\nb")

    monkeypatch.setattr("coramp.runs.running.execute", broken)
    told = invoke("run", "paper", "--out", "r")
    assert told.code == 1
    (line,) = told.errors
    assert line == "Error: unexpected ZeroDivisionError: a b; add --debug to see where"
    assert everything_below(here) == []


@pytest.mark.parametrize(
    "arguments",
    [("--debug", "run", "papr"), ("run", "--debug", "papr"), ("run", "papr", "--debug")],
)
def test_debugging_shows_where(here, arguments):
    with pytest.raises(CorampError, match="papr: no such file"):
        main(list(arguments))


def called(here, *arguments):
    environment = {key: value for key, value in os.environ.items() if key != "DISPLAY"}
    return subprocess.run(
        [COMMAND, *arguments],
        cwd=here,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
        timeout=300,
    )


def test_the_installed_command_tells_errors_the_same_way(here):
    wrong = called(here, "run", "paper", "--ramp", "-1", "--set", "control.step_s=nan")
    assert wrong.returncode == 1
    assert wrong.stdout == ""
    assert wrong.stderr.splitlines() == [
        "Error: --ramp: ramp.flow_veh_h: -1 is too small; allowed is at least 0",
        "Error: --set: control.step_s: nan is not finite; allowed is a finite number",
    ]
    usage = called(here, "drive")
    assert (usage.returncode, usage.stdout) == (2, "")
    assert usage.stderr == "Error: No such command 'drive'; see coramp --help\n"
    window = called(here, "run", "paper", "--gui", "--horizon", "5", "--out", "r")
    assert window.returncode == 1
    assert window.stderr.startswith("Error: --gui: there is no screen")
    debugged = called(here, "--debug", "plan", "nothing")
    assert debugged.returncode == 1
    assert "Traceback (most recent call last)" in debugged.stderr
    assert "CorampError: nothing: no such file or built-in" in debugged.stderr
    assert everything_below(here) == []
