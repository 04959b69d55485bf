"""What drives along x and y that are held for 1 ms leave of the error at least: the bound in docs/laws.md, section 8.

python tools/measure_held_drive.py

Everything is known in advance here, half a period of the reference with its reversals left out. Sample and tip move as
one along z, z is tracked as well as held drives can, and friction acts along the reference at all times, with its bound
at the load that z leaves. Then everything is linear, and the drives with the smallest largest error are a linear
program.
"""

import math
import sys
from types import SimpleNamespace

import numpy as np
from measure_predictive import KNOWN, parameters
from numpy.typing import NDArray
from scipy.optimize import linprog

from afm_model.jit import plain
from afm_model.law.predictive.constants import values
from afm_model.law.predictive.gains import transition
from afm_model.sample.paper import surface

_Array = NDArray[np.float64]
HOLD = 1e-3
"""Time for which a drive is held [s]."""
FINE = 20
"""Intervals in it."""
PART = 0.94
"""Of half a period that is looked at."""


def motion(stiffness: float, damping: float, step: float, loads: _Array) -> tuple[_Array, _Array]:
    """Positions (n + 1) of q'' = U - stiffness q - damping q' - load: per drive and state at the start, and without.

    Parameters
    ----------
    stiffness, damping, step : float [w0^2], [w0], [1/w0]
    loads : ndarray (n,)
        In each interval of length `step`; FINE intervals have one drive.
    """
    Phi, Gamma = transition(stiffness, damping, step)
    n = len(loads)
    drives = n // FINE
    free, forced = np.zeros((2, drives + 2)), np.zeros(2)
    free[0, drives] = free[1, drives + 1] = 1.0
    rows, rest = np.zeros((n + 1, drives + 2)), np.zeros(n + 1)
    rows[0] = free[0]
    for i in range(n):
        free = Phi @ free
        free[:, i // FINE] += Gamma
        forced = Phi @ forced - Gamma * loads[i]
        rows[i + 1], rest[i + 1] = free[0], forced[0]
    return rows, rest


def least_squares(rows: _Array, error: _Array) -> _Array:
    """What is left of an error when the drives make its squares smallest."""
    return np.asarray(rows @ np.linalg.lstsq(rows, -error, rcond=None)[0] + error)


def smallest_largest(rows: _Array, error: _Array) -> float:
    """Largest error that is left when the drives make it smallest."""
    one = np.ones((len(rows), 1))
    costs = np.append(np.zeros(rows.shape[1]), 1.0)
    found = linprog(
        costs,
        A_ub=np.vstack([np.hstack([rows, -one]), np.hstack([-rows, -one])]),
        b_ub=np.concatenate([-error, error]),
        bounds=[(None, None)] * len(costs),
    )
    return float(found.x[-1])


def main() -> int:
    """Print the bound and what least squares give."""
    sim, controller = parameters(HOLD, 1, {**KNOWN, "law.friction": "nominal"}, {}, 0.5)
    p = SimpleNamespace(**values(controller))
    omega = sim.reference.omega_x / p.w0
    amplitude = np.array(sim.reference.amplitude[:2]) / p.x0
    along = amplitude / np.linalg.norm(amplitude)
    drives = int(PART * math.pi / omega / p.hold)
    step = p.hold / FINE
    time = step * np.arange(-drives * FINE // 2, drives * FINE // 2 + 1)
    reference = amplitude[:, None] * np.sin(omega * time)
    here = SimpleNamespace(strength=1.0)
    height, curvature, strength = np.zeros((3, len(time)))
    for i, (x, y) in enumerate(reference.T):
        plain(surface)(x, y, here, p, 0)
        height[i], curvature[i], strength[i] = here.height, here.curvature, here.strength
    # Along z: docs/laws.md (8.1), the setpoint kept.
    load = p.w + p.eta_c2 * (sim.reference.z_r / p.z0 - p.a)
    indentation = p.delta + p.delta_curvature * curvature + p.delta_load * (load - p.load_0)
    target = sim.reference.z_r / p.z0 + indentation - height
    held = (p.w + p.eta_c2 * (height - p.delta - p.a)) / (p.mu + 1.0)
    rows, rest = motion(p.stiffness[2], p.damping[2], step, 0.5 * (held[:-1] + held[1:]))
    z = least_squares(rows, rest - target)
    bound = strength * (p.f_0 + curvature * (p.f_1 + p.f_2 * curvature)) * (1.0 + p.f_load * (load - p.load_0))
    friction = bound * (1.0 + p.f_load * p.eta_c2 * z)
    print(f"z, least squares: rms {1e9 * p.z0 * np.sqrt(np.mean(z**2)):.2f} nm")
    swing, alone = 0.5 * np.ptp(friction), 0.5 * np.ptp(bound)
    print(f"friction: {friction.mean():.2f} +- {swing:.2f}; if z were perfect +- {alone:.2f}")
    for axis, name in enumerate("xy"):
        loads = along[axis] * 0.5 * (friction[:-1] + friction[1:])
        rows, rest = motion(p.stiffness[axis], p.damping[axis], step, loads)
        error = rest - reference[axis]
        left = least_squares(rows, error)
        percent = 100.0 / amplitude[axis]
        print(
            f"{name}: largest error {percent * smallest_largest(rows, error):.2f} % at least; least squares: largest "
            f"{percent * np.abs(left).max():.2f} %, rms {percent * np.sqrt(np.mean(left**2)):.2f} %"
        )
    return 0


if __name__ == "__main__":
    sys.exit(main())
