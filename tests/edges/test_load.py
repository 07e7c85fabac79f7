"""Results from their folders, and what they say of themselves."""

import polars as pl
import pytest

import coramp
from coramp import CorampError
from tests.edges import SMALL_STUDY, edited

FLOWS = {"mainline_veh_h": 900, "ramp_veh_h": 400, "seed": 3, "horizon_s": 30.0}


@pytest.mark.parametrize("strategy", ["mainline-priority", "uncontrolled"])
def test_a_run_comes_back_as_it_was(tmp_path, strategy):
    settings = {"safety.time_gap_s": 0.5}
    made = coramp.run("paper", strategy, out=tmp_path / "r", overrides=settings, **FLOWS)
    back = coramp.load(tmp_path / "r")
    assert isinstance(back, coramp.RunResult)
    assert back.spec == made.spec
    assert back.spec.run_id == made.spec.run_id
    assert back.summary == made.summary
    assert back.broken_promises == made.broken_promises == []
    for name, frame in back.frames.items():
        assert frame.equals(made.frames[name])
    assert back.plot_time_space().axes[0].get_title() == made.plot_time_space().axes[0].get_title()
    assert back.plot_speeds()


def test_a_study_comes_back_as_it_was(tmp_path):
    changes = {"seeds = 1": "seeds = 2", '["mainline-priority"]': '["mainline-priority", "slots"]'}
    (tmp_path / "s.toml").write_text(edited(SMALL_STUDY, changes))
    made = coramp.study(str(tmp_path / "s.toml"), jobs=1, engine="exact", out=tmp_path / "o")
    back = coramp.load(str(tmp_path / "o"))
    assert isinstance(back, coramp.StudyResult)
    assert back.runs.equals(made.runs)
    assert back.streams.equals(made.streams)
    assert back.tables == made.tables
    assert back.layout == made.layout
    assert len(back.plot_delay("strategy").axes) == 3
    for name in ("runs.parquet", "streams.parquet"):
        (tmp_path / "o" / name).unlink()
    assert coramp.load(tmp_path / "o").runs.sort("strategy", "seed").equals(made.runs)


def test_what_holds_neither_is_refused(tmp_path):
    with pytest.raises(CorampError, match="holds no run and no study; give a folder that coramp"):
        coramp.load(tmp_path)


def test_results_say_what_they_are_on_less_than_a_screen(tmp_path):
    run = coramp.run("paper", engine="exact", **FLOWS)
    (tmp_path / "s.toml").write_text(SMALL_STUDY)
    study = coramp.study(str(tmp_path / "s.toml"), jobs=1, engine="exact", out=tmp_path / "o")
    texts = {"run": repr(run), "study": repr(study), "plan": repr(coramp.plan("example"))}
    for text in texts.values():
        lines = text.splitlines()
        assert len(lines) <= 6
        assert max(map(len, lines)) <= 80
    assert "paper, mainline-priority, 900 + 400 veh/h, seed 3" in texts["run"]
    assert f"delay {run.summary['delay_s']:.2f} s" in texts["run"]
    assert "plot_decision" in texts["run"]
    assert "1 runs, 0 failed" in texts["study"]
    assert "decisions: r1 reach" in texts["plan"]
    assert isinstance(run.vehicles, pl.DataFrame)
