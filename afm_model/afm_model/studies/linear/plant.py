"""The instrument, linearised: scanner, cantilever and contact under a held drive, and what is measured of them."""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...contact.jkr import stiffness_of_u, u_of_load
from ...contact.strength import bound_of_load
from ...core.jit import plain
from ...core.records import record_at, size
from ...instrument import Instrument
from ...parameters import SimParameters, Value, build, flatten
from ...parts.signals import Measurement
from ...plant.constants import plant_constants

_Array = NDArray[np.float64]
AXES = ("x", "y", "z")
STATES = 8
"""States of the plant: X, V_X, Y, V_Y, Z, V_Z, Q, V_Q."""


def nominal_friction(sim: SimParameters) -> _Array:
    """Friction of a flat sample at the setpoint, (3,) [w0^2 x0], against a motion along the reference."""
    p = plant_constants(sim)
    f = plain(bound_of_load)(p["f_s"], 1.0, _static_load(sim, p) / p["L_s"])
    # A part of the reference that has no amplitude does not move; of one that has none at all, x stands for it.
    along = np.abs([*sim.reference.amplitude, 0.0]) if any(sim.reference.amplitude) else np.array([1.0, 0.0, 0.0])
    return np.asarray(f * along / np.linalg.norm(along))


def _static_load(sim: SimParameters, p: Any) -> float:
    return float(p["eta_c"] ** 2 * (sim.reference.z_r / sim.scales.z0 - p["a"]) + p["w"])


def plant_matrices(sim: SimParameters, period: float) -> tuple[_Array, _Array, _Array]:
    """Exact step over a control period: nondimensional states from states, from volts, and from friction (8,)."""
    from scipy.linalg import expm  # here: a tenth of a second for nothing in a node

    p = plant_constants(sim)
    F, G = np.zeros((STATES, STATES)), np.zeros((STATES, 3))
    for i, axis in enumerate(AXES):
        eta, xi = p[f"eta_{axis}"], p[f"xi_{axis}"]
        F[2 * i, 2 * i + 1] = 1.0
        F[2 * i + 1, 2 * i : 2 * i + 2] = -eta * eta, -2.0 * xi * eta
        G[2 * i + 1, i] = p[f"gain_{axis}"]
    F[6, 7] = 1.0
    F[7, 6:8] = -(p["eta_c"] ** 2), -2.0 * p["xi_c"] * p["eta_c"]
    u = plain(u_of_load)(_static_load(sim, p) / p["L_s"])
    k = max(p["L_s"] * plain(stiffness_of_u)(u) / p["delta_0"], 0.0)
    c = 2.0 * p["zeta_n"] * math.sqrt(k)
    if sim.plant.kind != "compliant":
        # As good as rigid: far stiffer than either spring, and critically damped.
        k = 1e6 * (p["eta_c"] ** 2 + p["eta_z"] ** 2)
        c = 2.0 * math.sqrt(k)
    # N = k delta + c delta', delta = Z - Q on a flat sample.
    spring = np.array([k, c, -k, -c])
    F[5, 4:8] -= spring / p["mu"]
    F[7, 4:8] += spring
    f = nominal_friction(sim)
    load = np.array([0.0, -f[0], 0.0, -f[1], 0.0, 0.0, 0.0, 0.0])
    E = expm(np.block([[F, G, load[:, None]], [np.zeros((4, STATES + 4))]]) * sim.scales.w0 * period)
    return E[:STATES, :STATES], E[:STATES, STATES : STATES + 3], E[:STATES, STATES + 3]


def sensors(sim: SimParameters) -> _Array:
    """Measurement [SI] from the plant's states and the drive in force [V]."""
    C = np.zeros((size(Measurement), STATES + 3))
    x0, z0, w0 = sim.scales.x0, sim.scales.z0, sim.scales.w0
    for column in range(STATES + 3):
        y = record_at(C[:, column].copy(), 0, Measurement)
        axis = min(column // 2, 2)
        length = z0 if axis == 2 else x0
        if column < 6:
            target = y.velocity if column % 2 else y.position
            target[axis] = length * (w0 if column % 2 else 1.0)
        elif column == 6:
            y.deflection = z0
            y.deflection_voltage = z0 / sim.detector.deflection_sensitivity
        elif column == 7:
            y.deflection_rate = z0 * w0
        else:
            y.drive[column - STATES] = 1.0
        C[:, column] = np.array([y]).view(np.float64)
    return C


def measurement_at_rest(sim: SimParameters) -> _Array:
    """What is measured with the tip at its setpoint, the reference standing still, without noise."""
    noises = ("noise", "noise_density", "deflection_noise_density", "position_noise", "position_noise_density")
    quiet: dict[str, Value] = {f"detector.{name}": 0.0 for name in noises} | {"fault.kind": "none"}
    given = {name: value for name, value in flatten(sim).items() if not name.startswith("fault.")}
    known = {name: value for name, value in quiet.items() if name in given or name == "fault.kind"}
    instrument = Instrument(build(SimParameters, given | known), 1, hashed=False)
    y = instrument.measurement.copy()
    record = record_at(y, 0, Measurement)
    record.velocity[:] = record.reference_velocity[:] = record.reference_acceleration[:] = 0.0
    record.drive_sequence = record.newest_drive_sequence = 0
    record.deflection_rate = record.lateral_force = record.lateral_voltage = 0.0
    record.reference_position[:2] = record.position[:2]
    return y
