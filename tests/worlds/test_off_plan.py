"""A vehicle that SUMO does not carry as planned: what is told is what SUMO's positions say."""

import pytest

from coramp.runs.running import broken_promises, execute, make_spec
from coramp.worlds.sumo.session import Session

SETTINGS = {"mainline_veh_h": 1800, "ramp_veh_h": 500, "horizon_s": 40}


def run_with_a_fault(monkeypatch, after_s, for_s, slower_mps):
    """Has one mainline vehicle drive slower for a while than it is told, and then as fast again."""
    step_to, keep_speed = Session.step_to, Session.keep_speed

    def with_fault(session, step):
        for moment_s, speed_mps in ((after_s, 20.0 - slower_mps), (after_s + for_s, 20.0)):
            moment = round(moment_s / 0.1)
            if getattr(session, "at", 0) < moment <= step:
                step_to(session, moment)
                keep_speed(session, "m00003", speed_mps)
        session.at = step
        step_to(session, step)

    monkeypatch.setattr(Session, "step_to", with_fault)
    return execute(make_spec("paper", "mainline-priority", **SETTINGS))


def test_who_runs_into_a_slow_one_in_sumo_is_counted(monkeypatch):
    plain = execute(make_spec("paper", "mainline-priority", **SETTINGS))[1]
    assert (plain["safety_violations"], broken_promises(plain)) == (0, [])
    tables, row = run_with_a_fault(monkeypatch, after_s=16.0, for_s=8.0, slower_mps=8.0)
    assert row["plan_error_m"] > 10.0
    assert row["safety_violations"] >= 1
    assert row["min_margin_m"] < -5.0  # they overlap
    assert tables.violations["front_vehicle_id"].to_list()[0] == "m00003"
    assert any("nearer than the safe distance" in line for line in broken_promises(row))


def test_being_off_plan_alone_is_no_violation(monkeypatch):
    _, row = run_with_a_fault(monkeypatch, after_s=16.0, for_s=1.0, slower_mps=0.5)
    assert row["plan_error_m"] == pytest.approx(0.5, abs=0.1)
    assert row["safety_violations"] == 0
