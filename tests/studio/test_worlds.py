"""The studio's dials of the world: shares, presets, runs in SUMO that tell, fail and are killed."""

import json
import math
import os
import signal
import socket
import threading
import time
import tomllib
from contextlib import closing
from itertools import pairwise

import pytest
from axe_playwright_python.sync_playwright import Axe

import coramp
from coramp.errors import CorampError
from coramp.runs.running import make_spec, recorded
from coramp.scenarios.world_sections import PRESETS
from coramp.studio.dials import studio_of
from coramp.studio.process import SumoProcess
from coramp.studio.server import StudioServer
from coramp.studio.world import PERFECT, PRESET_WORDS, with_share
from coramp.worlds.sumo.files import SumoOptions
from tests.report.browser import chromium, in_browser, opened

HALF = {"share": "50", "horizon": "30"}
LONG = {"share": "50", "horizon": "1800", "second": "nothing"}


@pytest.fixture(scope="module")
def server():
    with StudioServer("paper", 0) as server:
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        yield server
        server.shutdown()
        thread.join()


@pytest.fixture
def answers(server):
    return server.answers


@pytest.fixture
def killed(monkeypatch):
    """The processes that are killed, by number."""
    pids, kill = [], SumoProcess.kill

    def killing(process):
        kill(process)
        pids.append(process.pid)

    monkeypatch.setattr(SumoProcess, "kill", killing)
    return pids


def told(answers, **asked):
    return json.loads(answers.runs(asked))


def figures(found, column=1):
    return {row[0]: row[column] for table in found["tables"] for row in table["rows"]}


def until(holds, wait_s=5.0):
    last_s = time.monotonic() + wait_s
    while not holds() and time.monotonic() < last_s:
        time.sleep(0.02)
    return holds()


def is_simulated(line):
    """Whether a line of progress tells that SUMO has got anywhere."""
    return any("simulated" in run["told"] for run in json.loads(line).get("progress", ()))


def test_figures_among_drivers_are_those_of_the_run(answers):
    found = told(answers, **HALF, preset="mild")
    settings = {"traffic.automated_share": 0.5, "world.preset": "mild"}
    run = coramp.run("paper", "mixed-slots", horizon_s=30.0, seed=1, overrides=settings)
    automated, drivers = figures(found, 1), figures(found, 2)
    assert found["tables"][0]["columns"][1:3] == ["mixed slots: automated", "mixed slots: drivers"]
    assert automated["fuel (l)"] == f"{run.summary['fuel_l']:.2f}"
    kinds = [row[1:3] for row in found["tables"][0]["rows"]]
    count = run.summary["automated_vehicles"]
    assert kinds[0] == [str(count), str(run.vehicles.height - count)]
    assert kinds[1] == [f"{run.summary[f'{k}_delay_s']:.2f}" for k in ("automated", "driver")]
    assert automated["brakings beyond 3 m/s²"] != drivers["collisions caused"]
    assert sum(found["runs"][0]["automated"]) == count
    assert found["runs"][1]["automated"] is None


def test_the_page_is_told_in_which_world_figures_hold(answers):
    one, beside = told(answers, **HALF, preset="mild")["world"]
    assert one["told"].startswith("share of 50 %, ")
    assert "vehicles automated, the others with fair drivers; preset mild (" in one["told"]
    assert "reports lost" in one["told"]
    assert beside["told"].endswith(
        "vehicles with fair drivers; preset mild, of which nothing reaches vehicles that nobody "
        "coordinates"
    )
    winter = told(answers, **HALF, preset="winter", strategy="uncontrolled:fair")["world"]
    assert "preset winter, of which [road] reaches vehicles" in winter[0]["told"]
    plain = told(answers, horizon="30", second="nothing")["world"]
    assert plain[0]["told"].endswith("vehicles automated; a perfect world")


def test_where_nobody_is_automated_drivers_are_alone(answers):
    found = told(answers, share="0", horizon="30")
    run = coramp.run("paper", "uncontrolled", drivers="fair", horizon_s=30.0, seed=1)
    assert [run["strategy"] for run in found["runs"]] == ["uncontrolled"]
    assert figures(found)["fuel (l)"] == f"{run.summary['fuel_l']:.2f}"


def test_automation_alone_stands_beside_it_at_the_same_share(answers):
    specs = studio_of("paper").specs({"share": "40", "second": "automation"})
    settings = {"traffic.automated_share": 0.4, "simulation.horizon_s": 300.0}
    alone = make_spec("paper", "uncontrolled", drivers="fair", overrides=settings)
    assert specs[1].run_id == alone.run_id
    found = told(answers, **HALF, second="automation")
    assert [run["title"] for run in found["runs"]] == [
        "mixed slots",
        "automation alone, fair drivers",
    ]
    assert found["runs"][0]["automated"] == found["runs"][1]["automated"]
    assert found["world"][1]["told"] == found["world"][0]["told"]


