"""Pages and diagrams of mixed traffic show who is automated and who has a driver."""

import polars as pl
import pytest

import coramp
from coramp.records.lapses import FALLBACK, UNKNOWN, lapses_in
from coramp.records.world_told import told_of_world
from coramp.report.page.asked import asked_table
from coramp.report.page.pages import comparison_table, notes
from coramp.report.page.shown import page_data
from coramp.report.time_space_figure import AUTOMATED_COLOUR
from coramp.report.writing import replay, report
from tests.report.browser import chromium, in_browser, opened

FAILING = {
    "traffic.automated_share": 0.5,
    "positioning.noise_m": 1.0,
    "reports.loss": 0.3,
    "reports.burst_s": 2.0,
    "commands.loss": 0.3,
    "commands.burst_s": 2.0,
    "incidents.breakdown_s": 30.0,
    "incidents.lasts_s": 10.0,
}
DEMAND = {"mainline_veh_h": 1500.0, "ramp_veh_h": 500.0, "horizon_s": 60.0, "seed": 77}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("mixed") / "run"
    half = {"traffic.automated_share": 0.5}
    coramp.run("paper", "mixed-slots", **DEMAND, overrides=half, out=folder)
    return folder


@pytest.fixture(scope="module")
def plain(tmp_path_factory):
    folder = tmp_path_factory.mktemp("plain") / "run"
    coramp.run("paper", "uncontrolled", **DEMAND, out=folder)
    return folder


def test_a_page_knows_who_is_automated(folder, plain):
    run = coramp.load(folder)
    told = page_data(run)
    assert told["automated"] == [int(own) for own in run.vehicles["automated"]]
    assert set(told["automated"]) == {0, 1}
    assert page_data(coramp.load(plain))["automated"] is None


def test_a_report_has_the_figures_by_kind(folder, plain):
    run = coramp.load(folder)
    shown = dict(row[:2] for row in comparison_table([run]).rows)
    assert shown["automated vehicles"] == str(run.summary["automated_vehicles"])
    assert {"delay of drivers (s)", "collisions that automated vehicles caused"} <= shown.keys()
    others = dict(row[:2] for row in comparison_table([coramp.load(plain)]).rows)
    assert "automated vehicles" not in others
    automated = run.summary["automated_vehicles"]
    kinds = f"{automated} automated, {run.vehicles.height - automated} with fair drivers"
    assert ("vehicles", kinds) in asked_table(run).rows


def test_a_report_does_not_call_it_a_proved_plan(folder):
    text = report(folder).read_text(encoding="utf-8")
    assert "an independent checker has proved" not in text
    assert "told their acceleration anew each period" in text
    assert not any("drivers do not know of" in note for note in notes(coramp.load(folder)))


def test_automation_alone_has_its_name_and_is_not_said_to_promise_anything():
    half = {"traffic.automated_share": 0.5}
    run = coramp.run("paper", "uncontrolled", horizon_s=120.0, seed=1, overrides=half)
    assert run.summary["safety_violations"]
    assert page_data(run)["title"] == "automation alone, fair drivers"
    (note,) = notes(run)
    assert "which vehicles that nobody coordinates do not know of" in note
    assert "keep the distance to stop" not in note


def test_lines_of_a_diagram_are_coloured_by_kind(folder):
    run = coramp.load(folder)
    (axes,) = run.plot_time_space().axes
    colours = {line.get_gid(): line.get_color() for line in axes.lines if line.get_gid()}
    for name, automated in run.vehicles.select("vehicle_id", "automated").iter_rows():
        assert (colours[name] == AUTOMATED_COLOUR) == automated
    assert {"automated", "driver"} <= set(axes.get_legend_handles_labels()[1])


@in_browser
@pytest.mark.parametrize("width", [1400, 375])
def test_a_replay_marks_and_explains_who_is_automated(folder, plain, width):
    mixed, alone = replay(folder), replay(plain)
    with chromium() as browser:
        with opened(browser, mixed.as_uri(), width) as page:
            legends = page.locator(".legend").all_inner_texts()
            assert "violet stripe: automated; the others have drivers" in legends[0]
            assert "automated vehicle" in legends[1]
            assert "moves for another" not in legends[1]
            assert page.evaluate("document.documentElement.scrollWidth") <= width
            kinds = page.evaluate(
                "(async () => {"
                " const run = await coramp.unpacked(document.getElementById('run-0'));"
                " return run.everyone.map((i) => [run.ids[i], coramp.role(run, i)]); })()"
            )
        with opened(browser, alone.as_uri(), width) as page:
            assert "violet" not in page.locator(".legend").first.inner_text()
            assert "moves for another" in page.locator(".legend").nth(1).inner_text()
    automated = dict(coramp.load(folder).vehicles.select("vehicle_id", "automated").iter_rows())
    assert {name: role == "automated" for name, role in kinds} == automated


