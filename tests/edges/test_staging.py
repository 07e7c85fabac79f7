"""Folders of results: replaced as a whole, and nothing lost that coramp did not write."""

import json
import os
import signal
import stat
import subprocess
import sys
import textwrap
from pathlib import Path

import pytest

from coramp import CorampError
from coramp.records.files import write_text
from coramp.records.staging import staged_folder
from coramp.records.unfinished import sweep, unfinished
from tests.edges import assert_refused, everything_below, invoke

RUN = ("run", "paper", "--engine", "exact", "--horizon", "5")


class Stopped(BaseException):
    """Stands for whatever ends a process at the wrong moment."""


def free(_):
    return None


def foreign(folder):
    names = sorted(entry.name for entry in folder.iterdir())
    return None if set(names) <= {"mark", "old"} else f"holds {names[0]}; give another folder"


def written(target, text, meanwhile=lambda: None):
    with staged_folder(target, foreign) as stage:
        (stage / "mark").write_text(text)
        meanwhile()


def refused_at_once(target, obstacle, match):
    with pytest.raises(CorampError, match=match), staged_folder(target, obstacle):
        pytest.fail("nothing may be computed")


def test_it_appears_once_all_is_written(tmp_path):
    target = tmp_path / "above" / "target"
    with staged_folder(target, free) as stage:
        (stage / "mark").write_text("x")
        assert not target.exists()
    assert everything_below(tmp_path) == ["above", "above/target", "above/target/mark"]
    assert stat.S_IMODE(target.stat().st_mode) == 0o755


@pytest.mark.parametrize("error", [CorampError, Stopped])
def test_what_fails_leaves_the_folder_before_it(tmp_path, error):
    target = tmp_path / "target"
    written(target, "before")

    def fails():
        raise error

    with pytest.raises(error):
        written(target, "half", fails)
    assert everything_below(tmp_path) == ["target", "target/mark"]
    assert (target / "mark").read_text() == "before"


def test_what_fails_at_first_leaves_nothing(tmp_path):
    with pytest.raises(Stopped), staged_folder(tmp_path / "target", free):
        raise Stopped
    assert everything_below(tmp_path) == []


def test_what_is_all_ours_is_replaced_as_a_whole(tmp_path):
    target = tmp_path / "target"
    written(target, "before")
    (target / "old").write_text("before")
    written(target, "after")
    assert everything_below(tmp_path) == ["target", "target/mark"]
    assert (target / "mark").read_text() == "after"


def test_an_empty_folder_is_used(tmp_path):
    target = tmp_path / "target"
    target.mkdir()
    written(target, "x")
    assert everything_below(target) == ["mark"]


def test_foreign_files_are_refused_before_anything_is_done(tmp_path):
    target = tmp_path / "target"
    target.mkdir()
    (target / "letter").write_text("dear")
    refused_at_once(target, foreign, "holds letter; give another folder")
    assert everything_below(tmp_path) == ["target", "target/letter"]


def test_a_file_is_refused(tmp_path):
    target = tmp_path / "target"
    target.write_text("dear")
    refused_at_once(target, free, "is a file; give a folder")
    assert target.read_text() == "dear"


@pytest.mark.parametrize("standing_in_it", [False, True])
def test_notes_written_meanwhile_stay_and_so_do_the_new_results(
    tmp_path, monkeypatch, standing_in_it
):
    target = tmp_path / "target"
    written(target, "before")
    monkeypatch.chdir(target if standing_in_it else tmp_path)
    with pytest.raises(CorampError, match=r"holds letter.*new results are in .*-new1") as told:
        written(target, "after", lambda: (target / "letter").write_text("dear"))
    assert (target / "mark").read_text() == "before"
    assert (target / "letter").read_text() == "dear"
    assert Path(str(told.value).rpartition(" ")[2], "mark").read_text() == "after"


