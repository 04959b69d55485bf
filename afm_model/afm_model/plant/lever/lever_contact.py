"""The contact of the plant `lever`: force of the sample on the tip at mid-step, normal and tangential.

Unknown are the indentation and, where the tip slides, how far. Everything elastic behind the tip is one compliance W,
so that they are found by Newton's method in one unknown. Equations: docs/lever.md (16) to (23), (47) to (49).
"""

import math
from typing import Any, NamedTuple

from ...contact.contact_table import attraction, end_of_contact, look_up
from ...core.elementary import cbrt, exp, log
from ...core.jit import kernel
from ...core.lane_ways import by_lane, rare, where
from ...core.records import Block, record_at
from ...parts.header import BlockHeader
from ...parts.signals import Surface
from .lever_constants import Constants
from .lever_state import Ledger, State

_CLOSE = 1e-6
"""A Newton step so short, in units of indentation, leaves an error of its square."""
_Pressed = tuple[float, float, float, float, float]


class Apart(NamedTuple):
    """Tip and sample at mid-step if there were no force between them, and how a force moves them apart."""

    target: float  # indentation [m]
    e_1: float  # way of the sample against the place that the tip holds on to, along both tangents [m]
    e_2: float
    w_nn: float  # way of the sample against the tip per force, along normal and tangents [m/N]
    w_n1: float
    w_n2: float
    w_11: float
    w_12: float
    w_22: float
    shear: float  # lateral stiffness of the contact per radius [Pa]


class Contact(NamedTuple):
    """What the contact comes to at mid-step."""

    delta: float  # indentation [m]
    N: float  # normal force [N]
    F_max: float  # friction bound [N]
    a: float  # contact radius [m]
    d_1: float  # direction of sliding, along both tangents
    d_2: float


FOUND, NEAR, FAR = range(3)
"""What a step of Newton's method has come to: the solution, to be stepped on from, nowhere."""


@kernel
def _ledger_alone(m: Block) -> Ledger:
    return record_at(m, record_at(m, 0, BlockHeader).plant_ledger, Ledger)


@kernel
def _ledger_in_lane(m: Any) -> Any:
    return m.ledger


ledger_of = by_lane(_ledger_alone, _ledger_in_lane)
"""The record of the instrument's block m in which the contact keeps its account."""


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
def indent(
    delta: float, target: float, w_n: float, w_f: float, f: State, p: Constants, m: Block, at: int
) -> tuple[float, float, float, float]:
    """Solve delta + w_n N(delta) + w_f F_max(delta) = target, from the last indentation on.

    Where there are several solutions, it is the first one in the direction in which the tip is pulled at the start.

    Returns
    -------
    (delta, N, F_max, a) : floats
    """
    x = delta
    for _ in range(8):
        step, N, bound, a, outcome = newton(x, pressed(x, f, p, m, at), target, w_n, w_f, f)
        x += step
        if outcome == FOUND:
            return x, N, bound, a
        if outcome == FAR:
            break
    return _march(delta, target, w_n, w_f, f, p, m, at)


@kernel
def newton(
    x: float, here: _Pressed, target: float, w_n: float, w_f: float, f: State
) -> tuple[float, float, float, float, int]:
    """One step of Newton's method for `indent`, from indentation x, at which `pressed` has found `here`.

    Returns
    -------
    (step, N, F_max, a, outcome) : floats, int
        Of the place to which the step leads, to first order; FOUND, NEAR or FAR.
    """
    N, stiffness, bound, growth, a = here
    slope = 1.0 + w_n * stiffness + w_f * growth
    step = (target - x - w_n * N - w_f * bound) / slope
    unit = f.unit_indentation
    # Across the end of the contact the slope changes too much.
    leap = (abs(step) > unit + 0.3 * abs(x - f.end)) | ((x - f.end) * (x + step - f.end) <= 0.0)
    found, far = abs(step) < _CLOSE * unit, slope < 0.1
    outcome = where(far, FAR, where(found, FOUND, where(leap, FAR, NEAR)))
    return step, N + stiffness * step, bound + growth * step, a, outcome


@kernel
def _march(
    delta: float, target: float, w_n: float, w_f: float, f: State, p: Constants, m: Block, at: int
) -> tuple[float, float, float, float]:
    """The same by steps until the balance changes sign, then by bisection: through folds and jumps."""
    N, _, bound, _, a = pressed(delta, f, p, m, at)
    balance = target - delta - w_n * N - w_f * bound
    step = math.copysign(1e-3 * f.unit_indentation, balance)
    low = high = delta
    for _ in range(300):
        high = low + step
        N, _, bound, _, a = pressed(high, f, p, m, at)
        if (target - high - w_n * N - w_f * bound) * balance <= 0.0:
            break
        low = high
        step *= 1.1
    for _ in range(60):
        middle = 0.5 * (low + high)
        if middle == low or middle == high:  # no number is between them
            break
        N, _, bound, _, a = pressed(middle, f, p, m, at)
        if (target - middle - w_n * N - w_f * bound) * balance > 0.0:
            low = middle
        else:
            high = middle
    middle = 0.5 * (low + high)
    N, _, bound, _, a = pressed(middle, f, p, m, at)
    return middle, N, bound, a


@kernel
def hold(e_1: float, e_2: float, k: float, w_11: float, w_12: float, w_22: float) -> tuple[float, float]:
    """Tangential force of a tip that sticks: (1/k + W)^-1 e, the contact's own stiffness k in series; 0 for k = 0."""
    a, b, c = 1.0 + k * w_11, k * w_12, 1.0 + k * w_22
    per = k / (a * c - b * b)
    return per * (c * e_1 - b * e_2), per * (a * e_2 - b * e_1)


