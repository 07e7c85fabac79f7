"""The example of the page on training: that it trains, and that what it trained pays."""

import importlib.util
import sys
from pathlib import Path

import numpy as np
import pytest

FOLDER = Path(__file__).parents[2] / "docs" / "experiments" / "merge-v1"


@pytest.fixture(scope="module")
def learn():
    spec = importlib.util.spec_from_file_location("learn", FOLDER / "learn.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    yield module
    sys.modules.pop("learn", None)


@pytest.fixture(scope="module")
def found(learn):
    return learn.judged()


def test_the_median_policy_comes_half_the_way_from_nothing_to_slots_on_unseen_seeds(found, learn):
    nothing, slots = np.array(found["does nothing"]), np.array(found["slots"])
    trained = [np.array(found[f"trained, seed {seed}"]) for seed in (1, 2, 3)]
    median = sorted(trained, key=np.mean)[1]
    assert np.mean(median) <= np.mean(nothing) - 0.5 * (np.mean(nothing) - np.mean(slots))
    less_s, half_s = learn.interval(median - nothing)
    assert less_s + half_s < 0.0


def test_neither_constant_nor_random_actions_come_half_the_way(found):
    half_s = 0.5 * (np.mean(found["does nothing"]) + np.mean(found["slots"]))
    others = [name for name in found if name.startswith(("constant", "random"))]
    assert len(others) == 4
    assert all(np.mean(found[name]) > half_s for name in others)


def test_the_page_has_the_table(found, learn):
    page = (FOLDER.parents[1] / "how-to" / "train-a-policy.md").read_text(encoding="utf-8")
    assert learn.table(found) in page


def test_seeds_are_apart(learn):
    assert not set(learn.JUDGED) & set(learn.VALIDATED)
    assert max(*learn.JUDGED, *learn.VALIDATED) < 1_000_000


def test_a_policy_is_trained_where_stable_baselines3_is(learn):
    pytest.importorskip("stable_baselines3", reason="stable-baselines3 is not here (extra learn)")
    policy, curve = learn.train(1, steps=512, every=256, validated=range(2000, 2001))
    assert [len(weight) for weight, _ in policy] == [32, 32, 1]
    assert [row[0] for row in curve] == [0, 256]
    action = learn.network(policy)(np.zeros(13))
    assert action.shape == (1,)
    assert -1.0 <= action[0] <= 1.0
