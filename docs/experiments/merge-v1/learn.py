"""Trains a policy for coramp/Merge-v1 with stable-baselines3, and judges policies.

``python learn.py train SEED`` trains for at most 300 s of one core and writes ``policy-SEED.json``,
``python learn.py judge`` prints the table of the page, ``python learn.py draw`` the curve.
"""

import json
import sys
import time
from pathlib import Path

import gymnasium
import numpy as np

import coramp
import coramp.gym  # registers the environment

HERE = Path(__file__).parent
ENVIRONMENT = "coramp/Merge-v1"
LONGEST_S = 300.0
STEPS = 40_000
EVERY = 2_500
TRAINED_HORIZON_S = 120.0
VALIDATED = range(2000, 2008)
"""Seeds on which the best policy of a training is chosen."""
JUDGED = range(1, 21)
"""Seeds that nothing was trained or chosen on."""


def delay_s(env, policy, seed):
    """Returns the mean delay (s) of all vehicles with a policy, of observations to actions."""
    seen, info = env.reset(seed=seed)
    over = False
    while not over:
        seen, _, ended, cut, info = env.step(policy(seen))
        over = ended or cut
    return info["delay_s"]


def network(weights):
    """Returns the policy of a network: layers of weights and biases, tanh between them."""

    def policy(seen):
        x = np.asarray(seen, np.float64)
        for k, (weight, bias) in enumerate(weights):
            x = np.asarray(weight) @ x + np.asarray(bias)
            x = np.tanh(x) if k < len(weights) - 1 else x
        return np.clip(x, -1.0, 1.0)

    return policy


def layers(model):
    """Returns the layers of a model's policy, as ``network`` takes them."""
    actor = [*model.policy.mlp_extractor.policy_net, model.policy.action_net]
    return [
        (
            layer.weight.detach().numpy().round(5).tolist(),
            layer.bias.detach().numpy().round(5).tolist(),
        )
        for layer in actor
        if hasattr(layer, "weight")
    ]


def train(seed, steps=STEPS, every=EVERY, validated=VALIDATED, longest_s=LONGEST_S):
    """Returns the best network on the validation seeds, and the curve: (steps, s, delay in s)."""
    import torch
    from stable_baselines3 import PPO
    from stable_baselines3.common.callbacks import BaseCallback
    from stable_baselines3.common.vec_env import DummyVecEnv, VecNormalize

    torch.set_num_threads(1)
    started, judge, curve, best = time.process_time(), gymnasium.make(ENVIRONMENT), [], []

    class Validate(BaseCallback):
        def _on_step(self):
            return time.process_time() - started < longest_s

        def _on_rollout_start(self):
            if self.num_timesteps < every * len(curve):
                return
            policy = layers(self.model)
            mean_s = float(np.mean([delay_s(judge, network(policy), k) for k in validated]))
            if not curve or mean_s < min(row[2] for row in curve):
                best[:] = policy
            curve.append((self.num_timesteps, time.process_time() - started, mean_s))
            print(*curve[-1], flush=True)

    made = [lambda: gymnasium.make(ENVIRONMENT, horizon_s=TRAINED_HORIZON_S)] * 4
    env = VecNormalize(DummyVecEnv(made), norm_obs=False, gamma=0.6)
    model = PPO(
        "MlpPolicy",
        env,
        seed=seed,
        device="cpu",
        gamma=0.6,
        gae_lambda=0.8,
        n_steps=64,
        batch_size=64,
        learning_rate=lambda left: 1e-3 * left + 1e-5,
        policy_kwargs={"net_arch": [32, 32], "log_std_init": -1.0},
    )
    model.learn(steps, callback=Validate())
    return best, curve


def slots_delay_s(seed):
    """Returns the mean delay (s) of all vehicles with ``slots`` on the same arrivals."""
    run = coramp.run(
        "paper",
        "slots",
        engine="exact",
        mainline_veh_h=1800.0,
        ramp_veh_h=500.0,
        overrides={"safety.time_gap_s": 1.0},
        horizon_s=300.0,
        seed=seed,
    )
    return run.summary["delay_s"]


def constant(value):
    """Returns the policy that always does the same."""
    return lambda _: np.full(1, value)


def at_random(random):
    """Returns the policy that draws its actions evenly."""
    return lambda _: random.uniform(-1.0, 1.0, 1)


