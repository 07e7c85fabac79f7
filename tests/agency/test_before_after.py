"""Before and after on the same arrivals, and the summary on two pages."""

import json
import math
import re

import polars as pl
import pytest

import coramp
from coramp.agency.before_after import Change, Measured, changes, paired
from coramp.agency.detectors import detectors_of
from coramp.agency.export import LOOP_FILES, csv_text
from coramp.agency.figures import FIGURES, densest_pc_mi_ln, letter_of
from coramp.agency.motion import motion_of
from coramp.agency.schemas import AGENCY
from coramp.agency.tables import agency_tables
from coramp.errors import CorampError
from coramp.report.page.summary import compared_words, summary_of, summary_of_pairs
from coramp.report.writing import report
from coramp.studies.statistics import estimate
from tests.agency import motion_by_hand, run_by_hand
from tests.edges import assert_refused, invoke
from tests.metrics import Car
from tests.report.browser import chromium, in_browser

TRAFFIC = {"mainline_veh_h": 1600.0, "ramp_veh_h": 500.0, "horizon_s": 120.0}
SEEDS = (1, 2, 3)


@pytest.fixture(scope="module")
def folders(tmp_path_factory):
    """Runs before and after with three seeds, in a folder each."""
    root = tmp_path_factory.mktemp("agency")
    for name, time_gap_s in (("before", 1.2), ("after", 0.0)):
        for seed in SEEDS:
            own = {"overrides": {"safety.time_gap_s": time_gap_s}, "out": root / name / str(seed)}
            coramp.run("paper", engine="exact", seed=seed, **own, **TRAFFIC)
    return root


@pytest.fixture(scope="module")
def pairs(folders):
    return paired(folders / "before", folders / "after")


def test_runs_are_paired_by_seed(pairs):
    seeds = [(a.run.summary["seed"], b.run.summary["seed"]) for a, b in pairs]
    assert seeds == [(1, 1), (2, 2), (3, 3)]
    for before, after in pairs:
        assert before.run.scenario.safety.time_gap_s == 1.2
        assert after.run.scenario.safety.time_gap_s == 0.0


def test_differences_are_taken_seed_by_seed(pairs):
    found = {change.key: change for change in changes(pairs)}
    delays = [
        (a.run.summary["mainline_delay_s"], b.run.summary["mainline_delay_s"]) for a, b in pairs
    ]
    change = found["mainline_delay_s"]
    assert change.before == estimate([a for a, _ in delays])
    assert change.after == estimate([b for _, b in delays])
    assert change.change == estimate([b - a for a, b in delays])
    assert change.change.mean == pytest.approx(change.after.mean - change.before.mean)
    assert change.change.values == len(SEEDS)
    assert list(found) == list(FIGURES)


def test_figures_are_those_of_the_run(pairs):
    measured = pairs[0][0]
    found, run = measured.figures, measured.run
    vehicles = run.vehicles
    assert found["delay_h"] == pytest.approx(vehicles["delay_s"].sum() / 3600.0)
    assert found["fuel_l"] == pytest.approx(run.summary["fuel_l"])
    through = vehicles.filter(pl.col("exit_s") <= 120.0).height
    assert found["through"] == through
    assert found["throughput_veh_h"] == pytest.approx(through * 30.0)
    assert found["broken_down_min"] == 0.0
    assert math.isnan(measured.breakdown_min)


def test_one_pair_has_no_interval(pairs):
    for change in changes(pairs[:1]):
        assert math.isnan(change.change.half_width)
        assert not change.is_sure


def test_what_cannot_be_paired_is_refused(folders, tmp_path):
    with pytest.raises(CorampError, match=r"holds no run, and no folders of runs"):
        paired(tmp_path, folders / "after")
    with pytest.raises(CorampError, match=r"has the seeds 1, 2, 3, and .* has 1; allowed"):
        paired(folders / "before" / "1", folders / "after")
    other = {**TRAFFIC, "ramp_veh_h": 400.0}
    coramp.run("paper", engine="exact", seed=1, out=tmp_path / "other", **other)
    with pytest.raises(CorampError, match=r"other vehicles arrive there with seed 1"):
        paired(folders / "before" / "1", tmp_path / "other")
    coramp.run("paper", engine="exact", seed=1, out=tmp_path / "again", **other)
    with pytest.raises(CorampError, match=r"other: is a second run with seed 1 in "):
        paired(tmp_path, tmp_path / "other")


