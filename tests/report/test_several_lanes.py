"""Runs on several lanes, and in networks, as they are drawn."""

import math
from itertools import pairwise

import pytest

from coramp.agency.before_after import Measured
from coramp.report.page.network_shown import shapes_data
from coramp.report.page.pages import replay_page
from coramp.report.page.shown import page_data, road_data
from coramp.report.page.summary import SEVERAL_LANES, summary_of
from coramp.report.time_space_figure import run_time_space_figure
from coramp.scenarios.loading import load_scenario
from tests.agency import run_by_hand
from tests.edges import invoke
from tests.metrics import PAPER
from tests.networks.test_runs import new_scenario
from tests.report.browser import chromium, in_browser, opened
from tests.report.lanes import CARS, CHANGES_S, three_lanes


@pytest.fixture(scope="module")
def run():
    return three_lanes()


def test_a_page_knows_who_is_on_which_lane_and_who_made_way(run):
    data = page_data(run)
    assert data["road"]["lanes"] == 3
    assert data["lanes"] == [
        [0.0, 0, CHANGES_S, 1],
        [0.0, 1],
        [0.0, 2],
        [0.0, -1, 25.0, 0],
    ]
    assert data["made_way"] == [[data["ids"].index("m1"), CHANGES_S]]


def test_a_page_of_one_lane_has_nothing_of_lanes(run):
    assert not {"lanes", "shapes"} & set(road_data(PAPER))


def test_each_lane_has_a_diagram_with_its_vehicles(run):
    figure = run_time_space_figure(run, 0.0, 60.0)
    third, second, first = figure.axes
    assert [axes.get_ylabel().split("\n")[0] for axes in figure.axes] == [
        "lane 3",
        "lane 2",
        "ramp and lane 1",
    ]

    def drawn(axes):
        return {line.get_gid() for line in axes.get_lines()}

    assert {"m1", "r1", "made-way"} <= drawn(first)
    assert not {"m2", "m3"} & drawn(first)
    assert {"m1", "m2"} <= drawn(second)
    assert drawn(third) == {"m3", "m1 faint", "m2 faint", "r1 faint"}
    (line,) = [line for line in second.get_lines() if line.get_gid() == "m1"]
    shown_s = [t for t, s in zip(*line.get_data(), strict=True) if not math.isnan(s)]
    assert min(shown_s) == CHANGES_S


def test_a_summary_says_which_lanes_it_is_of(run):
    found = summary_of([Measured(run)])
    assert "mean of all 3 lanes" in found["pictures"][0]["text"]
    assert found["table"].notes[-1] == SEVERAL_LANES
    assert SEVERAL_LANES not in summary_of([Measured(run_by_hand(CARS, 80.0))])["table"].notes


@in_browser
def test_a_replay_draws_each_lane_apart(run, tmp_path):
    path = tmp_path / "replay.html"
    path.write_text(replay_page([run]), encoding="utf-8")
    with chromium() as browser, opened(browser, f"file://{path}") as page:
        page.evaluate("coramp.shown.replay.views.value = 'whole'; coramp.shown.replay.look()")

        def across_px(time_s):
            """How far below the uppermost lane's middle each vehicle is, by id."""
            page.evaluate(f"coramp.shown.replay.seek({time_s})")
            return page.evaluate(
                "(() => { const { road } = coramp.shown.replay.panels[0];"
                "return Object.fromEntries(road.seen.map(({ id, py, row, station }) => "
                "[id, (py - road.y(road.rows[row], station, 3)) / road.lane])); })()"
            )

        before = across_px(CHANGES_S - 1.0)
        assert before == pytest.approx({"m1": 2.0, "m2": 1.0, "m3": 0.0, "r1": 3.0}, abs=0.01)
        during = across_px(CHANGES_S + 0.6)["m1"]
        assert 1.0 < during < 2.0
        after = across_px(CHANGES_S + 2.0)
        assert after["m1"] == pytest.approx(1.0, abs=0.01)
        assert "1 made way so far" in page.locator(".state").inner_text()
        assert across_px(30.0)["r1"] == pytest.approx(2.0, abs=0.01)


@in_browser
def test_a_diagram_begins_where_a_ramp_longer_than_the_mainline_does(tmp_path):
    folder = tmp_path / "r"
    half = ("--strategy", "mixed-slots", "--set", "traffic.automated_share=0.5", "--horizon", 10)
    assert invoke("run", "paper", "--set", "ramp.start_m=-900.0", *half, "--out", folder).code == 0
    assert invoke("report", folder).code == 0
    path = folder / "report.html"
    with chromium() as browser, opened(browser, f"file://{path}") as page:
        assert page.evaluate("coramp.shown.diagrams[0].plot.scales.y.min") == -900.0


@pytest.mark.parametrize("name", ["highway", "A10KW", "ramp"])
def test_a_networks_lanes_are_told_as_they_lie(tmp_path, name):
    scenario = load_scenario(str(new_scenario(tmp_path, name)))
    shapes = shapes_data(scenario)
    for lane in (-1, *range(scenario.mainline.lanes)):
        own = sorted((s for s in shapes if s["lane"] == lane), key=lambda s: s["from"])
        ends_m = scenario.ramp.acceleration_lane_m if lane < 0 else scenario.mainline.end_m
        starts_m = scenario.ramp.start_m if lane < 0 else scenario.mainline.start_m
        assert (own[0]["from"], own[-1]["to"]) == pytest.approx((starts_m, ends_m), abs=0.02)
        for before, after in pairwise(own):
            assert before["to"] == pytest.approx(after["from"], abs=0.02)
            assert math.dist(before["xy"][-2:], after["xy"][:2]) < 1.0
    beside = next(s for s in shapes if s["lane"] == 0 and s["from"] == 0.0)
    assert beside["xy"][:2] == [0.0, 0.0]


def test_a_run_can_be_looked_at_without_its_network(tmp_path):
    scenario = load_scenario(str(new_scenario(tmp_path, "ramp")))
    lost = scenario.network.model_copy(update={"file": str(tmp_path / "gone.net.xml")})
    assert shapes_data(scenario.model_copy(update={"network": lost})) == []
