"""Files that somebody edited, or made to break a parser: one line each, and soon."""

import copy
import json
import time
from pathlib import Path

import polars as pl
import pytest

import coramp
from coramp import CorampError
from coramp.records.files import read_json
from coramp.scenarios.loading import load_scenario
from coramp.scenarios.plain_data import DEEPEST, long_key_in, problem_with
from coramp.studies.definition import load_study
from coramp.studies.store import OF_ONE_SITE, _checksum, _part_in
from tests.edges import SMALL_STUDY, assert_refused, built_in, edited, invoke

DIGITS = "9" * 5000
HOSTILE = {
    "a list in a list": ("a = " + "[" * 5000 + "]" * 5000, "is nested too deep; allowed are 32"),
    "a table in a table": ("a = " + "{a=" * 5000 + "1" + "}" * 5000, "is nested too deep"),
    "a list that Python can hold": ("a = " + "[" * 200 + "]" * 200, "a: is nested too deep"),
    "a key of many parts": (".".join("a" * 50_000) + " = 1", "has too many parts; allowed are 32"),
    "quoted parts": (".".join(['"a b"'] * 50_000) + " = 1", "has too many parts"),
    "a table's name of many parts": (f"[{'.'.join('a' * 500)}]\nb = 1", "has too many parts"),
    "5,000 digits": (f"a = {DIGITS}", "a number is too large; allowed are whole numbers up to"),
    "400 digits": (f"a = {DIGITS[:400]}", "a: is too large; allowed are whole numbers up to"),
    "negative": (f"a.b = [1, -{DIGITS[:400]}]", "a.b: is too large; allowed are whole numbers up"),
}


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize("command", ["run", "plan", "study"])
@pytest.mark.parametrize("name", HOSTILE)
def test_hostile_toml_is_one_line_and_soon(here, command, name):
    text, expected = HOSTILE[name]
    Path("a.toml").write_text(text)
    started = time.perf_counter()
    told = invoke(command, "a.toml")
    assert time.perf_counter() - started < 5.0
    assert_refused(told)
    (line,) = told.errors
    assert line.startswith("Error: a.toml: ")
    assert expected in line
    assert len(line) < 250


@pytest.mark.parametrize(
    ("setting", "expected"),
    [
        (f"control.step_s={DIGITS}", "control.step_s: is too large; allowed are whole numbers"),
        (f"control.step_s={DIGITS[:400]}", "control.step_s: is too large; allowed are whole"),
        (f"control.step_s={'[' * 5000}{']' * 5000}", "control.step_s: is nested too deep"),
        (f"control.step_s={'[' * 100}{']' * 100}", "control.step_s: is nested too deep"),
        (f"{'.'.join('a' * 50_000)}=1", "has too many parts; allowed are 32"),
    ],
)
def test_hostile_settings_are_one_line(setting, expected):
    told = invoke("run", "paper", "--set", setting)
    assert_refused(told)
    (line,) = told.errors
    assert line.startswith("Error: --set: ")
    assert expected in line


def test_settings_from_python_are_held_to_the_same():
    with pytest.raises(CorampError, match=r"control\.step_s: is too large"):
        load_scenario("paper", {"control.step_s": 10**400})


@pytest.mark.parametrize(
    "text",
    [
        'description = "Words. Of one. Sentence each. ' + "And more. " * 100 + '"',
        "arrivals = [" + "{time_s=1.5, speed_mps=20.0}, " * 100 + "]",
        "a = " + "x" * 1_000_000,
        ".".join("a" * DEEPEST),
    ],
)
def test_ordinary_dots_are_no_long_key(text):
    started = time.perf_counter()
    assert long_key_in(text) is None
    assert time.perf_counter() - started < 1.0


def test_the_deepest_data_still_pass():
    data = 1
    for _ in range(DEEPEST):
        data = [data]
    assert problem_with(data) is None
    assert problem_with([data]) is not None
    assert problem_with({"a": {"b": 2**63 - 1}}) is None
    assert problem_with({"a": {"b": 2**63}}).startswith("a.b: is too large")


