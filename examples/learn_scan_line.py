"""Settings of a scan that are learnt: PPO of Stable-Baselines3, next to the best fixed settings of a grid.

pip install stable-baselines3 './afm_model[learn,plot]'
python examples/learn_scan_line.py                # ten minutes on two processors; draws learn_scan_line.png
python examples/learn_scan_line.py --minutes 0.2
"""

import argparse
import itertools
import time
import warnings

import matplotlib.pyplot as plt
import numpy as np
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.env_checker import check_env
from stable_baselines3.common.vec_env import SubprocVecEnv

from afm_model.studies.scan_line import SETTINGS, ScanLineEnv

GRID, CURVE, TEST = 10_000, 20_000, 30_000  # seeds of surfaces: of the grid, of the learning curve, of the table
LEVELS = [np.linspace(-0.2, 1.0, 5), [-1.0, 0.0, 0.6], [-1.0, -0.5], np.linspace(-0.4, 1.0, 6)]  # of each of SETTINGS


def best_fixed(surfaces):
    """Of all combinations of LEVELS that with the largest mean reward over some surfaces."""
    settings = np.array(list(itertools.product(*LEVELS)))
    earned = np.zeros(len(settings))
    for seed in range(GRID, GRID + surfaces):
        env = ScanLineEnv(lines=2 * len(settings))
        env.reset(seed=seed)
        for number, each in enumerate(settings):
            env.step(each)  # the second line with the same settings counts
            earned[number] += env.step(each)[1]
    return settings[earned.argmax()]


def mean_rewards(policy, first, surfaces):
    """Mean reward of a line, of each surface."""
    env, found = ScanLineEnv(), []
    for seed in range(first, first + surfaces):
        seen, _ = env.reset(seed=seed)
        earned, over = [], False
        while not over:
            seen, reward, terminated, over, _ = env.step(policy(seen))
            earned.append(reward)
            over |= terminated
        found.append(np.mean(earned))
    return np.array(found)


class Curve(BaseCallback):
    """Tests the policy now and then, and ends the learning when its time is over."""

    def __init__(self, minutes, every=4096):
        super().__init__()
        self.end, self.every, self.points = time.monotonic() + 60.0 * minutes, every, []

    def _on_step(self):
        if self.num_timesteps % self.every == 0 or not self.points:
            reward = mean_rewards(chosen_by(self.model), CURVE, 12).mean()
            self.points.append((self.num_timesteps, reward))
            print(f"{self.num_timesteps} lines: mean reward {reward:.3f}", flush=True)
        return time.monotonic() < self.end


def chosen_by(model):
    return lambda seen: model.predict(seen, deterministic=True)[0]


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--minutes", type=float, default=7.0, help="of learning")
    parser.add_argument("--surfaces", type=int, default=8, help="of the grid")
    arguments = parser.parse_args()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(ScanLineEnv())
    fixed = best_fixed(arguments.surfaces)
    print("best fixed settings:", dict(zip(SETTINGS, fixed.round(2).tolist(), strict=True)), flush=True)
    model = PPO(
        *("MlpPolicy", SubprocVecEnv([ScanLineEnv] * 2)),
        **{"n_steps": 256, "batch_size": 128, "learning_rate": 1e-3, "gamma": 0.5, "seed": 1, "device": "cpu"},
        policy_kwargs={"log_std_init": -1.0},
    )
    curve = Curve(arguments.minutes)
    model.learn(10**9, callback=curve)
    policies = {"middle of all settings": lambda seen: np.zeros(4), "best fixed": lambda seen: fixed}
    print("| settings | mean reward |\n|---|---|")
    found = {}
    for name, policy in {**policies, "PPO": chosen_by(model)}.items():
        found[name] = mean_rewards(policy, TEST, 40)
        print(f"| {name} | {found[name].mean():.3f} |", flush=True)
    gain = found["PPO"] - found["best fixed"]
    print(f"PPO less best fixed: {gain.mean():.3f} +- {gain.std() / np.sqrt(len(gain)):.3f}, better on {sum(gain > 0)}")
    figure, axes = plt.subplots(figsize=(6.0, 3.4), layout="constrained")
    axes.plot(*np.array(curve.points).T, marker=".", label="PPO")
    level = mean_rewards(policies["best fixed"], CURVE, 12).mean()
    axes.axhline(level, color="0.5", linestyle="--", label="best fixed settings of a grid on other surfaces")
    axes.set(xlabel="lines scanned", ylabel="mean reward of a line")
    axes.legend(frameon=False)
    axes.grid(alpha=0.3)
    figure.savefig("learn_scan_line.png", dpi=110)


if __name__ == "__main__":
    main()
