"""`coramp figures`: every file is written, nothing is run twice, what is wrong is one line."""

import dataclasses
import json
import shutil
import xml.etree.ElementTree as ET

import pytest

import coramp
import coramp.api
import coramp.studies.drawn_runs
from coramp import CorampError
from coramp.report.figures import LEFT_OUT, LONG_STUDIES, save_figures
from coramp.report.study_folder import read_study
from tests.edges import assert_refused, everything_below, invoke

ALL_LEFT_OUT = LEFT_OUT.format(", ".join(LONG_STUDIES))
NAMES = [
    "fig04-collision-acceleration",
    "fig06-09-positions",
    "fig07-11-time-space",
    "fig13-road",
    "fig14-mainline-speed",
    "fig15-ramp-speed",
    "fig16-fuel",
    "delay-by-flow",
    "gain-by-flow",
    "rungs-by-flow",
    "margins",
    "sensitivity",
]
STUDY = """
name = "tiny {layout}"
scenario = "paper"
layout = "{layout}"
seeds = 1
horizon_s = 30.0

[[runs]]
strategies = ["mainline-priority"]
engine = "exact"
flows_veh_h = [[1200.0, 500.0], [1800.0, 500.0]]
set = {{ "safety.time_gap_s" = [0.0, 0.6] }}
"""


def studied(folder, layout):
    (folder / f"{layout}.toml").write_text(STUDY.format(layout=layout))
    coramp.study(str(folder / f"{layout}.toml"), jobs=1, out=folder / layout)
    return folder / layout


@pytest.fixture(scope="module")
def studies(tmp_path_factory):
    folder = tmp_path_factory.mktemp("studies")
    return {layout: studied(folder, layout) for layout in ("paper", "sensitivity", "plain")}


@pytest.fixture(scope="module")
def drawn(studies, tmp_path_factory):
    out = tmp_path_factory.mktemp("figures") / "new" / "out"
    return out, invoke(*call(studies, out))


def call(studies, out):
    given = ("--study", studies["paper"], "--study", studies["sensitivity"])
    return ("figures", "--out", out, "--seeds", "1", *given)


def test_every_figure_is_written_as_svg_and_png(drawn):
    out, told = drawn
    assert told.code == 0
    files = {path.name for path in out.iterdir() if path.is_file()}
    assert files == {f"{name}.{end}" for name in NAMES for end in ("svg", "png")}
    for name in NAMES:
        assert (out / f"{name}.png").read_bytes().startswith(b"\x89PNG\r\n")
        text = (out / f"{name}.svg").read_text(encoding="utf-8")
        assert ET.fromstring(text).tag.endswith("svg")
        assert "(m" in text or "(s)" in text or "(%)" in text


def test_what_was_drawn_and_what_not_is_told_and_progress_apart(drawn):
    out, told = drawn
    lines = told.out.splitlines()
    assert lines[: len(NAMES)] == [f"{name}: svg, png" for name in NAMES]
    assert lines[-2:] == [f"12 figures in {out}.", f"Note: {ALL_LEFT_OUT}."]
    assert "--study out/NAME" in lines[-1]
    assert "9 of 9 runs" in told.err


def test_a_second_call_runs_nothing_and_gives_the_same_bytes(drawn, studies, monkeypatch):
    out, _ = drawn

    def forbidden(*_):
        raise AssertionError("it ran again")

    monkeypatch.setattr(coramp.studies.drawn_runs, "recorded", forbidden)
    before = {path.name: path.read_bytes() for path in out.iterdir() if path.is_file()}
    told = invoke(*call(studies, out), "--json")
    assert told.code == 0
    assert "9 of 9 runs are there already" in told.err
    after = {path.name: path.read_bytes() for path in out.iterdir() if path.is_file()}
    assert after == before
    data = json.loads(told.out)
    assert (data["kind"], list(data["files"])) == ("figures", NAMES)
    assert data["files"]["margins"] == [f"{out}/margins.svg", f"{out}/margins.png"]


def test_runs_are_of_the_flows_of_the_paper_and_kept_below_the_figures(drawn):
    out, _ = drawn
    kept = [json.loads(path.read_text()) for path in out.glob("study/runs/*/run.json")]
    found = {(k["strategy"], k["drivers"], k["engine"], k["ramp_veh_h"]) for k in kept}
    assert found == {
        (*who, ramp)
        for ramp in (200.0, 300.0, 500.0)
        for who in (
            ("uncontrolled", "paper", "sumo"),
            ("mainline-priority", None, "exact"),
            ("ramp-priority", None, "exact"),
        )
    }
    assert {k["mainline_veh_h"] for k in kept} == {1800.0}
    assert {k["specification"]["simulation"]["horizon_s"] for k in kept} == {30.0}


