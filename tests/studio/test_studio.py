"""The studio: its answers, its server, and its page in a real headless Chromium."""

import http.client
import json
import socket
import threading
import time
import tomllib
from contextlib import closing

import pytest
from axe_playwright_python.sync_playwright import Axe

import coramp
from coramp.cli.entry import main
from coramp.errors import CorampError
from coramp.runs.running import recorded
from coramp.strategies.mainline_priority import MainlinePriority
from coramp.studio.answers import Answers
from coramp.studio.dials import studio_of
from coramp.studio.server import StudioServer
from tests.report.browser import chromium, in_browser, opened


@pytest.fixture(scope="module")
def server():
    with StudioServer("paper", 0) as server:
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        yield server
        server.shutdown()
        thread.join()


@pytest.fixture(scope="module")
def browser():
    with chromium() as browser:
        yield browser


@pytest.fixture(scope="module")
def answers():
    with closing(Answers(studio_of("paper"))) as answers:
        yield answers


def told(answers, **asked):
    return json.loads(answers.runs({name: str(value) for name, value in asked.items()}))


def fetched(server, path, host=None, method="GET"):
    place = http.client.HTTPConnection("127.0.0.1", server.server_port)
    with closing(place) as connection:
        connection.request(method, path, headers={"Host": host} if host else {})
        response = connection.getresponse()
        return response.status, response.read().decode(), response.headers


def cell(found, title, column=1):
    rows = [row for table in found["tables"] for row in table["rows"]]
    return next(row[column] for row in rows if row[0] == title)


def test_figures_are_those_of_the_run(answers):
    found = told(answers, mainline=1300, ramp=600, seed=5, horizon=120)
    run = coramp.run(
        "paper", engine="exact", mainline_veh_h=1300, ramp_veh_h=600, seed=5, horizon_s=120
    )
    assert cell(found, "mainline delay (s)") == f"{run.summary['mainline_delay_s']:.2f}"
    assert cell(found, "fuel (l)") == f"{run.summary['fuel_l']:.2f}"
    assert found["runs"][0]["ids"] == run.vehicles["vehicle_id"].to_list()


def test_two_strategies_meet_the_same_arrivals(answers):
    found = told(answers, second="uncontrolled:fair", horizon=60)
    one, other = found["runs"]
    assert one["scheduled"] == other["scheduled"]
    assert found["tables"][0]["columns"][2] == "no control, fair drivers"


@pytest.mark.parametrize(
    ("asked", "message"),
    [
        ({"mainline": "9000"}, "mainline flow: 9000 is out of range; allowed is 0 to 4000 veh/h"),
        ({"lane": "long"}, "acceleration lane: 'long' is not a number; allowed is 50 to"),
        ({"error": "nan"}, "positioning error: nan is out of range"),
        ({"ramp": "inf"}, "ramp flow: inf is out of range"),
        ({"seed": "1.5"}, "seed: 1.5 is not whole"),
        ({"colour": "red"}, "colour: cannot be set here; allowed are gap, mainline, ramp"),
        ({"strategy": "luck"}, "there is no 'luck'; allowed are mainline-priority"),
        ({"strategy": "nothing", "second": "nothing"}, "nothing is chosen"),
        ({"ramp_speed": "30"}, "ramp.speed_mps: 30 is not below mainline.speed_mps"),
    ],
)
def test_what_cannot_be_set_is_told(answers, asked, message):
    errors = told(answers, **asked)["errors"]
    assert message in errors[0]
    assert not errors[0].startswith("studio:")


@pytest.mark.parametrize("lane_m", [50, 90, 200, 390])
@pytest.mark.parametrize(("mainline_mps", "ramp_mps"), [(14, 12), (20, 16), (33, 25)])
def test_sliders_within_reach_give_a_run(answers, lane_m, mainline_mps, ramp_mps):
    found = told(answers, lane=lane_m, mainline_speed=mainline_mps, ramp_speed=ramp_mps, horizon=30)
    if "errors" in found:
        assert any(word in found["errors"][0] for word in ("too short", "there is none at which"))
    else:
        assert cell(found, "safe-distance violations") == "0"
        assert cell(found, "unserved") == "0"


def test_a_saved_scenario_gives_the_same_figures(answers, tmp_path):
    asked = {
        "lane": "150",
        "mainline_speed": "25",
        "ramp_speed": "20",
        "horizon": "60",
        "seed": "3",
    }
    path = tmp_path / "saved.toml"
    path.write_text(answers.scenario_toml(asked))
    assert tomllib.loads(path.read_text())["name"] == "paper-studio"
    run = coramp.run(str(path), engine="exact", seed=3)
    found = told(answers, **asked)
    assert cell(found, "fuel (l)") == f"{run.summary['fuel_l']:.2f}"
    assert "--seed 3" in found["command"]


