"""The picture of a decision, held against the records of its run."""

import math
from pathlib import Path

import polars as pl
import pytest
from matplotlib.colors import to_hex

import coramp
from coramp import CorampError
from coramp.explain.story import story_in
from coramp.records.run import RunRecords
from coramp.records.run_folder import read_run
from coramp.report.story_figure import save_story_figure, story_figure
from coramp.report.story_scene import scene_of
from tests.edges import assert_refused, everything_below, invoke

LENGTH_M = 5.0


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    out = tmp_path_factory.mktemp("story") / "r"
    flows = {"mainline_veh_h": 2000, "ramp_veh_h": 1000, "seed": 3, "horizon_s": 200}
    gap = {"safety.time_gap_s": 0.9}
    coramp.run("paper", engine="exact", overrides=gap, out=out, **flows)
    return out


@pytest.fixture(scope="module")
def run(folder):
    return read_run(folder)


def station_m(run, name, time_s):
    """A vehicle's station from its pieces, worked out here."""
    pieces = run.trajectories.filter(vehicle_id=name).rows(named=True)
    piece = [p for p in pieces if p["time_s"] <= time_s][-1]
    x = time_s - piece["time_s"]
    return piece["station_m"] + piece["speed_mps"] * x + 0.5 * piece["accel_mps2"] * x * x


def artists(axes):
    found = {a.get_gid(): a for a in (*axes.get_lines(), *axes.patches)}
    return {gid: artist for gid, artist in found.items() if gid is not None}


def decision_of(run, rung, **more):
    rows = run.decisions.filter(pl.col("merge_time_s").is_not_null(), rung=rung, **more)
    return rows.row(0, named=True)


@pytest.mark.parametrize("rung", ["free", "reach", "create", "delay"])
def test_decision_and_merge_are_marked_where_the_records_have_them(run, rung):
    decision = decision_of(run, rung)
    name, now_s = decision["vehicle_id"], decision["time_s"]
    road, lines = (artists(axes) for axes in story_figure(run, name).axes)
    merge, mark = lines["merge"], lines["decision"]
    assert merge.get_xdata() == [decision["merge_time_s"]]
    assert merge.get_ydata() == [decision["merge_station_m"]]
    assert station_m(run, name, decision["merge_time_s"]) == pytest.approx(
        decision["merge_station_m"], abs=1e-6
    )
    assert mark.get_xdata() == [now_s]
    assert mark.get_ydata() == pytest.approx([station_m(run, name, now_s)])
    assert list(lines["decision-time"].get_xdata()) == [now_s, now_s]
    assert set(road["merge-station"].get_xdata()) == {decision["merge_station_m"]}


def test_everyone_stands_on_the_road_where_the_pieces_say(run):
    decision = decision_of(run, "create")
    now_s = decision["time_s"]
    above, _ = story_figure(run, decision["vehicle_id"]).axes
    boxes = {
        gid.removesuffix("-on-the-road"): box
        for gid, box in artists(above).items()
        if gid.endswith("-on-the-road")
    }
    low_m, high_m = above.get_xlim()
    there = {
        row["vehicle_id"]: station_m(run, row["vehicle_id"], now_s)
        for row in run.vehicles.iter_rows(named=True)
        if row["entry_s"] is not None and row["entry_s"] <= now_s <= (row["exit_s"] or math.inf)
    }
    inside = {n: m for n, m in there.items() if low_m + 5.0 <= m <= high_m - 5.0}
    assert inside.keys() == boxes.keys()
    assert {n: box.get_x() + LENGTH_M for n, box in boxes.items()} == pytest.approx(inside)
    assert {box.get_width() for box in boxes.values()} == {LENGTH_M}
    across = {n: box.get_y() + 0.5 * box.get_height() for n, box in boxes.items()}
    assert all(abs(across[n]) < 1e-9 for n in inside if n.startswith("m"))
    assert across[decision["vehicle_id"]] < -1.0
    expected = {decision["front_vehicle_id"], decision["rear_vehicle_id"]}
    assert {decision["vehicle_id"], *expected, *decision["adjusted_vehicle_ids"]} <= inside.keys()


