"""Studies of a corridor: the same rows wherever they run, and after an interruption."""

import json
import shutil
from itertools import pairwise

import polars as pl
import pytest

import coramp
from coramp import CorampError
from coramp.demand.corridor_demand import traffic_of
from coramp.records.corridor_outcome import CORRIDOR_RUNS, CORRIDOR_SITES, SITES, TOTALS
from coramp.report.study_folder import read_study
from coramp.report.writing import report
from coramp.scenarios.corridors import load_corridor
from coramp.studies import runner
from coramp.studies.corridor_paired import WHOLE, delays_of, gains
from tests.corridors import SITES as BOTH
from tests.corridors import written

STUDY = """
name = "strategies"
description = "Two sites, one road."
scenario = "road.toml"
seeds = 2
horizon_s = 30.0

[[runs]]
strategies = ["uncontrolled", "mixed-slots"]
"""
SHARES = '[runs.set]\n"traffic.automated_share" = [0.5, 1.5]\n'


class StoppedError(Exception):
    """What stops a study, as ctrl-c would."""


def study_in(folder, network, text=STUDY):
    """Writes a corridor and a study of it; returns the study's file."""
    written(folder, network)
    (folder / "study.toml").write_text(text)
    return str(folder / "study.toml")


@pytest.fixture(scope="module")
def resumed(tmp_path_factory, network):
    """The study's file, its states, and what it gives after it was stopped once and resumed."""
    folder = tmp_path_factory.mktemp("resumed")
    definition = study_in(folder, network)

    def stop(state):
        if state.done == 1:
            raise StoppedError

    with pytest.raises(StoppedError):
        coramp.study(definition, jobs=1, out=folder / "o", progress=stop)
    assert not (folder / "o" / "runs.parquet").exists()
    states = []
    result = coramp.study(definition, jobs=2, out=folder / "o", progress=states.append)
    return definition, states, result


def apart_from_time(runs):
    return runs.drop("wall_s")


def test_one_row_a_run_and_one_a_site(resumed):
    _, states, result = resumed
    assert states[0].skipped >= 1
    assert dict(result.runs.schema) == CORRIDOR_RUNS
    assert dict(result.sites.schema) == CORRIDOR_SITES
    assert result.runs.select("strategy", "seed").rows() == [
        ("mixed-slots", 1), ("mixed-slots", 2), ("uncontrolled", 1), ("uncontrolled", 2),
    ]  # fmt: skip
    assert result.failed.is_empty()
    assert result.broken_promises == []
    assert result.sites["site"].to_list() == [*BOTH] * 4
    assert result.sites["run_id"].to_list() == [
        run_id for run_id in result.runs["run_id"] for _ in BOTH
    ]
    stored = pl.read_parquet(result.folder / "sites.parquet")
    assert stored.equals(result.sites)
    assert coramp.load(result.folder).sites.equals(result.sites)


@pytest.mark.filterwarnings("ignore")
def test_dask_gives_what_processes_give_after_an_interruption(resumed, dask, tmp_path):
    definition, _, here = resumed
    address, _ = dask
    there = coramp.study(definition, cluster=address, out=tmp_path / "o")
    assert apart_from_time(there.runs).equals(apart_from_time(here.runs))
    assert there.sites.equals(here.sites)
    assert there.tables == here.tables


def test_a_study_gives_what_a_run_alone_gives(resumed):
    definition, _, result = resumed
    row = result.runs.filter(strategy="mixed-slots", seed=2).row(0, named=True)
    scenario = definition.replace("study.toml", "road.toml")
    alone = coramp.corridor(scenario, overrides={"simulation.horizon_s": 30.0}, seed=2)
    assert {name: row[name] for name in TOTALS} == alone.summary
    sites = result.sites.filter(run_id=row["run_id"]).select(*SITES)
    assert sites.equals(alone.sites)
    trips = alone.frames["trips"]
    from_ramps = trips.filter(pl.col("origin").str.contains("@"))
    assert row["ramp_delay_s"] == pytest.approx(from_ramps["delay_s"].mean())
    whole_s = row["mainline_delay_s"] * (trips.height - from_ramps.height)
    whole_s += row["ramp_delay_s"] * from_ramps.height
    assert whole_s == pytest.approx(row["delay_s"], abs=1e-6)
    times_s = sorted(trips["left_s"] - trips["scheduled_s"])
    assert times_s[0] < row["travel_p50_s"] < row["travel_p95_s"] <= times_s[-1]
    assert row["fallbacks"] == alone.sites["fallbacks"].sum()


def test_gains_are_differences_on_the_same_arrivals(resumed):
    _, _, result = resumed
    found = {gain.place: gain for gain in gains(result.runs, result.sites)}
    assert list(found) == [WHOLE, *BOTH]
    mean_s = {
        (row["strategy"], row["seed"]): row["mean_delay_s"]
        for row in result.runs.iter_rows(named=True)
    }
    by_s = [mean_s["uncontrolled", seed] - mean_s["mixed-slots", seed] for seed in (1, 2)]
    assert found[WHOLE].by_s[0].mean == pytest.approx(sum(by_s) / 2.0)
    assert found[WHOLE].by_s[0].values == 2
    delays = delays_of(result.runs, result.sites).filter(place=BOTH[0])
    row = result.sites.filter(site=BOTH[0]).row(0, named=True)
    served = row["mainline_served"], row["ramp_served"]
    lost_s = row["mainline_delay_s"] * served[0] + row["ramp_delay_s"] * served[1]
    assert delays["delay_s"][0] == pytest.approx(lost_s / sum(served))
    titles = [table.title for table in result.tables]
    assert titles == [
        *("The corridor", "By site", "Against uncontrolled on the same arrivals", "Promises"),
    ]
    gained = result.tables[2]
    assert [row[0] for row in gained.rows] == [WHOLE, *BOTH]
    assert {row[-1] for row in gained.rows} == {"2"}


