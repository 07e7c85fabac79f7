import doctest
import inspect
import math
import subprocess
import sys

import pandas as pd
import polars as pl
import pytest

import coramp
import coramp.api
from coramp.records.schemas import (
    ATTEMPTS,
    DECISIONS,
    MEASURED,
    RUNS,
    SPEEDS,
    STREAM_ROWS,
    TRAJECTORIES,
    VEHICLES,
    VIOLATIONS,
)
from tests.edges import SMALL_STUDY, everything_below

SCHEMAS = {
    "vehicles": VEHICLES,
    "speeds": SPEEDS,
    "trajectories": TRAJECTORIES,
    "decisions": DECISIONS,
    "attempts": ATTEMPTS,
    "positions": TRAJECTORIES,
    "violations": VIOLATIONS,
}


@pytest.fixture(scope="module")
def cooperative():
    return coramp.run("paper", seed=2, horizon_s=30.0)


@pytest.fixture(scope="module")
def uncontrolled():
    return coramp.run("paper", "uncontrolled", seed=2, horizon_s=30.0)


@pytest.fixture(scope="module")
def small_study(tmp_path_factory):
    folder = tmp_path_factory.mktemp("study")
    (folder / "small.toml").write_text(SMALL_STUDY)
    states = []
    result = coramp.api.study(
        str(folder / "small.toml"), seeds=2, jobs=1, out=folder / "o", progress=states.append
    )
    return result, states


@pytest.fixture(scope="module")
def example():
    return coramp.plan("example")


def test_what_the_package_offers_is_there():
    assert set(coramp.__all__) <= set(dir(coramp.api)) | {"CorampError"}
    with pytest.raises(AttributeError, match="no attribute 'drive'"):
        _ = coramp.drive


def test_everything_offered_can_be_called_by_its_name_after_a_run():
    code = (
        "import coramp\n"
        "coramp.plan('example')\n"
        "for name in ('run', 'study', 'plan', 'CorampError'):\n"
        "    assert callable(getattr(coramp, name)), name\n"
    )
    result = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=False
    )
    assert result.returncode == 0, result.stderr


def test_importing_the_package_alone_is_light():
    code = (
        "import sys, coramp\n"
        "heavy = {'numba', 'polars', 'pydantic', 'numpy', 'libsumo', 'matplotlib', 'scipy'}\n"
        "assert not heavy & set(sys.modules), heavy & set(sys.modules)"
    )
    result = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=False
    )
    assert result.returncode == 0, result.stderr


@pytest.mark.parametrize("module", [coramp, coramp.api])
def test_examples_in_docstrings_work(module):
    found = doctest.DocTestFinder().find(module, globs={"coramp": coramp})
    examples = [test for test in found if test.examples]
    assert examples
    runner = doctest.DocTestRunner()
    for test in examples:
        runner.run(test)
    assert runner.failures == 0
    assert runner.tries > 0


def test_a_run_gives_frames_with_the_columns_of_its_files(cooperative, uncontrolled):
    assert set(cooperative.frames) == set(SCHEMAS) - {"positions", "types"}
    assert set(uncontrolled.frames) == {"vehicles", "speeds", "positions", "violations"}
    assert uncontrolled.trajectories is None
    assert uncontrolled.decisions is None
    for result in (cooperative, uncontrolled):
        for name, frame in result.frames.items():
            assert isinstance(frame, pl.DataFrame)
            assert dict(frame.schema) == SCHEMAS[name]


def test_a_summary_is_a_row_of_runs(cooperative, uncontrolled):
    for result in (cooperative, uncontrolled):
        row = pl.DataFrame([result.summary], schema=RUNS, orient="row")
        assert set(result.summary) == set(RUNS)
        assert row["status"].item() == "ok"
        assert result.broken_promises == []
    assert cooperative.summary["drivers"] is None
    assert uncontrolled.summary["drivers"] == "fair"


