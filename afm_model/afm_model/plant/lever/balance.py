"""Whether the tip of the plant `lever` sticks or slides, and the forces with it; docs/lever.md (16) to (23).

One instrument alone tries what it did in the last step, then the other, each for as many of Newton's steps as it
takes. In lanes all make the same few steps of the same kernels; what they do not solve, the routine of one alone does.
"""

import math

from ...compiled.jit import kernel, routine
from ...compiled.records import Block
from ...compiled.ways import by_lane
from .constants import Constants
from .contact import Pressed, pressed_last, reach
from .in_lanes import SAME, Balance, balance_in_lane
from .indent import FAR, indent, is_off, newton, off
from .slide import Apart, ContactSolution, hold, slide, way_slid
from .state import State, ledger_of


@routine
def _begin_to_slide(
    delta: float, here: Pressed, d_1: float, d_2: float, c: Apart, s: State, p: Constants, m: Block, at: int
) -> ContactSolution:
    return slide(delta, here, d_1, d_2, c, s, p, m, at)


@kernel
def _alone(c: Apart, s: State, p: Constants, m: Block, at: int) -> Balance:
    # The tip holds on if friction can take what that needs; else it slides, friction being at its bound. First what it
    # did in the last step.
    if s.a == 0.0 and s.delta <= s.end and p.viscosity == 0.0 and (p.bridge == 0.0 or ledger_of(m).bridge == 0.0):
        # Off the sample, and to remain there.
        bare, force = reach(s, p, m, at)
        if is_off(c.target, c.w_nn, bare, force, s):
            # Near the root, without a division.
            start = c.target - c.w_nn * s.N
            start -= c.w_nn * ledger_of(m).stiffness * (start - s.delta)
            x, N, _, _, stiffness, _ = off(start, bare, c.target, c.w_nn, s)
            return ContactSolution(x, N, 0.0, 0.0, s.d_1, s.d_2, stiffness, 0.0), 0.0, 0.0, True
    found = ContactSolution(s.delta, s.N, s.F_max, s.a, s.d_1, s.d_2, 0.0, 0.0)
    T_1 = T_2 = 0.0
    stick = True
    slid = s.stuck == 0.0 and s.a > 0.0
    if slid:
        found = slide(s.delta, pressed_last(s, m), s.d_1, s.d_2, c, s, p, m, at)
        T_1, T_2 = found.F_max * found.d_1, found.F_max * found.d_2
        # How far it slid, times the contact's stiffness.
        stick = c.shear * found.a * way_slid(found.N, T_1, T_2, found.d_1, found.d_2, c) < found.F_max
    if stick:
        d_1, d_2 = found.d_1, found.d_2
        # From the last step's place, or that of sliding.
        x, here = s.delta, pressed_last(s, m)
        k = c.shear * s.a
        if slid and p.viscosity == 0.0:
            k = c.shear * found.a
        delta = N = bound = a = stiffness = growth = 0.0
        # The contact's stiffness goes with its radius: one of the step before would be late, and drive a swinging tip.
        for _ in range(8):
            # What the load does to the tangential force comes back as compliance.
            c_1, c_2 = hold(c.w_n1, c.w_n2, k, c.w_11, c.w_12, c.w_22)
            T_1, T_2 = hold(c.e_1, c.e_2, k, c.w_11, c.w_12, c.w_22)
            w_n = c.w_nn - c.w_n1 * c_1 - c.w_n2 * c_2
            held = c.target - c.w_n1 * T_1 - c.w_n2 * T_2
            # A step without a look at the contact: as a rule the next one is the last.
            step, _, _, _, outcome = newton(x, here, held, w_n, 0.0, s)
            start = x if outcome == FAR else x + step
            delta, N, bound, a, stiffness, growth = indent(s.delta, start, held, w_n, 0.0, s, p, m, at)
            x, here = delta, (N, stiffness, bound, growth, a)
            late, k = k, c.shear * a
            if abs(k - late) <= SAME * late:
                break
        T_1 -= c_1 * N
        T_2 -= c_2 * N
        found = ContactSolution(delta, N, bound, a, d_1, d_2, stiffness, growth)
        size = math.sqrt(T_1 * T_1 + T_2 * T_2)
        if size > bound:
            stick = False
            d_1, d_2 = T_1 / size, T_2 / size
            found = ContactSolution(delta, N, bound, a, d_1, d_2, stiffness, growth)
            if not slid and a > 0.0:
                found = _begin_to_slide(delta, here, d_1, d_2, c, s, p, m, at)
            T_1, T_2 = found.F_max * found.d_1, found.F_max * found.d_2
    return found, T_1, T_2, stick


balance = by_lane(_alone, balance_in_lane)
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
