"""Nondimensional constants of the equations of motion, derived once from the SI parameters.

Units: time 1/w0, lateral length x0, vertical length z0, lateral acceleration w0^2 x0, normal force m_c w0^2 z0;
docs/theory.md (22), (23), and (2), (3), (13) for the contact.
"""

import math

import numpy as np
from numpy.typing import NDArray

from ..contact.jkr import radius_at_zero_load
from ..parameters import Physics

FIELDS = (
    "h",  # integration step [1/w0]
    "eta_x",
    "eta_y",
    "eta_z",
    "eta_c",  # resonances [w0]
    "xi_x",
    "xi_y",
    "xi_z",
    "xi_c",  # damping ratios [1]
    "mu",  # m_p / m_c [1]
    "w",  # load [m_c w0^2 z0]
    "a",  # height of the cantilever's rest position [z0]
    "beta",  # sample height amplitude [z0]
    "k_x",
    "k_y",  # sample wave numbers [1/x0]
    "r",  # tip radius [z0]
    "L_s",  # |L_s| on a flat sample [m_c w0^2 z0]
    "delta_0",  # a_0^2 / R on a flat sample [z0]
    "f_s",  # friction at pull-off on a flat sample [m_p w0^2 x0]
    "zeta_n",  # damping ratio of the normal contact [1]
)

RECORD = np.dtype((np.record, [(name, np.float64) for name in FIELDS]))
"""How a kernel reads the constants by name: `p = constants.view(RECORD)[0]`. They travel as a plain float64 array,
which numba takes ten times faster than an array of records."""


def plant_constants(physics: Physics, dt: float) -> NDArray[np.float64]:
    """Constants for a step of `dt` seconds, in the order of `FIELDS`.

    Parameters
    ----------
    physics : Physics
    dt : float [s]
        Integration step.

    Returns
    -------
    ndarray (len(FIELDS),)
    """
    contact, sample, cantilever = physics.contact, physics.sample, physics.cantilever
    scanner, scales = physics.scanner, physics.scales
    w0, x0, z0 = scales.w0, scales.x0, scales.z0
    normal_force = cantilever.m_c * w0**2 * z0
    lateral_force = scanner.mu * cantilever.m_c * w0**2 * x0
    gamma = contact.surface_energy
    values = {
        "h": dt * w0,
        "eta_x": 2.0 * math.pi * scanner.f_x / w0,
        "eta_y": 2.0 * math.pi * scanner.f_y / w0,
        "eta_z": 2.0 * math.pi * scanner.f_z / w0,
        "eta_c": 2.0 * math.pi * cantilever.f_c / w0,
        "xi_x": scanner.xi_x,
        "xi_y": scanner.xi_y,
        "xi_z": scanner.xi_z,
        "xi_c": cantilever.xi_c,
        "mu": scanner.mu,
        "w": cantilever.W / normal_force,
        "a": cantilever.a / z0,
        "beta": sample.beta / z0,
        "k_x": sample.k_x * x0,
        "k_y": sample.k_y * x0,
        "r": contact.R / z0,
        "L_s": contact.pull_off_force / normal_force,
        "delta_0": radius_at_zero_load(contact.R, contact.K, gamma) ** 2 / contact.R / z0,
        "f_s": contact.friction_at_pull_off / lateral_force,
        "zeta_n": contact.zeta_n,
    }
    return np.array([values[name] for name in FIELDS])
