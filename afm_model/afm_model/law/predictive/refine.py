"""The drive of a long hold, improved on the motion that it leads to: docs/laws.md, section 8, "Long holds"."""

import math
from typing import Any

from ...core.jit import kernel, routine
from .decide import decide
from .plant import move

_TRIALS = 10
"""Drives that are tried beside the one of least squares."""
_GOLDEN = 0.5 * (math.sqrt(5.0) - 1.0)


@kernel
def follow_hold(at: int, u_x: float, u_y: float, u_z: float, p: Any, s: Any) -> float:
    """Move the scanner on by a hold from interval `at` on; sum of the squared errors at the ends of its intervals."""
    left = 0.0
    for i in range(at, at + p.fine):
        # One step an interval is enough to compare drives.
        move(u_x, u_y, u_z, p.tau, 1, p, s)
        e_x, e_y = s.X - s.path[i + 1, 0, 0], s.Y - s.path[i + 1, 1, 0]
        left += e_x * e_x + e_y * e_y
    return left


@routine
def left_by(u_x: float, u_y: float, slot: int, p: Any, s: Any) -> float:
    """Sum of the squared errors in the hold of a slot with this drive, and in the next one with that of least squares.

    The scanner is where it was when this returns.
    """
    X, Y, Z, V_X, V_Y, V_Z = s.X, s.Y, s.Z, s.V_X, s.V_Y, s.V_Z
    left = follow_hold(0, u_x, u_y, s.plan[slot, 2], p, s)
    decide(p.fine, slot + 1, p, s)
    left += follow_hold(p.fine, s.plan[slot + 1, 0], s.plan[slot + 1, 1], s.plan[slot + 1, 2], p, s)
    s.X, s.Y, s.Z, s.V_X, s.V_Y, s.V_Z = X, Y, Z, V_X, V_Y, V_Z
    return left


@routine
def refine(slot: int, p: Any, s: Any) -> None:
    """Improve the drive of a slot that begins with the first fine interval, along the reference.

    By golden section, within what friction changes from the lowest to the highest place of the surface. The drive of
    least squares stays if none is better.
    """
    middle = p.fine // 2
    v_x, v_y = s.path[middle, 0, 1], s.path[middle, 1, 1]
    speed = math.sqrt(v_x * v_x + v_y * v_y)
    if speed == 0.0:
        return
    t_x, t_y = v_x / speed, v_y / speed
    u_x, u_y = s.plan[slot, 0], s.plan[slot, 1]
    best, least = 0.0, left_by(u_x, u_y, slot, p, s)
    high = 2.0 * p.ripple * s.friction[middle]
    low = -high
    a, b = high - _GOLDEN * (high - low), low + _GOLDEN * (high - low)
    of_a = left_by(u_x + a * t_x, u_y + a * t_y, slot, p, s)
    of_b = left_by(u_x + b * t_x, u_y + b * t_y, slot, p, s)
    for _ in range(_TRIALS - 2):
        if of_a < of_b:
            high, b, of_b = b, a, of_a
            a = high - _GOLDEN * (high - low)
            of_a = left_by(u_x + a * t_x, u_y + a * t_y, slot, p, s)
        else:
            low, a, of_a = a, b, of_b
            b = low + _GOLDEN * (high - low)
            of_b = left_by(u_x + b * t_x, u_y + b * t_y, slot, p, s)
    if min(of_a, of_b) < least:
        best = a if of_a < of_b else b
    s.plan[slot, 0] = u_x + best * t_x
    s.plan[slot, 1] = u_y + best * t_y
