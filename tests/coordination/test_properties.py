"""What holds for any traffic: distances, causality, determinism, an end for everyone."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from coramp.coordination.plant import Arrival
from coramp.demand.arrivals import arrivals_of
from coramp.scenarios.loading import load_scenario
from coramp.strategies.base import Decision, FollowTrajectory
from coramp.strategies.situation import assess
from tests.situations import (
    COOPERATIVE,
    STEP_S,
    driven,
    least_margin_m,
    loop,
    named,
    situations,
    states,
)


@pytest.mark.parametrize("strategy", COOPERATIVE)
@settings(max_examples=25)
@given(situations())
def test_no_two_in_a_lane_come_nearer_than_promised(strategy, situation):
    scenario, arrivals, _ = situation
    coordinator = loop(scenario, arrivals, strategy)
    least_m = least_margin_m(driven(coordinator, arrivals), scenario.safety)
    assert least_m >= scenario.safety.execution_allowance_m - 1e-6


@given(situations())
def test_merges_keep_their_distance(situation):
    scenario, arrivals, strategy = situation
    coordinator = loop(scenario, arrivals, strategy)
    vehicles = driven(coordinator, arrivals)
    road, safety = scenario.rules().road, scenario.safety
    along = math.cos(road.merge_angle_rad)
    for row, vehicle in enumerate(vehicles):
        merge_s = coordinator.ledger.merge_time_s(row)
        if not math.isfinite(merge_s):
            continue
        own_m, own_mps, _ = states(vehicle, np.array([merge_s]))
        assert 0.0 < own_m[0] <= road.last_merge_station_m + 1e-6
        for other_row, other in enumerate(vehicles):
            station, speed, on_mainline = states(other, np.array([merge_s]))
            if other_row == row or np.isnan(station[0]) or not on_mainline[0]:
                continue
            front, rear = (station[0], own_m[0]), (own_m[0], station[0])
            ahead = station[0] > own_m[0]
            gap = (front[0] - front[1] if ahead else rear[0] - rear[1]) - (
                other.length_m if ahead else vehicle.length_m
            )
            needed = 2 * safety.positioning_error_m + (
                3.6 * (own_mps[0] * along - speed[0])
            ) ** 2 / (254 * (safety.adhesion + safety.resistance))
            assert gap >= needed + safety.execution_allowance_m - 1e-6


@given(situations())
def test_everyone_gets_through_and_no_plan_is_refused(situation):
    scenario, arrivals, strategy = situation
    coordinator = loop(scenario, arrivals, strategy)
    assert coordinator.refusals == []
    assert coordinator.waiting() == []
    assert all(coordinator.ledger.exit_time_s(k) < 400.0 for k in range(len(arrivals)))


@given(situations())
def test_accelerations_and_speeds_keep_their_bounds(situation):
    scenario, arrivals, strategy = situation
    coordinator = loop(scenario, arrivals, strategy)
    v0, motion = scenario.mainline.speed_mps, scenario.rules().motion
    for row, vehicle in enumerate(driven(coordinator, arrivals)):
        braking = -vehicle.pieces[:, 3].min()
        assert braking <= motion.comfort_mps2 + 1e-9
        assert vehicle.pieces[:, 3].max() <= motion.ramp_acceleration_mps2 + 1e-9
        assert vehicle.pieces[:, 2].min() >= -1e-9
        entered_mps = arrivals[coordinator.entered()[0][row]].speed_mps
        assert vehicle.pieces[:, 2].max() <= max(entered_mps, v0 * (1 + motion.speed_deviation)) + (
            1e-6
        )


@given(situations())
def test_pieces_join_without_a_jump(situation):
    scenario, arrivals, strategy = situation
    for vehicle in driven(loop(scenario, arrivals, strategy), arrivals):
        x = np.diff(vehicle.pieces[:, 0])
        station = vehicle.pieces[:-1, 1] + vehicle.pieces[:-1, 2] * x
        station += vehicle.pieces[:-1, 3] * x * x / 2
        assert np.allclose(station, vehicle.pieces[1:, 1], atol=1e-6)
        speed = vehicle.pieces[:-1, 2] + vehicle.pieces[:-1, 3] * x
        assert np.allclose(speed, vehicle.pieces[1:, 2], atol=1e-6)


def before(coordinator, time_s, delay_s):
    """Everything decided before a time: who entered, what was decided and committed."""
    committed = [
        (c.row, c.pieces.tolist())
        for c in coordinator.ledger.history
        if c.pieces[0, 0] < time_s + delay_s - 1e-9
    ]
    who, when = coordinator.entered()
    entered = [
        (k, step) for k, step in zip(who, when, strict=True) if step * STEP_S < time_s - 1e-9
    ]
    decided = [repr(d) for d in coordinator.decisions if d.time_s < time_s - 1e-9]
    return entered, decided, committed


@pytest.mark.parametrize("strategy", COOPERATIVE)
@settings(max_examples=25)
@given(situations(), st.integers(30, 400), st.randoms(use_true_random=False), st.data())
def test_what_arrives_later_changes_no_decision_before(strategy, situation, step, random, data):
    scenario, arrivals, _ = situation
    early = [a for a in arrivals if a.step < step]
    late = [a for a in arrivals if a.step >= step]
    change = data.draw(st.sampled_from(["insert", "remove", "retime", "all at once"]))
    if change == "remove" and late:
        late.pop(random.randrange(len(late)))
    elif change == "retime" and late:
        k = random.randrange(len(late))
        late[k] = late[k]._replace(step=step + random.randrange(200))
    elif change == "insert":
        stream = random.random() < 0.5
        speed = (scenario.ramp if stream else scenario.mainline).entry_speed_mps[0]
        late.append(arrivals[0]._replace(on_ramp=stream, step=step, speed_mps=speed))
    else:
        late = []
    delay_s = scenario.control.actuation_delay_s
    one = loop(scenario, arrivals, strategy)
    other = loop(scenario, named([*early, *late]), strategy)
    time_s = step * STEP_S
    # entries that follow at once from the start of a step are commitments with no delay
    assert before(one, time_s, min(delay_s, 0.0)) == before(other, time_s, min(delay_s, 0.0))
    assert before(one, time_s, delay_s)[1] == before(other, time_s, delay_s)[1]


@settings(max_examples=20)
@given(situations())
def test_the_same_traffic_gives_the_same_plans(situation):
    one, other = loop(*situation), loop(*situation)
    assert before(one, 1e9, 0.0) == before(other, 1e9, 0.0)


def test_a_plan_that_the_checker_refuses_is_not_driven():
    """A strategy that would merge into others is refused, and everyone keeps what he had."""
    scenario = load_scenario("paper")

    class Reckless:
        name, summary, cooperative = "reckless", "", True

        def decide(self, view, memory):
            row = view.subjects[0]
            situation = assess(view.fleet, row, view.time_s, 20.0, view.rules)
            approach = situation.approach
            t, s, v, _ = approach[-1]
            pieces = np.vstack(
                [approach[:-1], [t, s, v, 2.0], [t + 2.0, s + 2 * v + 4.0, v + 4.0, 0.0]]
            )
            return Decision((FollowTrajectory(row, pieces, t + 2.0),), (), memory)

    arrivals = named(
        [Arrival("", False, k, 20.0, 5.0) for k in range(4, 700, 5)]
        + [Arrival("", True, 100, 16.0, 5.0)]
    )
    coordinator = loop(scenario, arrivals, Reckless(), last_s=60.0)
    assert coordinator.refusals
    assert all(r.reason.startswith("comes nearer than") for r in coordinator.refusals)
    row = [arrivals[k].on_ramp for k in coordinator.entered()[0]].index(True)
    assert math.isinf(coordinator.ledger.merge_time_s(row))
    assert coordinator.ledger.trajectory(row)[-1, 2] == 0.0


@pytest.mark.parametrize("strategy", ["mainline-priority", "ramp-priority"])
def test_a_ramp_vehicle_always_holds_a_plan_that_ends_in_a_stop_or_a_merge(strategy):
    scenario = load_scenario(
        "paper",
        {
            "mainline.flow_veh_h": 3600.0,
            "ramp.flow_veh_h": 1500.0,
            "simulation.horizon_s": 120.0,
        },
    )
    arrivals = arrivals_of(scenario, 31)
    coordinator = loop(scenario, arrivals, strategy)
    on_ramp = [arrivals[k].on_ramp for k in coordinator.entered()[0]]
    stop_m = scenario.rules().road.stop_station_m
    for commitment in coordinator.ledger.history:
        last = commitment.pieces[-1]
        if on_ramp[commitment.row] and last[2] != scenario.mainline.speed_mps:
            assert last[2] == 0.0
            assert last[1] <= stop_m + 1e-9
