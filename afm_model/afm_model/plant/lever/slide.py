"""The tip of the plant `lever` slides: indentation and direction together; docs/lever.md (19), (21), (22), (24)."""

import math
from typing import NamedTuple

from ...compiled.jit import kernel, routine
from ...compiled.records import Block
from ...compiled.ways import where
from ...core.elementary import exp, log
from .constants import Constants
from .contact import Pressed, pressed
from .indent import CLOSE, FAR, FOUND, NEAR, indent
from .state import State


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


class ContactSolution(NamedTuple):
    """What the contact comes to at mid-step."""

    delta: float  # indentation [m]
    N: float  # normal force [N]
    F_max: float  # friction bound [N]
    a: float  # contact radius [m]
    d_1: float  # direction of sliding, along both tangents
    d_2: float
    stiffness: float  # slope of N and of F_max over the indentation [N/m]
    growth: float


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
def slide(
    delta: float, here: Pressed, d_1: float, d_2: float, c: Apart, f: State, p: Constants, m: Block, at: int
) -> ContactSolution:
    """Indentation and direction of a tip that slides, together: Newton's method in both, docs/lever.md (22).

    The direction d must lie along the way slid, so that friction always takes energy: what a step slides is small
    against what the cantilever gives way, and a direction that is nearly right would drive the tip.

    `here` is what `pressed` finds at the indentation delta, or has found in the last step.
    """
    x, t_1, t_2 = delta, d_1, d_2
    if p.viscosity == 0.0 and p.strengthening == 0.0:
        # A step without a look at the contact: as a rule the next one is the last.
        step, _, _, _, t_1, t_2, outcome = turned(x, here, d_1, d_2, c, f, p)
        if outcome == FAR:
            t_1, t_2 = d_1, d_2
        else:
            x += step
    for _ in range(12):
        here = pressed(x, f, p, m, at)
        step, N, bound, a, t_1, t_2, outcome = turned(x, here, t_1, t_2, c, f, p)
        if outcome == FAR:
            break
        x += step
        if outcome == FOUND:
            return ContactSolution(x, N, bound, a, t_1, t_2, here[1], here[3])
    return _in_turn(delta, d_1, d_2, c, f, p, m, at)


@routine
def _in_turn(
    delta: float, d_1: float, d_2: float, c: Apart, f: State, p: Constants, m: Block, at: int
) -> ContactSolution:
    """The same in turn: direction, then indentation."""
    N, stiffness, bound, growth, a = pressed(delta, f, p, m, at)
    x = delta
    mean = 0.5 * (c.w_11 + c.w_22)
    for _ in range(8):
        for _ in range(4):
            v_1 = c.e_1 - c.w_n1 * N - bound * ((c.w_11 - mean) * d_1 + c.w_12 * d_2)
            v_2 = c.e_2 - c.w_n2 * N - bound * (c.w_12 * d_1 + (c.w_22 - mean) * d_2)
            size = math.sqrt(v_1 * v_1 + v_2 * v_2)
            if size > 0.0:
                d_1, d_2 = v_1 / size, v_2 / size
        x, N, bound, a, stiffness, growth = indent(x, x, c.target, c.w_nn, c.w_n1 * d_1 + c.w_n2 * d_2, f, p, m, at)
    return ContactSolution(x, N, bound, a, d_1, d_2, stiffness, growth)


@kernel
def turned(
    x: float, here: Pressed, d_1: float, d_2: float, c: Apart, f: State, p: Constants
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
    found = (abs(step) < CLOSE * f.unit_indentation) & (abs(angle) < CLOSE)
    outcome = where(far, FAR, where(found, FOUND, NEAR))
    d_1, d_2 = d_1 - angle * d_2, d_2 + angle * d_1
    size = 1.0 / math.sqrt(d_1 * d_1 + d_2 * d_2)
    return step, N + stiffness * step, bound + growth * step, a, d_1 * size, d_2 * size, outcome


@kernel
def way_slid(N: float, T_1: float, T_2: float, d_1: float, d_2: float, c: Apart) -> float:
    """Way of the sample against the tip along the direction d, under the forces N and T [m]."""
    return d_1 * (c.e_1 - c.w_n1 * N - c.w_11 * T_1 - c.w_12 * T_2) + d_2 * (
        c.e_2 - c.w_n2 * N - c.w_12 * T_1 - c.w_22 * T_2
    )
