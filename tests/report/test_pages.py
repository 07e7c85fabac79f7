"""Reports and replays in a real headless Chromium."""

import json
import shutil

import pytest
from axe_playwright_python.sync_playwright import Axe

import coramp
from coramp.errors import CorampError
from coramp.kinematics.trajectory import station_and_speed
from coramp.records.run_folder import read_run
from coramp.records.schemas import RESULT_VERSION
from coramp.report.plan_figure import pieces_of_each
from coramp.report.writing import replay, report
from tests.report.browser import chromium, in_browser, opened

TRAFFIC = {"mainline_veh_h": 1800.0, "ramp_veh_h": 500.0, "seed": 77, "horizon_s": 120.0}
STUDY = """
name = "small"
scenario = "paper"
layout = "paper"
horizon_s = 60.0
[[runs]]
strategies = ["mainline-priority", "ramp-priority"]
flows_veh_h = [[800, 200], [1800, 500]]
engine = "exact"
"""


@pytest.fixture(scope="module")
def folders(tmp_path_factory):
    root = tmp_path_factory.mktemp("runs")
    for name in ("mainline-priority", "ramp-priority"):
        coramp.run("paper", name, engine="exact", out=root / name, **TRAFFIC)
    coramp.run("paper", "uncontrolled", out=root / "uncontrolled", **TRAFFIC)
    (root / "s.toml").write_text(STUDY)
    coramp.study(str(root / "s.toml"), seeds=2, jobs=1, out=root / "study")
    return root


@pytest.fixture(scope="module")
def browser():
    with chromium() as browser:
        yield browser


@in_browser
def test_scrubbing_puts_vehicles_where_the_records_say(browser, folders):
    path = report(folders / "mainline-priority", folders / "uncontrolled")
    records = coramp.run("paper", engine="exact", **TRAFFIC)
    pieces = {name: rows for name, rows, _ in pieces_of_each(records.trajectories)}
    with opened(browser, path.as_uri()) as page:
        page.get_by_label("view").select_option("whole")
        for time_s in (31.0, 55.5, 90.2):
            page.locator("input[type=range]").fill(str(time_s))
            seen = page.evaluate("coramp.shown.replay.positions(0)")
            there = records.vehicles.filter(
                (records.vehicles["entry_s"] <= time_s) & (records.vehicles["exit_s"] >= time_s)
            )["vehicle_id"]
            assert sorted({vehicle["id"] for vehicle in seen}) == sorted(there)
            rows, scale = page.evaluate(
                "(({rows, scale}) => [rows, scale])(coramp.shown.replay.panels[0].road)"
            )
            for vehicle in seen:
                station_m = station_and_speed(pieces[vehicle["id"]], time_s)[0]
                assert vehicle["station"] == pytest.approx(station_m, abs=2e-3)
                left_m = rows[vehicle["row"]]["from"]
                assert vehicle["px"] == pytest.approx((station_m - left_m) * scale, abs=1.0)


@in_browser
def test_the_delay_so_far_ends_at_the_runs_delay(browser, folders):
    path = replay(folders / "mainline-priority", folders / "uncontrolled")
    with opened(browser, path.as_uri()) as page:
        for place, name in enumerate(("mainline-priority", "uncontrolled")):
            summary = read_run(folders / name).content["summary"]
            lost_s = page.evaluate(f"coramp.delaySoFar(coramp.shown.runs[{place}], 1e4)")
            assert lost_s == pytest.approx(summary["delay_s"], abs=2e-3)
        page.locator(".replay").focus()
        page.keyboard.press("End")
        shown = page.locator(".delay strong").all_inner_texts()
        assert shown[1] == f"{summary['delay_s']:.1f} s"
        assert page.evaluate("coramp.delaySoFar(coramp.shown.runs[0], -1)") is None


