"""The contact of the plant `lever`: forces of the sample on the tip at an indentation; docs/lever.md (8) to (13),
(47) to (49).
"""

import math

from ...compiled.jit import kernel
from ...compiled.records import Block
from ...compiled.ways import rare
from ...contact.contact_table import attraction, end_of_contact, force_at_end, look_up
from ...core.elementary import cbrt
from ...parts.signals import Surface
from .constants import Constants
from .state import State, ledger_of

Pressed = tuple[float, float, float, float, float]
"""Normal force, its slope, friction bound, its slope, contact radius: see `normal`."""


@kernel
def place_frame(H: Surface, p: Constants, f: State, m: Block, at: int) -> None:
    """Write the contact at a place of the sample, H, into f, the State."""
    rho = 1.0 if H.curvature == 0.0 else 1.0 / (1.0 + H.curvature * p.rise / p.x0 * p.R)
    contrast = H.adhesion
    # (w^2 R_e / K^2)^(1/3), and the other powers by it.
    same = rho == 1.0 and contrast == 1.0 and H.modulus == 1.0
    root = 1.0 if same else cbrt(contrast * contrast * rho / (H.modulus * H.modulus))
    f.unit_force = p.unit_force * contrast * rho
    f.unit_indentation = p.unit_indentation * root
    f.unit_radius = p.unit_radius * contrast * rho / (root * H.modulus)
    f.hamaker_radius = p.hamaker_radius * contrast * rho
    f.row = (p.transition * root - p.row_first) / p.row_step
    f.tau = p.friction_per_area * H.strength
    f.end = f.unit_indentation * end_of_contact(f.row, m, at, p.rows)
    if p.viscosity != 0.0 or p.bridge != 0.0:
        own = ledger_of(m)
        own.eta = p.viscosity * H.viscosity
        own.pull = p.bridge_pull * rho * H.tension
        own.spread2 = p.bridge_spread2 / rho


@kernel
def bridge_force(gap: float, pull: float, spread2: float) -> tuple[float, float]:
    """Force of a liquid bridge of constant volume at a distance [m], and its slope over the approach, docs/lever.md
    (49).

    Parameters
    ----------
    gap : float [m]
        >= 0; as they touch it pulls by `pull`.
    pull : float [N]
    spread2 : float [m^2]
        V / (pi R_e).
    """
    if gap <= 0.0:
        return -pull, 0.0
    s2 = gap * gap + spread2
    s = math.sqrt(s2)
    return -pull * (1.0 - gap / s), -pull * spread2 / (s2 * s)


@kernel
def _contact(
    delta: float, f: State, p: Constants, m: Block, at: int
) -> tuple[float, float, float, float, float, float]:
    """As `normal`, and the slope of the contact radius."""
    F, S, a, b = look_up(delta / f.unit_indentation, f.row, m, at, p.rows)
    bound = growth = 0.0
    if rare(a == 0.0, m):
        # The distance at which the attraction is that of the end of the contact; from there on it grows.
        D = math.sqrt(-f.hamaker_radius / (6.0 * F * f.unit_force)) + max(f.end - delta, 0.0)
        N, stiffness = attraction(D, f.hamaker_radius)
        b = 0.0
    else:
        a *= f.unit_radius
        b *= f.unit_radius / f.unit_indentation
        area = math.pi * f.tau * a
        N, stiffness = F * f.unit_force, S * f.unit_force / f.unit_indentation
        bound, growth = area * a, 2.0 * area * b
    if p.bridge != 0.0:
        own = ledger_of(m)
        if own.bridge != 0.0:
            pull, change = bridge_force(f.end - delta, own.pull, own.spread2)
            N += pull
            stiffness += change
    return N, stiffness, bound, growth, a, b


@kernel
def reach(f: State, p: Constants, m: Block, at: int) -> tuple[float, float]:
    """Indentation at which tip and sample off contact would have no distance [m], and normal force where contact ends
    [N].
    """
    force = force_at_end(f.row, m, at, p.rows) * f.unit_force
    return f.end + math.sqrt(-f.hamaker_radius / (6.0 * force)), force


@kernel
def normal(delta: float, f: State, p: Constants, m: Block, at: int) -> tuple[float, float, float, float, float]:
    """Normal force [N] and friction bound [N] at indentation delta [m], each with its slope [N/m], and contact radius.

    Without viscosity: of a contact at rest.

    Parameters
    ----------
    f, p : records of State and Constants
    m, at : the table begins at m[at]
    """
    N, stiffness, bound, growth, a, _ = _contact(delta, f, p, m, at)
    return N, stiffness, bound, growth, a


@kernel
def pressed(delta: float, f: State, p: Constants, m: Block, at: int) -> tuple[float, float, float, float, float]:
    """The same with the force of the viscosity at the rate that this indentation at mid-step makes, docs/lever.md
    (48). Friction stays that of the area.
    """
    N, stiffness, bound, growth, a, b = _contact(delta, f, p, m, at)
    if p.viscosity != 0.0 and a > 0.0:
        own = ledger_of(m)
        rate = own.per * (delta - own.origin)
        N += own.drag * a * rate + own.push
        stiffness += own.drag * (b * rate + a * own.per)
    return N, stiffness, bound, growth, a


@kernel
def pressed_last(s: State, m: Block) -> Pressed:
    """What `pressed` has found in the last step."""
    own = ledger_of(m)
    return s.N, own.stiffness, s.F_max, own.growth, s.a
