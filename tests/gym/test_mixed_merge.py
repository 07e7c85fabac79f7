"""coramp/MixedMerge-v0: Gymnasium's own checker, seeds, what rewards add up to, and safety."""

import gc
import math
import warnings

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

import coramp
import coramp.gym
from coramp.errors import CorampError
from coramp.gym_mixed.lost import Losses
from coramp.gym_mixed.seen import FEATURES, order_of
from coramp.mixed.users import RoadUsers, in_order
from coramp.scenarios.loading import load_scenario

SHORT = {"horizon_s": 60.0}
FLOWS = {"mainline_veh_h": 1800.0, "ramp_veh_h": 500.0}
BUSY = {"mainline_veh_h": 2200.0, "ramp_veh_h": 700.0}
FLOW_KEYS = {"mainline.flow_veh_h": 1800.0, "ramp.flow_veh_h": 500.0}
HALF = {"traffic.automated_share": 0.5}


@pytest.fixture
def made():
    """Makes environments and closes them."""
    envs = []

    def make(**settings):
        envs.append(gymnasium.make("coramp/MixedMerge-v0", **settings).unwrapped)
        return envs[-1]

    yield make
    for env in envs:
        env.close()


def driven(env, seed, policy):
    """Everything that an episode returns."""
    observation, info = env.reset(seed=seed)
    steps, over = [(observation, info)], False
    while not over:
        observation, reward, ended, cut, info = env.step(policy(observation))
        steps.append((observation, reward, ended, cut, info))
        over = ended or cut
    return steps


def to_the_strategy(_):
    return None


def constant(accel, merge):
    return lambda seen: np.tile(np.float32([accel, merge]), (*seen.shape[:-1], 1))


def at_random(seed=7):
    random = np.random.default_rng(seed)
    return lambda seen: random.uniform(-1.0, 1.0, (*seen.shape[:-1], 2)).astype(np.float32)


def to_and_fro():
    """Brakes and speeds up in turn, and always wants to merge."""
    state = {"sign": 1.0}

    def policy(seen):
        state["sign"] *= -1.0
        return constant(state["sign"], 1.0)(seen)

    return policy


def late(seen):
    """Stops near the end of the acceleration lane and wants to merge only there."""
    station = seen[..., 1:2]
    merge = np.where(station > 0.7, 1.0, -1.0)
    return np.concatenate([np.where(station > 0.3, -0.6, 1.0), merge], -1).astype(np.float32)


@pytest.mark.parametrize("agents", ["one", "all"])
def test_gymnasiums_checker_has_nothing_to_say(made, agents):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(made(agents=agents, **SHORT), skip_render_check=True)


@pytest.mark.parametrize(("agents", "preset"), [("one", "urban-canyon"), ("all", None)])
def test_observations_are_of_order_one_and_the_same_again(made, agents, preset):
    env = made(agents=agents, overrides={"world.preset": preset} if preset else None, **SHORT)
    first = driven(env, 5, at_random())
    assert all(env.observation_space.contains(step[0]) for step in first)
    assert repr(first) == repr(driven(env, 5, at_random()))
    assert repr(first) != repr(driven(env, 6, at_random()))


def test_without_a_seed_traffic_differs_and_is_repeated_by_the_seed_before(made):
    env = made(agents="one", **SHORT)
    drawn = []
    for _ in range(2):
        env.reset(seed=4)
        seen, info = env.reset()
        drawn.append((repr(seen), repr(info)))
    assert drawn[0] == drawn[1]
    assert drawn[0] != tuple(map(repr, env.reset(seed=4)))


FAULTS = {"reports.loss": 0.3, "commands.loss": 0.3, "reports.delay_s": 0.2, "actuators.lag_s": 0.3}


