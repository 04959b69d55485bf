"""Whether the tip of the plant `lever` sticks or slides, and the forces with it; docs/lever.md (16) to (23).

One instrument alone tries what it did in the last step, then the other, each for as many of Newton's steps as it
takes. In lanes all make the same few steps of the same kernels; what they do not solve, the routine of one alone does.
"""

import math

from ...core.jit import kernel
from ...core.lane_ways import by_lane, rare, where
from ...core.records import Block
from .lever_constants import Constants
from .lever_contact import FAR, FOUND, Apart, Contact, hold, indent, newton, pressed, slide, turned
from .lever_state import State

_SAME = 1e-3
"""Relative change of the contact's stiffness that is none."""
_Balance = tuple[Contact, float, float, bool]


@kernel
def way_slid(N: float, T_1: float, T_2: float, d_1: float, d_2: float, c: Apart) -> float:
    """Way of the sample against the tip along the direction d, under the forces N and T [m]."""
    return d_1 * (c.e_1 - c.w_n1 * N - c.w_11 * T_1 - c.w_12 * T_2) + d_2 * (
        c.e_2 - c.w_n2 * N - c.w_12 * T_1 - c.w_22 * T_2
    )


@kernel
def _alone(c: Apart, s: State, p: Constants, m: Block, at: int) -> _Balance:
    # The tip holds on if friction can take what that needs; else it slides, friction being at its bound. First what it
    # did in the last step.
    delta, N, bound, a = s.delta, s.N, s.F_max, s.a
    k = c.shear * a
    d_1, d_2 = s.d_1, s.d_2
    T_1 = T_2 = 0.0
    stick = True
    slid = s.stuck == 0.0 and a > 0.0
    if slid:
        delta, N, bound, a, d_1, d_2 = slide(delta, d_1, d_2, c, s, p, m, at)
        T_1, T_2 = bound * d_1, bound * d_2
        # How far it slid, times the contact's stiffness.
        stick = c.shear * a * way_slid(N, T_1, T_2, d_1, d_2, c) < bound
    if stick:
        # The contact's stiffness goes with its radius: one of the step before would be late, and drive a swinging tip.
        for _ in range(8):
            # What the load does to the tangential force comes back as compliance.
            c_1, c_2 = hold(c.w_n1, c.w_n2, k, c.w_11, c.w_12, c.w_22)
            T_1, T_2 = hold(c.e_1, c.e_2, k, c.w_11, c.w_12, c.w_22)
            w_n = c.w_nn - c.w_n1 * c_1 - c.w_n2 * c_2
            delta, N, bound, a = indent(s.delta, c.target - c.w_n1 * T_1 - c.w_n2 * T_2, w_n, 0.0, s, p, m, at)
            late, k = k, c.shear * a
            if abs(k - late) <= _SAME * late:
                break
        T_1 -= c_1 * N
        T_2 -= c_2 * N
        size = math.sqrt(T_1 * T_1 + T_2 * T_2)
        if size > bound:
            stick = False
            d_1, d_2 = T_1 / size, T_2 / size
            if not slid and a > 0.0:
                delta, N, bound, a, d_1, d_2 = slide(delta, d_1, d_2, c, s, p, m, at)
            T_1, T_2 = bound * d_1, bound * d_2
    return Contact(delta, N, bound, a, d_1, d_2), T_1, T_2, stick


@kernel
def _tried(
    b: Contact, found: bool, stick: bool, held: float, w_n: float, c: Apart, s: State, p: Constants, m: Block, at: int
) -> tuple[Contact, bool]:
    """One of Newton's steps in a lane, sticking or sliding, both from the same look at the contact; nothing if the
    solution is found already.
    """
    here = pressed(b.delta, s, p, m, at)
    way, N, bound, a, outcome = newton(b.delta, here, held, w_n, 0.0, s)
    along, under, bearing, size, d_1, d_2, ends = turned(b.delta, here, b.d_1, b.d_2, c, s, p)
    outcome = where(stick, outcome, ends)
    rare((outcome == FAR) & (not found), m)
    now = Contact(
        where(found, b.delta, b.delta + where(stick, way, along)),
        where(found, b.N, where(stick, N, under)),
        where(found, b.F_max, where(stick, bound, bearing)),
        where(found, b.a, where(stick, a, size)),
        where(found | stick, b.d_1, d_1),
        where(found | stick, b.d_2, d_2),
    )
    return now, found | (outcome == FOUND)


@kernel
def _in_lane(c: Apart, s: State, p: Constants, m: Block, at: int) -> _Balance:
    stick, k = s.stuck != 0.0, c.shear * s.a
    c_1, c_2 = hold(c.w_n1, c.w_n2, k, c.w_11, c.w_12, c.w_22)
    T_1, T_2 = hold(c.e_1, c.e_2, k, c.w_11, c.w_12, c.w_22)
    w_n, held = c.w_nn - c.w_n1 * c_1 - c.w_n2 * c_2, c.target - c.w_n1 * T_1 - c.w_n2 * T_2
    # A tip that was off the sample did neither.
    rare(not s.a > 0.0, m)
    # Written out: a loop in a loop over lanes would not become vectors.
    b, found = Contact(s.delta, 0.0, 0.0, 0.0, s.d_1, s.d_2), False
    b, found = _tried(b, found, stick, held, w_n, c, s, p, m, at)
    b, found = _tried(b, found, stick, held, w_n, c, s, p, m, at)
    rare(not found, m)
    T_1, T_2 = where(stick, T_1 - c_1 * b.N, b.F_max * b.d_1), where(stick, T_2 - c_2 * b.N, b.F_max * b.d_2)
    # What begins to slide or to stick, and a contact whose stiffness changes, needs more than this.
    back = c.shear * b.a * way_slid(b.N, T_1, T_2, b.d_1, b.d_2, c)
    rare(where(stick, math.sqrt(T_1 * T_1 + T_2 * T_2) > b.F_max, back < b.F_max), m)
    rare(stick & (not abs(c.shear * b.a - k) <= _SAME * k), m)
    return b, T_1, T_2, stick


balance = by_lane(_alone, _in_lane)
"""Solve for what the contact comes to at mid-step.

Parameters
----------
c : Apart
s, p : records of State and Constants
m, at : block of the instrument, where the table of the contact begins

Returns
-------
contact, T_1, T_2, stick : Contact, floats, bool
    With friction [N] along both tangents, and whether the tip sticks.
"""
