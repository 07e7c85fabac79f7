"""Pages and diagrams of mixed traffic show who is automated and who has a driver."""

import pytest

import coramp
from coramp.report.page.pages import asked_table, comparison_table, notes
from coramp.report.page.shown import page_data
from coramp.report.time_space_figure import AUTOMATED_COLOUR
from coramp.report.writing import replay, report
from tests.report.browser import chromium, in_browser, opened

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
