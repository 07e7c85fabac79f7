import errno
import os
import signal
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path

import polars as pl
import pytest

import coramp.studies.runner
from coramp import CorampError
from coramp.api import study
from coramp.records.schemas import MEASURED
from coramp.runs.running import RunSpec, make_spec
from coramp.studies.runner import execute_part, run_missing
from coramp.studies.store import Part
from tests.edges import invoke
from tests.study import GRID, apart_from_time, written

COMMAND = Path(sys.executable).with_name("coramp")
RUNS_OF_GRID = 6


class Done:
    """A finished study."""

    def __init__(self, folder):
        self.folder = folder
        self.definition = written(folder)
        self.result = study(self.definition, jobs=1, out=folder / "o")

    @property
    def runs(self):
        return self.result.runs


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """Returns the study as it comes out without any interruption."""
    return Done(tmp_path_factory.mktemp("whole"))


@pytest.fixture
def copied(whole, tmp_path):
    """Returns a finished study of one's own."""
    target = tmp_path / "o"
    (target / "parts").mkdir(parents=True)
    for path in whole.result.folder.rglob("*"):
        if path.is_file():
            copy = target / path.relative_to(whole.result.folder)
            copy.parent.mkdir(parents=True, exist_ok=True)
            copy.write_bytes(path.read_bytes())
    written(tmp_path)
    return target


def start(copied, monkeypatch=None, **rest):
    """Runs the study of a folder again; returns result, states and how many runs it took."""
    executed = []
    execute = coramp.studies.runner.execute

    def counted(spec):
        executed.append(spec.run_id)
        return execute(spec)

    if monkeypatch is not None:
        monkeypatch.setattr(coramp.studies.runner, "execute", counted)
    states = []
    result = study(
        str(copied.parent / "s.toml"), **{"jobs": 1, **rest}, out=copied, progress=states.append
    )
    return result, states, executed


def parts_of(folder):
    return sorted((folder / "parts").glob("[!.]*.json"))


def test_all_runs_are_done_and_none_fails(whole):
    assert whole.runs.height == RUNS_OF_GRID
    assert set(whole.runs["status"]) == {"ok"}
    assert whole.runs["run_id"].n_unique() == RUNS_OF_GRID
    assert len(parts_of(whole.result.folder)) == RUNS_OF_GRID
    assert whole.runs["wall_s"].min() > 0.0


def test_seeds_are_paired_over_strategies(whole):
    for (_,), group in whole.runs.group_by(["seed"]):
        assert group["vehicles_mainline"].n_unique() == 1
        assert group["vehicles_ramp"].n_unique() == 1
    assert whole.runs["vehicles_mainline"].n_unique() == 2


def test_a_study_run_twice_is_the_same_apart_from_time(whole, tmp_path):
    again = Done(tmp_path)
    assert apart_from_time(again.runs).equals(apart_from_time(whole.runs))
    assert again.result.streams.equals(whole.result.streams)
    assert again.result.tables == whole.result.tables


def test_a_study_alone_gives_what_a_run_alone_gives(whole):
    row = whole.runs.filter(strategy="uncontrolled", drivers="paper", seed=2).row(0, named=True)
    alone = coramp.api.run(
        "paper",
        "uncontrolled",
        drivers="paper",
        mainline_veh_h=800.0,
        ramp_veh_h=500.0,
        seed=2,
        horizon_s=20.0,
    )
    for key, value in alone.summary.items():
        if key not in MEASURED:
            assert row[key] == value, key


def test_the_number_of_processes_does_not_change_the_result(whole, tmp_path):
    result = study(written(tmp_path), jobs=2, out=tmp_path / "o")
    assert apart_from_time(result.runs).equals(apart_from_time(whole.runs))
    assert result.streams.equals(whole.result.streams)
    assert (tmp_path / "o" / "tables.md").read_text() == (
        whole.result.folder / "tables.md"
    ).read_text()


def test_a_finished_study_runs_nothing_again(whole, copied, monkeypatch):
    result, states, executed = start(copied, monkeypatch)
    assert executed == []
    assert result.runs.equals(whole.runs)
    (state,) = states
    assert (state.total, state.done, state.skipped, state.damaged) == (RUNS_OF_GRID, 0, 6, 0)


def test_only_what_is_missing_is_run(whole, copied, monkeypatch):
    lost = whole.runs["run_id"].to_list()[1::2]
    for run_id in lost:
        (copied / "parts" / f"{run_id}.json").unlink()
    for name in ("runs.parquet", "streams.parquet", "tables.md"):
        (copied / name).unlink()
    result, states, executed = start(copied, monkeypatch)
    assert sorted(executed) == sorted(lost)
    assert apart_from_time(result.runs).equals(apart_from_time(whole.runs))
    assert [(s.done, s.skipped, s.damaged) for s in states] == [(k, 3, 0) for k in range(4)]
    assert pl.read_parquet(copied / "runs.parquet").equals(result.runs)


