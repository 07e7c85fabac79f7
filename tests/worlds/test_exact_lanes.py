"""Plans on several lanes in the exact engine: made, driven, recorded, explained, audited."""

import polars as pl
import pytest

import coramp
from coramp.audit.audit import audit
from coramp.explain.story import story_of
from coramp.report.story_scene import CONFLICT, MOVED, scene_of

THREE = {"mainline.lanes": 3, "mainline.lane_shares": [0.5, 0.25, 0.25]}


def run(strategy, **more):
    settings = {"horizon_s": 60.0, "seed": 1, "mainline_veh_h": 3600.0, "ramp_veh_h": 700.0}
    overrides = {**THREE, **more.pop("overrides", {})}
    return coramp.run("paper", strategy, engine="exact", overrides=overrides, **settings, **more)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("lanes") / "run"


@pytest.fixture(scope="module")
def made(folder):
    return run("ramp-priority", out=folder, keep_messages=True)


def test_vehicles_make_way_and_everyone_keeps_his_distance(made):
    summary = made.summary
    assert summary["made_way"] > 0
    assert summary["safety_violations"] == summary["refused_plans"] == summary["unserved"] == 0
    assert summary["min_margin_m"] >= 0.1 - 1e-9
    assert summary["outer_lane_delay_s"] is not None
    assert summary["lane_limit_veh_h"] is summary["delay_bound_s"] is None


def test_each_that_makes_way_does_so_for_a_decision_and_is_on_the_next_lane_from_then_on(made):
    decided = made.decisions.filter(rung="make way")
    assert decided.height == made.summary["made_way"]
    for row in decided.iter_rows(named=True):
        (who,) = row["adjusted_vehicle_ids"]
        assert who == row["conflict_vehicle_id"]
        own = made.trajectories.filter(vehicle_id=who).sort("time_s")
        further_in = own.filter(pl.col("lane") == "mainline 2")
        assert further_in["time_s"][0] >= row["time_s"] + 0.1 - 1e-9
        assert own["lane"].unique(maintain_order=True).to_list() == ["mainline", "mainline 2"]
        assert further_in["time_s"][0] + 4.5 <= row["nose_time_s"] + 1e-9


def test_just_one_attempt_of_each_decision_is_chosen(made):
    chosen = made.attempts.filter(reason="chosen")
    assert chosen.height == made.decisions.filter(pl.col("rung") != "hold").height
    own = chosen.filter(rung="make way")["moved_vehicle_id"].to_list()
    assert own == made.decisions.filter(rung="make way")["conflict_vehicle_id"].to_list()


def test_vehicles_of_the_lanes_further_in_keep_theirs(made):
    lanes = made.trajectories.group_by("vehicle_id").agg(pl.col("lane").unique())
    makers = set(made.decisions.filter(rung="make way")["conflict_vehicle_id"])
    inner = lanes.filter(pl.col("lane").list.contains("mainline 2"))
    assert {len(row) for name, row in inner.rows() if name not in makers} == {1}
    assert "mainline 3" in made.trajectories["lane"].unique().to_list()


def test_the_audit_confirms_it_from_the_log(made, folder):
    result = audit(folder)
    assert result.contradictions == []
    assert "made_way" in [check.claim for check in result.checks]


def test_the_story_tells_who_makes_way(made, folder):
    decision = made.decisions.filter(rung="make way").row(0, named=True)
    story = story_of(folder, decision["vehicle_id"])
    chapter = story.chapters[-1]
    who = decision["conflict_vehicle_id"]
    assert chapter.text.startswith(f"{who} makes way to the lane further in: it merges")
    assert any(f"{who} makes way" in line and "chosen" in line for line in chapter.tried)


def test_the_picture_of_a_decision_leaves_out_who_is_further_in(made):
    decision = made.decisions.filter(rung="make way").row(0, named=True)
    scene = scene_of(made, decision["vehicle_id"])
    who = decision["conflict_vehicle_id"]
    assert {MOVED, CONFLICT} <= set(scene.roles[who])
    changes_s = made.trajectories.filter(vehicle_id=who, lane="mainline 2")["time_s"][0]
    assert scene.driven[who].until_s == pytest.approx(changes_s + 4.5)
    came = made.trajectories.group_by("vehicle_id", maintain_order=True).first()
    outer = came.filter(pl.col("lane").is_in(["mainline", "ramp"]))["vehicle_id"].to_list()
    assert set(scene.driven) == set(outer)


@pytest.mark.parametrize(
    ("strategy", "engine", "line"),
    [
        ("slots", "exact", "strategy: slots plans for one lane, and mainline.lanes is above 1; "),
        ("mixed-slots", "exact", "engine: exact cannot run where mainline.lanes is above 1; "),
        ("slots", "sumo", "allowed are mainline-priority, .*uncontrolled, or mainline.lanes 1"),
    ],
)
def test_what_cannot_be_planned_on_several_lanes_is_refused_in_one_line(strategy, engine, line):
    with pytest.raises(coramp.CorampError, match=line):
        coramp.run("paper", strategy, engine=engine, overrides={"mainline.lanes": 3})
