"""coramp/Merge-v1: Gymnasium's own checker, seeds, what rewards add up to, and safety."""

import math
import warnings

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

import coramp
import coramp.gym
from coramp.errors import CorampError
from coramp.gym_v1 import AROUND_S, FEATURES, TOLERANCE_S
from coramp.scenarios.loading import load_scenario
from tests import situations

SHORT = {"horizon_s": 120.0}
TIME_GAP = {"safety.time_gap_s": 1.0}


def made(**settings):
    return gymnasium.make("coramp/Merge-v1", **settings).unwrapped


def driven(env, seed, policy):
    """Everything that an episode returns."""
    observation, info = env.reset(seed=seed)
    steps, over = [(observation, info)], False
    while not over:
        observation, reward, ended, cut, info = env.step(policy(observation))
        steps.append((observation, reward, ended, cut, info))
        over = ended or cut
    return steps


def constant(value):
    return lambda _: np.full(1, value, np.float32)


def at_random(seed=7):
    random = np.random.default_rng(seed)
    return lambda _: random.uniform(-1.0, 1.0, 1).astype(np.float32)


def behind_everybody(observation):
    """Asks for the first slot behind the last of the lane, a headway of 1.257 s after it."""
    shift_s = max(0.0, 1.26 - AROUND_S * float(observation[-1]))
    return np.array([max(-0.999, min(1.0, shift_s / 5.0 - 1.0))], np.float32)


def test_gymnasiums_checker_has_nothing_to_say():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(made(**SHORT), skip_render_check=True)


def test_spaces_are_float32_and_of_order_one():
    env = made()
    for space in (env.action_space, env.observation_space):
        assert space.dtype == np.float32
        assert (space.low == -1.0).all()
        assert (space.high == 1.0).all()
    for observation, *_ in driven(env, 3, at_random()):
        assert env.observation_space.contains(observation)


def test_the_same_seed_is_the_same_traffic():
    one, same = (driven(made(**SHORT), 5, at_random()) for _ in range(2))
    assert repr(one) == repr(same)
    assert repr(one) != repr(driven(made(**SHORT), 6, at_random()))


def test_without_a_seed_traffic_differs_and_is_repeated_by_the_seed_before():
    env = made(**SHORT)
    drawn = []
    for _ in range(2):
        env.reset(seed=4)
        env.reset()
        drawn.append(env.arrivals)
        env.reset()
        drawn.append(env.arrivals)
    assert drawn[:2] == drawn[2:]
    assert drawn[0] != drawn[1]


def test_seeds_are_those_of_runs():
    env = made(**SHORT)
    env.reset(seed=11)
    run = coramp.run(
        "paper",
        "slots",
        engine="exact",
        mainline_veh_h=1800.0,
        ramp_veh_h=500.0,
        overrides=TIME_GAP,
        horizon_s=120.0,
        seed=11,
    )
    assert [a.step * 0.1 for a in env.arrivals] == pytest.approx(run.vehicles["scheduled_s"])


@pytest.mark.parametrize("policy", [constant(-1.0), constant(1.0), behind_everybody, at_random()])
def test_rewards_add_up_to_the_delay_beyond_the_queue(policy):
    env = made(**SHORT)
    steps = driven(env, 8, policy)
    ledger, (arrival, _) = env.loop.coordinator.ledger, env.loop.coordinator.entered()
    free_s = {False: 40.0, True: 25.0 + 20.0 + 0.2}
    delays_s = [
        ledger.exit_time_s(row) - 0.1 * env.arrivals[k].step - free_s[env.arrivals[k].on_ramp]
        for row, k in enumerate(arrival.tolist())
    ]
    assert len(delays_s) == len(env.arrivals)
    mean_s = float(np.mean(delays_s))
    assert steps[-1][-1]["delay_s"] == pytest.approx(mean_s, abs=1e-9)
    total = sum(step[1] for step in steps[1:])
    run = coramp.run("paper", "slots", engine="exact", overrides=TIME_GAP, horizon_s=120.0, seed=8)
    of_all = run.vehicles["stream"] == "ramp"
    served_s = np.where(
        of_all, run.summary["ramp_fcfs_delay_s"], run.summary["mainline_fcfs_delay_s"]
    ).mean()
    assert total == pytest.approx(served_s - mean_s, abs=1e-9)


