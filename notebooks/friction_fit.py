"""What the notebook fit.ipynb fits with: simulated friction loops and force curves, and a posterior from them.

Approximate Bayesian computation with regression adjustment: Beaumont, Zhang and Balding, Genetics 162, 2025 (2002);
Blum and Francois, Statistics and Computing 20, 63 (2010).
"""

import math
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from functools import cache
from multiprocessing import get_context
from pathlib import Path

import numpy as np

from afm_model import changed, load_scenario, simulate_many
from afm_model.studies.inference import BatchSimulator

PARAMETERS = {  # smallest and largest value thought possible, each as likely as any other between
    "contact.tau": (0.6e9, 1.2e9),  # friction strength [Pa]
    "contact.gamma": (0.30, 0.50),  # surface energy, by which adhesion goes [J/m^2]
    "detector.lateral_in_deflection": (-0.05, 0.05),  # crosstalk
    "detector.noise": (0.01, 0.04),  # of each photodetector signal [V]
}
LOW, HIGH = np.array(list(PARAMETERS.values())).T
CHUNK = 500
KEPT = 1000
"""Simulations nearest to what was measured, from which the posterior is made."""


def _scenario(**values):
    """The open loop of the paper on a flat sample; no law, so that nothing is computed for one."""
    given = {name.replace("__", "."): value for name, value in values.items()}
    kinds = tuple(name.split(".")[0] for name in given if name.endswith(".kind"))
    scenario = load_scenario("open_loop")
    return replace(scenario, sim=changed(scenario.sim, given | {"score.start": 0.0}, afresh=kinds))


LOOP = _scenario(
    **{"sample__kind": "flat", "plant__control_period": 5e-5, "detector__sample_period": 5e-5},
    **{"reference__shape_x": "triangle", "reference__shape_y": "constant", "reference__omega_x": 800.0},
    **{"reference__amplitude_x": 8e-9, "run__duration": 9.8e-3},
)
"""A period and a quarter of a force on the scanner that is a triangle over time, until it slides both ways."""
CURVE = _scenario(
    **{"sample__kind": "flat", "plant__control_period": 2.5e-5, "detector__sample_period": 2.5e-5},
    **{"plant__gap": 2.2e-7, "onboard__kind": "pi", "reference__kind": "force_curve", "reference__z_r": 2.2e-7},
    **{"reference__settle": 0.0, "reference__ramp": 260e-9, "reference__trigger_force": 20e-9},
    **{"reference__approach_rate": 80e-6, "reference__retract_rate": 20e-6, "run__duration": 12e-3},
)
"""To the sample from 220 nm above, 20 nN, and back until the contact breaks."""


def draw(random, count):
    """Parameters (count, 4) that are thought possible, and seeds of noise (count, 2)."""
    return random.uniform(LOW, HIGH, (count, len(LOW))), random.integers(2**31, size=(count, 2))


def measure(values, seeds):
    """Loops and curves of instruments with these parameters, as `simulate_many` gives them."""
    sets = {f"afm_sim_node.{name}": column for name, column in zip(PARAMETERS, values.T, strict=True)}
    names = ("position", "deflection", "lateral_force")
    return [
        simulate_many(scenario, sets | {"afm_sim_node.plant.seed": seed}, grid=False, variables=names)
        for scenario, seed in ((LOOP, seeds[:, 0]), (CURVE, seeds[:, 1]))
    ]


def _noise(signal):
    """Standard deviation of white noise in slow signals (n, time), by their second differences."""
    return np.median(np.abs(np.diff(signal, n=2)), axis=1) / 0.6745 / math.sqrt(6.0)


def loop_summary(loop):
    """Six numbers of each loop [nN, nm]."""
    x, lateral, across = (loop[name].values * 1e9 for name in ("position", "lateral_force", "deflection"))
    step = np.gradient(x[:, :, 0], axis=1)
    later = loop.time.values >= 0.25 * loop.time.values[-1]
    forth, back = (np.where((sign * step > 0.1) & later, 1.0, 0.0) for sign in (1.0, -1.0))

    def slid(signal, way):
        return np.sum(way * signal, axis=1) / np.maximum(np.sum(way, axis=1), 1.0)

    return np.column_stack(
        [
            0.5 * (slid(lateral, forth) - slid(lateral, back)),
            0.5 * (slid(across, forth) - slid(across, back)),
            0.5 * (slid(lateral, forth) + slid(lateral, back)),
            np.sum(forth, axis=1) + np.sum(back, axis=1),
            np.log(_noise(lateral)),
            np.log(_noise(across)),
        ]
    )


