"""Initial state of both plants: at rest, in static contact, the tip at its setpoint; docs/theory.md (21), (27)."""

import numpy as np
from numpy.typing import NDArray

from ..errors import ParameterError
from . import state
from .constants import RECORD
from .paper import friction_of_load, place_sample, static_load


def rest(constants: NDArray[np.float64], z_r: float, *, drawn: bool = False) -> tuple[NDArray[np.float64], float]:
    """Static contact at X = Y = 0 with the tip at height `z_r`, as after an approach to the setpoint.

    Parameters
    ----------
    constants : ndarray
        From `plant_constants`.
    z_r : float [z0]
        Tip height.
    drawn : bool
        For the paper's plant with f_z drawn at random, whose mean is zero.

    Returns
    -------
    (s, u_z) : ndarray (SIZE,), float [w0^2 z0]
        State, and the drive that holds it: U_z = eta_z^2 Z + N/mu; drawn, (eta_z^2 + eta_c^2/mu) Q.

    Raises
    ------
    ParameterError
        If the cantilever would have to pull harder than adhesion holds.
    """
    c = constants.view(RECORD)[0]
    load = static_load(c, z_r)
    if load <= -c.L_s:
        raise ParameterError(
            f"the tip does not touch the sample at rest: at the setpoint z_r = {z_r:g} z0 the static load is "
            f"{load:.4g} m_c w0^2 z0 (cantilever.a = {c.a:g} z0) and must be > {-c.L_s:.4g}, the pull-off load: "
            f"lower cantilever.a, or raise cantilever.W or reference.z_r"
        )
    s = np.zeros(state.SIZE)
    s[state.Q] = z_r
    s[state.CONTACT] = 1.0
    s[state.N] = load
    s[state.F_MAX] = friction_of_load(c, 1.0, load)
    place_sample(s, c)
    u_z = (c.eta_z**2 + c.eta_c**2 / c.mu) * z_r if drawn else c.eta_z**2 * s[state.Z] + load / c.mu
    return s, float(u_z)
