"""coramp/Merge-v0: Gymnasium's own checker, seeds, rewards, and safety whatever agents do."""

import dataclasses
import math
from typing import ClassVar

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

import coramp.gym
from coramp.errors import CorampError
from coramp.scenarios.loading import load_scenario
from coramp.strategies.mainline_priority import MainlinePriority
from tests import situations

BUSY = {"mainline_veh_h": 2400.0, "ramp_veh_h": 900.0}


def made(**settings):
    return gymnasium.make(gymnasium.spec("coramp/Merge-v0"), **settings).unwrapped


def test_by_its_name_it_is_made_with_gymnasiums_warning_that_there_is_a_v1():
    with pytest.warns(DeprecationWarning, match="Merge-v0 is out of date"):
        env = gymnasium.make("coramp/Merge-v0")
    assert isinstance(env.unwrapped, coramp.gym.MergeEnv)


@pytest.mark.parametrize("agents", ["one", "all"])
def test_gymnasiums_checker_has_nothing_to_say(agents):
    check_env(made(agents=agents), skip_render_check=True)


def driven(env, seed, policy, steps=200):
    """Observations, rewards and ends of so many steps."""
    random = np.random.default_rng(7)
    observation, info = env.reset(seed=seed)
    seen = [(observation.copy(), info)]
    for _ in range(steps):
        observation, reward, ended, cut, info = env.step(policy(observation, random))
        seen.append((observation.copy(), reward, ended, cut, info))
        if ended or cut:
            break
    return seen


def at_random(shape):
    return lambda _, random: random.uniform(-1.0, 1.0, shape)


@pytest.mark.parametrize("agents", ["one", "all"])
def test_the_same_seed_is_the_same_traffic(agents):
    shape = (1,) if agents == "one" else (8,)
    one = driven(made(agents=agents, **BUSY), 5, at_random(shape))
    same = driven(made(agents=agents, **BUSY), 5, at_random(shape))
    other = driven(made(agents=agents, **BUSY), 6, at_random(shape))
    assert repr(one) == repr(same)
    assert repr(one) != repr(other)


def test_traffic_differs_from_episode_to_episode():
    env = made()
    first, _ = env.reset(seed=3)
    again, _ = env.reset()
    assert not np.array_equal(first, again)


@pytest.mark.parametrize("agents", ["one", "all"])
@pytest.mark.parametrize("action", [-1.0, 0.0, 1.0, None])
def test_whatever_agents_do_everyone_keeps_its_distance(agents, action):
    env = made(agents=agents, **BUSY)
    shape = env.action_space.shape
    policy = at_random(shape) if action is None else lambda *_: np.full(shape, action)
    seen = driven(env, 11, policy, 300)
    assert all(math.isfinite(step[1]) for step in seen[1:])
    assert env.loop.refusals == []
    end_s = seen[-1][-1]["time_s"]
    vehicles = situations.driven(env.loop, env.arrivals, end_s)
    safety = load_scenario("paper").safety
    least_m = situations.least_margin_m(vehicles, safety)
    assert least_m >= safety.execution_allowance_m - 1e-6


@pytest.mark.parametrize("slots", [1, 2])
def test_rewards_are_numbers_however_few_slots_there_are(slots):
    env = made(agents="all", slots=slots, **BUSY)
    for seed in range(3):
        seen = driven(env, seed, at_random((slots,)), 400)
        assert all(math.isfinite(step[1]) for step in seen[1:])


class Counting(MainlinePriority):
    """Remembers how often it has decided."""

    name = "counting"
    asked: ClassVar[list] = []

    def decide(self, view, memory):
        self.asked.append(memory)
        decision = super().decide(view, None)
        return dataclasses.replace(decision, memory=(memory or 0) + 1)


def test_agents_do_not_make_the_others_forget():
    coramp.register(Counting)
    Counting.asked.clear()
    driven(made(others="counting", **BUSY), 4, lambda *_: np.zeros(1), 60)
    assert Counting.asked == [None, *range(1, len(Counting.asked))]
    assert len(Counting.asked) > 5