@pytest.mark.parametrize("faults", [{}, FAULTS], ids=["perfect", "faults"])
def test_agents_left_to_the_strategy_are_a_run_and_rewards_are_its_delay(made, faults):
    env = made(overrides=faults, braking_cost_s=0.5, **SHORT)
    steps = driven(env, 11, to_the_strategy)
    run = coramp.run(
        "paper", "mixed-slots", **FLOWS, overrides={**HALF, **faults}, horizon_s=60.0, seed=11
    )
    found = env.figures()
    assert {name: run.summary[name] for name in found} == found
    vehicles, brakings = len(run.vehicles), steps[-1][-1]["hard_brakings"]
    total = sum(step[1] for step in steps[1:])
    assert total == pytest.approx(-found["delay_s"] - 0.5 * brakings / vehicles, abs=1e-3)
    assert steps[-1][-1]["lost_s"] == pytest.approx(found["delay_s"] * vehicles, abs=0.1)
    assert steps[-1][2:4] == (True, False)


def test_an_agent_alone_loses_what_it_brakes_for(made):
    settings = {"agents": "one", "mainline_veh_h": 0.0, "ramp_veh_h": 200.0, "automated_share": 1.0}
    env = made(**settings, **SHORT)
    free = driven(env, 2, constant(1.0, 1.0))
    slow = driven(env, 2, lambda seen: constant(-0.2 if seen[1] < -0.5 else 1.0, 1.0)(seen))
    assert free[0][1]["vehicles"] == slow[0][1]["vehicles"]
    assert [step[-1]["hard_brakings"] for step in (free[-1], slow[-1])] == [0, 0]
    lost_s = [-sum(step[1] for step in steps[1:]) for steps in (free, slow)]
    took_s = [steps[-1][-1]["time_s"] - steps[0][1]["time_s"] for steps in (free, slow)]
    assert lost_s[1] - lost_s[0] == pytest.approx(took_s[1] - took_s[0], abs=0.25)
    assert lost_s[1] > lost_s[0] + 2.0


ADVERSARIES = {
    "full throttle": constant(1.0, 1.0),
    "never merges": constant(1.0, -1.0),
    "to and fro": to_and_fro(),
    "late": late,
    "at random": at_random(),
}


@pytest.mark.parametrize("name", ADVERSARIES)
@pytest.mark.parametrize("preset", [None, "hard"])
def test_whatever_agents_ask_for_they_cause_no_collision_and_keep_their_promise(made, name, preset):
    overrides = {"safety.time_gap_s": 0.5, "safety.standstill_gap_m": 2.0}
    overrides |= {"world.preset": preset} if preset else {}
    env = made(**BUSY, overrides=overrides, longest_s=60.0, **SHORT)
    steps = driven(env, 21, ADVERSARIES[name])
    assert all(math.isfinite(step[1]) for step in steps[1:])
    found = env.figures()
    assert found["collisions_by_automated"] == found["automated_violations"] == 0
    assert found["collisions"] == 0
    assert found["plan_error_m"] < 0.05


def test_without_the_supervisor_full_throttle_collides(made, monkeypatch):
    """What keeps agents safe is the on-board part: the test above can fail."""
    from coramp.worlds.sumo import mixed

    by_the_law = mixed.driven_and_changes

    def as_told(users, around, ahead, told_mps2, wishes, laws):
        changes = by_the_law(users, around, ahead, told_mps2, wishes, laws)[1]
        accel = np.minimum(told_mps2, laws.following.speed_up_mps2)
        stops = -users.speed_mps / laws.period_s
        return np.where(users.automated, np.maximum(stops, accel), 0.0), changes

    monkeypatch.setattr(mixed, "driven_and_changes", as_told)
    env = made(mainline_veh_h=1200.0, overrides={"mainline.speed_mps": 20.0}, **SHORT)
    driven(env, 21, constant(0.2, 1.0))
    assert env.figures()["automated_violations"] > 0


def test_who_was_cut_or_refused_is_counted(made):
    env = made(**BUSY, longest_s=30.0, **SHORT)
    asked = driven(env, 3, constant(1.0, 1.0))[-1][-1]
    passed = driven(env, 3, constant(-0.01, -1.0))[-1][-1]
    nobody = driven(env, 3, to_the_strategy)[-1][-1]
    assert asked["cut"] > 0
    assert asked["refused"] > 0
    assert passed["refused"] == nobody["refused"] == nobody["cut"] == 0


