"""What a study would do and how far it is; very large ones; another engine."""

import json

import pytest

import coramp
from coramp.api import outlook
from coramp.cli.entry import main
from coramp.report.study_folder import scenario_of
from coramp.scenarios.toml_files import builtin_text
from tests.study import GRID, written


def test_nothing_is_run_or_written_by_a_dry_run(tmp_path, capsys):
    with pytest.raises(SystemExit) as ended:
        main(["study", written(tmp_path), "--dry-run", "--json", "--out", str(tmp_path / "o")])
    assert ended.value.code == 0
    told = json.loads(capsys.readouterr().out)
    assert (told["runs"], told["done"], told["missing"]) == (6, 0, 6)
    assert told["expected_s"] > 0.0
    assert not (tmp_path / "o").exists()


def test_the_status_counts_what_is_done_and_what_is_damaged(tmp_path):
    definition, folder = written(tmp_path), tmp_path / "o"
    whole = coramp.study(definition, jobs=1, out=folder)
    assert outlook(definition, out=folder).done == 6
    part = folder / "parts" / f"{whole.runs['run_id'][0]}.json"
    part.write_bytes(part.read_bytes()[:-40])
    seen = outlook(definition, out=folder)
    assert (seen.done, seen.damaged, seen.missing, seen.failed) == (5, 1, 1, 0)


def test_rows_of_a_scenario_file_that_was_changed_since_are_told(tmp_path, capsys):
    scenario = tmp_path / "mine.toml"
    scenario.write_text(builtin_text("paper"))
    definition = written(tmp_path, GRID.replace('scenario = "paper"', 'scenario = "mine.toml"'))
    folder = tmp_path / "o"
    first = coramp.study(definition, jobs=1, out=folder)
    assert outlook(definition, out=folder).outdated == 0
    scenario.write_text(scenario.read_text().replace("min_headway_s = 0.6", "min_headway_s = 0.7"))
    seen = outlook(definition, out=folder)
    assert (seen.done, seen.missing, seen.outdated) == (0, 6, 6)
    with pytest.raises(SystemExit):
        main(["study", definition, "--status", "--out", str(folder)])
    told = capsys.readouterr().out
    assert "kept, but of the scenario file before it was changed" in told
    assert "the tables and the report in the folder are of the old file" in " ".join(told.split())
    notices = []
    again = coramp.study(definition, jobs=1, out=folder, notice=notices.append)
    assert any("scenario file was changed since" in line for line in notices)
    assert not set(again.runs["run_id"]) & set(first.runs["run_id"])
    assert outlook(definition, out=folder).outdated == 0
    assert scenario_of(folder)["mainline"]["min_headway_s"] == 0.7


def test_a_dry_run_says_that_compiling_is_left_out(tmp_path, capsys):
    with pytest.raises(SystemExit):
        main(["study", written(tmp_path), "--dry-run", "--out", str(tmp_path / "o")])
    assert "expected duration leaves out compiling" in " ".join(capsys.readouterr().out.split())


def test_speeds_of_a_studys_tables_can_be_in_kmh(tmp_path):
    definition = written(tmp_path)
    mps, kmh = (coramp.study(definition, jobs=1, out=tmp_path / "o", kmh=k) for k in (False, True))
    tables = [next(t for t in result.tables if t.title == "All runs") for result in (mps, kmh)]
    one, other = (
        [float(row[t.columns.index(f"mainline speed ({unit})")].split()[0]) for row in t.rows]
        for t, unit in zip(tables, ("m/s", "km/h"), strict=True)
    )
    assert other == pytest.approx([3.6 * v for v in one], abs=0.03)
    assert mps.runs.equals(kmh.runs)


def test_half_the_processes_take_twice_as_long(tmp_path):
    definition = written(tmp_path)
    one, two = (outlook(definition, jobs=jobs, out=tmp_path / "o") for jobs in (1, 2))
    assert one.expected_s == pytest.approx(2 * two.expected_s)


def test_very_many_runs_are_asked_about(tmp_path):
    definition = written(tmp_path)
    with pytest.raises(coramp.CorampError, match="has 300000 runs; add --yes to run so many"):
        outlook(definition, seeds=100_000)
    with pytest.raises(coramp.CorampError, match="--yes"):
        coramp.study(definition, seeds=100_000, out=tmp_path / "o")
    assert not (tmp_path / "o").exists()


def test_a_study_without_runs_is_told(tmp_path):
    text = GRID[: GRID.index("[[runs]]")]
    with pytest.raises(coramp.CorampError, match="at least one of runs and searches"):
        coramp.study(written(tmp_path, text), out=tmp_path / "o")


def test_another_engine_moves_only_cooperative_runs(tmp_path):
    definition = written(tmp_path)
    sumo = coramp.study(definition, jobs=2, out=tmp_path / "sumo").runs
    exact = coramp.study(definition, jobs=2, engine="exact", out=tmp_path / "exact").runs
    engines = dict(exact.select("strategy", "engine").unique().iter_rows())
    assert engines == {"mainline-priority": "exact", "uncontrolled": "sumo"}
    assert exact["mainline_delay_s"].to_list() == pytest.approx(
        sumo["mainline_delay_s"].to_list(), abs=1e-9
    )
    with pytest.raises(coramp.CorampError, match="holds another study"):
        coramp.study(definition, engine="exact", out=tmp_path / "sumo")
    with pytest.raises(coramp.CorampError, match="there is no 'exactly'"):
        coramp.study(definition, engine="exactly", out=tmp_path / "o")


SEARCH = """
name = "searched"
scenario = "paper"
seeds = 2
horizon_s = 30.0

[[searches]]
strategies = ["mainline-priority"]
engine = "exact"
mainline_from_veh_h = 1200.0
mainline_to_veh_h = 1600.0
resolution_veh_h = 100.0
ramp_veh_h = [200.0]
"""


def test_searches_count_at_most_before_and_as_they_were_after(tmp_path):
    definition, folder = written(tmp_path, SEARCH), tmp_path / "o"
    before = outlook(definition, jobs=1, out=folder)
    # the middle of five flows, of the two beyond it, and the last
    assert (before.runs, before.missing, before.searches_at_most) == (0, 0, 2 * 3)
    assert before.expected_s > 0.0
    result = coramp.study(definition, jobs=1, out=folder)
    after = outlook(definition, jobs=1, out=folder)
    # nothing breaks down in half a minute: 1400, 1500 and 1600
    assert result.runs.height == 2 * 3
    assert (after.runs, after.done, after.searches_at_most, after.expected_s) == (6, 6, 0, 0.0)
    more = outlook(definition, seeds=3, jobs=1, out=folder)
    assert (more.runs, more.done, more.searches_at_most) == (6, 6, 3)
    upper = result.runs.filter(mainline_veh_h=1600.0, seed=1)["run_id"].item()
    part = folder / "parts" / f"{upper}.json"
    part.write_bytes(part.read_bytes()[:-40])
    seen = outlook(definition, jobs=1, out=folder)
    assert (seen.runs, seen.damaged, seen.searches_at_most) == (5, 1, 1)


def test_the_outlook_refuses_what_the_study_refuses(tmp_path):
    with pytest.raises(coramp.CorampError, match="--jobs: 0 is too small"):
        outlook(written(tmp_path), jobs=0, out=tmp_path / "o")