@pytest.mark.parametrize("content", ["[" * 100_000, DIGITS, '{"a": NaN}', '{"a": -Infinity}'])
def test_hostile_json_is_told(tmp_path, content):
    (tmp_path / "a.json").write_text(content)
    with pytest.raises(CorampError, match=r"a\.json: cannot be read: .*; run again to write it"):
        read_json(tmp_path / "a.json")


@pytest.mark.parametrize("name", ["../x", "a/b", "..", ".", ".x", "/tmp/x", " a", "a\\b", "a\nb"])
def test_a_study_cannot_lead_out_of_its_folder(here, name):
    Path("s.toml").write_text(edited(SMALL_STUDY, {'"small"': json.dumps(name)}))
    told = invoke("study", "s.toml", "--jobs", "1")
    assert_refused(told)
    assert "cannot be the name of a folder; allowed are letters, digits" in told.err
    assert [path.name for path in Path().rglob("*")] == ["s.toml"]


@pytest.mark.parametrize("name", ["worth-2", "a b", "v1.2", "Größe", "a_b"])
def test_a_study_may_be_called_what_a_folder_may(here, name):
    Path("s.toml").write_text(edited(SMALL_STUDY, {'"small"': json.dumps(name)}))
    assert load_study("s.toml").name == name


class TestPart:
    @pytest.fixture(scope="class", autouse=True)
    @staticmethod
    def study(tmp_path_factory):
        folder = tmp_path_factory.mktemp("study")
        (folder / "s.toml").write_text(SMALL_STUDY)
        coramp.study(str(folder / "s.toml"), jobs=1, engine="exact", out=folder / "o")
        return folder

    @staticmethod
    def part(study):
        return next((study / "o" / "parts").glob("*.json"))

    def test_a_part_as_it_is_written_is_whole(self, study):
        assert _part_in(self.part(study), OF_ONE_SITE) is not None

    @pytest.mark.parametrize("content", ["[" * 100_000, DIGITS, "[]", "1", '{"run": 1}'])
    def test_a_hostile_part_is_a_damaged_one(self, study, tmp_path, content):
        path = tmp_path / "a.json"
        path.write_text(content)
        assert _part_in(path, OF_ONE_SITE) is None

    @pytest.mark.parametrize(
        "edit",
        [
            lambda c: c["run"].pop("status"),
            lambda c: c["run"].update(more=1),
            lambda c: c["streams"][0].pop("stream"),
            lambda c: c.update(streams=[1]),
        ],
    )
    def test_a_part_with_other_columns_is_a_damaged_one(self, study, tmp_path, edit):
        content = json.loads(self.part(study).read_text())
        edit(content)
        content["sha256"] = _checksum(content["run"], content["streams"])
        path = tmp_path / self.part(study).name
        path.write_text(json.dumps(content))
        assert _part_in(path, OF_ONE_SITE) is None

    @pytest.mark.parametrize(
        ("edit", "expected"),
        [
            (lambda c: c.pop("study"), "study.json: study: "),
            (lambda c: c["study"].update(scenario=3), "study.json: study: scenario "),
            (lambda c: c.pop("versions"), "study.json: versions: is no list of versions"),
        ],
    )
    def test_an_edited_study_is_told(self, study, edit, expected):
        mark = study / "o" / "study.json"
        before = mark.read_text()
        content = json.loads(before)
        edit(content)
        mark.write_text(json.dumps(content))
        told = invoke("report", study / "o")
        mark.write_text(before)
        assert_refused(told)
        assert expected in told.err

    def test_a_table_without_its_columns_is_told(self, study):
        path = study / "o" / "runs.parquet"
        before = path.read_bytes()
        pl.read_parquet(path).drop("fuel_l").write_parquet(path)
        told = invoke("report", study / "o")
        path.write_bytes(before)
        assert_refused(told)
        assert "runs.parquet: has no column fuel_l: it was edited" in told.err


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    folder = tmp_path_factory.mktemp("run") / "r"
    coramp.run("paper", engine="exact", horizon_s=30.0, out=folder)
    return folder