def test_the_server_is_for_this_machine_only(server):
    own = f"127.0.0.1:{server.server_port}"
    assert server.server_address[0] == "127.0.0.1"
    assert fetched(server, "/", own)[0] == 200
    assert fetched(server, "/", "elsewhere.example")[0] == 403
    assert fetched(server, "/../etc/passwd")[0] == 404
    assert fetched(server, "/", method="POST")[0] == 501
    assert "connect-src 'self'" in fetched(server, "/")[2]["Content-Security-Policy"]
    status, text, headers = fetched(server, "/scenario.toml?lane=120")
    assert (status, tomllib.loads(text)["ramp"]["acceleration_lane_m"]) == (200, 120.0)
    assert 'filename="paper-studio.toml"' in headers["Content-Disposition"]
    assert fetched(server, "/scenario.toml?lane=x")[0] == 400


def raw(server, *pieces, wait_s=0.0, timeout_s=20.0):
    """Sends bytes, with a pause after each piece, and returns all that comes back."""
    with socket.create_connection(("127.0.0.1", server.server_port), timeout_s) as connection:
        received = b""
        try:
            for piece in pieces:
                connection.sendall(piece)
                time.sleep(wait_s)
            while more := connection.recv(65536):
                received += more
        except ConnectionError:
            pass
        return received.decode()


def head(server, target="/scenario.toml", *lines):
    host = f"Host: 127.0.0.1:{server.server_port}"
    return "\r\n".join([f"GET {target} HTTP/1.1", host, *lines, "", ""]).encode()


@pytest.mark.parametrize("lines", [("Content-Length: {length}",), ("Transfer-Encoding: chunked",)])
def test_a_body_is_never_read_as_a_request(server, lines):
    second = head(server, "/nowhere")
    asked = head(server, "/", *(line.format(length=len(second)) for line in lines))
    answer = raw(server, asked + second)
    assert answer.startswith("HTTP/1.1 400 Bad Request")
    assert answer.count("HTTP/1.1") == 1
    assert "Connection: close" in answer


def test_an_address_that_is_none_is_answered(server):
    answer = raw(server, head(server, "http://[bad/", "Connection: close"))
    assert answer.startswith("HTTP/1.1 400 Bad Request")
    assert answer.endswith("the address is not valid\n")


@pytest.mark.parametrize("pieces", [(b"",), (b"GET / HT",), tuple(b"GET / HTTP/1.1\r\nX: y" * 9)])
def test_slow_clients_hold_no_thread_for_ever(server, monkeypatch, pieces):
    monkeypatch.setattr("coramp.studio.server.READ_S", 0.5)
    monkeypatch.setattr("coramp.studio.server._Handler.timeout", 0.5)
    pieces = [bytes([piece]) if isinstance(piece, int) else piece for piece in pieces]
    started, before = time.perf_counter(), threading.active_count()
    assert raw(server, *pieces, wait_s=0.02) == ""
    assert time.perf_counter() - started < 5.0
    time.sleep(0.2)
    assert threading.active_count() <= before


def test_a_heavy_run_holds_nobody_up(answers):
    begun, go_on = threading.Event(), threading.Event()

    class Heavy(MainlinePriority):
        name = "heavy"

        def decide(self, view, memory):
            begun.set()
            go_on.wait(30.0)
            return super().decide(view, memory)

    coramp.register(Heavy, replace=True)
    studio = Answers(studio_of("paper"))
    found = []
    heavy = threading.Thread(
        target=lambda: found.append(
            told(studio, strategy="heavy", horizon=60, ramp=600, second="nothing")
        )
    )
    heavy.start()
    assert begun.wait(20.0)
    started = time.perf_counter()
    assert "tables" in told(studio, horizon=60, ramp=600, second="nothing")
    assert time.perf_counter() - started < 5.0
    assert not found
    go_on.set()
    heavy.join(20.0)
    assert "tables" in found[0]


