"""The commands of a report that run it again: they give the same run."""

import json
import shlex

import pytest

import coramp
from coramp.records.run_folder import read_run
from coramp.report.writing import _repeat
from tests.edges import invoke

SETTINGS = {
    "mainline.entry_speed_mps": [16.0, 19.0],
    "control.gap_position": "front",
    "motion.speed_deviation": 0.05,
}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("run") / "r"
    flows = {"mainline_veh_h": 1234.5678, "ramp_veh_h": 500.0, "horizon_s": 20.25, "seed": 3}
    coramp.run("paper", engine="exact", overrides=SETTINGS, out=folder, **flows)
    return folder


def test_a_run_keeps_its_settings_as_they_were_given(folder):
    content = json.loads((folder / "run.json").read_text())
    assert content["settings"] == SETTINGS
    assert json.loads(content["summary"]["settings"]) == SETTINGS
    assert content["overrides"] == " ".join(f"{k}={v}" for k, v in sorted(SETTINGS.items()))


def test_the_command_repeats_the_run(folder, tmp_path):
    command, note = _repeat([read_run(folder)])
    assert "--set 'mainline.entry_speed_mps=[16.0, 19.0]'" in command
    assert note.startswith("#")
    words = shlex.split(command)
    assert words[0] == "coramp"
    assert invoke(*words[1:], "--out", tmp_path / "again").code == 0
    again = json.loads((tmp_path / "again" / "run.json").read_text())
    assert again["run_id"] == json.loads((folder / "run.json").read_text())["run_id"]


def test_a_run_of_an_older_version_tells_its_settings(folder, tmp_path):
    content = json.loads((folder / "run.json").read_text())
    del content["settings"], content["summary"]["settings"]
    content["result_version"] = 4
    copy = tmp_path / "old"
    copy.mkdir()
    for path in folder.iterdir():
        (copy / path.name).write_bytes(path.read_bytes())
    (copy / "run.json").write_text(json.dumps(content))
    command, older, _ = _repeat([read_run(copy)])
    assert "--set" not in command
    assert older == f"# an older coramp ran it, with {content['overrides']}"