@pytest.mark.parametrize("policy", [constant(-1.0), constant(0.2), behind_everybody, at_random()])
def test_whatever_agents_ask_for_everyone_keeps_its_distance(policy):
    env = made(**SHORT)
    steps = driven(env, 13, policy)
    assert all(math.isfinite(step[1]) for step in steps[1:])
    end_s = steps[-1][-1]["time_s"]
    vehicles = situations.driven(env.loop.coordinator, env.arrivals, end_s)
    safety = load_scenario("paper", TIME_GAP).safety
    least_m = situations.least_margin_m(vehicles, safety)
    assert least_m >= safety.execution_allowance_m - 1e-6


def test_who_asks_for_nothing_merges_by_itself():
    steps = driven(made(**SHORT), 9, constant(-1.0))
    assert steps[-1][2:4] == (True, False)
    assert steps[-1][-1]["refused"] == 0
    assert steps[-1][0].tolist() == [0.0] * FEATURES


def test_to_ask_for_the_slot_behind_everybody_saves_delay():
    env = made()
    asked = [driven(env, seed, behind_everybody)[-1][-1]["delay_s"] for seed in range(3000, 3004)]
    nothing = [driven(env, seed, constant(-1.0))[-1][-1]["delay_s"] for seed in range(3000, 3004)]
    assert np.mean(asked) < 0.5 * np.mean(nothing)


def test_a_slot_is_given_at_once_where_nobody_is():
    env = made(mainline_veh_h=0.0, ramp_veh_h=100.0)
    _, info = env.reset(seed=2)
    row, loop = info["row"], env.loop
    free_s = loop.crossing_s(row)
    _, _, _, _, info = env.step(np.zeros(1, np.float32))
    ledger = loop.coordinator.ledger
    pieces = ledger.trajectory(row)
    last_s, last_m = pieces[-1, :2]
    assert last_s - last_m / 20.0 == pytest.approx(free_s + 5.0, abs=1e-6)
    assert info["refused"] == 0


def test_a_wish_on_top_of_another_vehicle_is_refused():
    env = made()
    observation, info = env.reset(seed=2)
    while not -TOLERANCE_S - 0.2 > AROUND_S * observation[-1] > -2.5:
        observation, _, ended, _, info = env.step(behind_everybody(observation))
        assert not ended
    shift_s = -AROUND_S * float(observation[-1]) - 0.5
    *_, info = env.step(np.array([shift_s / 5.0 - 1.0], np.float32))
    assert info["refused"] == 1


def test_what_takes_too_long_is_cut_off():
    *_, (_, _, ended, cut, info) = driven(made(longest_s=60.0), 1, constant(-1.0))
    assert (ended, cut) == (False, True)
    assert info["time_s"] == pytest.approx(60.0)


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        ({"period_s": math.nan}, "period_s: nan cannot be; allowed is above 0"),
        ({"longest_shift_s": 0.0}, "longest_shift_s: 0 cannot be; allowed is above 0, up to 60"),
        ({"longest_s": -1.0}, "longest_s: -1 cannot be; allowed is above 0"),
        ({"mainline_veh_h": -1.0}, "mainline.flow_veh_h"),
        ({"time_gap_s": math.inf}, "safety.time_gap_s"),
    ],
)
def test_what_cannot_be_is_refused(settings, said):
    with pytest.raises(CorampError, match=said):
        made(**settings)


def test_a_ramp_without_anybody_is_told_and_not_waited_for():
    with pytest.raises(CorampError, match="ramp_veh_h: no ramp vehicle came"):
        made(ramp_veh_h=0.0, mainline_veh_h=0.0).reset(seed=1)


def test_an_action_that_is_not_finite_is_refused():
    env = made(**SHORT)
    env.reset(seed=1)
    with pytest.raises(CorampError, match="not finite"):
        env.step(np.array([math.nan], np.float32))
