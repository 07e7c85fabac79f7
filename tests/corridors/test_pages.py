"""Report, replay and export of a corridor's run: what is drawn, and where."""

import json
import math

import numpy as np
import polars as pl
import pytest
from typer.testing import CliRunner

import coramp
from coramp import CorampError
from coramp.agency.corridor_contour import _lanes as lanes_of_road
from coramp.agency.corridor_contour import _seen as seen_on_roads
from coramp.agency.corridor_contour import contours_of
from coramp.agency.export import export
from coramp.audit.audit import audit
from coramp.cli.commands import app
from coramp.records.corridor_run import read_corridor
from coramp.records.run_folder import read_run
from coramp.report.page.corridor_page import corridor_page, title_of
from coramp.report.page.corridor_shown import corridor_data
from coramp.report.writing import replay, report
from coramp.scenarios.corridors import network_of
from tests.corridors import SITES, written
from tests.report.browser import chromium, in_browser


@pytest.fixture(scope="module")
def runs(tmp_path_factory, network):
    """Folders of two runs on the same arrivals, with SUMO's positions of the first."""
    folder = tmp_path_factory.mktemp("runs")
    path = written(folder, network, 0.5, 30.0)
    coramp.corridor(path, out=folder / "slots", keep_sumo=True)
    coramp.corridor(path, "uncontrolled", out=folder / "alone")
    return folder / "slots", folder / "alone"


@pytest.fixture(scope="module")
def positions(runs):
    """SUMO's positions of the first."""
    return pl.read_parquet(runs[0] / "sumo" / "fcd.parquet").drop_nulls("vehicle_id")


def test_a_run_has_the_same_figures_whether_positions_are_kept_or_not(runs):
    kept = read_corridor(runs[0])
    again = coramp.corridor(str(runs[0].parent / "road.toml"))
    assert again.summary == kept.summary
    assert all(frame.equals(kept.frames[name]) for name, frame in again.frames.items())


def test_the_way_along_the_road_goes_on_through_junctions(runs):
    """A vehicle's way grows by what it drives, by its speed, from one edge to the next as well."""
    records = read_corridor(runs[0])
    corridor = records.corridor()
    lanes = [dict(lanes_of_road(network_of(corridor), road)) for road in corridor.roads]
    assert any(lane.startswith(":") for lane in lanes[0])
    seen = seen_on_roads(records, lanes).sort("vehicle_id", "time_s")
    driven = 0
    for _, own in seen.group_by("vehicle_id"):
        way_m, speed_mps = own["way_m"].to_numpy(), own["speed_mps"].to_numpy()
        np.testing.assert_allclose(np.diff(own["time_s"].to_numpy()), 1.0, atol=1e-6)
        expected_m = 0.5 * (speed_mps[1:] + speed_mps[:-1])
        np.testing.assert_allclose(np.diff(way_m), expected_m, atol=2.0)
        driven += way_m[-1] > 2000.0
    assert driven > 5


def test_a_cell_has_the_mean_speed_of_who_was_there(runs, positions):
    (road,) = contours_of(read_corridor(runs[0]))
    noses_m = read_corridor(runs[0]).frames["sites"]["nose_m"].to_list()
    assert list(road.noses_m) == noses_m
    assert 700.0 < noses_m[0] < noses_m[1] - 1100.0
    assert road.free_mps == pytest.approx(27.78)
    assert (np.diff(road.edges_s), np.diff(road.edges_m)) == (
        pytest.approx(10.0),
        pytest.approx(50.0),
    )
    whole = (positions["timestep_time"] * 10.0).round().cast(pl.Int64) % 10 == 0
    there = positions.filter(whole & pl.col("vehicle_lane").str.starts_with("a_")).filter(
        pl.col("timestep_time").is_between(20.0, 29.95) & pl.col("vehicle_pos").is_between(400, 450)
    )
    assert there.height > 5
    assert road.speed_mps[2, 8] == pytest.approx(there["vehicle_speed"].mean())
    assert math.isnan(road.speed_mps[0, -1])


def test_vehicles_are_where_sumo_had_them_and_on_drawn_lanes(runs, positions):
    records = read_corridor(runs[0])
    data = corridor_data(records)
    assert (data["period_s"], data["cut"]) == (0.5, False)
    lanes = [np.reshape(shape["xy"], (-1, 2)) for shape in data["shapes"]]
    nose_m = records.corridor().sites[0].merge_edge.lanes[0].shape_m[0]
    shift_m = np.array(nose_m) - [data["sites"][0][key] for key in "xy"]
    trips = records.frames["trips"].filter(pl.col("entered_s").is_not_null())
    assert {v["id"] for v in data["vehicles"]} == set(trips["vehicle_id"])
    for vehicle in data["vehicles"][::5]:
        found = np.column_stack([np.cumsum(vehicle["x"]), np.cumsum(vehicle["y"])]) / 10.0
        told = positions.filter(vehicle_id=vehicle["id"]).filter(
            (pl.col("timestep_time") * 10.0).round().cast(pl.Int64) % 5 == 0
        )
        assert vehicle["from"] * 0.5 == pytest.approx(told["timestep_time"][0])
        there = told.select("vehicle_x", "vehicle_y").to_numpy() - shift_m
        np.testing.assert_allclose(found, there, atol=0.061)
        speeds = np.cumsum(vehicle["speed"]) / 10.0
        np.testing.assert_allclose(speeds, told["vehicle_speed"].to_numpy(), atol=0.051)
        for point in found[::10]:
            assert min(_away_m(point, lane) for lane in lanes) < 2.0


