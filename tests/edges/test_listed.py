"""Arrivals that are listed: what stands beside them, and what is told of them."""

import re

import pytest

import coramp
from coramp import CorampError
from coramp.runs.running import make_spec
from coramp.scenarios.loading import load_scenario
from coramp.studies.definition import expand, load_study
from tests.edges import assert_refused, built_in, edited, invoke

FLOWS = {"flow_veh_h = 1800.0": "", "flow_veh_h = 500.0": ""}
MANY = [("mainline", float(k), 19.0) for k in range(1, 91)]
FEW = [("mainline", 1.0, 20.0), ("mainline", 3.0, 19.0), ("ramp", 2.5, 16.0)]


def listing(given):
    return "".join(
        f'\n[[arrivals]]\nstream = "{stream}"\ntime_s = {time_s}\nspeed_mps = {speed_mps}\n'
        for stream, time_s, speed_mps in given
    )


def scenario_file(folder, given=FEW, name="listed.toml", changes=FLOWS):
    path = folder / name
    path.write_text(edited(built_in("scenarios", "paper"), changes) + listing(given))
    return str(path)


def study_file(folder, flows="", strategies='"mainline-priority"', name="s.toml"):
    path = folder / name
    path.write_text(
        f'name = "s"\nscenario = "listed.toml"\nhorizon_s = 30.0\nseeds = 3\n[[runs]]\n'
        f"strategies = [{strategies}]\n{flows}\n"
    )
    return str(path)


def test_a_list_and_a_flow_in_one_file_are_refused(tmp_path):
    told = invoke("run", scenario_file(tmp_path, changes={}))
    assert_refused(told)
    (line,) = told.errors
    assert "mainline.flow_veh_h, ramp.flow_veh_h: beside [[arrivals]]" in line
    assert line.endswith("allowed is a list or flows, never both")


def test_options_that_a_list_would_swallow_are_refused_by_name(tmp_path):
    told = invoke("run", scenario_file(tmp_path), "--mainline", "2000", "--ramp", "900")
    assert_refused(told)
    assert [line.split(":")[1].strip() for line in told.errors] == ["--mainline", "--ramp"]
    setting = invoke("run", scenario_file(tmp_path), "--set", "ramp.flow_to_veh_h=900")
    assert_refused(setting)
    assert "--set: ramp.flow_to_veh_h: beside [[arrivals]]" in setting.err


def test_a_list_that_is_set_takes_the_place_of_the_files_flows():
    given = [{"stream": "mainline", "time_s": 1.0, "speed_mps": 20.0}]
    found = load_scenario("paper", {"arrivals": given, "simulation.horizon_s": 60.0})
    assert (found.mainline.flow_veh_h, found.ramp.flow_veh_h) == (60.0, 0.0)
    with pytest.raises(CorampError, match=r"^mainline.flow_veh_h: beside"):
        make_spec("paper", overrides={"arrivals": given}, mainline_veh_h=5.0, blamed="")


def test_a_run_tells_the_demand_that_was(tmp_path):
    result = coramp.run(scenario_file(tmp_path), engine="exact", horizon_s=30.0)
    assert result.flows == "240 + 120 veh/h"  # two and one in 30 s
    assert (result.summary["mainline_veh_h"], result.summary["ramp_veh_h"]) == (240.0, 120.0)


def test_a_report_of_a_list_says_so_and_repeats_it(tmp_path):
    out = tmp_path / "r"
    coramp.run(scenario_file(tmp_path), engine="exact", horizon_s=30.0, out=out)
    assert invoke("report", out).code == 0
    text = (out / "report.html").read_text()
    assert "240 + 120 veh/h" in text
    assert "listed, 2 + 1 vehicles in 30 s" in text
    assert "Arrivals are listed" in text
    assert "one draw of arrivals" not in text
    assert "--mainline" not in re.search(r"<pre.*?</pre>", text, re.DOTALL).group()


def test_a_study_over_flows_of_a_list_is_refused(tmp_path):
    scenario_file(tmp_path)
    told = invoke("study", study_file(tmp_path, "flows_veh_h = [[800, 200], [900, 300]]"))
    assert_refused(told)
    assert "mainline.flow_veh_h, ramp.flow_veh_h: beside [[arrivals]]" in told.err