@kernel
def strengthened(bound: float, drawn: float, give: float, p: Constants) -> float:
    """Friction of a tip that slides faster the larger it is, F = F_max (1 + b ln(1 + v / v_0)), docs/lever.md (24).

    Parameters
    ----------
    bound : float [N]
        F_max, friction at rest.
    drawn : float [m]
        Way to go in this step along the direction of sliding, if friction were zero.
    give : float [m/N]
        How far the tip and its contact give way under friction.
    """
    slid = drawn - give * bound
    if p.strengthening == 0.0 or slid <= 0.0:
        return bound
    # In y = ln(1 + v / v_0) the balance is concave: Newton's method from beyond the root does not step over it.
    y = min(slid / (give * bound * p.strengthening), log(1.0 + slid / p.slow_way))
    for _ in range(30):
        way = p.slow_way * exp(y)
        excess = drawn - give * bound * (1.0 + p.strengthening * y) - (way - p.slow_way)
        change = excess / (give * bound * p.strengthening + way)
        y += change
        if abs(change) < 1e-13:
            break
    return bound * (1.0 + p.strengthening * max(y, 0.0))


@kernel
def slide(delta: float, d_1: float, d_2: float, c: Apart, f: State, p: Constants, m: Block, at: int) -> Contact:
    """Indentation and direction of a tip that slides, together: Newton's method in both, docs/lever.md (22).

    The direction d must lie along the way slid, so that friction always takes energy: what a step slides is small
    against what the cantilever gives way, and a direction that is nearly right would drive the tip.
    """
    x = delta
    for _ in range(12):
        step, N, bound, a, t_1, t_2, outcome = turned(x, pressed(x, f, p, m, at), d_1, d_2, c, f, p)
        if outcome == FAR:
            break
        x, d_1, d_2 = x + step, t_1, t_2
        if outcome == FOUND:
            return Contact(x, N, bound, a, d_1, d_2)
    # In turn: direction, then indentation.
    N, _, bound, _, a = pressed(delta, f, p, m, at)
    x = delta
    mean = 0.5 * (c.w_11 + c.w_22)
    for _ in range(8):
        for _ in range(4):
            v_1 = c.e_1 - c.w_n1 * N - bound * ((c.w_11 - mean) * d_1 + c.w_12 * d_2)
            v_2 = c.e_2 - c.w_n2 * N - bound * (c.w_12 * d_1 + (c.w_22 - mean) * d_2)
            size = math.sqrt(v_1 * v_1 + v_2 * v_2)
            if size > 0.0:
                d_1, d_2 = v_1 / size, v_2 / size
        x, N, bound, a = indent(x, c.target, c.w_nn, c.w_n1 * d_1 + c.w_n2 * d_2, f, p, m, at)
    return Contact(x, N, bound, a, d_1, d_2)


@kernel
def turned(
    x: float, here: _Pressed, d_1: float, d_2: float, c: Apart, f: State, p: Constants
) -> tuple[float, float, float, float, float, float, int]:
    """One step of Newton's method for `slide`, from indentation x, at which `pressed` has found `here`.

    Returns
    -------
    (step, N, F_max, a, d_1, d_2, outcome) : floats, int
        As those of `newton`, with the direction.
    """
    N, stiffness, bound, growth, a = here
    along, across = c.w_n1 * d_1 + c.w_n2 * d_2, c.w_n2 * d_1 - c.w_n1 * d_2
    g_1, g_2 = c.e_1 - c.w_n1 * N, c.e_2 - c.w_n2 * N
    if p.strengthening != 0.0 and a > 0.0:
        give = d_1 * (c.w_11 * d_1 + 2.0 * c.w_12 * d_2) + c.w_22 * d_2 * d_2 + 1.0 / (c.shear * a)
        rest, bound = bound, strengthened(bound, g_1 * d_1 + g_2 * d_2, give, p)
        growth *= bound / rest
    turn = (c.w_11 - c.w_22) * d_1 * d_2 + c.w_12 * (d_2 * d_2 - d_1 * d_1)
    turning = (c.w_11 - c.w_22) * (d_1 * d_1 - d_2 * d_2) + 4.0 * c.w_12 * d_1 * d_2
    r_1 = c.target - x - c.w_nn * N - along * bound
    r_2 = bound * turn - (g_1 * d_2 - g_2 * d_1)
    J_11, J_12 = 1.0 + c.w_nn * stiffness + along * growth, across * bound
    J_21, J_22 = across * stiffness - growth * turn, g_1 * d_1 + g_2 * d_2 - bound * turning
    determinant = J_11 * J_22 - J_12 * J_21
    step = (J_22 * r_1 - J_12 * r_2) / determinant
    angle = (J_11 * r_2 - J_21 * r_1) / determinant
    far = (J_11 < 0.1) | (J_22 <= 0.0) | (determinant <= 0.1 * J_11 * J_22)
    far |= (abs(step) > f.unit_indentation) | (abs(angle) > 0.5) | ((x - f.end) * (x + step - f.end) <= 0.0)
    found = (abs(step) < _CLOSE * f.unit_indentation) & (abs(angle) < _CLOSE)
    outcome = where(far, FAR, where(found, FOUND, NEAR))
    d_1, d_2 = d_1 - angle * d_2, d_2 + angle * d_1
    size = 1.0 / math.sqrt(d_1 * d_1 + d_2 * d_2)
    return step, N + stiffness * step, bound + growth * step, a, d_1 * size, d_2 * size, outcome
