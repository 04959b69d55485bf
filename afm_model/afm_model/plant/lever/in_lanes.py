"""What lanes compute in place of what an instrument alone does: no loop, no branch, both ways of each choice.

That is why it is not one source with balance.py: alone, an instrument takes the one way that it needs, for half of the
operations, and as many of Newton's steps as it takes.
"""

import math

from ...compiled.jit import kernel
from ...compiled.records import Block
from ...compiled.ways import rare, where
from .constants import Constants
from .contact import pressed, pressed_last
from .indent import FAR, FOUND, newton, pulled
from .slide import Apart, ContactSolution, hold, turned, way_slid
from .state import State

Balance = tuple[ContactSolution, float, float, bool]
SAME = 1e-3
"""Relative change of the contact's stiffness below which it counts as the same."""


@kernel
def balance_in_lane(c: Apart, s: State, p: Constants, m: Block, at: int) -> Balance:
    """Make the same few steps in every lane, and mark those that they do not solve."""
    stick, k = s.stuck != 0.0, c.shear * s.a
    c_1, c_2 = hold(c.w_n1, c.w_n2, k, c.w_11, c.w_12, c.w_22)
    T_1, T_2 = hold(c.e_1, c.e_2, k, c.w_11, c.w_12, c.w_22)
    w_n, held = c.w_nn - c.w_n1 * c_1 - c.w_n2 * c_2, c.target - c.w_n1 * T_1 - c.w_n2 * T_2
    # A tip that was off the sample did neither.
    rare(not s.a > 0.0, m)
    # Written out: a loop in a loop over lanes would not become vectors. First without a look at the contact, as alone.
    here = pressed_last(s, m)
    way, _, _, _, outcome = newton(s.delta, here, held, w_n, 0.0, s)
    along, _, _, _, d_1, d_2, ends = turned(s.delta, here, s.d_1, s.d_2, c, s, p)
    rare(where(stick, outcome, ends) == FAR, m)
    x = s.delta + where(stick, way, along)
    here = pressed(x, s, p, m, at)
    way, N, bound, a, outcome = newton(x, here, held, w_n, 0.0, s)
    along, under, bearing, size, d_1, d_2, ends = turned(x, here, d_1, d_2, c, s, p)
    rare(where(stick, outcome, ends) != FOUND, m)
    b = ContactSolution(
        x + where(stick, way, along),
        where(stick, N, under),
        where(stick, bound, bearing),
        where(stick, a, size),
        where(stick, s.d_1, d_1),
        where(stick, s.d_2, d_2),
        here[1],
        here[3],
    )
    rare(stick & (not pulled(s.delta, b.delta - s.delta, held, w_n, 0.0, s)), m)
    T_1, T_2 = where(stick, T_1 - c_1 * b.N, b.F_max * b.d_1), where(stick, T_2 - c_2 * b.N, b.F_max * b.d_2)
    # What begins to slide or to stick, and a contact whose stiffness changes, needs more than this.
    back = c.shear * b.a * way_slid(b.N, T_1, T_2, b.d_1, b.d_2, c)
    rare(where(stick, math.sqrt(T_1 * T_1 + T_2 * T_2) > b.F_max, back < b.F_max), m)
    rare(stick & (not abs(c.shear * b.a - k) <= SAME * k), m)
    return b, T_1, T_2, stick