@pytest.fixture(scope="module")
def failing(tmp_path_factory):
    folder = tmp_path_factory.mktemp("failing") / "run"
    coramp.run("paper", "mixed-slots", **DEMAND, overrides=FAILING, out=folder)
    return folder


def test_a_page_counts_what_was_lost_by_second(failing, folder):
    run = coramp.load(failing)
    counts = page_data(run)["heard"]["counts"]
    assert sum(counts["report_lost"]) == run.summary["reports_lost"]
    assert sum(counts["command_lost"]) == run.summary["commands_lost"]
    at_once = run.heard.filter("fallback").group_by("time_s").len()["len"].max()
    assert max(counts["fallback"]) == at_once
    assert page_data(coramp.load(folder))["heard"] is None
    assert "vehicles not known to the coordinator for" in told_of_world(run)


def test_a_diagram_marks_fallbacks_gaps_and_the_breakdown(failing):
    (axes,) = coramp.load(failing).plot_time_space().axes
    marks = {"in fallback", "gaps: not known", "broken down"}
    assert marks <= set(axes.get_legend_handles_labels()[1])


KNOWN = """([name, time]) => {
    const run = coramp.shown.runs[0];
    const known = coramp.known(run, run.indexOf.get(name), time);
    return known === null ? null : [known.error, known.age, known.unknown, known.fallback,
        known.low <= known.station && known.station <= known.high];
}"""


@in_browser
def test_a_replay_knows_what_the_coordinator_knew(failing):
    run = coramp.load(failing)
    rows = run.heard.filter(pl.col("error_m").is_null() | (pl.col("error_m").abs() > 1.0))
    with chromium() as browser, opened(browser, replay(failing).as_uri(), 1100) as page:
        for row in rows.gather_every(7).rows(named=True):
            found = page.evaluate(KNOWN, [row["vehicle_id"], row["time_s"] + 0.1])
            error_m, age_s, unknown, fallback, within = found
            assert unknown == (row["error_m"] is None)
            assert fallback == row["fallback"]
            assert within
            if not unknown:
                assert error_m == pytest.approx(row["error_m"], abs=0.31)
                assert age_s == pytest.approx(row["age_s"], abs=0.31)
        lapses = page.evaluate(
            "coramp.lapses(coramp.shown.runs[0]).map((l) => [coramp.shown.runs[0].ids[l.vehicle],"
            " l.bit === coramp.FALLBACK, Math.round(10 * l.from), Math.round(10 * l.to)])"
        )
    own = [lapse for lapse in lapses_in(run.heard) if lapse.what in (FALLBACK, UNKNOWN)]
    told = {
        (x.vehicle_id, x.what == FALLBACK, round(10 * x.from_s), round(10 * x.until_s)) for x in own
    }
    assert {tuple(lapse) for lapse in lapses} == told


@in_browser
@pytest.mark.parametrize("width", [1400, 375])
def test_a_replay_tells_what_failed_when_and_goes_there(failing, folder, width):
    run = coramp.load(failing)
    (event,) = run.safety_events.filter(event="vehicle breaks down").rows(named=True)
    with chromium() as browser:
        with opened(browser, replay(failing).as_uri(), width) as page:
            legends = page.locator(".legend").all_inner_texts()
            assert "triangle: broken down" in legends[0]
            assert "fallback, its last command is older than 1.5 s" in legends[0]
            assert "gaps in a line: not known to the coordinator" in legends[1]
            lines = page.locator(".strip-names").inner_text().split()
            assert " ".join(lines) == "events lost reports lost commands not known fallback"
            assert page.evaluate("document.documentElement.scrollWidth") <= width
            box = page.locator("canvas.strip").bounding_box()
            share = event["time_s"] / page.evaluate("coramp.shown.replay.end")
            page.locator("canvas.strip").click(
                position={"x": 8 + share * (box["width"] - 16) + 4, "y": 6}
            )
            page.evaluate("coramp.shown.replay.seek(coramp.shown.replay.time + 2)")
            broken = page.evaluate(
                "[...coramp.brokenDown(coramp.shown.runs[0], coramp.shown.replay.time)]"
                ".map((i) => coramp.shown.runs[0].ids[i])"
            )
            assert broken == [event["rear_vehicle_id"]]
            page.get_by_role("button", name="next fallback or lost sight").click()
            chosen, time_s = page.evaluate(
                "[coramp.shown.replay.selected, coramp.shown.replay.time]"
            )
            own = [x for x in lapses_in(run.heard) if x.vehicle_id == chosen]
            assert any(x.from_s <= time_s <= x.until_s + 0.2 for x in own)
            assert "drives by itself for" in page.locator(".story").inner_text() or (
                "is not known to the coordinator" in page.locator(".story").inner_text()
            )
        with opened(browser, replay(folder).as_uri(), width) as page:
            assert page.locator("canvas.strip").count() == 0
            assert "fallback" not in page.locator(".legend").first.inner_text()