@pytest.mark.parametrize("below", [False, True])
def test_a_folder_that_one_stands_in_keeps_its_place(tmp_path, monkeypatch, below):
    target = tmp_path / "target"
    written(target, "before")
    monkeypatch.chdir(target)
    (target / "old").write_text("before")
    written(Path.cwd() if below else Path(), "after")
    assert os.listdir() == ["mark"]  # noqa: PTH208
    assert Path("mark").read_text() == "after"
    assert everything_below(tmp_path) == ["target", "target/mark"]


def test_a_failure_in_the_middle_of_an_exchange_loses_nothing(tmp_path, monkeypatch):
    target = tmp_path / "target"
    written(target, "before")
    monkeypatch.chdir(target)
    renamed, real = [], Path.rename

    def fails_at_second(self, new):
        renamed.append(self)
        if len(renamed) == 2:
            raise OSError(5, "Input/output error")
        return real(self, new)

    with pytest.raises(CorampError, match=r"Input/output error; the new results are in"):
        written(Path(), "after", lambda: monkeypatch.setattr(Path, "rename", fails_at_second))
    assert (target / "mark").read_text() == "before"
    assert (target / "target-new1" / "mark").read_text() == "after"


def test_a_link_to_a_folder_is_followed(tmp_path):
    written(tmp_path / "real", "before")
    (tmp_path / "link").symlink_to("real")
    written(tmp_path / "link", "after")
    assert (tmp_path / "link").is_symlink()
    assert (tmp_path / "real" / "mark").read_text() == "after"
    (tmp_path / "real" / "letter").write_text("dear")
    refused_at_once(tmp_path / "link", foreign, "link: holds letter")


@pytest.mark.parametrize("leads_to", ["nowhere", "link"])
def test_a_link_to_nothing_is_refused_before_anything_is_done(tmp_path, leads_to):
    (tmp_path / "link").symlink_to(leads_to)
    refused_at_once(tmp_path / "link", free, "link: is a link to nothing; give a folder")


def test_a_link_to_a_file_is_refused_before_anything_is_done(tmp_path):
    (tmp_path / "letter").write_text("dear")
    (tmp_path / "link").symlink_to("letter")
    refused_at_once(tmp_path / "link", free, "link: is a file; give a folder")


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    folder = tmp_path_factory.mktemp("finished") / "r"
    assert invoke(*RUN, "--out", folder).code == 0
    return folder


