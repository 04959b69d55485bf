"""What is asked of the drive, interval by interval: the reference, friction along it, the height of the sample.

The reference beyond the measurement is continued as the sine, parabola or line that it has been.
"""

import math

from afm_model.parts import Measurement, hypot, kernel, routine, sincos

from .constants import Constants
from .nominal_plant import held_along_z, look, nominal_bound, steps, stretched
from .sample_estimate import REST
from .state import State

_FAR = 4.0
"""Distance from a moving reference at the start beyond which a tip is brought to it [x0]."""
_FORGET = 0.9
_SLOWEST = 1e-5
_TURNS = 0.1
"""Sine of the angle between rate and acceleration from which on a reference turns round a corner."""


@kernel
def start_softly(y: Measurement, p: Constants, s: State) -> None:
    """Bring a tip that is far from a moving reference at the start to it, no faster than the reference moves.

    Sent there at once it would leave the sample.
    """
    if s.started == 0.0:
        far_x, far_y = y.position[0] / p.x0 - s.p[0], y.position[1] / p.x0 - s.p[1]
        far = s.fastest > 0.0 and hypot(far_x, far_y) > _FAR
        s.lead[0], s.lead[1] = (far_x, far_y) if far else (0.0, 0.0)
    left, step = hypot(s.lead[0], s.lead[1]), s.fastest * p.hold
    if left > step:
        for axis in range(2):
            s.v[axis] -= s.lead[axis] / left * s.fastest
            s.lead[axis] *= 1.0 - step / left
            s.p[axis] += s.lead[axis]
    elif left > 0.0:
        s.lead[0] = s.lead[1] = 0.0
        s.from_x, s.from_y, s.reach = s.p[0], s.p[1], 0.0


@kernel
def take_reference(y: Measurement, p: Constants, s: State) -> None:
    """Take position, rate and acceleration from the measurement, and the frequency from how they have changed.

    For a sine about any mean the change of the acceleration is -omega^2 times that of the position; for a line and a
    parabola it is zero.
    """
    for axis in range(3):
        length = p.z0 if axis == 2 else p.x0
        s.p[axis] = y.reference_position[axis] / length
        s.v[axis] = y.reference_velocity[axis] / (length * p.w0)
        s.acc[axis] = y.reference_acceleration[axis] / (length * p.w0 * p.w0)
    s.fastest = max(s.fastest, math.sqrt(s.v[0] * s.v[0] + s.v[1] * s.v[1]))
    for axis in range(2):
        if s.started != 0.0:
            moved = s.p[axis] - s.p_last[axis]
            s.sum_pa[axis] = _FORGET * s.sum_pa[axis] + moved * (s.acc[axis] - s.acc_last[axis])
            s.sum_pp[axis] = _FORGET * s.sum_pp[axis] + moved * moved
        square = -s.sum_pa[axis] / s.sum_pp[axis] if s.sum_pp[axis] > 0.0 else 0.0
        s.omega[axis] = math.sqrt(max(square, _SLOWEST * _SLOWEST))
        s.p_last[axis] = s.p[axis]
        s.acc_last[axis] = s.acc[axis]
    start_softly(y, p, s)


