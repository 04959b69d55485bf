"""A law that is learnt: a few weights by the cross-entropy method, 64 instruments at once; then beside laws of ours.

python examples/learn_tracking.py            # some minutes
python examples/learn_tracking.py --rounds 5
"""

import argparse
from dataclasses import replace

import numpy as np

from afm_model import changed, load_scenario, simulate
from afm_model.studies.learning import OBSERVATION, TrackingVectorEnv, rewards

WORST = 5e-9  # error at which the reward is -1 [m]
SCENARIO = load_scenario("closed_loop_predictive")  # 50 us, nothing known of the sample
LAWS = {"pid": {}, "observer": {}, "observer, friction learned": {"law.friction": "learned"}, "predictive": None}
INPUTS = {
    axis: [OBSERVATION.index(name) for name in names]
    for axis, names in {
        0: ("reference_position_x", "position_x", "velocity_x", "reference_velocity_x", "lateral_force"),
        1: ("reference_position_y", "position_y", "velocity_y", "reference_velocity_y", "lateral_force"),
    }.items()
}
Z = OBSERVATION.index("drive_z")


def act(weights, seen, scale):
    """Actions of n policies, weights (n, 2, 6), for what n instruments show: linear, with the direction of motion."""
    actions = np.zeros((len(seen), 3))
    for axis, inputs in INPUTS.items():
        x = np.column_stack([seen[:, inputs], np.sign(seen[:, inputs[3]])])
        actions[:, axis] = np.sum(weights[:, axis] * x, axis=1)
    actions[:, 2] = seen[:, Z] / scale  # as it is
    return np.clip(actions, -1.0, 1.0)


def returns(envs, weights, seed):
    """Mean reward of each policy over an episode."""
    seen, _ = envs.reset(seed=seed)
    earned, over = np.zeros(len(weights)), np.zeros(len(weights), bool)
    steps = 0
    while not over.all():
        seen, reward, terminated, truncated, _ = envs.step(act(weights, seen, 4.0))
        earned += np.where(over, 0.0, reward)
        over |= terminated | truncated
        steps += 1
    return earned / steps


def learn(rounds, policies=64, elite=10):
    """The mean of the last generation."""
    # A quarter of a period of the reference, in which the scanner sticks, slips and turns.
    short = {"run.duration": 0.04, "score.start": 0.0, "detector.sample_period": 5e-5}
    envs = TrackingVectorEnv(replace(SCENARIO, sim=changed(SCENARIO.sim, short)), policies, worst=WORST)
    random = np.random.default_rng(1)
    mean, spread = np.zeros((2, 6)), np.tile([0.1, 0.1, 0.02, 0.1, 0.002, 0.1], (2, 1))
    for number in range(rounds):
        weights = mean + spread * random.standard_normal((policies, 2, 6))
        found = returns(envs, weights, seed=0)
        best = weights[np.argsort(found)[-elite:]]
        mean, spread = best.mean(axis=0), best.std(axis=0) + 0.5 * spread * 0.9**number
        print(f"round {number + 1}: best {found.max():.4f}, mean {found.mean():.4f}", flush=True)
    return mean


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rounds", type=int, default=60)
    weights = learn(parser.parse_args().rounds)
    envs = TrackingVectorEnv(SCENARIO, 1, worst=WORST)
    print("| law | mean reward |\n|---|---|")
    print(f"| learnt | {returns(envs, weights[None], 0)[0]:.3g} |")
    for name, values in LAWS.items():
        law = SCENARIO.controller
        if values is not None:
            law = changed(law, {"law.kind": name.split(",")[0], "law.period": 5e-5, **values}, afresh=("law",))
        earned = rewards(simulate(SCENARIO.sim, law).measurements[1:], WORST)
        print(f"| {name} | {earned.mean():.3g} |")


if __name__ == "__main__":
    main()
