"""Lateral motion of the scanner against friction: one step of the midpoint scheme, shared by both plants."""

from ..contact.friction import friction_impulse
from ..core.jit import kernel
from .constants import Constants
from .state import State


@kernel
def kick_lateral(s: State, p: Constants, u_x: float, u_y: float, f: float) -> tuple[float, float, float, float]:
    """Velocities after the forces of one step of length h, positions being those at mid-step.

    X'' = U_x - eta_x^2 X - 2 xi_x eta_x X' - f d_x and Y alike, docs/theory.md (22), by (38) to (40): damping by the
    Cayley form (1-d)/(1+d).

    Parameters
    ----------
    s : record of State
        Positions at mid-step, velocities at the start of the step.
    p : record of plant constants
    u_x, u_y : float [w0^2 x0]
        Drive.
    f : float [m_p w0^2 x0]
        Radius of the friction disc.

    Returns
    -------
    (v_x, v_y, f_x, f_y) : floats
        Velocities at the end of the step; mean friction over it.
    """
    h = p.h
    d_x = h * p.xi_x * p.eta_x
    d_y = h * p.xi_y * p.eta_y
    p_x = (1.0 - d_x) * s.V_X + h * (u_x - p.eta_x * p.eta_x * s.X)
    p_y = (1.0 - d_y) * s.V_Y + h * (u_y - p.eta_y * p.eta_y * s.Y)
    j_x, j_y, stick = friction_impulse(p_x, p_y, s.V_X, s.V_Y, 1.0 + d_x, 1.0 + d_y, h * f)
    if stick:
        return 0.0, 0.0, j_x / h, j_y / h
    return (p_x - j_x) / (1.0 + d_x), (p_y - j_y) / (1.0 + d_y), j_x / h, j_y / h


@kernel
def store_friction(s: State, f_x: float, f_y: float, f_max: float) -> None:
    """Keep the friction of the step in the state, for the detector and the score."""
    s.F_x = f_x
    s.F_y = f_y
    s.F_max = f_max