class TestRun:
    @pytest.fixture
    def run(self, finished, tmp_path):
        folder = tmp_path / "r"
        folder.mkdir()
        for path in finished.iterdir():
            (folder / path.name).write_bytes(path.read_bytes())
        return folder

    def told(self, run):
        lines = []
        for command in (("explain", run, "r00001"), ("report", run), ("replay", run)):
            told = invoke(*command)
            assert_refused(told)
            (line,) = told.errors
            lines.append(line)
        assert len(set(lines)) == 1
        return lines[0]

    @pytest.mark.parametrize(
        ("edit", "expected"),
        [
            (lambda c: c.pop("seed"), "run.json: seed: is missing; it must be there"),
            (lambda c: c.pop("drivers"), "run.json: drivers: is missing"),
            (lambda c: c.update(scenario=3), "run.json: scenario: 3 cannot be; allowed is a text"),
            (lambda c: c.update(versions=None), "run.json: versions: is no list of versions"),
            (lambda c: c["summary"].pop("fuel_l"), "summary.fuel_l: is missing"),
            (lambda c: c["summary"].update(fuel_l="x"), "summary.fuel_l: 'x' cannot be; allowed"),
            (lambda c: c["summary"].update(seed=-1), "summary.seed: -1 is out of range; allowed"),
            (lambda c: c["summary"].update(seed=True), "summary.seed: True cannot be; allowed is"),
            (lambda c: c.update(summary=[1]), "summary: [1] is not an object; allowed is one"),
            (lambda c: c["specification"].pop("ramp"), "specification: is no valid scenario (ramp"),
            (lambda c: c.update(specification=None), "specification: is no valid scenario ("),
            (lambda c: c["specification"]["ramp"].update(start_m=1e300), "is no valid scenario ("),
            (lambda c: c.update(overrides=10**30), "run.json: overrides: is too large"),
        ],
    )
    def test_an_edited_run_json_is_told(self, run, edit, expected):
        content = json.loads((run / "run.json").read_text())
        changed = copy.deepcopy(content)
        edit(changed)
        (run / "run.json").write_text(json.dumps(changed))
        assert expected in self.told(run)

    @pytest.mark.parametrize(
        ("name", "edit", "expected"),
        [
            ("vehicles", lambda f: f.drop("entry_s"), "vehicles.parquet: has no column entry_s"),
            ("speeds", lambda f: f.drop("time_s"), "speeds.parquet: has no column time_s"),
            ("decisions", lambda f: f.drop("rung"), "decisions.parquet: has no column rung"),
            ("trajectories", lambda f: f.drop("lane"), "trajectories.parquet: has no column lane"),
            (
                "vehicles",
                lambda f: f.with_columns(pl.col("entry_s").cast(pl.String)),
                "vehicles.parquet: entry_s holds String; allowed is Float64",
            ),
        ],
    )
    def test_an_edited_table_is_told(self, run, name, edit, expected):
        path = run / f"{name}.parquet"
        edit(pl.read_parquet(path)).write_parquet(path)
        assert expected in self.told(run)

    def test_a_run_of_an_older_version_lacks_columns_and_is_read(self, run):
        content = json.loads((run / "run.json").read_text())
        content["result_version"] = 3
        del content["summary"]["discharge_flow_veh_h"]
        (run / "run.json").write_text(json.dumps(content))
        assert invoke("report", run).code == 0


def test_what_is_built_in_passes():
    for kind in ("scenarios", "studies", "snapshots"):
        assert long_key_in(built_in(kind, "paper" if kind != "snapshots" else "example")) is None