def curve_summary(curve):
    """Two numbers of each curve [nm]: deflection at the break of the contact, and the mean before it."""
    bend = curve.deflection.values * 1e9
    lowest = np.argmin(bend, axis=1)
    near = np.clip(lowest[:, None] + np.arange(-8, 1), 0, bend.shape[1] - 1)
    return np.column_stack([bend.min(axis=1), np.take_along_axis(bend, near, axis=1).mean(axis=1)])


def summarise(loop, curve):
    """Eight numbers of each loop and curve."""
    return np.hstack([loop_summary(loop), curve_summary(curve)])


@cache
def _simulators():
    return [
        BatchSimulator(LOOP, list(PARAMETERS), loop_summary),
        BatchSimulator(CURVE, list(PARAMETERS), curve_summary),
    ]


def _chunk(job):
    seed, number, folder = job
    file = Path(folder) / f"loops_{seed}_{number}.npz"
    if not file.exists():
        values, seeds = draw(np.random.default_rng((seed, number)), CHUNK)
        file.parent.mkdir(parents=True, exist_ok=True)
        found = [simulator(values, seed) for simulator, seed in zip(_simulators(), seeds.T, strict=True)]
        np.savez(file, values=values, summaries=np.hstack(found))
    with np.load(file) as kept:
        return kept["values"], kept["summaries"]


def simulate_table(count, seed, folder, processes=2):
    """Parameters and summaries of `count` loops and as many curves, by some processes; kept in `folder`."""
    jobs = [(seed, number, str(folder)) for number in range(math.ceil(count / CHUNK))]
    with ProcessPoolExecutor(processes, mp_context=get_context("spawn")) as pool:
        values, summaries = zip(*pool.map(_chunk, jobs), strict=True)
    return np.concatenate(values)[:count], np.concatenate(summaries)[:count]


def _line(values):
    """With the logarithm of the noise: its error goes by its size."""
    return np.column_stack([values[:, :3], np.log(values[:, 3])])


class Posterior:
    """What summaries say of parameters, from a table of simulations.

    Parameters
    ----------
    values, summaries : ndarray (n, 4), (n, 8)
    """

    def __init__(self, values, summaries):
        self.line = _line(values)
        self.middle, self.scale = summaries.mean(axis=0), summaries.std(axis=0)
        x = self._terms(summaries)
        # Four statistics: what a polynomial makes of the summaries for each parameter.
        self.weights = np.linalg.lstsq(x, self.line, rcond=None)[0]
        self.statistics = x @ self.weights
        self.spread = (self.line - self.statistics).std(axis=0)

    def _terms(self, summaries):
        s = np.clip((summaries - self.middle) / self.scale, -4.0, 4.0)
        i, j = np.triu_indices(s.shape[1])
        return np.column_stack([np.ones(len(s)), s, s[:, i] * s[:, j], s**3])

    def given(self, summary):
        """Parameters (KEPT, 4) and their weights, given one summary (8,)."""
        statistic = self._terms(summary[None])[0] @ self.weights
        away = (self.statistics - statistic) / self.spread
        distance = np.linalg.norm(away, axis=1)
        near = np.argpartition(distance, KEPT)[:KEPT]
        away = away[near]
        weights = 1.0 - (distance[near] / distance[near].max()) ** 2
        root = np.sqrt(weights)[:, None]
        x = np.column_stack([np.ones(KEPT), away])
        y = self.line[near] / self.spread
        mean = np.linalg.lstsq(x * root, y * root, rcond=None)[0]
        left = y - x @ mean
        # How wide it is may depend on where it is, too.
        width = np.linalg.lstsq(x * root, np.log(left**2 + 1e-12) * root, rcond=None)[0]
        found = (mean[0] + left * np.exp(0.5 * (width[0] - x @ width))) * self.spread
        found[:, 3] = np.exp(found[:, 3])
        return np.clip(found, LOW, HIGH), weights


def quantiles(values, weights, parts):
    """Quantiles (len(parts), 4) of weighted values (n, 4)."""
    found = []
    for column in values.T:
        order = np.argsort(column)
        summed = np.cumsum(weights[order]) - 0.5 * weights[order]
        found.append(np.interp(parts, summed / weights.sum(), column[order]))
    return np.array(found).T