def test_seeds_that_change_nothing_run_once_and_are_said(tmp_path):
    scenario_file(tmp_path)
    name = study_file(tmp_path, strategies='"mainline-priority", "uncontrolled"')
    seeds = [(spec.strategy, spec.seed) for spec in expand(load_study(name), 3)]
    assert seeds == [("mainline-priority", 1), *(("uncontrolled", seed) for seed in (1, 2, 3))]
    told = invoke("study", name, "--jobs", "1", "--out", tmp_path / "o")
    assert told.code == 0
    assert "no seed changes a run with mainline-priority" in told.err
    assert "0.00 ± 0.00" not in told.out.split("Promises")[0].split("uncontrolled")[0]
    assert invoke("report", tmp_path / "o").code == 0
    page = (tmp_path / "o" / "report.html").read_text()
    assert "a cooperative run is the same with every seed" in page
    assert "240 + 120, listed one by one" in page
    assert "runs with 3 seeds are done" not in page


def test_a_seed_that_changes_nothing_is_said(tmp_path):
    name, options = scenario_file(tmp_path), ("--engine", "exact", "--horizon", "30")
    assert "seed 4 changes nothing" in invoke("run", name, "--seed", "4", *options).err
    assert invoke("run", name, *options).err == ""
    one, other = (make_spec(name, seed=seed, engine="exact", horizon_s=30.0) for seed in (1, 4))
    assert not one.seed_matters
    assert make_spec(name, "uncontrolled").seed_matters
    assert make_spec("paper").seed_matters
    rows = [coramp.run(name, seed=s.seed, horizon_s=30.0).vehicles for s in (one, other)]
    assert rows[0].equals(rows[1])  # in SUMO as well


def test_a_horizon_too_short_for_a_list_is_one_line(tmp_path):
    told = invoke("run", scenario_file(tmp_path, MANY), "--horizon", "10.5")
    assert_refused(told)
    (line,) = told.errors
    assert "--horizon: simulation.horizon_s: 10.5 is too short for the list" in line
    assert "80 of 90 arrivals lie beyond it, the first arrivals.10 at 11 s" in line
    assert line.endswith("allowed is at least 90 s")


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"horizon_s": 40.0}, "here 30 s, there 40 s"),
        ({"seed": 2}, "here seed 1, there seed 2"),
        ({"overrides": {"mainline.min_headway_s": 0.7}}, "here due at "),
    ],
)
def test_what_differs_from_the_run_against_is_named(tmp_path, change, said):
    common = {"engine": "exact", "seed": 1, "horizon_s": 30.0, "mainline_veh_h": 600.0}
    coramp.run("paper", out=tmp_path / "one", **common)
    coramp.run("paper", out=tmp_path / "other", **{**common, **change})
    told = invoke("report", tmp_path / "one", "--against", tmp_path / "other")
    assert_refused(told)
    (line,) = told.errors
    assert said in line
    assert "600 + 500 veh/h" not in line


def test_a_study_finds_its_scenario_beside_itself(tmp_path, monkeypatch):
    folder = tmp_path / "mine"
    folder.mkdir()
    scenario_file(folder)
    study_file(folder)
    monkeypatch.chdir(tmp_path)
    first = coramp.study("mine/s.toml", seeds=1, jobs=1, out=tmp_path / "o")
    monkeypatch.chdir(folder)
    again = coramp.study("s.toml", seeds=1, jobs=1, out=tmp_path / "o")
    assert again.runs.equals(first.runs)  # the same study, from wherever it is started
    (folder / "listed.toml").rename(tmp_path / "listed.toml")
    monkeypatch.chdir(tmp_path)
    told = invoke("study", "mine/s.toml")
    assert_refused(told)
    assert "mine/s.toml: scenario: mine/listed.toml: no such file" in told.err


def test_a_snapshot_finds_its_scenario_beside_itself(tmp_path, monkeypatch):
    folder = tmp_path / "mine"
    folder.mkdir()
    scenario_file(folder)
    text = built_in("snapshots", "example")
    named = re.sub(r'^scenario = ".*"', 'scenario = "listed.toml"', text, flags=re.MULTILINE)
    (folder / "at.toml").write_text(named)
    monkeypatch.chdir(tmp_path)
    told = invoke("plan", "mine/at.toml")
    assert "no such file" not in told.err