@in_browser
def test_a_vehicle_alone_has_no_delay_on_its_way(browser, folders, tmp_path):
    alone = {"mainline_veh_h": 0.0, "ramp_veh_h": 200.0, "seed": 3, "horizon_s": 60.0}
    coramp.run("paper", engine="exact", out=tmp_path, **alone)
    with opened(browser, replay(tmp_path).as_uri()) as page:
        lost_s = page.evaluate(
            "(() => { const run = coramp.shown.runs[0], i = run.everyone[0], all = [];"
            " for (let t = run.scheduled[i]; t < run.exit[i] + 2; t += 1)"
            " all.push(coramp.delayOf(run, i, t)); return all; })()"
        )
        assert len(lost_s) > 20
        assert lost_s == pytest.approx([0.0] * len(lost_s), abs=0.2)


@in_browser
@pytest.mark.parametrize(("width", "height"), [(1400, 900), (375, 812)])
def test_the_play_bar_is_in_sight_and_vehicles_are_big(browser, folders, width, height):
    path = replay(folders / "mainline-priority", folders / "uncontrolled")
    with opened(browser, path.as_uri(), width) as page:
        page.set_viewport_size({"width": width, "height": height})
        for scrolled in (0, 400):
            page.evaluate(f"scrollTo(0, {scrolled})")
            box = page.get_by_role("button", name="play").bounding_box()
            assert 0 <= box["y"] <= height - box["height"]
        assert page.evaluate("5 * coramp.shown.replay.panels[0].road.scale") >= 14.0
        canvas = page.locator("canvas[role=img]").first.bounding_box()
        assert canvas["width"] > 0.92 * width
        first_ms = page.evaluate(
            "performance.getEntriesByName('first-contentful-paint')[0].startTime"
        )
        assert first_ms < 1000.0


@in_browser
def test_keys_hold_without_focus_and_a_vehicle_is_named(browser, folders):
    path = replay(folders / "mainline-priority", folders / "uncontrolled")
    with opened(browser, path.as_uri()) as page:
        before = page.evaluate("coramp.shown.replay.time")
        page.keyboard.press(".")
        assert page.evaluate("coramp.shown.replay.time") == pytest.approx(before + 0.1)
        page.keyboard.press(" ")
        page.get_by_role("button", name="pause").wait_for()
        page.keyboard.press(" ")
        page.get_by_role("button", name="play").wait_for()
        page.keyboard.press("n")
        chosen = page.evaluate("coramp.shown.replay.selected")
        assert chosen.startswith("r")
        for state in page.locator(".state").all_inner_texts():
            assert "smallest gap now" in state
        assert f"{chosen}: " in page.locator(".state").first.inner_text()
        seen = page.evaluate("coramp.shown.replay.positions(0)[0]")
        canvas = page.locator("canvas[role=img]").first.bounding_box()
        page.mouse.move(canvas["x"] + seen["px"] - 4, canvas["y"] + seen["py"])
        assert page.evaluate("coramp.shown.replay.hovered") == seen["id"]


@in_browser
def test_long_vehicles_are_drawn_as_tractor_and_trailer(browser, folders):
    cases = [(None, 4.0, False), (None, 16.5, True), ("truck", 9.0, True), ("bus", 12.0, False)]
    with opened(browser, replay(folders / "mainline-priority").as_uri()) as page:
        for kind, length_m, articulated in cases:
            run = json.dumps({"type": [kind], "length": [length_m]})
            assert page.evaluate(f"coramp.isArticulated({run}, 0)") is articulated
        assert page.evaluate("coramp.isArticulated({length: [16.5]}, 0)") is True


@in_browser
def test_playing_moves_vehicles(browser, folders):
    path = replay(folders / "mainline-priority", folders / "ramp-priority")
    with opened(browser, path.as_uri()) as page:
        before = page.evaluate("coramp.shown.replay.time")
        page.get_by_role("button", name="play").click()
        page.wait_for_function(f"coramp.shown.replay.time > {before} + 0.5")
        page.get_by_role("button", name="pause").click()
        stopped = page.evaluate("coramp.shown.replay.time")
        page.wait_for_timeout(100)
        assert page.evaluate("coramp.shown.replay.time") == stopped


