"""Whether the tip of the plant `lever` sticks or slides, and the forces with it; docs/lever.md (16) to (23).

One instrument alone tries what it did in the last step, then the other, each for as many of Newton's steps as it
takes. In lanes all make the same few steps of the same kernels; what they do not solve, the routine of one alone does.
"""

import math

from ...core.jit import kernel
from ...core.lane_ways import by_lane, rare, where
from ...core.records import Block
from .lever_constants import Constants
from .lever_contact import FAR, FOUND, hold, indent, newton, pressed, slide, turned
from .lever_state import State

_SAME = 1e-3
"""Relative change of the contact's stiffness that is none."""
_Balance = tuple[float, float, float, float, float, float, float, float, bool]


@kernel
def way_slid(
    e_1: float,
    e_2: float,
    N: float,
    T_1: float,
    T_2: float,
    d_1: float,
    d_2: float,
    w_n1: float,
    w_n2: float,
    w_11: float,
    w_12: float,
    w_22: float,
) -> float:
    """Way of the sample against the tip along the direction d, under the forces N and T [m]."""
    return d_1 * (e_1 - w_n1 * N - w_11 * T_1 - w_12 * T_2) + d_2 * (e_2 - w_n2 * N - w_12 * T_1 - w_22 * T_2)


@kernel
def _alone(
    target: float,
    e_1: float,
    e_2: float,
    w_nn: float,
    w_n1: float,
    w_n2: float,
    w_11: float,
    w_12: float,
    w_22: float,
    shear: float,
    s: State,
    p: Constants,
    m: Block,
    at: int,
) -> _Balance:
    # The tip holds on if friction can take what that needs; else it slides, friction being at its bound. First what it
    # did in the last step.
    delta, N, bound, a = s.delta, s.N, s.F_max, s.a
    k = shear * a
    d_1, d_2 = s.d_1, s.d_2
    T_1 = T_2 = 0.0
    stick = True
    slid = s.stuck == 0.0 and a > 0.0
    if slid:
        delta, N, bound, a, d_1, d_2 = slide(
            delta, d_1, d_2, target, e_1, e_2, w_nn, w_n1, w_n2, w_11, w_12, w_22, shear, s, p, m, at
        )
        T_1, T_2 = bound * d_1, bound * d_2
        # How far it slid, times the contact's stiffness.
        stick = shear * a * way_slid(e_1, e_2, N, T_1, T_2, d_1, d_2, w_n1, w_n2, w_11, w_12, w_22) < bound
    if stick:
        # The contact's stiffness goes with its radius: one of the step before would be late, and drive a swinging tip.
        for _ in range(8):
            # What the load does to the tangential force comes back as compliance.
            c_1, c_2 = hold(w_n1, w_n2, k, w_11, w_12, w_22)
            T_1, T_2 = hold(e_1, e_2, k, w_11, w_12, w_22)
            w_n = w_nn - w_n1 * c_1 - w_n2 * c_2
            delta, N, bound, a = indent(s.delta, target - w_n1 * T_1 - w_n2 * T_2, w_n, 0.0, s, p, m, at)
            late, k = k, shear * a
            if abs(k - late) <= _SAME * late:
                break
        T_1 -= c_1 * N
        T_2 -= c_2 * N
        size = math.sqrt(T_1 * T_1 + T_2 * T_2)
        if size > bound:
            stick = False
            d_1, d_2 = T_1 / size, T_2 / size
            if not slid and a > 0.0:
                delta, N, bound, a, d_1, d_2 = slide(
                    delta, d_1, d_2, target, e_1, e_2, w_nn, w_n1, w_n2, w_11, w_12, w_22, shear, s, p, m, at
                )
            T_1, T_2 = bound * d_1, bound * d_2
    return delta, N, bound, a, d_1, d_2, T_1, T_2, stick


