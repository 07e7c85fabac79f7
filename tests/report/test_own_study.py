"""The report of a study of one's own, and speeds and delays over time in it."""

import html
import re
import tomllib

import numpy as np
import polars as pl
import pytest

import coramp
from coramp.report.over_time_figure import (
    binned,
    delays_over_time_figure,
    speeds_over_time_figure,
)
from coramp.report.page.study_answer import own_answer
from coramp.report.page.study_repeat import repeat_command
from coramp.report.page.study_sure import of_differences, of_little
from coramp.report.varied_figure import varied
from coramp.report.writing import report
from coramp.scenarios.toml_files import builtin_text
from coramp.studies.definition import Study, load_study
from coramp.studies.speed_unit import KMH
from coramp.studies.summary import overview
from coramp.studies.tables import Table, without_same
from tests.edges import invoke
from tests.report.browser import chromium, in_browser, opened
from tests.study import overridden, run_row, runs_of

STUDY = """
name = "own"
scenario = "paper"
horizon_s = 60.0
seeds = 2

[[runs]]
strategies = ["mainline-priority", "slots", "uncontrolled"]
engine = "exact"
flows_veh_h = [[900.0, 400.0]]
set = { "safety.time_gap_s" = [0.6, 1.0] }
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    root = tmp_path_factory.mktemp("own")
    (root / "own.toml").write_text(STUDY)
    coramp.study(str(root / "own.toml"), jobs=1, out=root / "own")
    return root / "own"


def captions(text):
    return re.findall(r"<figcaption>(.*?)</figcaption>", text)


def test_a_first_report_has_its_pictures_and_runs_to_watch(folder):
    text = report(folder).read_text()
    at = "at 900 + 400 veh/h, 0.6 s + 0 m, seed 1"
    assert re.search(r"horizon of a run \(s\)</td><td[^>]*>60</td>", text)
    assert captions(text) == [
        "Mean delay over what varies, with 95 % intervals over seeds",
        f"Mean speed over time {at}, the first of 2 settings",
        f"Mean delay over time {at}, the first of 2 settings",
    ]
    assert f"and the replay, are of {at.removeprefix('at ')}, the first of 2 settings." in text
    another = re.search(r"<pre[^>]*><code># another: (.*?)</code>", text, re.DOTALL).group(1)
    assert another.splitlines()[0] == "time gap 1.0 s, seed 1"
    assert another.count("coramp run paper --strategy") == 3
    assert another.count("--drivers fair") == 1
    assert "--set safety.time_gap_s=1.0 --out out/b" in another
    assert another.splitlines()[-2:] == [
        f"coramp report out/a --against out/{other}" for other in "bc"
    ]
    assert re.findall(r'id="run-\d"', text) == ['id="run-0"', 'id="run-1"', 'id="run-2"']
    assert "has kept no runs to watch" not in text
    assert "<summary>Differences on the same arrivals</summary>" in text


def test_the_answer_tells_each_setting_apart(folder):
    text = report(folder).read_text()
    answer = re.search(r'id="answer">(.*?)</div>', text, re.DOTALL).group(1)
    assert re.findall(r"<li><strong>(.*?):</strong>", answer) == ["0.6 s + 0 m", "1.0 s + 0 m"]
    assert answer.count("no control, fair drivers (who keep 1.0 s + 2.5 m)") == 2
    assert len(re.findall(r"is best by \d+\.\d\d ± \d+\.\d\d s over", answer)) == 2
    assert "time_gap_s" not in answer


def test_every_row_tells_the_value_of_what_varies_and_the_answers_names(tmp_path):
    blocks = STUDY.replace("[0.6, 1.0]", "[0.0, 1.0]").replace("60.0", "30.0")
    (tmp_path / "own.toml").write_text(blocks)
    coramp.study(str(tmp_path / "own.toml"), jobs=1, out=tmp_path / "own")
    text = report(tmp_path / "own").read_text()
    assert "as in the scenario" not in text
    assert "mainline priority (mainline-priority); slots; no control, fair drivers (unc" in text
    own = re.search(r'aria-label="All runs">(.*?)</table>', text, re.DOTALL).group(1)
    told = re.findall(r"<tr><td[^>]*>(.*?)</td><td[^>]*>(.*?)</td>", own)
    gaps = ("time gap 0 s", "time gap 1.0 s")
    names = ("mainline priority", "slots", "no control, fair drivers")
    assert sorted(told) == sorted((name, gap) for name in names for gap in gaps)
    pairs = re.search(r'aria-label="Differences.*?">(.*?)</table>', text, re.DOTALL).group(1)
    cells = re.findall(r"<td[^>]*>((?:mainline|slots|no control).*?)</td>", pairs)
    assert cells
    assert all(cell.endswith(gaps) for cell in cells)
    assert "no gaps beyond Eq. 1, seed 1, the first of 2 settings" in captions(text)[1]


def test_what_columns_mean_and_how_sure_differences_are_is_said(folder):
    text = report(folder).read_text()
    fold = re.search(r"What the columns mean</summary>(.*?)</details>", text, re.DOTALL).group(1)
    own = re.search(r'aria-label="All runs">(.*?)</table>', text, re.DOTALL).group(1)
    heads = [h.partition(" (")[0] for h in re.findall(r"<th[^>]*>(.*?)</th>", own)[2:]]
    assert set(re.findall(r"<dt>(.*?)</dt>", fold)) == set(heads)
    sure = text.split("<h2>How sure</h2>")[1].split("<h2>")[0]
    assert "seed by seed on the same arrivals, so they are surer than the means" in sure
    assert "There are 2 seeds and 60 s of arrivals a run, which is little" in sure


def test_how_sure_counts_differences_that_may_be_chance():
    def delays(strategy, by_seed):
        return [run_row(strategy, seed=s, delay_s=d) for s, d in enumerate(by_seed, 1)]

    slots = delays("slots", (1.0, 5.0, 9.0))
    (sure,) = of_differences(runs_of(*slots, *delays("game", (1.5, 5.7, 9.6))))
    assert sure.endswith("The intervals of all differences in the answer exclude zero.")
    (unsure,) = of_differences(runs_of(*slots, *delays("game", (1.5, 4.7, 9.6))))
    assert "The intervals of 1 of the 1 differences in the answer hold zero" in unsure
    assert list(of_differences(runs_of(*slots))) == []


@pytest.mark.parametrize(
    ("seeds", "horizon_s", "told"),
    [(3, 60.0, "3 seeds and 60 s"), (1, 60.0, "60 s"), (3, 3600.0, "3 seeds"), (10, 1800.0, None)],
)
def test_few_seeds_and_a_short_horizon_are_told(seeds, horizon_s, told):
    lines = list(of_little(seeds, horizon_s))
    assert [line.startswith(f"There are {told}") for line in lines] == ([True] if told else [])


def test_the_note_on_the_bound_stands_only_beside_it():
    drivers = runs_of(run_row("uncontrolled"), run_row("uncontrolled", seed=2))
    assert not any("Least delay" in note for note in overview(drivers).notes)
    beside = overview(runs_of(run_row(delay_bound_s=1.0)))
    assert any("Least delay" in note for note in beside.notes)


PAIRED = """
[[runs]]
strategies = ["mainline-priority", "uncontrolled"]
flows_veh_h = [[900.0, 400.0]]
set = { "safety.time_gap_s" = GAP, "safety.standstill_gap_m" = [2.5], "drivers.fair.tau_s" = GAP }
"""


def test_drivers_whose_gaps_vary_along_are_told_with_their_own(tmp_path):
    blocks = "".join(PAIRED.replace("GAP", gap) for gap in ("[1.0]", "[0.6]"))
    head = STUDY.partition("[[runs]]")[0].replace("60.0", "30.0")
    (tmp_path / "own.toml").write_text(head + blocks)
    said = []
    coramp.study(str(tmp_path / "own.toml"), jobs=1, out=tmp_path / "own", notice=said.append)
    text = report(tmp_path / "own").read_text()
    answer = re.search(r'id="answer">(.*?)</div>', text, re.DOTALL).group(1)
    assert re.findall(r"\(who keep (.*?)\)", answer) == ["0.6 s + 2.5 m", "1.0 s + 2.5 m"]
    assert "at unequal gaps" not in answer
    assert "Drivers drive the same" not in text
    assert not [line for line in said if "for coordinated vehicles only" in line]


def test_what_compares_unequal_gaps_says_so_and_how_to_vary_both(folder):
    text = report(folder).read_text()
    answer = re.search(r'id="answer">(.*?)</div>', text, re.DOTALL).group(1)
    assert len(re.findall(r"over no control, fair drivers at unequal gaps", answer)) == 2
    assert not re.search(r"over (slots|mainline priority) at unequal gaps", answer)
    note = re.search(r'<p class="note">(time gap.*?)</p>', text).group(1)
    assert "same with every value" in note
    assert "which sets safety.time_gap_s and drivers.fair.tau_s" in note


def test_the_files_of_ones_own_are_shown_whole_with_their_names(tmp_path):
    scenario = builtin_text("paper")
    (tmp_path / "roads").mkdir()
    (tmp_path / "roads" / "mine.toml").write_text(f"# a ramp <of> mine\n{scenario}")
    study = STUDY.replace('scenario = "paper"', 'scenario = "roads/mine.toml"')
    (tmp_path / "asked.toml").write_text(study)
    out = tmp_path / "o"
    coramp.study(str(tmp_path / "asked.toml"), seeds=1, jobs=1, out=out)
    text = report(out).read_text()
    assert "<code>coramp study asked.toml --seeds 1</code>" in text
    for name, content in (("asked.toml", study), ("roads/mine.toml", "# a ramp <of> mine")):
        fold = re.search(f"<summary>{name}</summary>(.*?)</details>", text, re.DOTALL).group(1)
        assert content in html.unescape(fold)
    (tmp_path / "roads" / "mine.toml").write_text(f"# another\n{scenario}")
    assert "a ramp &lt;of&gt; mine" in report(out).read_text()
    coramp.study(str(tmp_path / "asked.toml"), seeds=1, jobs=1, out=out)
    assert "# another\n" in report(out).read_text()


def test_an_engine_that_an_option_chose_is_in_the_command():
    built_in = load_study("paper")
    assert repeat_command(built_in, {}, 3) == "coramp study paper --seeds 3"
    moved = repeat_command(built_in.on_engine("exact"), {}, 3)
    assert moved == "coramp study paper --seeds 3 --engine exact"
    own = {"mine.toml": STUDY}
    study = Study.model_validate(tomllib.loads(STUDY))
    assert repeat_command(study, own, 2) == "coramp study mine.toml --seeds 2"
    assert repeat_command(study.on_engine("sumo"), own, 2).endswith("--seeds 2 --engine sumo")


@in_browser
def test_a_phone_shows_strategy_setting_and_delay_first(folder):
    with chromium() as browser, opened(browser, report(folder).as_uri(), 375) as page:
        heads = page.locator("main table").first.locator("th")
        assert heads.all_inner_texts()[:3] == ["strategy", "setting", "delay of all (s)"]
        box = heads.nth(2).bounding_box()
        assert box["x"] + box["width"] <= 375
        assert page.evaluate("document.documentElement.scrollWidth") <= 375


@in_browser
def test_diagrams_begin_where_the_replay_stands(folder):
    with chromium() as browser, opened(browser, report(folder).as_uri(), 1400) as page:
        time_s = page.evaluate("coramp.shown.replay.time")
        assert time_s > 5.0
        for place in range(2):
            low, high = page.evaluate(
                f"(({{min, max}}) => [min, max])(coramp.shown.diagrams[{place}].plot.scales.x)"
            )
            assert low <= time_s <= high


def test_axes_of_speeds_say_where_they_begin():
    run = coramp.run("paper", engine="exact", horizon_s=100.0, mainline_veh_h=900)
    figure = speeds_over_time_figure([run], KMH)
    assert "mean speed of those on the road (km/h)" in figure.get_supylabel()
    for axes in figure.axes:
        low = axes.get_ylim()[0]
        assert low == 0.0 or f"(axis from {low:g})" in axes.get_title()
        assert low <= min(axes.get_lines()[0].get_ydata())
    assert figure.axes[-1].get_xlabel() == "time (s)"
    assert delays_over_time_figure([run]).axes[-1].get_xlabel() == "time when due (s)"


def test_numbers_stand_to_the_right(folder):
    text = report(folder).read_text()
    assert re.search(r'<td class="short number">\d+\.\d\d ± \d+\.\d\d</td>', text)
    assert '<th scope="col" class="number">delay of all (s)</th>' in text
    assert re.search(r'<td(?! class="short number)[^>]*>slots</td>', text)


def test_speeds_can_be_shown_in_kmh(folder):
    mps, kmh = report(folder).read_text(), report(folder, kmh=True).read_text()
    assert "mainline speed (m/s)" in mps
    assert "mainline speed (km/h)" in kmh
    assert "m/s)" not in kmh.split("<h2>What happened")[0].split("<tbody>")[1].split("<script")[0]
    speeds = pl.read_parquet(folder / "runs.parquet")["mainline_speed_mps"]
    told = [float(v) for v in re.findall(r">(\d+\.\d\d) ± \d+\.\d\d<", kmh)]
    assert any(60.0 < v < 73.0 for v in told)
    assert all(16.0 < v < 20.1 for v in speeds)


def test_the_report_of_a_run_has_speed_and_delay_over_time_too(tmp_path):
    out = tmp_path / "r"
    coramp.run("paper", engine="exact", horizon_s=60.0, out=out)
    assert invoke("report", out, "--kmh").code == 0
    text = (out / "report.html").read_text()
    ours = [line.split(" (")[0].split(" at ")[0] for line in captions(text)]
    assert ours[:2] == ["Speed on the mainline", "Queues over time"]  # the summary's
    assert ours[2:] == ["Mean speed over time", "Mean delay over time"]
    assert "-400 to 400 m, 72 km/h" in text
    assert "mainline speed (km/h)" in text
    told = float(re.search(r"mainline speed \(km/h\)</td><td[^>]*>([\d.]+)<", text).group(1))
    assert told == pytest.approx(3.6 * coramp.load(out).summary["mainline_speed_mps"], abs=0.006)
    assert "--kmh" in invoke("report", "--help").out


def test_bins_hold_weighed_means_and_empty_ones_are_left_out():
    frame = pl.DataFrame({"t": [0.0, 5.0, 31.0], "v": [10.0, 20.0, 7.0], "n": [1, 3, 2]})
    times_s, means = binned(frame, ("t", "v", "n"), 10.0)
    assert times_s.tolist() == [5.0, 35.0]
    assert means.tolist() == [17.5, 7.0]
    assert len(binned(frame.clear(), ("t", "v", "n"), 10.0)[0]) == 0


def test_lines_over_time_are_those_of_the_records():
    run = coramp.run("paper", engine="exact", horizon_s=100.0, mainline_veh_h=900)
    mainline, ramp = delays_over_time_figure([run]).axes
    for axes, stream in ((mainline, "mainline"), (ramp, "ramp")):
        (line,) = axes.get_lines()
        here = run.vehicles.filter(stream=stream)
        first = here.filter(pl.col("scheduled_s") < 10.0)["delay_s"]
        if len(first):
            assert line.get_ydata()[0] == pytest.approx(first.mean())
    (one,), (other,) = (
        speeds_over_time_figure([run], *unit).axes[0].get_lines() for unit in ((), (KMH,))
    )
    assert np.allclose(3.6 * one.get_ydata(), other.get_ydata())


def test_the_answer_says_how_sure_it_is():
    def delays(strategy, by_seed):
        return [run_row(strategy, seed=s, delay_s=d) for s, d in enumerate(by_seed, 1)]

    good = runs_of(*delays("slots", (1.0, 5.0, 9.0)), *delays("game", (1.5, 5.7, 9.6)))
    told = own_answer(good)
    assert told.lead == (
        "At 800 + 200 veh/h, seconds that a vehicle loses (mean over 3 seeds ± 95 % interval):"
    )
    assert told.items == (
        (
            "",
            "slots 5.00 ± 9.94 s, game 5.60 ± 10.06 s. Slots is best by 0.60 ± 0.25 s over game.",
        ),
    )
    good = runs_of(*delays("slots", (1.0, 5.0, 9.0)), *delays("game", (1.5, 4.7, 9.6)))
    assert own_answer(good).items[0][1].endswith("s over game (may be chance).")
    once = runs_of(
        *delays("slots", (1.0,)), overridden(run_row(delay_s=3.0), "safety.adhesion=0.3")
    )
    assert own_answer(once).items[0] == ("as in the scenario", "slots 1.00 s.")
    named = own_answer(once, {"safety": {"adhesion": 0.4}})
    assert [label for label, _ in named.items] == ["adhesion φ 0.4", "adhesion φ 0.3"]


def test_what_a_run_does_not_set_stands_in_its_place_among_what_others_set():
    runs = runs_of(
        run_row(delay_s=1.0),
        *(overridden(run_row(delay_s=3.0), f"safety.time_gap_s={gap}") for gap in (0.6, 1.4)),
    )
    values = [
        run.values["safety.time_gap_s"] for run in varied(runs, {"safety": {"time_gap_s": 1.0}})
    ]
    assert sorted(values) == [0.6, 1.0, 1.4]
    assert varied(runs)[0].values["safety.time_gap_s"] == "as it is"


def test_columns_that_are_the_same_in_all_rows_become_a_note():
    table = Table("t", ("a", "b", "c"), (("1", "x", "2"), ("3", "x", "4")), ("n",))
    slim = without_same(table)
    assert (slim.columns, slim.rows) == (("a", "c"), (("1", "2"), ("3", "4")))
    assert slim.notes == ("n", "In all rows: b x.")
    assert without_same(slim) == slim


def test_a_column_of_numbers_knows_it():
    assert Table("T", ("a", "b"), (("x", "1"), ("2", "3.5 ± 0.1"))).numeric == [False, True]