@pytest.mark.parametrize(
    ("asked", "message"),
    [
        (
            {"share": "50", "strategy": "slots"},
            "strategy: slots cannot run where [traffic] leaves some vehicles to drivers; allowed",
        ),
        (
            {"preset": "hard", "strategy": "ramp-priority"},
            "strategy: ramp-priority cannot run where the world is not perfect ([world], ",
        ),
        ({"preset": "hard", "lane": "50"}, "actuators.lag_s: who reacts 0.5 s late and passes"),
        ({"share": "101"}, "automated vehicles: 101 is out of range; allowed is 0 to 100 %"),
        ({"preset": "foggy"}, "preset: there is no 'foggy'; allowed are none, mild, hard, rtk-5g,"),
        ({"drivers": "bob"}, "drivers: there is no 'bob'; allowed are paper, fair,"),
    ],
)
def test_a_world_that_cannot_be_is_told(answers, asked, message):
    assert told(answers, **asked)["errors"][0].startswith(message)


def test_every_preset_can_be_chosen():
    assert list(PRESET_WORDS) == [PERFECT, *PRESETS]
    for preset in PRESETS:
        spec, _ = studio_of("paper").specs({"preset": preset, "lane": "390"})
        assert (spec.strategy, spec.engine, spec.scenario.world.preset) == (
            "mixed-slots",
            "sumo",
            preset,
        )


def test_a_scenario_with_shares_and_a_preset_starts_from_them(tmp_path):
    path = tmp_path / "own.toml"
    path.write_text("""
mainline = {speed_mps = 20, flow_veh_h = 1500, start_m = -400, end_m = 400}
ramp = {speed_mps = 16, flow_veh_h = 500, start_m = -400, acceleration_lane_m = 200}
traffic = {mainline_automated_share = 0.6, ramp_automated_share = 0.2, drivers = "credible"}
world = {preset = "winter"}
vehicle = [{name = "car", share = 0.9}, {name = "truck", share = 0.1, automated_share = 1}]
""")
    studio = studio_of(str(path))
    assert studio.start["share"] == 55.0  # 0.9 x (1500 x 0.6 + 500 x 0.2) / 2000 + 0.1
    assert studio.chosen == {
        "strategy": "mixed-slots",
        "second": "uncontrolled:credible",
        "preset": "winter",
        "drivers": "credible",
    }
    own, beside = studio.specs({})
    assert (own.scenario.traffic, own.drivers) == (studio.scenario.traffic, "credible")
    assert not beside.scenario.has_automated
    (half,) = studio.specs({"share": "50", "preset": "none", "second": "nothing"})
    every = [(kind, ramp) for kind in ("car", "truck") for ramp in (False, True)]
    assert {half.scenario.automated_share_of(*kind) for kind in every} == {0.5}
    assert not half.scenario.has_faults
    assert set(with_share(studio.scenario, 50.0)) == {
        "vehicle",
        *(f"traffic.{stream}automated_share" for stream in ("", "mainline_", "ramp_")),
    }


def test_a_saved_scenario_keeps_its_world(answers, tmp_path):
    asked = {**HALF, "preset": "mild", "drivers": "credible", "second": "nothing"}
    path = tmp_path / "saved.toml"
    path.write_text(answers.scenario_toml(asked))
    kept = tomllib.loads(path.read_text())
    assert (kept["traffic"]["automated_share"], kept["world"]["preset"]) == (0.5, "mild")
    assert "--strategy mixed-slots --engine sumo --drivers credible" in path.read_text()
    run = coramp.run(str(path), "mixed-slots", drivers="credible", seed=1)
    assert figures(told(answers, **asked))["fuel (l)"] == f"{run.summary['fuel_l']:.2f}"


@pytest.mark.parametrize("strategy", ["mixed-slots", "uncontrolled"])
def test_a_run_tells_how_far_it_is_and_stays_the_same(strategy):
    settings = {"traffic.automated_share": 0.5, "simulation.horizon_s": 30.0}
    spec, times_s = make_spec("paper", strategy, overrides=settings), []
    watched = recorded(spec, SumoOptions(tell=times_s.append))
    assert times_s[-1] == math.inf
    assert times_s == sorted(times_s)
    assert max(later - time_s for time_s, later in pairwise(times_s[:-1])) <= 5.0
    assert watched.positions.equals(recorded(spec).positions)


def test_progress_comes_before_the_answer(answers):
    *before, last = answers.lines({**LONG, "horizon": "240"})
    assert "runs" in json.loads(last)
    progress = [json.loads(line)["progress"] for line in before]
    shares = [runs[0]["share"] for runs in progress]
    assert shares == sorted(shares)
    assert {runs[0]["title"] for runs in progress} == {"mixed slots"}
    assert any(" of 240 s simulated" in runs[0]["told"] for runs in progress)


def test_a_run_that_nobody_waits_for_is_killed(answers, killed):
    lines = answers.lines(LONG)
    other = answers.lines(LONG)
    next(other)
    assert any(map(is_simulated, lines))
    lines.close()
    time.sleep(0.3)
    assert killed == []
    other.close()
    assert until(lambda: killed)
    with pytest.raises(ProcessLookupError):
        os.kill(killed[0], 0)
    assert "runs" in told(answers, **HALF)


