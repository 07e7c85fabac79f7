"""A run tells what the coordinator knew, what was lost, and what each vehicle did, as it was."""

import numpy as np
import polars as pl
import pytest

from coramp.records.lapses import FALLBACK, UNKNOWN, lapses_in
from coramp.runs.running import execute, make_spec, recorded
from coramp.worlds.faults.air import Air
from coramp.worlds.sumo.files import SumoOptions

DEMAND = {"mainline_veh_h": 1500.0, "ramp_veh_h": 500.0, "seed": 5, "horizon_s": 60.0}
HALF = {"traffic.automated_share": 0.5}
FAILING = {
    **HALF,
    "positioning.noise_m": 2.0,
    "reports.loss": 0.3,
    "reports.burst_s": 2.0,
    "reports.delay_s": 0.3,
    "commands.loss": 0.3,
    "commands.burst_s": 2.0,
}
KEEP = SumoOptions(keep_messages=True)


def specified(overrides):
    return make_spec("paper", "mixed-slots", overrides=overrides, **DEMAND)


@pytest.fixture(scope="module")
def failing():
    """Returns a run in a world that fails, and where it heard whom to be, by time and number."""
    seen = {}
    own = Air.heard

    def heard(self, now_s, users):
        found = own(self, now_s, users)
        for number, station_m in zip(found.number.tolist(), found.station_m, strict=True):
            seen[round(now_s, 3), number] = station_m
        return found

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Air, "heard", heard)
        run = recorded(specified(FAILING), KEEP)
    return run, seen


def test_what_was_heard_is_what_is_recorded(failing):
    run, seen = failing
    number = {name: k for k, name in enumerate(run.vehicles["vehicle_id"])}
    known = run.heard.drop_nulls("station_m")
    for time_s, name, station_m in known.select("time_s", "vehicle_id", "station_m").iter_rows():
        assert seen[round(time_s, 3), number[name]] == pytest.approx(station_m, abs=1e-3)
    unknown = run.heard.filter(pl.col("station_m").is_null())
    assert unknown.height > 0
    for time_s, name in unknown.select("time_s", "vehicle_id").iter_rows():
        assert (round(time_s, 3), number[name]) not in seen


def test_the_error_is_that_of_the_station(failing):
    run, _ = failing
    own = run.on_board.select("time_s", "vehicle_id", true_m="station_m")
    both = run.heard.drop_nulls("station_m").join(own, on=["time_s", "vehicle_id"])
    assert both.height > 500
    error_m = (both["station_m"] - both["true_m"] - both["error_m"]).abs()
    assert error_m.max() < 1e-3
    assert both["error_m"].std() > 1.5


def test_what_was_lost_and_who_fell_back_are_those_of_the_row(failing):
    run, _ = failing
    row, heard = run.summary, run.heard
    assert heard["report_lost"].sum() == row["reports_lost"] > 0
    assert heard["command_lost"].sum() == row["commands_lost"] > 0
    lapses = lapses_in(heard)
    assert sum(lapse.what == FALLBACK for lapse in lapses) == row["fallbacks"] > 0
    known = [lapse for lapse in lapses if lapse.what == UNKNOWN]
    rows = heard["station_m"].null_count()
    total_s = sum(lapse.until_s - lapse.from_s for lapse in known)
    assert total_s == pytest.approx(0.2 * rows)


def test_nothing_is_left_out_but_what_is_known_as_it_is(failing):
    run, seen = failing
    names = run.vehicles["vehicle_id"].to_list()
    told = set(zip(run.heard["time_s"].round(3), run.heard["vehicle_id"], strict=True))
    own = {(round(r["time_s"], 3), r["vehicle_id"]): r for r in run.on_board.rows(named=True)}
    for (time_s, number), station_m in seen.items():
        key = time_s, names[number]
        if key not in told and key in own:
            assert station_m == pytest.approx(own[key]["station_m"], abs=2e-3)


def test_what_is_noted_changes_nothing(failing):
    run, _ = failing
    tables, row = execute(specified(FAILING))
    measured = {"wall_s", "planning_median_s", "planning_p95_s"}
    assert {k: v for k, v in row.items() if k not in measured} == {
        k: v for k, v in run.summary.items() if k not in measured
    }
    frames = tables.frames()
    assert run.frames.keys() - frames.keys() == {"heard", "on_board"}
    for name, frame in frames.items():
        assert frame.equals(run.frames[name]), name


def test_a_perfect_world_has_nothing_to_tell_of_what_was_heard():
    assert recorded(specified(HALF)).heard is None
    run = recorded(specified(HALF), KEEP)
    assert run.heard is None
    assert run.on_board.height > 0
    assert not run.on_board["fallback"].any()


def test_a_bias_is_the_error_of_everyone():
    run = recorded(specified({**HALF, "positioning.bias_m": 20.0}))
    assert np.allclose(run.heard["error_m"].drop_nulls(), 20.0, atol=1e-3)


def test_who_fails_is_among_the_events():
    shares = {f"behaviour.{what}_share": 0.3 for what in ("silent", "disobeys", "lies")}
    overrides = {**HALF, **shares, "positioning.outages_per_h": 200.0}
    run = recorded(specified(overrides))
    events = run.safety_events.group_by("event").agg(pl.col("rear_vehicle_id")).rows()
    found = {event: set(names) for event, names in events}
    automated = set(run.vehicles.filter("automated")["vehicle_id"])
    for what in ("vehicle falls silent", "vehicle disobeys", "vehicle lies"):
        assert set() < found[what] < automated
    assert found["positioning fails"]
    for name in found["vehicle falls silent"]:
        silent = run.safety_events.filter(event="vehicle falls silent", rear_vehicle_id=name)
        exit_s = run.vehicles.filter(vehicle_id=name)["exit_s"][0]
        own = run.heard.filter(vehicle_id=name)
        after = own.filter(pl.col("time_s") > silent["time_s"][0] + 3.3)
        assert after["station_m"].null_count() == after.height
        assert after.height > 0 or exit_s < silent["time_s"][0] + 3.6