def test_a_run_that_is_under_way_is_run_once(monkeypatch):
    from coramp.studio import answers as module

    runs, studio, found = [], Answers(studio_of("paper")), []
    monkeypatch.setattr(module, "recorded", lambda spec: runs.append(spec) or recorded(spec))
    threads = [
        threading.Thread(
            target=lambda: found.append(told(studio, horizon=60, seed=9, second="nothing"))
        )
        for _ in range(4)
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(30.0)
    assert len(found) == 4
    assert len(runs) == 1
    assert all(one == found[0] for one in found)


def test_a_port_in_use_is_told_in_a_line(server, capsys):
    with pytest.raises(SystemExit) as stopped:
        main(["studio", "--port", str(server.server_port)])
    assert stopped.value.code == 1
    expected = f"Error: --port: {server.server_port} is in use; give another, or 0 for any that is"
    assert capsys.readouterr().err.startswith(expected)


def test_a_port_that_is_none_is_refused():
    with pytest.raises(CorampError, match="70000 is out of range"):
        StudioServer("paper", 70000)


@in_browser
def test_a_slider_changes_figures_picture_and_address(browser, server):
    with opened(browser, server.address) as page:
        before = page.locator("#figures").inner_text(), page.evaluate("coramp.shown.runs[0].count")
        page.locator("[data-slider=mainline]").fill("1000")
        page.evaluate("coramp.ready")
        after = page.locator("#figures").inner_text(), page.evaluate("coramp.shown.runs[0].count")
        assert before[0] != after[0]
        assert after[1] < before[1]
        assert page.locator("[data-number=mainline]").input_value() == "1000"
        assert page.url.endswith("?mainline=1000")
        assert page.evaluate("coramp.shown.diagrams.length") == 2
        page.locator("[data-choice=second]").select_option("nothing")
        page.evaluate("coramp.ready")
        assert page.locator("#show canvas[role=img]").count() == 1


@in_browser
def test_what_decides_is_at_hand_and_the_rest_folds(browser, server):
    with opened(browser, server.address) as page:
        for name in ("gap", "mainline", "ramp", "lane"):
            assert page.locator(f"[data-slider={name}]").is_visible()
        assert page.locator("[data-choice=second]").input_value() == "uncontrolled:fair"
        assert page.locator("[data-slider=error]").is_hidden()
        titles = page.evaluate("coramp.shown.runs.map((run) => run.title)")
        assert titles == ["mainline priority", "no control, fair drivers"]
        page.get_by_text("More settings").click()
        assert page.locator("[data-slider=error]").is_visible()
        page.locator("[data-slider=gap]").fill("1")
        page.evaluate("coramp.ready")
        assert page.get_by_role("button", name="Reset").is_visible()
        page.get_by_role("button", name="Reset").click()
        page.evaluate("coramp.ready")
        assert page.locator("[data-number=gap]").input_value() == "0"
    with opened(browser, f"{server.address}?error=0.5&second=nothing") as page:
        assert page.locator("[data-slider=error]").is_visible()


@in_browser
def test_no_figure_stands_beside_what_was_not_computed(browser, server):
    with opened(browser, f"{server.address}?second=nothing&horizon=60") as page:
        assert page.locator("#figures table").is_visible()
        assert "difference between plan and SUMO" not in page.locator("#figures").inner_text()
        page.locator("[data-number=mainline]").fill("9999")
        page.evaluate("coramp.ready")
        assert page.get_by_role("alert").is_visible()
        for place in ("#figures", "#answer", "#show"):
            assert page.locator(place).is_hidden()
        page.locator("[data-number=mainline]").fill("900")
        page.evaluate("coramp.ready")
        assert page.locator("#figures table").is_visible()


@in_browser
def test_the_address_brings_a_setting_back(browser, server):
    address = f"{server.address}?ramp=300&horizon=60&second=ramp-priority&seed=4"
    with opened(browser, address) as page:
        assert page.locator("[data-number=ramp]").input_value() == "300"
        assert page.evaluate("coramp.shown.runs.map((run) => run.seed)") == [4, 4]
        assert page.locator("#save").get_attribute("href").startswith("scenario.toml?ramp=300")
        page.locator("#reset").click()
        page.evaluate("coramp.ready")
        assert page.url == server.address
    with opened(browser, f"{server.address}?strategy=luck&lane=999") as page:
        alerts = " ".join(page.get_by_role("alert").all_inner_texts())
        assert "acceleration lane: 999 is out of range" in alerts


@in_browser
def test_what_is_out_of_range_is_told_in_the_page(browser, server):
    with opened(browser, server.address) as page:
        page.get_by_text("More settings").click()
        page.locator("[data-number=error]").fill("99")
        page.evaluate("coramp.ready")
        assert "positioning error: 99 is out of range" in page.get_by_role("alert").inner_text()
        page.locator("[data-number=error]").fill("0.5")
        page.evaluate("coramp.ready")
        assert page.get_by_role("alert").count() == 0


@in_browser
def test_the_view_stays_when_a_slider_moves(browser, server):
    with opened(browser, server.address) as page:
        page.evaluate(
            "coramp.shown.replay.seek(100); coramp.shown.diagrams[0].show([90, 130], [-100, 200])"
        )
        page.locator("[data-slider=ramp]").fill("600")
        page.evaluate("coramp.ready")
        assert page.evaluate("coramp.shown.replay.time") == 100
        scale = page.evaluate(
            "(({min, max}) => [min, max])(coramp.shown.diagrams[0].plot.scales.x)"
        )
        assert scale == [90, 130]


@in_browser
@pytest.mark.parametrize("colours", ["light", "dark"])
@pytest.mark.parametrize("width", [375, 1100])
def test_the_studio_is_for_everyone(browser, server, colours, width):
    with opened(browser, server.address, width, color_scheme=colours) as page:
        assert page.evaluate("document.documentElement.scrollWidth") <= width
        found = Axe().run(page).response["violations"]
        assert [v["id"] for v in found if v["impact"] in ("serious", "critical")] == []
        page.locator("[data-slider=mainline]").focus()
        page.keyboard.press("ArrowRight")
        page.evaluate("coramp.ready")
        assert page.evaluate("coramp.studio.asked().get('mainline')") == "1850"
