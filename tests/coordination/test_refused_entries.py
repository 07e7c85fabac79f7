"""Entries that the checker refuses: told once, and tried again when something has changed."""

from coramp.audit.reasons import REASONS, TOO_HARD
from coramp.coordination.coordinator import Coordinator
from coramp.coordination.examination import Examiner
from coramp.coordination.plant import Arrival
from coramp.loading import load_scenario
from coramp.running import execute, make_spec
from coramp.strategies.registry import strategy_named
from tests.situations import named

RULES = load_scenario("paper").rules()
LAST_STEP = 1200


def run_with(comfort_mps2, *arrivals):
    """Runs arrivals (stream, time in s, speed) past a checker that allows less than planners use."""
    listed = [Arrival("", s == "r", round(t / 0.1), v, 5.0) for s, t, v in arrivals]
    loop = Coordinator(strategy_named("mainline-priority")(), RULES, named(listed), 20.0)
    loop._examiner = Examiner(loop._examiner.bounds._replace(comfort_mps2=comfort_mps2))
    loop.expect_arrivals()
    loop.run(LAST_STEP)
    return loop


def test_an_entry_that_can_never_be_safe_is_told_once():
    loop = run_with(1.0, ("m", 1.0, 15.0), ("m", 5.0, 20.0))  # to v0 it takes 1.5 m/s2
    assert loop.waiting() == [0, 1]
    assert [(r.time_s, r.reason) for r in loop.refusals] == [(1.0, REASONS[TOO_HARD])]


def test_it_is_tried_again_once_something_has_changed():
    # behind the slow one it would have to brake with 2 m/s2; alone it keeps its 20 m/s
    loop = run_with(1.8, ("m", 1.0, 10.0), ("m", 1.7, 20.0))
    assert [r.reason for r in loop.refusals] == [REASONS[TOO_HARD]]
    assert loop.waiting() == []


def test_the_least_effort_is_within_a_weak_acceleration_on_the_ramp():
    for strategy in ("fifo-optimal-control", "milp-sequence"):
        settings = {"motion.ramp_acceleration_mps2": 2.1, "simulation.drain_s": 300.0}
        spec = make_spec("paper", strategy, engine="exact", horizon_s=120, overrides=settings)
        _, row = execute(spec)
        assert (row["refused_plans"], row["unserved"]) == (0, 0)


def test_steered_vehicles_keep_to_a_weak_acceleration_on_the_lane():
    settings = {"motion.ramp_acceleration_mps2": 1.2, "motion.free_acceleration_mps2": 1.2}
    spec = make_spec("paper", "virtual-platoon", engine="exact", horizon_s=60, overrides=settings)
    tables, row = execute(spec)
    lane = tables.trajectories.filter(lane="acceleration")
    assert lane["accel_mps2"].max() <= 1.2 + 1e-6
    assert row["unserved"] == 0
