"""Lateral motion of the scanner against friction: one step of the midpoint scheme, shared by both plants."""

from ..compiled.jit import kernel
from ..contact.friction import friction_impulse
from .constants import Constants
from .state import State


@kernel
def kick_lateral(s: State, p: Constants, u_x: float, u_y: float, f: float) -> tuple[float, float, float, float]:
    """Velocities after the forces of one step of length h, positions being those at mid-step.

    X'' = U_x - eta_x^2 X - 2 xi_x eta_x X' - f d_x and Y alike, docs/theory.md (22), by (38) to (40).

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
    p_x = p.keep_x * s.V_X + h * (u_x - p.spring_x * s.X)
    p_y = p.keep_y * s.V_Y + h * (u_y - p.spring_y * s.Y)
    j_x, j_y, stick = friction_impulse(p_x, p_y, s.V_X, s.V_Y, p.take_x, p.take_y, h * f)
    f_x, f_y = j_x * p.inverse_h, j_y * p.inverse_h
    if stick:
        return 0.0, 0.0, f_x, f_y
    return (p_x - j_x) * p.take_x, (p_y - j_y) * p.take_y, f_x, f_y


@kernel
def store_friction(s: State, f_x: float, f_y: float, f_max: float) -> None:
    """Keep the friction of the step in the state, for the detector and the score."""
    s.F_x = f_x
    s.F_y = f_y
    s.F_max = f_max