def test_a_folder_that_cannot_be_written_is_one_line(studies, tmp_path):
    (tmp_path / "file").write_text("")
    told = invoke(*call(studies, tmp_path / "file" / "figures"))
    assert_refused(told)
    (line,) = told.errors
    assert f"{tmp_path}/file/figures: cannot be written: Not a directory" in line
    told = invoke(*call(studies, tmp_path / "file"))
    assert_refused(told)
    assert "cannot be written" in told.errors[0]
    assert everything_below(tmp_path) == ["file"]


def test_what_is_no_finished_study_is_refused_before_anything_runs(studies, tmp_path):
    out = tmp_path / "out"
    (tmp_path / "empty").mkdir()
    for folder, text in (
        (tmp_path / "empty", "holds no study; give a folder that coramp study --out has written"),
        (studies["plain"], "layout plain; allowed are paper, sensitivity, capacity"),
    ):
        told = invoke("figures", "--out", out, "--study", folder)
        assert_refused(told)
        assert text in told.errors[0]
        assert not out.exists()
    told = invoke("figures", "--out", out, "--seeds", "0")
    assert_refused(told)
    assert told.errors == ["Error: --seeds: 0 is too small; allowed is at least 1"]


def test_a_study_that_was_stopped_or_damaged_is_told(studies, tmp_path):
    for name in ("study.json", "runs.parquet"):
        (tmp_path / name).write_bytes((studies["paper"] / name).read_bytes())
    whole = read_study(tmp_path)
    assert (whole.layout, whole.horizon_s, whole.runs.height, whole.failed) == ("paper", 30.0, 4, 0)
    (tmp_path / "runs.parquet").write_bytes(b"nothing")
    with pytest.raises(CorampError, match="cannot be read"):
        read_study(tmp_path)
    (tmp_path / "runs.parquet").unlink()
    with pytest.raises(CorampError, match="is not finished"):
        read_study(tmp_path)


def test_help_has_an_example():
    told = invoke("figures", "--help")
    assert (told.code, told.err) == (0, "")
    assert "Example: coramp figures --seeds 10 --study out/capacity" in told.out


def test_what_is_not_given_is_run_in_the_exact_engine_below_the_figures(
    studies, tmp_path, monkeypatch
):
    asked = []

    def study(name, *, seeds, jobs, engine, out, progress):
        asked.append((name, seeds, jobs, engine, out))
        shutil.copytree(studies[name], out)

    def not_drawn(figure, path):
        return path

    monkeypatch.setattr(coramp.api, "study", study)
    monkeypatch.setattr(coramp.report.figures, "save_figure", not_drawn)
    drawn = coramp.api.figures(tmp_path / "out", seeds=2, jobs=1)
    kept = tmp_path / "out" / "study"
    assert asked == [(name, 2, 1, "exact", kept / name) for name in ("paper", "sensitivity")]
    assert list(drawn.files) == NAMES
    runs = [json.loads(path.read_text()) for path in kept.glob("runs/*/run.json")]
    seeds = {(run["strategy"], run["seed"]) for run in runs}
    assert seeds == {
        ("uncontrolled", 1),
        *((name, seed) for name in ("mainline-priority", "ramp-priority") for seed in (1, 2)),
    }


def test_runs_that_failed_are_told(studies, tmp_path, monkeypatch):
    monkeypatch.setattr(coramp.report.figures, "_catalogue", lambda *_: iter(()))
    stored = {name: read_study(studies[name]) for name in ("paper", "sensitivity")}
    stored["paper"] = dataclasses.replace(stored["paper"], failed=3)
    drawn = save_figures(tmp_path, stored, [])
    assert drawn.notes == (
        f"3 runs of {studies['paper']} failed and are not drawn",
        ALL_LEFT_OUT,
    )
    with_capacity = save_figures(tmp_path, {**stored, "capacity": stored["sensitivity"]}, [])
    assert with_capacity.notes == (
        drawn.notes[0],
        LEFT_OUT.format("field, baseline, penetration, hostile"),
    )