def test_a_summary_says_what_its_records_say(cooperative, uncontrolled):
    for result in (cooperative, uncontrolled):
        summary, vehicles = result.summary, result.vehicles
        assert summary["fuel_l"] == pytest.approx(vehicles["fuel_l"].sum())
        assert summary["unserved"] == vehicles.height - vehicles["finished"].sum()
        for stream in ("mainline", "ramp"):
            of_stream = vehicles.filter(stream=stream)
            assert summary[f"vehicles_{stream}"] == of_stream.height
            assert summary[f"{stream}_delay_s"] == pytest.approx(of_stream["delay_s"].mean())
    rungs = cooperative.decisions.group_by("rung").agg(pl.col("vehicle_id").n_unique())
    for rung, count in rungs.rows():
        assert cooperative.summary[f"rung_{rung}"] == count


@pytest.mark.parametrize("strategy", ["mainline-priority", "uncontrolled"])
def test_the_same_call_gives_the_same_result(cooperative, uncontrolled, strategy):
    first = cooperative if strategy == "mainline-priority" else uncontrolled
    again = coramp.run("paper", strategy, seed=2, horizon_s=30.0)
    for name, frame in first.frames.items():
        assert frame.equals(again.frames[name])
    one, other = ({k: v for k, v in r.summary.items() if k not in MEASURED} for r in (first, again))
    assert one == other


def test_frames_become_pandas_frames_with_the_same_values(cooperative, small_study, example):
    for result in (cooperative, small_study[0], example):
        frames = result.to_pandas()
        assert frames
        for name, frame in frames.items():
            assert isinstance(frame, pd.DataFrame)
            ours = getattr(result, name)
            assert list(frame.columns) == ours.columns
            assert len(frame) == ours.height
            for column in ours.columns:
                mine = frame[column].tolist()
                for value, expected in zip(mine, ours[column].to_list(), strict=True):
                    missing = value is None or value != value
                    assert missing if expected is None else value == expected


def test_numbers_stay_numbers_in_pandas_even_where_all_are_missing(cooperative):
    nobody = coramp.run("paper", mainline_veh_h=600.0, ramp_veh_h=0.0, horizon_s=5.0)
    for result in (cooperative, nobody):
        for name, frame in result.to_pandas().items():
            for column, kind in SCHEMAS[name].items():
                if kind == pl.Float64:
                    assert frame[column].dtype == float, (name, column)


def test_pandas_is_asked_for_where_it_is_missing(example, monkeypatch):
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(coramp.CorampError, match="pandas is not installed"):
        example.to_pandas()


def test_overrides_and_flows_reach_the_run():
    result = coramp.run(
        "paper",
        mainline_veh_h=700,
        ramp_veh_h=0,
        horizon_s=20,
        seed=4,
        overrides={"safety.positioning_error_m": 0.5},
    )
    assert result.summary["mainline_veh_h"] == 700.0
    assert result.summary["vehicles_ramp"] == 0
    assert result.summary["ramp_delay_s"] is None
    assert result.summary["overrides"] == "safety.positioning_error_m=0.5"
    specification = result.content["specification"]
    assert specification["safety"]["positioning_error_m"] == 0.5
    assert specification["simulation"]["horizon_s"] == 20.0
    assert specification["mainline"]["flow_veh_h"] == 700.0