def test_who_passes_every_gap_up_stands_at_the_end_of_the_lane_until_it_is_cut_off(made):
    steps = driven(made(longest_s=90.0, **SHORT), 3, constant(1.0, -1.0))
    *_, (observation, _, ended, cut, info) = steps
    assert (ended, cut) == (False, True)
    assert (observation == 0.0).all()
    assert info["vehicles"] == []
    station, speed = steps[-2][0][0, 1:3]
    assert 0.97 < station < 1.0
    assert speed == pytest.approx(0.0, abs=0.01)
    assert info["time_s"] - steps[0][1]["time_s"] == pytest.approx(90.0, abs=1.0)


def test_the_time_before_there_is_an_agent_cuts_nothing_off(made):
    env = made(agents="one", longest_s=10.0, horizon_s=90.0)
    _, info = env.reset(seed=3)
    assert info["time_s"] >= 30.0
    arrivals = coramp.demand.arrivals.arrivals_of(load_scenario("paper", FLOW_KEYS), 3)
    assert info["vehicles"][0] in [a.vehicle_id for a in arrivals if a.on_ramp and a.step >= 300]
    for _ in range(10):
        *_, ended, cut, info = env.step(None)
    assert (ended, cut) == (False, True)


def test_what_is_seen_by_hand_of_an_agent_alone(made):
    env = made(mainline_veh_h=0.0, ramp_veh_h=60.0, automated_share=1.0, horizon_s=120.0)
    observation, info = env.reset(seed=1)
    assert info["vehicles"] == ["r00001"]
    expected = [1.0, -1.0, 0.8, 1.0, 0.0, 0.0]
    nobody = [[1.0, 0.0, 0.0, 0.0]] * 3 + [[-1.0, 0.0, 0.0, 0.0]] * 2
    assert observation[0, :6].tolist() == pytest.approx(expected, abs=0.06)
    assert observation[0, 6:].reshape(5, 4).tolist() == nobody
    assert (observation[1:] == 0.0).all()


def test_what_is_seen_of_others_is_what_was_heard_and_how_long_ago(made):
    kinds = set()
    for delay_s in (0.0, 0.4):
        env = made(overrides={"reports.delay_s": delay_s}, longest_s=20.0, **SHORT)
        for observation, *_ in driven(env, 8, to_the_strategy)[1:-1]:
            for row in observation[observation[:, 0] == 1.0]:
                others = row[6:].reshape(5, 4)
                there = others[:, 2] != 0.0
                kinds |= set(others[:, 2].tolist())
                assert row[4] == pytest.approx(delay_s, abs=1e-6)
                assert others[there, 3] == pytest.approx(delay_s, abs=1e-6)
                assert (others[~there, 3] == 0.0).all()
        env.close()
    assert kinds == {-1.0, 0.0, 1.0}


def users_of(station_m, on_mainline):
    count = len(station_m)
    ones = np.ones(count)
    return RoadUsers(
        np.arange(10, 10 + count),
        np.array(station_m, np.float64),
        *(20.0 * ones, 0.0 * ones, 5.0 * ones, np.array(on_mainline), np.ones(count, np.bool_)),
        *(20.0 * ones, 2.0 * ones, np.inf * ones, 6.0 * ones),
    )


def test_the_order_of_passing_is_that_of_places():
    users = users_of([0.0, -50.0, -10.0, -40.0, -60.0], [True, True, False, False, False])
    ramp = in_order(users.station_m, ~users.on_mainline)
    assert order_of(users, ramp, ((12, 10), (13, 12), (14, 11))) == [0, 2, 3, 1, 4]
    assert order_of(users, ramp, ((12, -1), (13, 11), (14, 13))) == [2, 0, 1, 3, 4]
    assert order_of(users, ramp, ((12, 11), (13, 99))) == [0, 1, 2, 3, 4]