def test_the_densest_15_minutes_count():
    """The lane is 200 m: two stand from 300 s on, among 600 m of lanes; the run lasts 25 min."""
    cars = [
        Car(f"m{k}", [(300.0, 10.0 * k, 0.0, 0.0)], scheduled_s=300.0, entry_s=300.0)
        for k in (1, 2)
    ]
    cars.insert(0, Car("m0", [(0.0, -400.0, 20.0, 0.0)], exit_s=40.0))
    motion = motion_by_hand(cars, 1500.0)
    assert densest_pc_mi_ln(motion) == pytest.approx(2.0 / 0.6 * 1.609344)
    assert letter_of({"density_pc_mi_ln": 12.0, "broken_down_min": 0.0}) == "B"
    assert letter_of({"density_pc_mi_ln": 12.0, "broken_down_min": 15.0}) == "F"


def test_words_say_what_the_table_says(pairs):
    found = summary_of_pairs(pairs)
    words = " ".join(found["words"])
    by = {change.key: change for change in changes(pairs)}
    told = ("time_spent_h", "mainline_delay_s", "ramp_delay_s", "co2_kg")
    for key in told:
        digits = FIGURES[key].digits
        assert f"{by[key].after.mean:.{digits}f}" in words
        assert f"{by[key].before.mean:.{digits}f} before" in words
    assert "1600 vehicles an hour on the mainline and 500 on the ramp over 2 minutes" in words
    assert "3 draws of arrivals" in words
    assert "Traffic breaks down neither before nor after" in words
    sure = [by[key].is_sure for key in told]
    assert words.count("this is sure") == sum(sure)
    assert words.count("this may be chance") == len(told) - sum(sure)
    assert by["time_spent_h"].change.mean < 0.0
    assert words.count(" less (") == len(told)
    rows = {row[0]: row[1:] for row in found["table"].rows}
    label = FIGURES["mainline_delay_s"].label
    assert rows[label][0] == f"{by['mainline_delay_s'].before.mean:.1f}"
    assert "±" in rows[label][2]


@pytest.mark.parametrize(
    ("after", "words"),
    [
        ([8.0, 9.0], "They emit 8.5 kg after, 10.0 before: 1.5 less (15 %); this may be chance."),
        ([8.0, 8.2], "They emit 8.1 kg after, 10.0 before: 1.9 less (19 %); this is sure."),
        ([12.0, 12.2], "They emit 12.1 kg after, 10.0 before: 2.1 more (21 %); this is sure."),
        ([10.01, 10.02], "They emit 10.0 kg after, 10.0 before: no difference."),
        ([8.0], "They emit 8.0 kg after, 10.0 before: 2.0 less (20 %)."),
    ],
)
def test_a_sentence_says_whether_the_difference_is_sure(after, words):
    before = [10.0] * len(after)
    change = Change(
        "co2_kg", estimate(before), estimate(after), estimate([a - 10.0 for a in after])
    )
    assert compared_words(change, "They emit", "kg") == words


def test_a_run_alone_has_a_summary_of_its_own(pairs):
    found = summary_of([pairs[0][1]])
    words = " ".join(found["words"])
    assert "With mainline priority vehicles lose" in words
    assert "every vehicle gets through" in words
    assert found["table"].columns == ("what", "value")
    assert len(found["pictures"]) == 2


def test_what_happened_is_told_even_where_it_is_bad():
    """Who stands never gets out; nobody is on the ramp."""
    run = run_by_hand([Car("m1", [(0.0, -300.0, 0.0, 0.0)])], 900.0)
    words = " ".join(summary_of([Measured(run)])["words"])
    assert "1 vehicle does not get through" in words
    assert "Traffic does not break down" in words