def test_a_run_leaves_files_only_where_it_is_told(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    coramp.run("paper", horizon_s=5.0)
    coramp.plan("example")
    assert everything_below(tmp_path) == []
    coramp.run("paper", horizon_s=5.0, out="r")
    assert (tmp_path / "r" / "run.json").exists()


def test_a_study_gives_runs_streams_and_tables(small_study):
    result, states = small_study
    assert dict(result.runs.schema) == RUNS
    assert dict(result.streams.schema) == STREAM_ROWS
    assert result.runs["seed"].to_list() == [1, 2]
    assert result.failed.is_empty()
    assert result.broken_promises == []
    assert [table.title for table in result.tables] == ["All runs", "Promises"]
    assert [(s.total, s.done, s.skipped, s.failed, s.damaged) for s in states] == [
        (2, 0, 0, 0, 0),
        (2, 1, 0, 0, 0),
        (2, 2, 0, 0, 0),
    ]
    assert states[0].last is None
    assert states[2].last is not None
    assert pl.read_parquet(result.folder / "runs.parquet").equals(result.runs)


def test_a_study_is_kept_below_out_by_its_name(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "s.toml").write_text(SMALL_STUDY)
    result = coramp.api.study("s.toml", jobs=1)
    assert str(result.folder) == "out/small"
    assert (tmp_path / "out" / "small" / "tables.md").exists()


def test_a_broken_promise_of_a_study_is_told_with_its_run(small_study):
    result, _ = small_study
    runs = result.runs.with_columns(
        collisions=pl.when(pl.col("seed") == 2).then(3).otherwise(0).cast(pl.Int64)
    )
    broken = coramp.api.StudyResult(result.folder, runs, result.streams, result.tables)
    assert broken.broken_promises == [
        "mainline-priority, 800 + 500 veh/h, seed 2: 3 collisions in SUMO"
    ]


def test_a_plan_gives_decisions_and_trajectories_before_and_after(example):
    assert dict(example.decisions.schema) == DECISIONS
    assert dict(example.trajectories.schema) == TRAJECTORIES
    decision = example.decisions.row(0, named=True)
    assert (decision["front_vehicle_id"], decision["rear_vehicle_id"]) == ("m4", "m5")
    assert decision["min_margin_m"] >= 0.0
    stop = example.before.filter(vehicle_id="r1").row(-1, named=True)
    assert stop["speed_mps"] == pytest.approx(0.0, abs=1e-9)
    assert stop["station_m"] < 0.0
    merged = example.trajectories.filter(vehicle_id="r1", lane="mainline")
    assert merged["time_s"].min() == pytest.approx(decision["merge_time_s"])
    assert merged["station_m"].min() == pytest.approx(decision["merge_station_m"])


def test_the_quantities_of_a_plan_are_those_of_the_paper(example):
    values = {(q.equation, q.symbol): q.value for q in example.quantities("r1")}
    assert values["24", "t_1"] == pytest.approx(100.0 / (60.0 / 3.6))
    assert values["25", "t_2"] == pytest.approx((100.0 - 60.0) / 3.6 / 2.0)
    assert values["18", "S_R"] == pytest.approx((100.0**2 - 60.0**2) / 3.6**2 / 4.0)
    assert values["22", "a_r"] == 6.0
    assert values["1", "L_safe"] == pytest.approx(0.04, abs=1e-5)
    with pytest.raises(coramp.CorampError, match="m1: was not planned; planned were r1"):
        example.quantities("m1")


@pytest.mark.parametrize(
    "call",
    [
        lambda: coramp.run("papr"),
        lambda: coramp.run("paper", "mainline"),
        lambda: coramp.run("paper", engine="exactly"),
        lambda: coramp.run("paper", seed=-1),
        lambda: coramp.run("paper", mainline_veh_h=-1.0),
        lambda: coramp.run("paper", horizon_s=math.nan),
        lambda: coramp.run("paper", overrides={"control.stp_s": 0.1}),
        lambda: coramp.run("paper", overrides={"control.step_s": None}),
        lambda: coramp.run("paper", "uncontrolled", drivers="fast"),
        lambda: coramp.run("paper", keep_sumo=True),
        lambda: coramp.api.study("papr"),
        lambda: coramp.api.study("paper", seeds=0),
        lambda: coramp.api.study("paper", jobs=0),
        lambda: coramp.plan("exmple"),
        lambda: coramp.plan("example", "uncontrolled"),
    ],
)
def test_what_cannot_be_done_is_a_coramp_error_with_its_lines(call, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(coramp.CorampError) as caught:
        call()
    assert caught.value.messages
    assert str(caught.value) == "\n".join(caught.value.messages)
    assert everything_below(tmp_path) == []


def test_public_functions_are_documented():
    for name in ("run", "study", "plan"):
        text = inspect.getdoc(getattr(coramp.api, name))
        assert len(text.splitlines()) >= 3