def test_an_agent_that_keeps_going_merges_and_the_episode_ends():
    seen = driven(made(mainline_veh_h=400.0, ramp_veh_h=200.0), 1, lambda *_: np.zeros(1))
    *_, (observation, _, ended, cut, info) = seen
    assert (ended, cut) == (True, False)
    assert observation.tolist() == [0.0] * coramp.gym.FEATURES
    assert info["rows"] == []
    assert len(seen) in range(47, 56)  # 400 m at 15 to 17 m/s, in steps of 0.5 s


def test_an_agent_that_is_not_there_in_time_is_cut_off():
    env = made(longest_s=10.0)
    seen = driven(env, 1, lambda *_: np.full(1, -1.0), 400)
    assert len(seen) == 21
    *_, (observation, reward, ended, cut, _) = seen
    assert (ended, cut) == (False, True)
    assert observation[2] == 0.0
    # who stands loses all the time, and pays for the braking that it asks for
    assert reward == pytest.approx(-0.5 - 0.02 * 2.94**2 * 0.5, abs=1e-3)


def test_what_is_seen_by_hand():
    env = made(mainline_veh_h=0.0, ramp_veh_h=200.0, horizon_s=60.0)
    observation, info = env.reset(seed=2)
    row = info["rows"][0]
    pieces = env.loop.ledger.trajectory(row)
    assert observation[0] == 1.0
    assert observation[1] == pytest.approx(-400.0)
    assert observation[2] == pytest.approx(pieces[0, 2])
    assert observation[3:5].tolist() == [400.0, 16.0]
    assert observation[5:].tolist() == [400.0, 20.0] * 2 + [-400.0, 20.0] * 2


def test_all_agents_are_front_first_and_share_the_slots():
    env = made(agents="all", **BUSY)
    env.reset(seed=4)
    for _ in range(60):
        observation, *_ = env.step(np.zeros(8))
    stations = observation[observation[:, 0] == 1.0, 1]
    assert len(stations) > 2
    assert (np.diff(stations) < 0.0).all()
    assert (observation[observation[:, 0] == 0.0] == 0.0).all()


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        ({"agents": "some"}, "agents: 'some' cannot be; allowed are one, all"),
        ({"horizon_s": 10.0}, "horizon_s: 10 cannot be; allowed is above 30 s"),
        ({"period_s": math.nan}, "period_s: nan cannot be; allowed is above 0"),
        ({"period_s": -1.0}, "period_s: -1 cannot be"),
        ({"longest_s": 0.1}, "longest_s: 0.1 cannot be; allowed is period_s, 0.5, and more"),
        ({"slots": 0}, "slots: 0 cannot be; allowed is at least 1"),
        ({"others": "ocbf"}, "others: ocbf does not plan"),
        ({"others": "alinea"}, "others: alinea does not plan"),
        ({"mainline_veh_h": -1.0}, "mainline.flow_veh_h"),
    ],
)
def test_what_cannot_be_is_refused(settings, said):
    with pytest.raises(CorampError, match=said):
        made(**settings)


def test_a_ramp_without_anybody_is_told_and_not_waited_for():
    with pytest.raises(CorampError, match="ramp_veh_h: no ramp vehicle came"):
        made(ramp_veh_h=0.0).reset(seed=1)


def test_an_action_that_is_not_finite_is_refused():
    env = made()
    env.reset(seed=1)
    with pytest.raises(CorampError, match="not finite"):
        env.step(np.array([math.nan]))


@pytest.mark.parametrize("seed", range(5))
def test_rewards_add_up_to_delay_effort_and_refusals(seed):
    env = made(mainline_veh_h=1800.0, ramp_veh_h=300.0)
    _, info = env.reset(seed=seed)
    (row,), started_s = info["rows"], info["time_s"]
    total, effort, ended = 0.0, 0.0, False
    random = np.random.default_rng(seed)
    while not ended:
        share = random.uniform(-0.2, 0.5)
        _, reward, ended, _, info = env.step(np.array([share]))
        accel = share * (2.94 if share < 0.0 else 1.5)
        total, effort = total + reward, effort + 0.02 * accel**2 * 0.5
    free_flow_s = 25.0 + 2.0 + 18.2
    delay_s = env.loop.ledger.exit_time_s(row) - started_s - free_flow_s
    assert total == pytest.approx(-delay_s - effort - info["interventions"], abs=1e-6)
