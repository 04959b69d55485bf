"""A data set of exact stick-slip with its truth, in the form of the set EMPS of nonlinear_benchmarks, which loads it.

python examples/stick_slip_data.py --out out/stick_slip

    train, test = nonlinear_benchmarks.EMPS(dir_placement="out/stick_slip")  # u: force [N], y: position [m]

The files DATA_EMPS.mat (train: many sines) and DATA_EMPS_PULSES.mat (test: steps) hold the truth as well, in SI units:
x, v, friction, stuck, and the mass, damping, stiffness and friction_bound of m x'' + c x' + k x = u - friction.
"""

import argparse
import zipfile
from pathlib import Path

import numpy as np
from scipy.io import savemat

from afm_model import changed, load_scenario, simulate

TICKS, PERIOD = 5000, 50e-6
NOISE = 10e-12  # of the position sensor [m]


class Given:
    """Drives x with these voltages, one a control period."""

    def __init__(self, voltage):
        self.drives = iter(np.column_stack([voltage, 0.0 * voltage, 0.0 * voltage]))

    def answer(self, measurement):
        return next(self.drives)


def sines(random):
    """Voltage of 15 sines of 1 V, 4 to 116 Hz, with random phases."""
    t = PERIOD * np.arange(TICKS)
    phases = random.uniform(0.0, 2.0 * np.pi, (15, 1))
    return np.sum(np.sin(2.0 * np.pi * 4.0 * np.arange(1, 30, 2)[:, None] * t + phases), axis=0)


def steps(random):
    """Voltage that jumps every 5 ms."""
    return np.repeat(random.uniform(-8.0, 8.0, TICKS // 100), 100)


def measured(voltage, seed):
    """Variables of a file: what was measured when x was driven by this voltage, and the truth."""
    given = load_scenario("open_loop").sim
    kinds = {"plant.kind": "paper", "sample.kind": "flat", "plant.z": "held", "plant.seed": seed}
    times = {"plant.control_period": PERIOD, "detector.sample_period": PERIOD, "run.duration": TICKS * PERIOD}
    others = {"score.start": 0.0, "detector.position_noise": NOISE}
    sim = changed(given, kinds | times | others, afresh=("plant", "sample"))
    run = simulate(sim, Given(voltage))
    mass, omega = sim.scanner.mass_ratio * sim.cantilever.m_c, 2.0 * np.pi * sim.scanner.f_x
    k = mass * omega**2
    force = k * sim.piezo.sensitivity_x * voltage
    columns = {"t": run.time, "vir": force, "qm": run.position[:, 0], "qg": force / k}
    columns |= {"x": run.truth.position[:, 0], "v": run.truth.velocity[:, 0], "friction": run.truth.friction[:, 0]}
    columns |= {"stuck": run.truth.stuck, "friction_bound": run.truth.friction_bound}
    constants = {"mass": mass, "damping": 2.0 * sim.scanner.xi_x * mass * omega, "stiffness": k}
    return {name: np.reshape(each, (-1, 1)) for name, each in (columns | constants).items()}


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path("out/stick_slip"))
    folder = parser.parse_args().out / "EMPS"
    folder.mkdir(parents=True, exist_ok=True)
    random = np.random.default_rng(1)
    with zipfile.ZipFile(folder / "EMPS.zip", "w") as packed:  # by which the package knows that it has the files
        for seed, (name, shape) in enumerate({"DATA_EMPS": sines, "DATA_EMPS_PULSES": steps}.items()):
            file = folder / f"{name}.mat"
            savemat(file, measured(shape(random), seed), do_compression=True)
            packed.write(file, file.name)
            print(file)


if __name__ == "__main__":
    main()