@kernel
def _tried(
    delta: float,
    N: float,
    bound: float,
    a: float,
    d_1: float,
    d_2: float,
    found: bool,
    slid: bool,
    held: float,
    w_n: float,
    target: float,
    e_1: float,
    e_2: float,
    w_nn: float,
    w_n1: float,
    w_n2: float,
    w_11: float,
    w_12: float,
    w_22: float,
    shear: float,
    s: State,
    p: Constants,
    m: Block,
    at: int,
) -> tuple[float, float, float, float, float, float, bool]:
    """One of Newton's steps in a lane, sticking or sliding, both from the same look at the contact; nothing if the
    solution is found already.
    """
    here = pressed(delta, s, p, m, at)
    way, load, most, radius, outcome = newton(delta, here, held, w_n, 0.0, s)
    along, under, bearing, size, t_1, t_2, ends = turned(
        delta, here, d_1, d_2, target, e_1, e_2, w_nn, w_n1, w_n2, w_11, w_12, w_22, shear, s, p
    )
    outcome = where(slid, ends, outcome)
    rare((outcome == FAR) & (not found), m)
    N = where(found, N, where(slid, under, load))
    bound = where(found, bound, where(slid, bearing, most))
    a = where(found, a, where(slid, size, radius))
    d_1 = where(found | (not slid), d_1, t_1)
    d_2 = where(found | (not slid), d_2, t_2)
    delta = where(found, delta, delta + where(slid, along, way))
    return delta, N, bound, a, d_1, d_2, found | (outcome == FOUND)


@kernel
def _in_lane(
    target: float,
    e_1: float,
    e_2: float,
    w_nn: float,
    w_n1: float,
    w_n2: float,
    w_11: float,
    w_12: float,
    w_22: float,
    shear: float,
    s: State,
    p: Constants,
    m: Block,
    at: int,
) -> _Balance:
    slid, k = s.stuck == 0.0, shear * s.a
    c_1, c_2 = hold(w_n1, w_n2, k, w_11, w_12, w_22)
    T_1, T_2 = hold(e_1, e_2, k, w_11, w_12, w_22)
    w_n, held = w_nn - w_n1 * c_1 - w_n2 * c_2, target - w_n1 * T_1 - w_n2 * T_2
    delta, N, bound, a, d_1, d_2 = s.delta, 0.0, 0.0, 0.0, s.d_1, s.d_2
    # Written out: a loop in a loop over lanes would not become vectors.
    delta, N, bound, a, d_1, d_2, found = _tried(
        delta,
        N,
        bound,
        a,
        d_1,
        d_2,
        False,
        slid,
        held,
        w_n,
        target,
        e_1,
        e_2,
        w_nn,
        w_n1,
        w_n2,
        w_11,
        w_12,
        w_22,
        shear,
        s,
        p,
        m,
        at,
    )
    delta, N, bound, a, d_1, d_2, found = _tried(
        delta,
        N,
        bound,
        a,
        d_1,
        d_2,
        found,
        slid,
        held,
        w_n,
        target,
        e_1,
        e_2,
        w_nn,
        w_n1,
        w_n2,
        w_11,
        w_12,
        w_22,
        shear,
        s,
        p,
        m,
        at,
    )
    rare(not found, m)
    T_1, T_2 = where(slid, bound * d_1, T_1 - c_1 * N), where(slid, bound * d_2, T_2 - c_2 * N)
    # What begins to slide or to stick, and a contact whose stiffness changes, needs more than this.
    back = way_slid(e_1, e_2, N, T_1, T_2, d_1, d_2, w_n1, w_n2, w_11, w_12, w_22)
    rare(where(slid, shear * a * back < bound, math.sqrt(T_1 * T_1 + T_2 * T_2) > bound), m)
    rare((not slid) & (not abs(shear * a - k) <= _SAME * k), m)
    return delta, N, bound, a, d_1, d_2, T_1, T_2, not slid


balance = by_lane(_alone, _in_lane)
"""Solve for what the contact comes to at mid-step: (delta, N, F_max, a, d_1, d_2, T_1, T_2, stick).

Parameters
----------
target : float [m]
    Indentation without force.
e_1, e_2 : floats [m]
    Way of the sample against what the tip holds on to, along both tangents, without force.
w_nn, w_n1, w_n2, w_11, w_12, w_22 : floats [m/N]
    How the sample moves against the tip with the force, along normal and tangents.
shear : float [Pa]
    Lateral stiffness per contact radius.
s, p : records of State and Constants
m, at : block of the instrument, where the table of the contact begins

Returns
-------
delta, N, F_max, a, d_1, d_2, T_1, T_2, stick : floats, bool
    Indentation, normal force, friction bound, contact radius, direction of sliding, friction, and whether it sticks.
"""