def test_what_is_lost_by_hand():
    scenario = load_scenario("paper", {"mainline.flow_veh_h": 600.0, "simulation.horizon_s": 30.0})
    arrivals = coramp.demand.arrivals.arrivals_of(scenario, 1)
    automated = np.zeros(len(arrivals), np.bool_)
    losses = Losses(scenario, arrivals, automated)
    first_s = arrivals[0].step * 0.1
    here = users_of([-400.0], [True])._replace(number=np.array([0]))
    start_m, v0_mps = scenario.mainline.start_m, scenario.mainline.speed_mps
    losses.look(first_s + 2.0, here._replace(station_m=np.array([start_m])))
    assert losses.lost_s[0] == pytest.approx(2.0)
    losses.look(first_s + 4.0, here._replace(station_m=np.array([start_m + v0_mps])))
    assert losses.lost_s[0] == pytest.approx(3.0)
    braking = here._replace(
        station_m=np.array([start_m + 2.0 * v0_mps]), speed_mps=np.array([16.0])
    )
    losses.look(first_s + 5.0, braking)
    losses.look(first_s + 6.0, braking._replace(speed_mps=np.array([12.9])))
    losses.look(first_s + 7.0, braking._replace(speed_mps=np.array([12.9])))
    losses.look(first_s + 8.0, braking._replace(speed_mps=np.array([9.8])))
    assert losses.hard_brakings[0] == 2


def test_one_episode_at_a_time_in_a_process(made):
    one, other = made(**SHORT), made(**SHORT)
    one.reset(seed=1)
    with pytest.raises(CorampError, match="one simulation a process, and the episode of another"):
        other.reset(seed=1)
    with pytest.raises(CorampError, match="step: no episode runs; call reset"):
        other.step(to_the_strategy(None))
    with pytest.raises(CorampError, match="SUMO: one simulation a process"):
        coramp.run("paper", "uncontrolled", horizon_s=30.0)
    one.step(None)  # and goes on
    one.close()
    other.reset(seed=1)
    other.close()
    assert coramp.run("paper", "uncontrolled", horizon_s=30.0).summary["unserved"] == 0


def test_an_environment_that_nobody_has_any_more_is_closed(made):
    env = gymnasium.make("coramp/MixedMerge-v0", **SHORT)
    env.reset(seed=1)
    del env
    gc.collect()
    made(**SHORT).reset(seed=1)


def test_after_its_end_an_episode_leaves_sumo_to_others(made):
    one, other = made(agents="one", **SHORT), made(agents="one", **SHORT)
    driven(one, 1, to_the_strategy)
    driven(other, 1, to_the_strategy)
    assert one.figures() == other.figures()
    with pytest.raises(CorampError, match="step: no episode runs"):
        one.step(None)


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        ({"agents": "some"}, "agents: 'some' cannot be; allowed are one, all"),
        ({"slots": 0}, "slots: 0 cannot be; allowed is at least 1"),
        ({"period_s": math.nan}, "period_s: nan cannot be; allowed is above 0, up to 10"),
        ({"period_s": 0.3}, "period_s: 0.3 cannot be; allowed are whole multiples of 0.2"),
        ({"braking_cost_s": -1.0}, "braking_cost_s: -1 cannot be; allowed is 0 and more"),
        ({"longest_s": 0.5}, "longest_s: 0.5 cannot be; allowed is period_s, 1, and more"),
        ({"others": "slots"}, "others: slots coordinates nobody among drivers; allowed is mixed-"),
        ({"drivers": "nobody"}, "drivers: there is no 'nobody' in paper"),
        ({"automated_share": 1.5}, "traffic.automated_share"),
        ({"overrides": {"world.preset": "none"}}, "world.preset"),
        ({"mainline_veh_h": -1.0}, "mainline.flow_veh_h"),
    ],
)
def test_what_cannot_be_is_refused(made, settings, said):
    with pytest.raises(CorampError, match=said):
        made(**settings)


def test_a_ramp_without_anybody_automated_is_told_and_not_waited_for(made):
    with pytest.raises(CorampError, match="no automated ramp vehicle came"):
        made(overrides={"traffic.ramp_automated_share": 0.0}).reset(seed=1)


@pytest.mark.parametrize(
    ("action", "said"),
    [(np.full((4, 2), np.nan), "not finite"), (np.zeros((3, 2)), "action: 3 pairs cannot be")],
)
def test_an_action_that_cannot_be_is_refused(made, action, said):
    env = made(**SHORT)
    env.reset(seed=1)
    with pytest.raises(CorampError, match=said):
        env.step(action)


def test_figures_are_those_of_an_episode_that_has_ended(made):
    env = made(**SHORT)
    env.reset(seed=1)
    with pytest.raises(CorampError, match="figures: there are none before an episode has ended"):
        env.figures()
    assert env.observation_space.shape[1] == FEATURES