@in_browser
def test_the_summary_prints_on_two_pages(folders, tmp_path):
    page_file = tmp_path / "compared.html"
    told = invoke("compare", folders / "before", folders / "after", "--out", page_file, "--kmh")
    assert told.code == 0, told.err
    written = report(folders / "after" / "1", folders / "before" / "1")
    with chromium() as browser:
        page = browser.new_page()
        page.goto(page_file.as_uri())
        for paper in ("A4", "Letter"):
            assert len(re.findall(rb"/Type /Page\b", page.pdf(format=paper))) == 2
        page.goto(written.as_uri())
        assert page.locator("main h2").first.inner_text() == "Summary"
        assert page.locator(".summary img").count() == 2
        page.emulate_media(media="print")
        page.set_viewport_size({"width": 720, "height": 900})  # Letter less margins, in CSS px
        heights = page.evaluate(
            "[...document.querySelectorAll('.summary .sheet')].map(s => s.offsetHeight)"
        )
        assert max(heights) < 960 - 80  # less the header of the page
        page.close()


def test_compare_prints_and_draws(folders, tmp_path):
    told = invoke(
        "compare", folders / "before", folders / "after", "--plot", tmp_path / "p.png", "--wide"
    )
    assert told.code == 0, told.err
    assert told.out.startswith("Means of 3 seeds, with 95 % intervals of the difference")
    assert (tmp_path / "p.png").stat().st_size > 10_000
    told = invoke("compare", folders / "before", folders / "after", "--json")
    rows = json.loads(told.out)
    assert [row["figure"] for row in rows] == list(FIGURES)
    assert set(rows[0]) == {"figure", "unit", "before", "after", "change", "half_width", "seeds"}
    alone = json.loads(invoke("compare", folders / "before/1", folders / "after/1", "--json").out)
    assert alone[0]["half_width"] is None
    assert_refused(
        invoke("compare", folders / "before", folders / "after", "--out", tmp_path / "p.pdf")
    )


def test_export_writes_every_table_once(folders, tmp_path):
    source, out = folders / "after" / "1", tmp_path / "tables"
    told = invoke("export", source, out)
    assert told.code == 0, told.err
    stored = {path.stem for path in source.glob("*.parquet")}
    assert {path.stem for path in out.glob("*.csv")} == {*stored, *AGENCY, "flowrouter"}
    assert {path.name for path in out.iterdir()} >= set(LOOP_FILES)
    vehicles = pl.read_csv(out / "vehicles.csv")
    kept = pl.read_parquet(source / "vehicles.parquet")
    assert vehicles.columns == kept.columns
    assert vehicles["delay_s"].to_list() == kept["delay_s"].to_list()
    for name, schema in AGENCY.items():
        assert pl.read_csv(out / f"{name}.csv").columns == list(schema)
    assert_refused(invoke("export", source, out))
    assert_refused(invoke("export", tmp_path / "nowhere", tmp_path / "new"))
    assert not (tmp_path / "new").exists()


def test_export_of_a_study_writes_its_rows(tmp_path):
    (tmp_path / "s.toml").write_text(
        'name = "small"\nscenario = "paper"\nhorizon_s = 30.0\n[[runs]]\n'
        'strategies = ["mainline-priority"]\nflows_veh_h = [[800, 200]]\nengine = "exact"\n'
    )
    coramp.study(str(tmp_path / "s.toml"), seeds=2, jobs=1, out=tmp_path / "study")
    assert invoke("export", tmp_path / "study", tmp_path / "tables").code == 0
    assert pl.read_csv(tmp_path / "tables" / "runs.csv").height == 2
    assert pl.read_csv(tmp_path / "tables" / "streams.csv").height == 4


def test_lists_and_nothing_in_a_cell():
    frame = pl.DataFrame({"a": [["x", "y"], None], "b": [1.5, None]})
    assert csv_text(frame) == "a,b\nx y,1.5\n,\n"


def test_tables_have_their_columns(pairs):
    motion = motion_of(pairs[0][0].run)
    for name, frame in agency_tables(motion).items():
        assert dict(frame.schema) == AGENCY[name]
    assert len({d.name for d in detectors_of(motion.scenario)}) == 5
