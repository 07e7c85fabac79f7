"""The example of the page on training among drivers: that it trains, and that its table is true."""

import importlib.util
import json
import sys
from pathlib import Path

import numpy as np
import pytest

FOLDER = Path(__file__).parents[2] / "docs" / "experiments" / "mixed-merge-v0"
PAGE = FOLDER.parents[1] / "how-to" / "train-among-drivers.md"


@pytest.fixture(scope="module")
def learn():
    spec = importlib.util.spec_from_file_location("learn_among_drivers", FOLDER / "learn.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    yield module
    sys.modules.pop("learn_among_drivers", None)


@pytest.fixture(scope="module")
def found():
    return json.loads((FOLDER / "judged.json").read_text(encoding="utf-8"))


def test_the_page_has_the_table(found, learn):
    assert learn.table(found) in PAGE.read_text(encoding="utf-8")
    assert list(found) == list(learn.policies())


def test_the_table_is_what_policies_drive_now(found, learn):
    names = ["trained, seed 3", "mixed-slots"]
    seed = learn.JUDGED[0]
    now = learn.judged(names, [seed])
    assert now == {name: found[name][:1] for name in names}


def test_the_median_policy_loses_less_than_random_actions_and_than_the_fastest(found, learn):
    delay_s = {name: np.array([row["delay_s"] for row in rows]) for name, rows in found.items()}
    trained = [values for name, values in delay_s.items() if name.startswith("trained")]
    median = sorted(trained, key=np.mean)[1]
    less_s, half_s = learn.interval(median - delay_s["random actions"])
    assert less_s + half_s < 0.0
    assert median.mean() < delay_s["as fast as it may, merges"].mean()


def test_mixed_slots_and_keeping_ones_speed_lose_about_the_same(found, learn):
    """The page says that it comes as far."""
    delay_s = [
        np.array([row["delay_s"] for row in found[name]])
        for name in ("keeps its speed, merges", "mixed-slots")
    ]
    beyond_s, half_s = learn.interval(delay_s[0] - delay_s[1])
    assert abs(beyond_s) < half_s


def test_seeds_are_apart(learn):
    assert not set(learn.JUDGED) & set(learn.VALIDATED)
    assert max(*learn.JUDGED, *learn.VALIDATED) < learn.TRAINED_FROM


def test_a_policy_is_trained(learn, monkeypatch):
    monkeypatch.setattr(learn, "POPULATION", 3)
    monkeypatch.setattr(learn, "ELITE", 1)
    monkeypatch.setattr(learn, "EPISODES", 1)
    monkeypatch.setattr(learn, "SETTINGS", {**learn.SETTINGS, "horizon_s": 40.0})
    weights, curve = learn.train(1, generations=2, validated=[2000])
    assert [row[0] for row in curve] == [0, 3]
    assert len(weights) == len(learn.SPREAD)
    action = learn.linear(weights)(np.zeros((4, 26), np.float32))
    assert action.shape == (4, 2)
    assert (np.abs(action) <= 1.0).all()