@in_browser
def test_hovering_shows_the_decision_with_its_equations(browser, folders):
    path = report(folders / "mainline-priority")
    with opened(browser, path.as_uri()) as page:
        place = page.evaluate(
            "(() => { const d = coramp.shown.diagrams[0], run = d.run;"
            " const i = run.everyone.find((i) => run.decisionsOf.has(i) && run.merge[i] !== null);"
            " d.show([0, 90], d.full.y); d.plot.over.scrollIntoView({block: 'center'});"
            " const box = d.plot.over.getBoundingClientRect(), time = run.merge[i] - 8;"
            " return {id: run.ids[i], told: run.decisionsOf.get(i).at(-1).told,"
            " x: box.left + d.plot.valToPos(time, 'x'),"
            " y: box.top + d.plot.valToPos(coramp.state(run, i, time).station, 'y')}; })()"
        )
        page.mouse.move(place["x"], place["y"])
        tip = page.locator(".tip")
        tip.wait_for(state="visible")
        text = tip.inner_text()
        assert place["id"] in text
        assert place["told"] in text
        assert "Eq. 31: a_r' =" in text
        page.mouse.click(place["x"], place["y"])
        details = page.locator(".details").inner_text()
        for equation in ("Eq. 1", "Eq. 17", "Eq. 24", "Eq. 33"):
            assert equation in details


@in_browser
def test_the_keyboard_reaches_a_vehicles_decision(browser, folders):
    path = report(folders / "mainline-priority")
    with opened(browser, path.as_uri()) as page:
        page.locator(".plot").focus()
        page.keyboard.press("n")
        assert "r00001" in page.locator(".details h4").inner_text()
        page.locator(".replay").focus()
        before = page.evaluate("coramp.shown.replay.time")
        page.keyboard.press("ArrowRight")
        assert page.evaluate("coramp.shown.replay.time") == pytest.approx(before + 1.0)


@in_browser
@pytest.mark.parametrize(("width", "colours"), [(375, "dark"), (1100, "light")])
def test_pages_are_for_everyone(browser, folders, colours, width):
    for path in (report(folders / "study"), replay(folders / "uncontrolled")):
        with opened(browser, path.as_uri(), width, color_scheme=colours) as page:
            assert page.evaluate("document.documentElement.scrollWidth") <= width
            found = Axe().run(page).response["violations"]
            assert [v["id"] for v in found if v["impact"] in ("serious", "critical")] == []


@in_browser
def test_a_study_shows_strategy_against_strategy(browser, folders):
    with opened(browser, report(folders / "study").as_uri()) as page:
        assert page.locator("#show canvas[role=img]").count() == 2
        page.locator("[data-chooses=second]").select_option("nothing")
        page.evaluate("coramp.ready")
        assert page.locator("#show canvas[role=img]").count() == 1


@in_browser
def test_a_notebook_shows_runs_studies_and_plans(browser, folders, tmp_path):
    run = coramp.run("paper", engine="exact", **TRAFFIC)
    study = coramp.study(str(folders / "s.toml"), seeds=2, jobs=1, out=folders / "study")
    parts = [found._repr_html_() for found in (run, study, coramp.plan("example"))]
    page_text = f"<!DOCTYPE html><html lang=en><title>Notebook</title>{''.join(parts)}</html>"
    (tmp_path / "notebook.html").write_text(f"<script>coramp = {{}}</script>{page_text}")
    with opened(browser, (tmp_path / "notebook.html").as_uri()) as page:
        frame = page.frame_locator("iframe")
        frame.locator("canvas[role=img]").wait_for()
        frame.get_by_role("button", name="play").click()
        frame.get_by_role("button", name="pause").wait_for()
        pictures = page.locator("img").evaluate_all(
            "all => all.map((i) => [i.alt, i.naturalWidth])"
        )
        assert len(pictures) == 4
        assert all(alt and width > 100 for alt, width in pictures)
        assert f"{run.summary['ramp_delay_s']:.2f} s on the ramp" in page.inner_text("body")
        assert "reach" in page.inner_text("body")


def test_a_report_names_its_numbers(folders):
    text = report(folders / "mainline-priority").read_text()
    summary = json.loads((folders / "mainline-priority" / "run.json").read_text())["summary"]
    assert f"{summary['mainline_delay_s']:.2f} s on the mainline" in " ".join(text.split())
    assert "--seed 77 --horizon 120" in text


