"""Static contact under the load of a resting cantilever."""

from ..contact.jkr import effective_radius_ratio, indentation_of_u, u_of_load
from ..core.elementary import cbrt
from ..core.jit import kernel
from ..core.records import Block
from ..parts.dispatch import surface
from .constants import Constants
from .state import State


@kernel
def static_load(p: Constants, q: float) -> float:
    """Load of a resting cantilever at tip height q [m_c w0^2 z0], docs/theory.md (27)."""
    return p.eta_c * p.eta_c * (q - p.a) + p.w


@kernel
def static_indentation(p: Constants, rho: float, load: float) -> float:
    """JKR indentation [z0] under `load` at effective radius ratio rho, docs/theory.md (6), (7)."""
    return p.delta_0 * cbrt(rho) * indentation_of_u(u_of_load(load / (p.L_s * rho)))


@kernel
def place_sample(s: State, p: Constants, m: Block) -> None:
    """Sample height from docs/theory.md (21), Z = Q - H + delta, and its rate without that of delta."""
    H = surface(s.X, s.Y, m)
    rho = effective_radius_ratio(H, p.r)
    s.Z = s.Q - H.height + static_indentation(p, rho, static_load(p, s.Q))
    s.V_Z = s.V_Q - H.slope_x * s.V_X - H.slope_y * s.V_Y