def behind_everybody(later_s=0.0):
    """Returns the rule that asks for the slot a headway behind the last of the lane, or later."""

    def policy(seen):
        shift_s = max(0.0, 1.26 + later_s - 5.0 * seen[-1])
        return np.array([np.clip(shift_s / 5.0 - 1.0, -0.999, 1.0)])

    return policy


def stored(seed):
    """Returns what ``train SEED`` wrote: the network and its curve."""
    return json.loads((HERE / f"policy-{seed}.json").read_text(encoding="utf-8"))


def judged(seeds=JUDGED):
    """Returns by name the delay (s) of all vehicles of each seed."""
    env = gymnasium.make(ENVIRONMENT)
    policies = {"does nothing": constant(-1.0)}
    policies |= {f"constant action {value:g}": constant(value) for value in (-0.9, -0.5, 0.0)}
    policies["random actions"] = at_random(np.random.default_rng(0))
    for seed in (1, 2, 3):
        policies[f"trained, seed {seed}"] = network(stored(seed)["layers"])
    policies["rule: behind everybody"] = behind_everybody()
    policies["the same, 0.3 s later"] = behind_everybody(0.3)
    found = {name: [delay_s(env, policy, k) for k in seeds] for name, policy in policies.items()}
    return {**found, "slots": [slots_delay_s(k) for k in seeds]}


def interval(values):
    """Returns the mean and half the width of its 95 % interval (Student's t)."""
    from scipy.stats import t

    spread = np.std(values, ddof=1) / np.sqrt(len(values))
    return float(np.mean(values)), float(t.ppf(0.975, len(values) - 1) * spread)


def table(found):
    """Returns the page's table."""
    lines = ["| policy | delay of all (s) | difference from doing nothing (s) |", "|---|---|---|"]
    nothing = np.array(found["does nothing"])
    for name, values in found.items():
        mean_s, half_s = interval(values)
        less_s, less_half_s = interval(np.array(values) - nothing)
        less = "" if name == "does nothing" else f"{less_s:.2f} ± {less_half_s:.2f}"
        lines.append(f"| {name} | {mean_s:.2f} ± {half_s:.2f} | {less} |")
    return "\n".join(lines)


def draw(path):
    """Draws the learning curves: delay on the validation seeds over decisions."""
    import matplotlib as mpl

    mpl.use("Agg")
    from matplotlib import pyplot as plt

    env = gymnasium.make(ENVIRONMENT)
    nothing_s = np.mean([delay_s(env, constant(-1.0), k) for k in VALIDATED])
    slots_s = np.mean([slots_delay_s(k) for k in VALIDATED])
    figure, axes = plt.subplots(figsize=(6.4, 3.4), layout="constrained")
    looks = (("#0072b2", "o", "-"), ("#d55e00", "s", "--"), ("#009e73", "D", "-."))
    for seed, (colour, marker, line) in zip((1, 2, 3), looks, strict=True):
        steps, _, delays_s = np.array(stored(seed)["curve"]).T
        axes.plot(steps / 1e3, delays_s, line, color=colour, lw=0.8, alpha=0.6)
        best_s = np.minimum.accumulate(delays_s)
        axes.plot(steps / 1e3, best_s, line, color=colour, marker=marker, ms=4)
        axes.plot([], [], line, color=colour, marker=marker, ms=4, label=f"training seed {seed}")
    axes.axhline(nothing_s, color="#000000", ls=":", label="does nothing")
    axes.axhline(0.5 * (nothing_s + slots_s), color="#7f7f7f", ls="--", label="half the distance")
    axes.axhline(slots_s, color="#cc79a7", ls="-", label="slots")
    axes.set(xlabel="decisions (thousands)", ylabel="delay of all (s), validation seeds", ylim=0.0)
    axes.legend(fontsize=8)
    figure.savefig(path, dpi=110, metadata={"Software": None})


def main(words):
    """Does what the command line says."""
    if words[0] == "train":
        seed = int(words[1])
        policy, curve = train(seed)
        (HERE / f"policy-{seed}.json").write_text(
            json.dumps({"layers": policy, "curve": curve}) + "\n", encoding="utf-8"
        )
    elif words[0] == "judge":
        print(table(judged()))
    else:
        draw(words[1])


if __name__ == "__main__":
    main(sys.argv[1:])
