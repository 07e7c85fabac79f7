"""Trains a policy for coramp/MixedMerge-v0 by the cross-entropy method, and judges policies.

``python learn.py train SEED`` trains for about 250 s of one core and writes ``policy-SEED.json``,
``python learn.py judge`` judges all, writes ``judged.json`` and prints the table of the page.
"""

import json
import sys
import time
from pathlib import Path

import gymnasium
import numpy as np

import coramp.gym  # noqa: F401 - registers the environment

HERE = Path(__file__).parent
ENVIRONMENT = "coramp/MixedMerge-v0"
SETTINGS = {
    "mainline_veh_h": 2200.0,
    "ramp_veh_h": 700.0,
    "overrides": {"safety.time_gap_s": 0.5, "safety.standstill_gap_m": 2.0},
}
LONGEST_S = 250.0
POPULATION, ELITE, EPISODES = 24, 4, 5
"""Policies a generation, those that make the next one, and episodes that each of them drives."""
TRAINED_FROM = 1_000_000
TRAINED_LONGEST_S = 200.0
"""Episodes of a training are cut off so long after their first observation."""
VALIDATED = range(2000, 2008)
"""Seeds on which the best generation of a training is chosen."""
JUDGED = range(1, 21)
"""Seeds that nothing was trained or chosen on."""
SEEN = [6, 7, 14, 15]
"""Distance and speed of the vehicle ahead on the ramp, and of the one that is to pass before."""
SPREAD = np.array([1.0, 4.0, 2.0, 4.0, 2.0])
"""How widely the first generation is drawn: a constant, then a weight for each number seen."""
SHOWN = {
    "delay_s": "delay of all (s)",
    "driver_hard_brakings_3": "hard braking of drivers",
    "ramp_stops": "ramp vehicles that stop",
}


def made(**more):
    """Returns an environment of the example."""
    return gymnasium.make(ENVIRONMENT, **{**SETTINGS, **more}).unwrapped


def linear(weights):
    """Returns the policy whose acceleration is linear in what it sees; it always wants to merge."""

    def policy(seen):
        accel = np.clip(seen[:, SEEN] @ weights[1:] + weights[0], -1.0, 1.0)
        return np.column_stack([accel, np.ones(len(seen))]).astype(np.float32)

    return policy


def driven(env, policy, seed):
    """Returns the sum of rewards of an episode; ``env.figures()`` has more then."""
    seen, _ = env.reset(seed=seed)
    total, over = 0.0, False
    while not over:
        seen, reward, ended, cut, _ = env.step(policy(seen))
        total, over = total + reward, ended or cut
    return total


def value_of(env, policy, seeds):
    """Returns the mean of -log(1 + cost in s) over seeds.

    Otherwise the few episodes in which traffic breaks down would outweigh all others.
    """
    return float(np.mean([-np.log1p(-driven(env, policy, seed)) for seed in seeds]))


def train(seed, generations=1000, validated=VALIDATED, longest_s=LONGEST_S):
    """Returns the best weights on the validation seeds, and the curve: (episodes, s, value)."""
    env, random = made(longest_s=TRAINED_LONGEST_S), np.random.default_rng(seed)
    started = time.process_time()
    mean, spread, curve, best = np.zeros(len(SPREAD)), SPREAD.copy(), [], None
    for generation in range(generations):
        value = value_of(env, linear(mean), validated)
        if not curve or value > max(row[2] for row in curve):
            best = mean
        curve.append((generation * POPULATION * EPISODES, time.process_time() - started, value))
        print(*curve[-1], flush=True)
        if curve[-1][1] >= longest_s:
            break
        seeds = random.integers(TRAINED_FROM, 2**31 - 1, EPISODES).tolist()
        drawn = mean + spread * random.normal(size=(POPULATION, len(mean)))
        values = [value_of(env, linear(weights), seeds) for weights in drawn]
        chosen = drawn[np.argsort(values)[-ELITE:]]
        mean = chosen.mean(axis=0)
        spread = chosen.std(axis=0) + 0.05 * SPREAD
    env.close()
    return best, curve


def stored(seed):
    """Returns what ``train SEED`` wrote: the weights and their curve."""
    return json.loads((HERE / f"policy-{seed}.json").read_text(encoding="utf-8"))


def constant(accel):
    """Returns the policy that always does the same and wants to merge."""
    return lambda seen: np.tile([accel, 1.0], (len(seen), 1))


def at_random(random):
    """Returns the policy that draws its actions evenly."""
    return lambda seen: random.uniform(-1.0, 1.0, (len(seen), 2))


def behind_who_passes_before(seen):
    """Follows the vehicle that is to pass before at 12 m, 2 m/s slower, and never brakes hard."""
    accel = 8.0 * (seen[:, 14] - 0.12) + 4.0 * (seen[:, 15] - 0.2)
    return np.column_stack([np.clip(accel, -0.15, 1.0), np.ones(len(seen))]).astype(np.float32)


def policies():
    """Returns all policies of the table by name."""
    found = {
        "random actions": at_random(np.random.default_rng(0)),
        "as fast as it may, merges": constant(1.0),
        "keeps its speed, merges": constant(0.0),
    }
    for seed in (1, 2, 3):
        found[f"trained, seed {seed}"] = linear(np.array(stored(seed)["weights"]))
    found["rule: gently behind who is to pass before"] = behind_who_passes_before
    return {**found, "mixed-slots": lambda _: None}


def judged(names=None, seeds=JUDGED):
    """Returns by policy the figures of each seed: the keys of ``SHOWN``."""
    env, found = made(), {}
    for name, policy in policies().items():
        if names is not None and name not in names:
            continue
        found[name] = []
        for seed in seeds:
            driven(env, policy, seed)
            figures = env.figures()
            assert figures["collisions_by_automated"] == figures["automated_violations"] == 0
            found[name].append({key: round(figures[key], 6) for key in SHOWN})
    env.close()
    return found


def interval(values):
    """Returns the mean and half the width of its 95 % interval (Student's t)."""
    from scipy.stats import t

    spread = np.std(values, ddof=1) / np.sqrt(len(values))
    return float(np.mean(values)), float(t.ppf(0.975, len(values) - 1) * spread)


def table(found):
    """Returns the page's table; differences are paired by seed."""
    heads = ["policy", *SHOWN.values(), "delay beyond mixed-slots (s)"]
    lines = ["| " + " | ".join(heads) + " |", "|---" * len(heads) + "|"]
    best_s = np.array([row["delay_s"] for row in found["mixed-slots"]])
    for name, rows in found.items():
        cells = [interval([row[key] for row in rows]) for key in SHOWN]
        beyond = interval(np.array([row["delay_s"] for row in rows]) - best_s)
        shown = [f"{mean:.2f} ± {half:.2f}" for mean, half in cells]
        last = "" if name == "mixed-slots" else f"{beyond[0]:.2f} ± {beyond[1]:.2f}"
        lines.append("| " + " | ".join([name, *shown, last]) + " |")
    return "\n".join(lines)


def main(words):
    """Does what the command line says."""
    if words[0] == "train":
        weights, curve = train(int(words[1]))
        (HERE / f"policy-{int(words[1])}.json").write_text(
            json.dumps({"weights": weights.round(5).tolist(), "curve": curve}) + "\n",
            encoding="utf-8",
        )
    else:
        found = judged()
        (HERE / "judged.json").write_text(json.dumps(found) + "\n", encoding="utf-8")
        print(table(found))


if __name__ == "__main__":
    main(sys.argv[1:])