class TestRunFolder:
    @pytest.fixture
    def ours(self, finished, tmp_path, monkeypatch):
        monkeypatch.chdir(tmp_path)
        folder = Path("r")
        folder.mkdir()
        for path in finished.iterdir():
            (folder / path.name).write_bytes(path.read_bytes())
        return folder

    def refused(self, *arguments):
        before = {path: path.read_bytes() for path in Path().rglob("*") if path.is_file()}
        told = invoke(*RUN, *arguments)
        assert_refused(told)
        after = {path: path.read_bytes() for path in Path().rglob("*") if path.is_file()}
        assert after == before
        (line,) = told.errors
        return line

    def test_a_run_with_report_and_sumo_files_is_replaced(self, ours):
        assert invoke("report", ours).code == 0
        (ours / "sumo").mkdir()
        (ours / "sumo" / "routes.rou.xml").write_text("<routes/>")
        assert invoke(*RUN, "--seed", "2", "--out", "r").code == 0
        assert json.loads((ours / "run.json").read_text())["seed"] == 2
        tables = ("attempts", "decisions", "speeds", "trajectories", "vehicles", "violations")
        assert everything_below(ours) == sorted(["run.json", *(f"{t}.parquet" for t in tables)])

    @pytest.mark.parametrize(
        "place", ["notes.md", ".notes", "vehicles.csv", "run.json.bak", "sumo/notes.md", "a/b"]
    )
    def test_notes_in_a_run_stay(self, ours, place):
        (ours / place).parent.mkdir(exist_ok=True)
        (ours / place).write_text("dear")
        assert self.refused("--out", "r") == (
            "Error: r: holds a run and what coramp did not write "
            f"({Path(place).parts[0]}); move that away, or give another folder"
        )

    def test_many_notes_are_counted(self, ours):
        for number in range(6):
            (ours / f"{number}.txt").write_text("dear")
        assert "(0.txt, 1.txt, 2.txt and 3 more)" in self.refused("--out", "r")

    def test_a_link_in_a_run_is_not_ours(self, ours):
        Path("elsewhere").write_text("dear")
        (ours / "report.html").symlink_to("../elsewhere")
        assert "(report.html)" in self.refused("--out", "r")

    @pytest.mark.parametrize("content", ["{}", '{"kind": "run"}', "[1]", "no JSON", ""])
    def test_a_foreign_run_json_makes_no_run(self, tmp_path, monkeypatch, content):
        monkeypatch.chdir(tmp_path)
        Path("foreign").mkdir()
        Path("foreign/run.json").write_text(content)
        Path("foreign/vehicles.parquet").write_text("dear")
        line = self.refused("--out", "foreign")
        assert line.startswith("Error: foreign: holds other files (run.json); give another or an")

    def test_where_one_stands_results_are_replaced(self, ours, monkeypatch):
        monkeypatch.chdir(ours)
        assert invoke(*RUN, "--seed", "2", "--out", ".").code == 0
        assert json.loads(Path("run.json").read_text())["seed"] == 2
        assert everything_below(ours.parent.resolve())[0] == "attempts.parquet"

    def test_tables_without_a_study_are_left_alone(self, tmp_path, monkeypatch):
        monkeypatch.chdir(tmp_path)
        Path("mine").mkdir()
        Path("mine/tables.md").write_text("dear")
        told = invoke("study", "paper", "--seeds", "1", "--out", "mine")
        assert_refused(told)
        assert "holds other files and no study" in told.err
        assert everything_below(tmp_path) == ["mine", "mine/tables.md"]


KILLED = """
import os, signal, sys
from pathlib import Path
from coramp.records.staging import staged_folder
from coramp.records.files import write_text

def killed(*_):
    os.kill(os.getpid(), signal.SIGKILL)

if sys.argv[1] == "file":
    os.fsync = killed
    write_text(Path("a.txt"), "half")
with staged_folder(Path("r"), lambda _: None) as stage:
    (stage / "vehicles.parquet").write_text("half")
    killed()
"""


@pytest.mark.parametrize("what", ["file", "folder"])
def test_what_a_killed_process_leaves_is_swept_up(tmp_path, what):
    program = [sys.executable, "-c", textwrap.dedent(KILLED), what]
    told = subprocess.run(program, cwd=tmp_path, check=False, env=os.environ)
    assert told.returncode == -signal.SIGKILL
    assert len(everything_below(tmp_path)) >= 1
    if what == "file":
        write_text(tmp_path / "b.txt", "whole")
        assert everything_below(tmp_path) == ["b.txt"]
    else:
        written(tmp_path / "r", "whole")
        assert everything_below(tmp_path) == ["r", "r/mark"]


def test_what_is_being_written_is_not_swept_up(tmp_path):
    with unfinished(tmp_path, "a") as file, unfinished(tmp_path, "b", is_folder=True) as folder:
        sweep(tmp_path)
        assert file.exists()
        assert folder.exists()
    assert everything_below(tmp_path) == []


def test_only_names_of_ours_are_swept_up(tmp_path):
    for name in ("a.coramp-unfinished", ".a", ".coramp"):
        (tmp_path / name).write_text("dear")
    sweep(tmp_path)
    assert len(everything_below(tmp_path)) == 3


def test_a_long_name_can_be_written(tmp_path):
    write_text(tmp_path / ("ä" * 120), "text")
    assert everything_below(tmp_path) == ["ä" * 120]