def test_the_arrivals_of_a_seed_are_the_same_for_every_share(tmp_path, network):
    path = written(tmp_path, network, 0.5)
    known = []
    for share in (0.0, 0.5, 1.0):
        corridor = load_corridor(path, {"traffic.automated_share": share})
        traffic = traffic_of(corridor, 7)
        known.append(
            [
                (arrival.vehicle_id, arrival.step, way)
                for own in traffic
                for arrival, way in zip(own.arrivals, own.leaves_by, strict=True)
            ]
        )
        automated = sum(int(own.automated.sum()) for own in traffic)
        assert automated == pytest.approx(share * len(known[-1]), abs=0.15 * len(known[-1]))
    assert len(known[0]) > 50
    assert all(one == other for one, other in pairwise(known))


def test_a_run_that_fails_is_a_row_and_runs_again(resumed, tmp_path, monkeypatch):
    definition, _, result = resumed
    folder = tmp_path / "o"
    shutil.copytree(result.folder, folder)
    lost = result.runs["run_id"][0]
    (folder / "parts" / f"{lost}.json").unlink()

    def failing(spec):
        raise CorampError("SUMO: gone")

    with monkeypatch.context() as patch:
        patch.setattr(runner, "execute_corridor", failing)
        broken = coramp.study(definition, jobs=1, out=folder)
    assert broken.failed.select("run_id", "error").rows() == [(lost, "SUMO: gone")]
    assert broken.failed["mean_delay_s"].to_list() == [None]
    assert lost not in broken.sites["run_id"]
    again = coramp.study(definition, jobs=1, out=folder)
    assert apart_from_time(again.runs).equals(apart_from_time(result.runs))
    assert again.sites.equals(result.sites)


def test_a_folder_of_a_corridors_study_is_none_of_one_site(resumed, tmp_path):
    _, _, result = resumed
    content = json.loads((result.folder / "study.json").read_text())
    assert content["kind"] == "corridor study"
    assert content["scenario"]["corridor"]["sites"] == [*BOTH]
    with pytest.raises(CorampError, match="holds another study"):
        coramp.study(
            study_in(tmp_path, content["scenario"]["corridor"]["file"]),
            seeds=1,
            out=_with_another_name(result.folder, tmp_path),
        )


def _with_another_name(folder, tmp_path):
    shutil.copytree(folder, tmp_path / "o")
    content = json.loads((tmp_path / "o" / "study.json").read_text())
    (tmp_path / "o" / "study.json").write_text(json.dumps({**content, "kind": "study"}))
    return tmp_path / "o"


def test_its_page_answers_and_the_figures_of_one_site_refuse_it(resumed):
    _, _, result = resumed
    page = report(result.folder).read_text()
    delay_s = result.tables[0].rows[0][2]
    assert f"a vehicle loses {delay_s} s on average" in page
    assert "than uncontrolled; this " in page
    assert page.count("data:image/svg+xml") == 1
    assert "coramp study study.toml --seeds 2" in page
    assert all(site in page for site in BOTH)
    assert result.plot_delay().get_axes()[0].get_title() == "mainline"
    assert "<table" in result._repr_html_()
    assert set(result.to_pandas()) == {"runs", "sites"}
    with pytest.raises(CorampError, match="holds the study of a corridor, of which there is no"):
        read_study(result.folder)
    with pytest.raises(CorampError, match=r"^over: flow: a corridor's study is drawn by site"):
        result.plot_delay("flow")


def test_what_is_ahead_is_told(resumed, tmp_path):
    definition, _, result = resumed
    ahead = coramp.api.outlook(definition, seeds=3, out=result.folder)
    assert (ahead.runs, ahead.done, ahead.failed, ahead.searches_at_most) == (6, 4, 0, 0)
    assert ahead.expected_s > 0.0
    fresh = coramp.api.outlook(definition, out=tmp_path / "none")
    assert (fresh.runs, fresh.done) == (4, 0)


@pytest.mark.parametrize(
    ("text", "line"),
    [
        (STUDY + SHARES, r"traffic\.automated_share: .*1\.5"),
        (
            STUDY + "mainline_veh_h = [900.0]\nramp_veh_h = [200.0]\n",
            "runs: flows are those of one",
        ),
        (STUDY + 'engine = "exact"\n', "runs: engine: exact knows no corridors; allowed is sumo"),
        ('layout = "paper"\n' + STUDY, "layout: paper is for one merge site"),
        (STUDY.replace("mixed-slots", "slots"), "slots"),
        (STUDY + 'drivers = ["nobody"]\n', "nobody"),
        (STUDY + '[runs.set]\n"corridor.ramp_flow_veh_h" = [[1.0]]\n', "has 1 flows for 2 sites"),
    ],
)
def test_what_cannot_be_studied_is_told_in_a_line(tmp_path, network, text, line):
    with pytest.raises(CorampError, match=line) as told:
        coramp.study(study_in(tmp_path, network, text), out=tmp_path / "o")
    assert all(message.startswith(str(tmp_path)) for message in told.value.messages)
    assert all("\n" not in message for message in told.value.messages)
    assert not (tmp_path / "o").exists()
