"""Entries that the checker refuses: told once, and tried again when something has changed."""

import numpy as np

from coramp.checker.reasons import REASONS, TOO_HARD
from coramp.coordination.coordinator import Coordinator
from coramp.coordination.plant import Arrival
from coramp.kinematics.trajectory import ACCEL, MAX_PIECES
from coramp.messages.feed import RequestFeed
from coramp.motion.driving import hold_then_merge
from coramp.runs.running import execute, make_spec
from coramp.scenarios.loading import load_scenario
from coramp.strategies.registry import strategy_named
from tests.mathematics import fleet_of, pieces
from tests.situations import named

RULES = load_scenario("paper").rules()
LAST_STEP = 1200


def run_with(comfort_mps2, *arrivals):
    """Runs arrivals (stream, time, speed) past a checker that allows less than planners use."""
    listed = [Arrival("", s == "r", round(t / 0.1), v, 5.0) for s, t, v in arrivals]
    loop = Coordinator(
        strategy_named("mainline-priority")(), RULES, RequestFeed(named(listed)), 20.0
    )
    examiner = loop._commitments.examiner
    examiner.bounds = examiner.bounds._replace(comfort_mps2=comfort_mps2)
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
        settings = {f"motion.{key}_acceleration_mps2": 0.6 for key in ("ramp", "free")}
        spec = make_spec("paper", strategy, engine="exact", horizon_s=120, overrides=settings)
        _, row = execute(spec)
        assert (row["refused_plans"], row["unserved"]) == (0, 0)


def test_a_held_acceleration_keeps_to_a_weak_one_on_the_lane():
    weak = RULES._replace(motion=RULES.motion._replace(ramp_acceleration_mps2=1.2))
    weak = weak._replace(motion=weak.motion._replace(free_acceleration_mps2=1.0))
    out = np.empty((MAX_PIECES, 4))
    fleet = fleet_of((pieces(0.0, 20.0, 14.0), 12.0))
    n = hold_then_merge(fleet, 0, 1.5, 2.0, 1.0, weak, out)
    assert n > 1
    assert out[:n, ACCEL].max() == 1.2
