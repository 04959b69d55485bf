"""The reference beyond the measurement: continued as the sine, parabola or line that it has been."""

import math
from typing import Any

from ...core.jit import kernel

_FORGET = 0.9
_SLOWEST = 1e-5


@kernel
def take_reference(y: Any, p: Any, s: Any) -> None:
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


@kernel
def continue_reference(axis: int, first: float, n: int, p: Any, s: Any) -> None:
    """Write the reference of x or y into the path: at n + 1 places, a fine interval apart, from time `first` on."""
    w = s.omega[axis]
    cos, sin = math.cos(w * first), math.sin(w * first)
    cos_step, sin_step = math.cos(w * p.tau), math.sin(w * p.tau)
    a, b = s.v[axis] / w, s.acc[axis] / (w * w)
    for i in range(n + 1):
        s.path[i, axis, 0] = s.p[axis] + a * sin + b * (1.0 - cos)
        s.path[i, axis, 1] = w * (a * cos + b * sin)
        cos, sin = cos * cos_step - sin * sin_step, sin * cos_step + cos * sin_step