def _away_m(point, line):
    """How far a point is from a line of points."""
    start, way = line[:-1], np.diff(line, axis=0)
    along = np.clip(((point - start) * way).sum(axis=1) / (way**2).sum(axis=1), 0.0, 1.0)
    return np.hypot(*(point - start - along[:, None] * way).T).min()


def test_who_is_in_a_zone_is_who_was_handed_over(runs):
    records = read_corridor(runs[0])
    data = corridor_data(records)
    zones = {v["id"]: v["zones"] for v in data["vehicles"]}
    entered = records.frames["hand_overs"].filter(event="enters")
    assert sum(map(len, zones.values())) == entered.height
    automated = {v["id"] for v in data["vehicles"] if v["automated"]}
    assert {name for name, own in zones.items() if own} <= automated
    assert all(start < end for own in zones.values() for start, end in own)


def test_too_many_positions_are_cut_and_the_page_says_so(runs, monkeypatch):
    monkeypatch.setattr("coramp.report.page.corridor_shown.MOST_SAMPLES", 800)
    data = corridor_data(read_corridor(runs[0]))
    assert data["cut"]
    assert data["period_s"] == 2.0
    assert 0.0 < data["end_s"] < 60.0
    assert 700 < sum(len(v["x"]) for v in data["vehicles"]) <= 800


def test_the_report_tells_what_the_tables_hold(runs):
    records = [read_corridor(folder) for folder in runs]
    page = corridor_page(records)
    first, other = records
    assert title_of(first).startswith("mixed-slots (")
    assert "all vehicles got through" in page
    assert page.count("data:image/svg+xml") == 2
    assert all(site in page for site in SITES)
    by_s = other.summary["mean_delay_s"] - first.summary["mean_delay_s"]
    word = "less" if by_s >= 0.0 else "more"
    assert f"a vehicle loses {abs(by_s):.2f} s {word} with mixed-slots" in page
    assert "There is no picture of speeds along the road" in page
    assert "coramp run road.toml --strategy mixed-slots --drivers" in page
    alone = corridor_page(records[:1])
    assert "There is no picture" not in alone
    assert "<script>\n\n</script>" in alone


def test_pages_are_written_and_say_what_wrote_them(runs):
    for page in (report(runs[0], runs[1]), replay(runs[0])):
        assert '<meta name="generator" content="coramp">' in page.read_text()[:400]
    back = coramp.load(runs[0])
    assert back.summary == read_corridor(runs[0]).summary


def test_what_cannot_be_shown_is_told_in_a_line(runs, tmp_path, network):
    with pytest.raises(CorampError, match=r"alone: holds no positions; run again with --keep-sumo"):
        replay(runs[1])
    other = written(tmp_path, network, 0.5, 20.0)
    coramp.corridor(other, "uncontrolled", out=tmp_path / "other")
    with pytest.raises(CorampError, match=r"^--against: other vehicles arrive there \(road, 2 "):
        report(runs[0], tmp_path / "other")
    (tmp_path / "none").mkdir()
    with pytest.raises(CorampError, match=r"^--against: .*none: holds no run of a corridor"):
        report(runs[0], tmp_path / "none")
    for read in (read_run, audit):
        with pytest.raises(CorampError, match="allowed are coramp report, replay and export"):
            read(runs[0])
    mark = tmp_path / "other" / "run.json"
    content = json.loads(mark.read_text())
    mark.write_text(json.dumps({k: v for k, v in content.items() if k != "seed"}))
    with pytest.raises(CorampError, match=r"run\.json: seed: is missing"):
        report(tmp_path / "other")


def test_messages_are_refused_with_what_is_there_instead(tmp_path, network):
    path = written(tmp_path, network)
    told = CliRunner().invoke(app, ["run", path, "--keep-messages", "--out", str(tmp_path / "o")])
    assert told.exit_code != 0
    assert "keep no messages; allowed is --keep-sumo" in str(told.exception)


def test_every_table_is_exported(runs, tmp_path):
    files = export(runs[0], tmp_path / "csv")
    assert [file.name for file in files] == [
        *("sites.csv", "trips.csv", "passages.csv", "hand_overs.csv"),
    ]
    sites = pl.read_csv(tmp_path / "csv" / "sites.csv")
    assert sites["site"].to_list() == [*SITES]


@in_browser
@pytest.mark.parametrize("width", [1280, 375])
def test_the_replay_shows_the_road_and_moves(runs, width):
    path = replay(runs[0])
    complaints = []
    with chromium() as browser:
        page = browser.new_context(viewport={"width": width, "height": 800}).new_page()
        page.on("console", lambda message: complaints.append(message.text))
        page.on("pageerror", lambda error: complaints.append(str(error)))
        page.goto(path.as_uri())
        page.evaluate("coramp.ready")
        assert page.evaluate("document.documentElement.scrollWidth") <= width
        state = page.locator(".state")
        assert "vehicles on the road · mean speed" in state.inner_text()
        seen = page.evaluate("coramp.shown.panels[0].map.seen.map(({ px, py }) => [px, py])")
        page.get_by_role("button", name="one second on").click()
        moved = page.evaluate("coramp.shown.panels[0].map.seen.map(({ px, py }) => [px, py])")
        assert len(seen) > 20
        assert seen != moved
        page.get_by_label("show").select_option(label=f"site 2: {SITES[1]}")
        assert 0 < page.evaluate("coramp.shown.panels[0].map.seen.length") < len(seen)
        page.get_by_label("colours").select_option("kind")
        assert "in a coordinator" in page.locator(".legend").inner_text()
        page.get_by_role("button", name="play", exact=True).click()
        page.wait_for_function("coramp.shown.time > 62")
    assert complaints == []
