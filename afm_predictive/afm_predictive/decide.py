"""The drive of one slot; docs/predictive.md."""

import math

from afm_model.parts import kernel, routine

from .asked import ask_of_z
from .constants import Constants
from .nominal_plant import bound_at, friction_turns_drive
from .state import State

_MOST = 0.2
"""Largest turn of the direction of friction: the more the drive points across the line the farther friction that is
lower than believed lets it throw the tip across."""
_BESIDE = 0.5
"""Part of the predicted error of x and y: z is asked for at that distance from the reference. With all of the error the
loop does not tolerate a drive that comes a period late."""

_STUCK = 0.1
"""Error in radians of the shortest wave from which on a tip is freed that rests and lags the reference."""
_SLOW = 0.1
"""Way in a time unit over the error up to which a tip counts as resting, or soon to, next to a reference that rests.

In packets a part of that: the next drive follows soon.
"""
_NEAR = 30.0
"""Radians of the shortest wave up to which positions alone know the way to a reference that rests."""


@kernel
def drive(axis: int, at: int, e: float, e_rate: float, p: Constants, s: State) -> float:
    """Least squares drive of one axis from interval `at` on, error e at its beginning."""
    # Two sums: none waits for the other.
    u, u_rate = -p.K[axis, 0] * e, -p.K[axis, 1] * e_rate
    for j in range(p.horizon):
        u += p.G[axis, j, 0] * s.asked[at + j, axis, 0]
        u_rate += p.G[axis, j, 1] * s.asked[at + j, axis, 1]
    return u + u_rate


@routine
def decide(at: int, slot: int, p: Constants, s: State) -> None:
    """Write the drive of a slot that begins with the fine interval `at` into the plan, from the predicted state."""
    e_x, e_y = s.X - s.path[at, 0, 0], s.Y - s.path[at, 1, 0]
    # In radians of the shortest wave.
    far = math.sqrt(e_x * e_x + e_y * e_y) * p.wave_number
    if p.back > 0:
        # The tip rides on the sample where it is. Were z asked for along the reference the load would change with the
        # error, and friction with it: a spring that pushes away, stronger than the gain of a slow loop.
        beside = _BESIDE / max(far, 1.0)
        ask_of_z(at, p.back, beside * e_x, beside * e_y, p, s)
    e_z, e_zrate = s.Z - s.path[at, 2, 0], s.V_Z - s.path[at, 2, 1]
    u_z = drive(2, at, e_z, e_zrate, p, s)
    # Friction in the slot opposes the motion towards the line as well: the direction of the reference, turned.
    end = at + p.fine
    r_x, r_y = s.path[end, 0, 0] - s.path[at, 0, 0], s.path[end, 1, 0] - s.path[at, 1, 0]
    way = math.sqrt(r_x * r_x + r_y * r_y)
    n_x, n_y = (-r_y / way, r_x / way) if way > 0.0 else (0.0, 0.0)
    off = e_x * n_x + e_y * n_y
    if p.measured != 0 and off != 0.0:
        # Of an estimated error only what exceeds its own uncertainty turns the direction.
        off *= max(0.0, 1.0 - s.across / (off * off))
        # The way must be longer than that as well.
        off *= way * way / (way * way + s.across)
    nu = min(max(-p.turn * off / way, -_MOST), _MOST) if way > 0.0 else 0.0
    changed_x, changed_y = 0.0, 0.0
    for j in range(p.fine):
        # The load follows the error along z, which the held drive leaves.
        before = e_z
        e_z, e_zrate = (
            p.Phi[2, 0, 0] * e_z + p.Phi[2, 0, 1] * e_zrate + p.Gamma[2, 0] * u_z - s.asked[at + j, 2, 0],
            p.Phi[2, 1, 0] * e_z + p.Phi[2, 1, 1] * e_zrate + p.Gamma[2, 1] * u_z - s.asked[at + j, 2, 1],
        )
        f = s.friction[at + j] * (1.0 + p.f_load * p.eta_c2 * 0.5 * (before + e_z))
        d_x, d_y = s.direction[at + j, 0] + nu * n_x, s.direction[at + j, 1] + nu * n_y
        size = math.sqrt(d_x * d_x + d_y * d_y)
        if size > 0.0:
            change = s.gain_of[0] * (f * d_x / size - s.friction[at + j] * s.direction[at + j, 0])
            changed_x += change * (p.G[0, j, 0] * p.Gamma[0, 0] + p.G[0, j, 1] * p.Gamma[0, 1])
            change = s.gain_of[1] * (f * d_y / size - s.friction[at + j] * s.direction[at + j, 1])
            changed_y += change * (p.G[1, j, 0] * p.Gamma[1, 0] + p.G[1, j, 1] * p.Gamma[1, 1])
    turns = friction_turns_drive(0, p, s)
    if far > p.taken and (p.measured != 0 or turns):
        # Taken back by no more than that in a response: the tip would be thrown beyond, or leave the sample.
        e_x, e_y = e_x * p.taken / far, e_y * p.taken / far
    s.plan[slot, 0] = drive(0, at, e_x, s.V_X - s.path[at, 0, 1], p, s) + changed_x
    s.plan[slot, 1] = drive(1, at, e_y, s.V_Y - s.path[at, 1, 1], p, s) + changed_y
    s.plan[slot, 2] = u_z
    if p.frees == 0 or far <= _STUCK:
        return
    if way == 0.0:
        size = math.sqrt(e_x * e_x + e_y * e_y)
        slow = math.sqrt(s.V_X * s.V_X + s.V_Y * s.V_Y) * p.slots < _SLOW * size
        if slow and turns and (p.measured == 0 or far < _NEAR):
            # Towards a reference that rests no friction was asked for.
            f = bound_at(s.X, s.Y, s.Z, p, s)
            s.plan[slot, 0] -= s.gain_of[0] * f * e_x / size
            s.plan[slot, 1] -= s.gain_of[1] * f * e_y / size
    elif s.V_X == 0.0 and s.V_Y == 0.0 and -(e_x * r_x + e_y * r_y) > way * way:
        # A tip that rests behind the reference is held by friction where it is, not by that of the reference. A surface
        # makes no more of a difference.
        more = max(bound_at(s.X, s.Y, s.Z, p, s) - s.friction[at], 0.0)
        more = min(more, 2.0 * p.ripple * s.friction[at]) / way
        s.plan[slot, 0] += s.gain_of[0] * more * r_x
        s.plan[slot, 1] += s.gain_of[1] * more * r_y