def test_more_seeds_run_only_the_new_ones(whole, copied, monkeypatch):
    result, _, executed = start(copied, monkeypatch, seeds=3)
    assert len(executed) == 3
    assert result.runs.height == 9
    assert apart_from_time(result.runs.filter(pl.col("seed") < 3)).equals(
        apart_from_time(whole.runs)
    )


def test_an_interrupted_write_is_run_again(whole, copied, monkeypatch):
    victim = parts_of(copied)[2]
    victim.rename(victim.with_name(f".{victim.name}.4711"))
    result, states, executed = start(copied, monkeypatch)
    assert executed == [victim.stem]
    assert states[0].damaged == 0
    assert apart_from_time(result.runs).equals(apart_from_time(whole.runs))


def flip(path, old, new):
    content = path.read_bytes()
    assert old in content
    path.write_bytes(content.replace(old, new, 1))


@pytest.mark.parametrize(
    "damage",
    [
        lambda path: flip(path, b'"collisions": 0', b'"collisions": 1'),
        lambda path: flip(path, b'"status": "ok"', b'"status": "no"'),
        lambda path: flip(path, b"{", b"\xff"),
        lambda path: path.write_bytes(path.read_bytes()[:400]),
        lambda path: path.write_bytes(b""),
    ],
)
def test_a_damaged_part_is_found_told_and_run_again(whole, copied, monkeypatch, damage):
    victim = parts_of(copied)[3]
    damage(victim)
    definition = copied.parent / "s.toml"
    told = invoke("study", definition, "--jobs", "1", "--out", copied)
    assert told.code == 0
    assert "5 of 6 runs are there already" in told.err
    assert "1 result" in told.err
    assert "damaged" in told.err
    runs = pl.read_parquet(copied / "runs.parquet")
    assert apart_from_time(runs).equals(apart_from_time(whole.runs))
    _, states, executed = start(copied, monkeypatch)
    assert (executed, states[0].damaged) == ([], 0)


def failing(condition, error):
    execute = coramp.studies.runner.execute

    def run(spec):
        if condition(spec):
            raise error
        return execute(spec)

    return run


@pytest.mark.parametrize(
    ("error", "told"),
    [
        (
            CorampError("SUMO: out of petrol", "and of patience"),
            "SUMO: out of petrol; and of patience",
        ),
        (ZeroDivisionError("by nothing"), "ZeroDivisionError: by nothing"),
    ],
)
def test_a_failed_run_is_a_row_and_the_study_goes_on(whole, tmp_path, monkeypatch, error, told):
    with monkeypatch.context() as patch:
        run = failing(lambda spec: spec.drivers == "fair" and spec.seed == 1, error)
        patch.setattr(coramp.studies.runner, "execute", run)
        printed = invoke("study", written(tmp_path), "--jobs", "1", "--out", tmp_path / "o")
    assert printed.code == 1
    assert printed.errors[-1].startswith("Error: 1 run failed; see the error column of ")
    runs = pl.read_parquet(tmp_path / "o" / "runs.parquet")
    assert runs.height == RUNS_OF_GRID
    assert runs["run_id"].equals(whole.runs["run_id"])
    (failed,) = runs.filter(status="failed").iter_rows(named=True)
    assert (failed["drivers"], failed["seed"]) == ("fair", 1)
    assert failed["error"].startswith(told)
    assert failed["mainline_delay_s"] is None
    assert failed["wall_s"] >= 0.0
    good = runs.filter(status="ok")
    assert apart_from_time(good).equals(
        apart_from_time(whole.runs.filter(pl.col("run_id") != failed["run_id"]))
    )
    streams = pl.read_parquet(tmp_path / "o" / "streams.parquet")
    assert failed["run_id"] not in streams["run_id"]
    assert "| failed runs | 1 |" in (tmp_path / "o" / "tables.md").read_text()

    again, states, executed = start(tmp_path / "o", monkeypatch)
    assert executed == [failed["run_id"]]
    assert states[0].damaged == 0
    assert apart_from_time(again.runs).equals(apart_from_time(whole.runs))
    assert again.failed.is_empty()


def test_failures_are_counted_on_the_way(tmp_path, monkeypatch):
    run = failing(lambda spec: spec.strategy == "uncontrolled", CorampError("x"))
    monkeypatch.setattr(coramp.studies.runner, "execute", run)
    states = []
    study(written(tmp_path), seeds=1, jobs=1, out=tmp_path / "o", progress=states.append)
    assert [state.failed for state in states] == [0, 0, 1, 2]


