"""Force curves on polystyrene at several rates: what is recovered of the contact. Writes a table into docs/images.md.

python tools/measure_force_curves.py            # some minutes
"""

import argparse
import math
import sys
from pathlib import Path
from typing import NamedTuple

import numpy as np
from figures import page
from figures.runs import ROOT

from afm_model import ControllerParameters, SimParameters, build, simulate
from afm_model.analysis import contact_fit, force_curve
from afm_model.contact.maugis import branch, pull_off
from afm_model.parameters import Value

PAGE = ROOT / "docs" / "images.md"
RATES = (0.3e-6, 1e-6, 3e-6, 10e-6, 30e-6, 100e-6)
K, RADIUS = 2.8, 10e-9
CURVE: dict[str, Value] = {
    "plant.kind": "lever",
    # A cantilever for force modulation, 225 x 28 x 3 um, nominal.
    "plant.k": K,
    "plant.f0": 75e3,
    "plant.Q": 200.0,
    "plant.length": 225e-6,
    "plant.width": 28e-6,
    "plant.thickness": 3e-6,
    "plant.tip_height": 12e-6,
    "plant.tip_radius": RADIUS,
    "plant.tilt": 0.0,
    "plant.scanner": "stack_13um",
    "plant.pair": "si_polystyrene",
    "plant.dt": 0.25e-6,
    "plant.temperature": 295.0,
    "plant.gap": 20e-9,
    "detector.sample_period": 1e-6,
    "detector.deflection_noise_density": 1e-13,
    "detector.channels": "z_loop, curve_phase",
    "sample.kind": "flat",
    "onboard.kind": "pi",
    "reference.kind": "force_curve",
    "reference.settle": 5e-3,
    "reference.ramp": 80e-9,
    "reference.trigger_force": 30e-9,
}


class Recovered(NamedTuple):
    """Of one curve, each over what was set, less one."""

    modulus: float
    told: float  # uncertainty that the fit tells of it
    adhesion: float
    work: float
    snap_in: float


class Curve(NamedTuple):
    """A force curve as it is saved."""

    z: np.ndarray
    deflection: np.ndarray
    parameters: SimParameters


def curve(rate: float, seed: int) -> Curve:
    """A force curve at a rate [m/s], from settling to the end of the retract."""
    values = CURVE | {"reference.approach_rate": rate, "reference.retract_rate": rate, "plant.seed": seed}
    longest = build(SimParameters, values).reference.longest
    parameters = build(SimParameters, values | {"run.duration": longest})
    # The law moves nothing: the reference along x and y rests at zero.
    done = simulate(parameters, build(ControllerParameters, {"law.kind": "open_loop"}))
    phase = done.channel("curve_phase")
    part = (phase >= 1.0) & (phase <= 4.0)
    return Curve(done.channel("z_loop")[part], done.channel("deflection")[part], parameters)


def snap_in_way(parameters: SimParameters) -> float:
    """Way from the snap-in to the contact point, at rest [m]: docs/lever.md (13) and D = (HR/3k)^(1/3)."""
    plant = parameters.plant
    units, hamaker = plant.contact_units, plant.pair_numbers.hamaker
    exact = branch("maugis", plant.transition)
    end = exact.least_indentation
    d = end + np.linspace(0.0, 3.0, 20_001) ** 2
    force = exact.solve(d)[1]
    zero = float(np.interp(0.0, force[force.argmin() :], d[force.argmin() :]))
    at_contact = math.sqrt(hamaker * RADIUS / (6.0 * abs(force[0]) * units.force))
    return (zero - end) * units.indentation + 1.5 * (hamaker * RADIUS / (3.0 * K)) ** (1.0 / 3.0) - at_contact


def recovered(one: Curve) -> Recovered:
    """What the analysis finds in a curve."""
    plant = one.parameters.plant
    pair = plant.pair_numbers
    pull = pull_off("maugis", plant.transition) * plant.contact_units.force
    fit = contact_fit(one.z, one.deflection, K, RADIUS, sensitivity_error=0.0)
    points = force_curve(one.z, one.deflection, K)
    E = 0.75 * pair.K
    return Recovered(
        modulus=fit.modulus.value / E - 1.0,
        told=fit.modulus.uncertainty / E,
        adhesion=fit.pull_off.value / pull - 1.0,
        work=fit.work_of_adhesion.value / pair.work_of_adhesion - 1.0,
        snap_in=points.snap_in_way / snap_in_way(one.parameters) - 1.0,
    )


def table(curves: int) -> list[str]:
    """Rows: means over curves, and their scatter."""
    rows = [
        "| rate [µm/s] | E* [%] | uncertainty of E* [%] | pull-off [%] | work of adhesion [%] "
        "| way of the snap-in [%] |",
        "| --- | --- | --- | --- | --- | --- |",
    ]
    for rate in RATES:
        each = 100.0 * np.array([recovered(curve(rate, seed)) for seed in range(1, curves + 1)])
        middle, scatter = each.mean(axis=0), each.std(axis=0, ddof=1)
        cells = [f"{middle[i]:.1f}" if i == 1 else f"{middle[i]:+.1f} ± {scatter[i]:.1f}" for i in range(each.shape[1])]
        rows.append(f"| {1e6 * rate:g} | " + " | ".join(cells) + " |")
        print(rows[-1], flush=True)
    return rows


def main() -> int:
    """Measure and write."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--curves", type=int, default=4, help="curves at each rate")
    parser.add_argument("--page", type=Path, default=PAGE, help="page to write the table into")
    arguments = parser.parse_args()
    page.insert(arguments.page, "rates", table(arguments.curves))
    return 0


if __name__ == "__main__":
    sys.exit(main())