def test_a_half_done_study_says_how_much(folders, tmp_path):
    half = shutil.copytree(folders / "study", tmp_path / "half")
    (half / "runs.parquet").unlink()
    min((half / "parts").iterdir()).unlink()
    assert "7 of 8 runs with 2 seeds are done" in report(half).read_text()


def test_a_study_without_kept_runs_says_so_and_gets_them_again(folders, tmp_path):
    bare = shutil.copytree(folders / "study", tmp_path / "bare")
    kept = {path.name for path in (bare / "shown").iterdir()}
    assert len(kept) == 4
    shutil.rmtree(bare / "shown")
    assert "has kept no runs to watch" in report(bare).read_text()
    said = []
    coramp.study(str(folders / "s.toml"), seeds=2, jobs=1, out=bare, notice=said.append)
    assert said == ["keeping the records of 4 runs for the report"]
    assert {path.name for path in (bare / "shown").iterdir()} == kept
    assert "has kept no runs to watch" not in report(bare).read_text()


def test_failed_runs_are_listed(folders, tmp_path):
    import polars as pl

    broken = shutil.copytree(folders / "study", tmp_path / "broken")
    runs = pl.read_parquet(broken / "runs.parquet").with_row_index()
    first = pl.col("index") == 0
    runs.with_columns(
        status=pl.when(first).then(pl.lit("failed")).otherwise("status"),
        error=pl.when(first).then(pl.lit("SUMO: went away")).otherwise("error"),
    ).drop("index").write_parquet(broken / "runs.parquet")
    text = report(broken).read_text()
    assert "1 of 8 runs failed" in text
    assert "SUMO: went away" in text


def test_an_empty_folder_a_newer_format_and_other_arrivals_are_refused(folders, tmp_path):
    with pytest.raises(CorampError, match="holds no run and no study"):
        report(tmp_path)
    newer = shutil.copytree(folders / "ramp-priority", tmp_path / "newer")
    content = json.loads((newer / "run.json").read_text())
    (newer / "run.json").write_text(json.dumps({**content, "result_version": RESULT_VERSION + 1}))
    with pytest.raises(CorampError, match="by a newer coramp"):
        report(newer)
    other = {**TRAFFIC, "seed": 78}
    coramp.run("paper", engine="exact", out=tmp_path / "other", **other)
    with pytest.raises(CorampError, match="other vehicles arrive there"):
        replay(folders / "mainline-priority", tmp_path / "other")


def test_a_run_that_gives_other_delays_than_the_study_is_not_shown(folders, tmp_path):
    import polars as pl

    other = shutil.copytree(folders / "study", tmp_path / "other")
    runs = pl.read_parquet(other / "runs.parquet")
    mine = pl.col("strategy") == "ramp-priority"
    delay = pl.when(mine).then(pl.col("ramp_delay_s") + 1.0).otherwise("ramp_delay_s")
    runs.with_columns(ramp_delay_s=delay).write_parquet(other / "runs.parquet")
    text = report(other).read_text()
    assert text.count("is not shown: its records have other delays than the study") == 2
    assert ">ramp priority</option>" not in text
    assert ">mainline priority</option>" in text


def test_a_report_sets_the_delay_beside_the_least_that_the_lane_allows(folders):
    summary = read_run(folders / "mainline-priority").content["summary"]
    text = report(folders / "mainline-priority", folders / "uncontrolled").read_text()
    assert (
        f"All together lose {summary['delay_s']:.2f} s, {summary['delay_bound_ratio']:.2f} times "
        f"the {summary['delay_bound_s']:.2f} s that the lane allows at best."
    ) in text
    for line in ("least delay that the lane allows (s)", "most that the lane carries"):
        assert line in text


def test_a_run_from_before_the_bound_still_has_a_report(folders, tmp_path):
    old = shutil.copytree(folders / "mainline-priority", tmp_path / "old")
    content = json.loads((old / "run.json").read_text())
    kept = {k: v for k, v in content["summary"].items() if "bound" not in k and "lane" not in k}
    kept.pop("delay_s")
    old_content = {**content, "summary": kept, "result_version": 3}
    (old / "run.json").write_text(json.dumps(old_content))
    text = report(old).read_text()
    assert "mainline delay (s)" in text
    assert "All together lose" not in text