def test_the_gap_and_the_required_gap_are_drawn_at_the_decision(run):
    decision = decision_of(run, "create", scenario=2)
    above, _ = story_figure(run, decision["vehicle_id"]).axes
    drawn = artists(above)
    gap, place = drawn["gap"], drawn["place"]
    assert gap.get_x() == pytest.approx(decision["rear_station_m"])
    assert gap.get_width() == pytest.approx(decision["gap_m"])
    rear_m, front_m = drawn["required-gap"].get_xdata()
    assert front_m - rear_m == pytest.approx(decision["required_gap_m"])
    place_m = place.get_x() + LENGTH_M
    ahead_s = decision["merge_time_s"] - decision["time_s"]
    assert place_m == pytest.approx(decision["merge_station_m"] - 20.0 * ahead_s)
    assert front_m - place_m == pytest.approx(place_m - LENGTH_M - rear_m)  # in the middle of it


def test_lines_are_what_was_driven_within_the_window(run):
    decision = decision_of(run, "reach")
    below = story_figure(run, decision["vehicle_id"]).axes[1]
    from_s, until_s = below.get_xlim()
    assert (from_s, until_s) == (decision["time_s"] - 3.0, decision["merge_time_s"] + 4.0)
    entered = set(run.vehicles.drop_nulls("entry_s")["vehicle_id"])
    lines = {gid: line for gid, line in artists(below).items() if gid in entered}
    for name, line in lines.items():
        row = run.vehicles.filter(vehicle_id=name).row(0, named=True)
        times_s, stations_m = line.get_data()
        assert times_s[0] == pytest.approx(max(from_s, row["entry_s"]))
        assert times_s[-1] == pytest.approx(min(until_s, row["exit_s"]))
        for k in (0, len(times_s) // 2, -1):
            assert stations_m[k] == pytest.approx(station_m(run, name, times_s[k]), abs=1e-6)
    present = run.vehicles.filter((pl.col("entry_s") < until_s) & (pl.col("exit_s") > from_s))
    assert set(lines) == set(present["vehicle_id"])


def test_those_who_have_to_do_with_it_look_different_from_the_others(run):
    decision = decision_of(run, "create", scenario=3)
    below = story_figure(run, decision["vehicle_id"]).axes[1]
    lines = artists(below)
    front, rear = decision["front_vehicle_id"], decision["rear_vehicle_id"]
    moved = [n for n in decision["adjusted_vehicle_ids"] if n not in (front, rear)]
    others = [n for n in lines if n.startswith("m0") and n not in (front, rear, *moved)]
    names = [decision["vehicle_id"], front, rear, moved[0], others[0]]
    assert len({to_hex(lines[n].get_color()) for n in names}) == 5
    assert len({str(lines[n].get_linestyle()) for n in names[1:]}) >= 3
    assert all(lines[n].get_linewidth() < 1.0 for n in others)
    _, labels = below.get_legend_handles_labels()
    assert f"{front}, X, moved, conflict" in labels or f"{front}, X, moved" in labels
    assert f"{rear}, Y, moved" in labels


def test_the_last_decision_that_merges_counts(run):
    held = set(run.decisions.filter(rung="hold")["vehicle_id"])
    merged = run.decisions.filter(pl.col("merge_time_s").is_not_null())
    name = next(n for n in merged["vehicle_id"] if n in held)
    scene = scene_of(run, name)
    assert scene.decision["rung"] != "hold"
    assert scene.decision["merge_time_s"] == merged.filter(vehicle_id=name)["merge_time_s"].item()


def test_a_hold_without_a_merge_is_drawn_without_one(run):
    name = run.decisions.filter(rung="hold")["vehicle_id"][0]
    only = RunRecords(
        run.content,
        run.summary,
        run.vehicles,
        run.speeds,
        run.trajectories,
        run.decisions.filter(rung="hold"),
    )
    above, below = story_figure(only, name).axes
    assert above.get_title().endswith("rung hold: no merge is safe yet")
    assert "merge" not in artists(below)
    assert not {"gap", "required-gap", "place", "merge-station"} & artists(above).keys()
    time_s = only.decisions.filter(vehicle_id=name)["time_s"].item()
    assert artists(below)["decision"].get_ydata() == pytest.approx([station_m(run, name, time_s)])


def test_who_was_moved_is_shown_at_the_decision_that_moved_it(run):
    decision = decision_of(run, "create")
    moved = decision["adjusted_vehicle_ids"][-1]
    last = [
        row for row in run.decisions.rows(named=True) if moved in (row["adjusted_vehicle_ids"])
    ][-1]
    above, below = story_figure(run, moved).axes
    assert above.get_title().startswith(f"{moved} moves for {last['vehicle_id']}, decision at ")
    assert artists(below)["merge"].get_xdata() == [last["merge_time_s"]]


def test_without_a_decision_its_own_passage_is_drawn(run):
    told = {*run.decisions["vehicle_id"], *run.decisions["adjusted_vehicle_ids"].explode()}
    row = run.vehicles.filter(~pl.col("vehicle_id").is_in(list(told - {None}))).row(0, named=True)
    (axes,) = story_figure(run, row["vehicle_id"]).axes
    assert axes.get_title() == f"{row['vehicle_id']}: no decision was about it; its own passage"
    assert axes.get_xlim() == pytest.approx((row["entry_s"], row["exit_s"]))
    left = run.vehicles.drop_nulls("exit_s").sort("exit_s")["vehicle_id"].to_list()
    after = left[left.index(row["vehicle_id"]) + 1]
    assert f"{after}, leaves after it" in axes.get_legend_handles_labels()[1]
    assert "decision" not in artists(axes)


def test_who_never_entered_cannot_be_drawn(run):
    name = run.vehicles["vehicle_id"][0]
    without = run.trajectories.filter(pl.col("vehicle_id") != name)
    only = RunRecords(run.content, run.summary, run.vehicles, run.speeds, without, run.decisions)
    with pytest.raises(CorampError, match=f"{name} never entered"):
        story_figure(only, name)


def test_a_run_at_hand_tells_the_same_story_and_draws_the_same(folder, run):
    text = save(run, "r00001", folder.parent / "a.svg")
    assert save(read_run(folder), "r00001", folder.parent / "b.svg") == text
    assert f'id="{run.decisions["vehicle_id"][0]}"' in text
    assert story_in(run, "r00001").chapters
    with pytest.raises(CorampError, match=r"^there is no vehicle 'x'; allowed are m00001 to r"):
        story_in(run, "x")


def save(run, name, path):
    save_story_figure(run, name, path)
    return path.read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("name", "magic"), [("p.png", b"\x89PNG\r\n"), ("p.svg", b"<?xml"), ("p.pdf", b"%PDF-")]
)
def test_the_command_draws_and_tells_as_before(folder, tmp_path, name, magic):
    told = invoke("explain", folder, "r00002", "--plot", tmp_path / name)
    assert (told.code, told.err) == (0, "")
    assert told.out == invoke("explain", folder, "r00002").out
    assert (tmp_path / name).read_bytes().startswith(magic)
    assert everything_below(tmp_path) == [name]


@pytest.mark.parametrize("name", ["p.txt", "p", "folder", "nowhere/p.png", "folder/p.png/q.svg"])
def test_a_picture_needs_a_place_and_an_ending_that_is_known(folder, tmp_path, monkeypatch, name):
    monkeypatch.chdir(tmp_path)
    Path("folder").mkdir()
    told = invoke("explain", folder, "r00002", "--plot", name)
    assert_refused(told)
    assert told.err.startswith(f"Error: --plot: {name}: ")
    assert told.errors[0].endswith("; allowed are png, svg and pdf files")
    assert everything_below(tmp_path) == ["folder"]


def test_an_unknown_vehicle_is_told_and_nothing_is_drawn(folder, tmp_path):
    told = invoke("explain", folder, "r99999", "--plot", tmp_path / "p.png")
    assert_refused(told)
    assert told.err.startswith(f"Error: {folder}: there is no vehicle 'r99999'; allowed are ")
    assert everything_below(tmp_path) == []


def test_the_help_tells_of_the_option():
    assert "--plot" in invoke("explain", "--help").out
