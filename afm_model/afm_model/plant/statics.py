"""Static contact under the load of a resting cantilever."""

from ..compiled.jit import kernel
from ..compiled.records import Block
from ..contact.jkr import indentation_of_u, radius_ratios, u_of_load
from ..parts.dispatch import surface
from .constants import Constants
from .state import State


@kernel
def static_load(p: Constants, q: float) -> float:
    """Load of a resting cantilever at tip height q [m_c w0^2 z0], docs/theory.md (27)."""
    return p.spring_c * (q - p.a) + p.w


@kernel
def static_indentation(p: Constants, rho_third: float, load_ratio: float) -> float:
    """JKR indentation [z0], docs/theory.md (6), (7).

    rho_third is the cube root of the effective radius ratio, load_ratio that of the load to the pull-off load there.
    """
    return p.delta_0 * rho_third * indentation_of_u(u_of_load(load_ratio))


@kernel
def place_sample(s: State, p: Constants, m: Block) -> None:
    """Sample height from docs/theory.md (21), Z = Q - H + delta, and its rate without that of delta."""
    H = surface(s.X, s.Y, m)
    _, third, inverse, _ = radius_ratios(H, p.r)
    s.Z = s.Q - H.height + static_indentation(p, third, static_load(p, s.Q) * (p.inverse_L_s * inverse))
    s.V_Z = s.V_Q - H.slope_x * s.V_X - H.slope_y * s.V_Y