def test_a_run_that_must_fail_fails_alone():
    spec = make_spec("paper", "uncontrolled", horizon_s=5.0)
    hopeless = RunSpec(spec.scenario, spec.strategy, spec.engine, "nobody", spec.seed)
    part = execute_part(hopeless)
    assert part.run["status"] == "failed"
    assert "nobody" in part.run["error"]
    assert part.run["run_id"] == hopeless.run_id
    assert part.rows == []


@dataclass(frozen=True)
class Deadly:
    """A run that takes its process with it."""

    run_id, settings = "deadly", None
    keys = {"scenario": "deadly", "strategy": "deadly"}  # noqa: RUF012

    @property
    def strategy(self):
        os.kill(os.getpid(), signal.SIGKILL)


class Memory:
    """A store that keeps everything in memory."""

    def __init__(self):
        self.written = {}

    def read(self, spec):
        return None

    def is_damaged(self, spec):
        return False

    def write(self, spec, part: Part):
        self.written[spec.run_id] = part


def test_a_run_that_kills_its_process_fails_alone(monkeypatch):
    monkeypatch.setattr(coramp.studies.runner, "DEATHS_BEFORE_ISOLATION", 1)
    good = make_spec("paper", horizon_s=5.0)
    store = Memory()
    run_missing(store, [Deadly(), good], 2, lambda state: None)
    assert {name: part.run["status"] for name, part in store.written.items()} == {
        "deadly": "failed",
        good.run_id: "ok",
    }
    assert store.written["deadly"].run["error"] == ("strategy deadly: the process that ran it died")


LONG_GRID = GRID.replace("horizon_s = 20.0", "horizon_s = 120.0").replace("seeds = 2", "seeds = 3")


def test_a_study_that_is_killed_half_way_goes_on_where_it_was(tmp_path):
    definition, folder = written(tmp_path, LONG_GRID), tmp_path / "o"
    scratch = tmp_path / "scratch"
    scratch.mkdir()
    process = subprocess.Popen(
        [COMMAND, "study", definition, "--jobs", "2", "--out", folder],
        env={**os.environ, "TMPDIR": str(scratch), "JOBLIB_TEMP_FOLDER": str(scratch)},
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )
    try:
        deadline = time.monotonic() + 300.0  # kernels may have to be compiled first
        while len(parts_of(folder)) < 2 and time.monotonic() < deadline:
            assert process.poll() is None
            time.sleep(0.01)
    finally:
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()
    before = {path.name: path.read_bytes() for path in parts_of(folder)}
    assert 2 <= len(before) < 9
    assert not (folder / "runs.parquet").exists()
    states = []
    resumed = study(definition, jobs=1, out=folder, progress=states.append)
    assert states[0].skipped == len(before)
    assert states[0].damaged == 0
    assert {path.name for path in parts_of(folder)} >= set(before)
    for name, content in before.items():
        assert (folder / "parts" / name).read_bytes() == content
    uninterrupted = study(definition, jobs=1, out=tmp_path / "p")
    assert apart_from_time(resumed.runs).equals(apart_from_time(uninterrupted.runs))
    assert resumed.streams.equals(uninterrupted.streams)
    assert resumed.tables == uninterrupted.tables


def test_a_study_interrupted_between_two_runs_keeps_the_first(whole, tmp_path, monkeypatch):
    class Stop(BaseException):
        pass

    def stop(state):
        if state.done == 2:
            raise Stop

    definition = written(tmp_path)
    with pytest.raises(Stop):
        study(definition, jobs=1, out=tmp_path / "o", progress=stop)
    assert len(parts_of(tmp_path / "o")) == 2
    result, states, executed = start(tmp_path / "o", monkeypatch)
    assert (states[0].skipped, len(executed)) == (2, 4)
    assert apart_from_time(result.runs).equals(apart_from_time(whole.runs))


def test_a_full_disk_stops_a_study_and_keeps_what_was_done(whole, copied, monkeypatch, recwarn):
    for part in list((copied / "parts").iterdir()):
        part.unlink()
    synced = []

    def full_after_three(descriptor):
        synced.append(descriptor)
        if len(synced) > 3:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    with monkeypatch.context() as patched:
        patched.setattr("coramp.records.files.os.fsync", full_after_three)
        with pytest.raises(CorampError, match="No space left on device; runs that are done are"):
            start(copied, jobs=2)
    assert not recwarn.list
    assert len(list((copied / "parts").iterdir())) == 3
    result, _, took = start(copied, monkeypatch)
    assert len(took) == RUNS_OF_GRID - 3
    assert apart_from_time(result.runs).equals(apart_from_time(whole.runs))