@kernel
def continue_reference(axis: int, first: float, n: int, p: Constants, s: State) -> None:
    """Write the reference of x or y into the path: at n + 1 places, a fine interval apart, from time `first` on.

    Where its corners are known a line turns back there.
    """
    w = s.omega[axis]
    sin, cos = sincos(w * first)
    sin_step, cos_step = sincos(w * p.tau)
    a, b = s.v[axis] / w, s.acc[axis] / (w * w)
    for i in range(n + 1):
        s.path[i, axis, 0] = s.p[axis] + a * sin + b * (1.0 - cos)
        s.path[i, axis, 1] = w * (a * cos + b * sin)
        cos, sin = cos * cos_step - sin * sin_step, sin * cos_step + cos * sin_step
    if p.corner[axis] > 0.0:
        for i in range(n + 1):
            # Of the way from corner to corner and back.
            part = 0.25 * (s.path[i, axis, 0] / p.corner[axis] + 1.0)
            part -= math.floor(part)
            s.path[i, axis, 0] = p.corner[axis] * (1.0 - abs(4.0 * part - 2.0))
            if part > 0.5:
                s.path[i, axis, 1] = -s.path[i, axis, 1]
    if steps(p, s):
        period = p.slots * p.fine
        for i in range(0, n + 1, period):
            middle = s.path[min(i + period // 2, n), axis, 0]
            for j in range(i, min(i + period, n + 1)):
                s.path[j, axis, 0], s.path[j, axis, 1] = middle, 0.0


@kernel
def rate(i: int, axis: int, s: State) -> float:
    """Of the reference in the middle of a fine interval."""
    return 0.5 * (s.path[i, axis, 1] + s.path[i + 1, axis, 1])


@kernel
def ask_of(axis: int, i: int, held: float, p: Constants, s: State) -> None:
    """What fine interval i asks for: reference(i+1) - Phi reference(i) + Gamma times what the drive has to hold."""
    for k in range(2):
        s.asked[i, axis, k] = (
            s.path[i + 1, axis, k]
            - p.Phi[axis, k, 0] * s.path[i, axis, 0]
            - p.Phi[axis, k, 1] * s.path[i, axis, 1]
            + p.Gamma[axis, k] * held
        )


@kernel
def ask_of_z(at: int, n: int, e_x: float, e_y: float, p: Constants, s: State) -> None:
    """Height of the scanner that keeps the tip at its setpoint, and bound of friction if it does, over n intervals.

    From interval `at` on, where the tip is off the reference by an error that vanishes evenly until their end.
    """
    for i in range(at, at + n + 1):
        ahead = s.path_begins + i * p.tau
        left = 1.0 - (i - at) / n
        look(s.path[i, 0, 0] + left * e_x, s.path[i, 1, 0] + left * e_y, p, s)
        z_r = s.p[2] + ahead * (s.v[2] + 0.5 * ahead * s.acc[2])
        load = p.w + p.eta_c2 * (z_r - p.a)
        delta = p.delta + p.delta_curvature * s.curvature + p.delta_load * (load - p.load_0)
        s.path[i, 2, 0] = z_r + delta - s.height + s.approach
        s.friction[i] = s.here * nominal_bound(load, p, s)
    for i in range(at, at + n + 1):
        before, after = max(i - 1, at), min(i + 1, at + n)
        s.path[i, 2, 1] = (s.path[after, 2, 0] - s.path[before, 2, 0]) / ((after - before) * p.tau)
    for i in range(at, at + n):
        s.friction[i] = 0.5 * (s.friction[i] + s.friction[i + 1])
        z = 0.5 * (s.path[i, 2, 0] + s.path[i + 1, 2, 0])
        ask_of(2, i, held_along_z(s.p[2] - z, p) + s.slow[2] + s.softer[2] * stretched(2, z, s), p, s)


@kernel
def heads(i: int, v_x: float, v_y: float, s: State) -> tuple[float, float]:
    """Rate of the reference in fine interval i; where it nearly rests and turns, the way that it comes from or goes to.

    There friction does not turn with it: the drive would push a tip across that does not move.
    """
    v2, slow = v_x * v_x + v_y * v_y, REST * s.fastest
    if v2 >= slow * slow:
        return v_x, v_y
    a_x, a_y = s.path[i + 1, 0, 1] - s.path[i, 0, 1], s.path[i + 1, 1, 1] - s.path[i, 1, 1]
    if abs(a_x * v_y - a_y * v_x) <= _TURNS * math.sqrt(v2 * (a_x * a_x + a_y * a_y)):
        return v_x, v_y
    return (a_x, a_y) if a_x * v_x + a_y * v_y > 0.0 else (-a_x, -a_y)


@routine
def ask(first: float, n: int, p: Constants, s: State) -> None:
    """Write path, friction, direction and what is asked for n fine intervals from the time `first` on."""
    continue_reference(0, first, n, p, s)
    continue_reference(1, first, n, p, s)
    s.path_begins = first
    ask_of_z(0, n, 0.0, 0.0, p, s)
    for i in range(n):
        v_x, v_y = heads(i, rate(i, 0, s), rate(i, 1, s), s)
        # A drive that is held cannot turn with friction inside its slot: there the scanner rests for a moment.
        middle = i - i % p.fine + p.fine // 2
        m_x, m_y = heads(middle, s.path[middle, 0, 1], s.path[middle, 1, 1], s)
        if v_x * m_x + v_y * m_y <= 0.0:
            v_x, v_y = m_x, m_y
        speed = math.sqrt(v_x * v_x + v_y * v_y)
        scale = 1.0 / speed if speed > 0.0 else 0.0
        s.direction[i, 0], s.direction[i, 1] = scale * v_x, scale * v_y
        for axis in range(2):
            q = 0.5 * (s.path[i, axis, 0] + s.path[i + 1, axis, 0])
            held = (
                s.gain_of[axis] * s.friction[i] * s.direction[i, axis]
                + s.slow[axis]
                + s.softer[axis] * stretched(axis, q, s)
            )
            ask_of(axis, i, held, p, s)