def test_a_page_that_goes_away_ends_its_run_and_holds_nobody_up(server, killed):
    host = f"127.0.0.1:{server.server_port}"
    query = "share=50&second=nothing&seed=2&horizon=1800"
    asked = f"GET /runs?{query} HTTP/1.1\r\nHost: {host}\r\n\r\n"
    with closing(socket.create_connection(server.server_address, 20.0)) as connection:
        connection.sendall(asked.encode())
        received = b""
        while b" of 1800 s simulated" not in received:
            received += connection.recv(65536)
        started = time.perf_counter()
        found = told(server.answers, horizon="30", seed="7", second="nothing")
        assert "runs" in found
        assert time.perf_counter() - started < 2.0
        assert killed == []
    assert until(lambda: killed)


def test_a_process_that_dies_is_told_and_replaced(answers, monkeypatch):
    pids, run = [], SumoProcess.run

    def running(process, *asked):
        pids.append(process.pid)
        return run(process, *asked)

    monkeypatch.setattr(SumoProcess, "run", running)
    lines = answers.lines({**LONG, "seed": "3"})
    assert any(map(is_simulated, lines))
    os.kill(pids[0], signal.SIGKILL)
    *_, last = lines
    (error,) = json.loads(last)["errors"]
    assert error.startswith("SUMO: its process ended with code -9 before the run did")
    assert "runs" in told(answers, **HALF)


def test_what_fails_in_the_process_is_told(answers):
    spec = studio_of("paper").specs(HALF)[0]
    unknown = type(spec)(spec.scenario, "luck", "sumo", "fair", 1)
    with pytest.raises(CorampError, match="there is no 'luck'"):
        answers._processes.run(unknown, lambda _: None, lambda: True)


@pytest.fixture(scope="module")
def browser():
    with chromium() as browser:
        yield browser


@in_browser
def test_the_share_dial_brings_a_strategy_that_can_run(browser, server):
    with opened(browser, f"{server.address}?horizon=30") as page:
        page.locator("[data-slider=share]").fill("50")
        page.evaluate("coramp.ready")
        assert page.locator("[data-choice=strategy]").input_value() == "mixed-slots"
        assert page.locator("#switched").inner_text() == (
            "mainline priority cannot run in this world; mixed slots is shown instead."
        )
        assert "share of 50 %" in page.locator("#world").inner_text()
        assert "Figures by kind of vehicle" in page.locator("#figures").inner_text()
        assert page.get_by_text("violet stripe: automated").is_visible()
        page.locator("[data-choice=strategy]").select_option("slots")
        page.evaluate("coramp.ready")
        assert "allowed are mixed-slots" in page.get_by_role("alert").inner_text()
        assert page.locator("#figures").is_hidden()
        page.locator("[data-choice=strategy]").select_option("mixed-slots")
        page.locator("[data-choice=drivers]").select_option("credible")
        page.evaluate("coramp.ready")
        assert page.locator("[data-choice=second]").input_value() == "uncontrolled:credible"
        found = Axe().run(page).response["violations"]
        assert [v["id"] for v in found if v["impact"] in ("serious", "critical")] == []


@in_browser
def test_the_next_move_of_a_dial_kills_the_run_before(browser, server, killed):
    with opened(browser, f"{server.address}?horizon=30&second=nothing", 375) as page:
        page.locator("[data-number=seed]").evaluate(
            "() => { coramp.studio.set({ horizon: '1800', seed: '5' }); }"
        )
        page.locator("[data-slider=share]").fill("60")
        page.locator("#progress progress[value]:not([value='0'])").wait_for()
        assert "of 1800 s simulated" in page.locator("#progress").inner_text()
        assert page.evaluate("document.documentElement.scrollWidth") <= 375
        assert killed == []
        page.locator("[data-slider=share]").fill("100")
        page.evaluate("coramp.ready")
        assert until(lambda: killed)
        assert page.locator("[data-choice=strategy]").input_value() == "mainline-priority"
        assert page.locator("#switched").inner_text() == ""
        assert page.locator("#progress").is_hidden()
        assert "vehicles automated; a perfect world" in page.locator("#world").inner_text()


def test_on_several_lanes_what_plans_there_can_be_chosen(tmp_path):
    file = tmp_path / "two.toml"
    file.write_text(
        "[mainline]\nstart_m = -400.0\nend_m = 400.0\nspeed_mps = 20.0\nlanes = 2\n"
        "flow_veh_h = 2400.0\n[ramp]\nstart_m = -400.0\nspeed_mps = 16.0\n"
        "acceleration_lane_m = 200.0\nflow_veh_h = 600.0\n"
    )
    studio = studio_of(str(file))
    assert {"mainline-priority", "ramp-priority", "mixed-slots"} <= set(studio.choices)
    assert "slots" not in studio.choices
    one, beside = studio.specs({"strategy": "ramp-priority", "second": "mixed-slots"})
    assert (one.engine, one.is_mixed) == ("sumo", False)
    assert (beside.engine, beside.is_mixed) == ("sumo", True)
    with pytest.raises(
        CorampError, match=r"ramp-priority cannot run where \[traffic\] leaves some"
    ):
        studio.specs({"strategy": "ramp-priority", "share": "50"})
