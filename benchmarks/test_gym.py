"""Steps a second of the Gymnasium environments on one core, resets with new traffic included."""

import time

import gymnasium
import numpy as np
import pytest

import coramp.gym  # noqa: F401 - registers the environment

STEPS = 20_000
STEPS_A_SECOND_AT_LEAST = 5_000
DECISIONS = 2_000
DECISIONS_A_SECOND_AT_LEAST = 200


@pytest.mark.parametrize("agents", ["one", "all"])
def test_steps_a_second(benchmark, agents):
    env = gymnasium.make(gymnasium.spec("coramp/Merge-v0"), agents=agents)
    random = np.random.default_rng(1)
    actions = random.uniform(-0.3, 0.5, (STEPS, *env.action_space.shape))

    def drive():
        env.reset(seed=1)
        started = time.perf_counter()
        for action in actions:
            *_, ended, cut, _ = env.step(action)
            if ended or cut:
                env.reset()
        return STEPS / (time.perf_counter() - started)

    drive()
    speeds = []
    benchmark.pedantic(lambda: speeds.append(drive()), rounds=5, iterations=1)
    best = max(speeds)
    print(f"\nagents={agents}, 1800 + 500 veh/h: {best:,.0f} steps/s ({min(speeds):,.0f} at least)")
    assert best >= STEPS_A_SECOND_AT_LEAST


@pytest.mark.parametrize("actions", ["random", "nothing"])
def test_decisions_a_second(benchmark, actions):
    env = gymnasium.make("coramp/Merge-v1")
    random = np.random.default_rng(1)
    nothing = np.full((DECISIONS, 1), -1.0, np.float32)
    asked = random.uniform(-1.0, -0.2, (DECISIONS, 1)) if actions == "random" else nothing

    def drive():
        env.reset(seed=1)
        started = time.perf_counter()
        for action in asked.astype(np.float32):
            *_, ended, cut, _ = env.step(action)
            if ended or cut:
                env.reset()
        return DECISIONS / (time.perf_counter() - started)

    drive()
    speeds = []
    benchmark.pedantic(lambda: speeds.append(drive()), rounds=3, iterations=1)
    best = max(speeds)
    print(f"\nMerge-v1, {actions}: {best:,.0f} decisions/s ({min(speeds):,.0f} at least)")
    assert best >= DECISIONS_A_SECOND_AT_LEAST
