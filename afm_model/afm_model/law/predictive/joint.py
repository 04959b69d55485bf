"""Where the scanner is and how strong friction is, from positions and the lateral force, over a known surface.

The ratio of friction to its nominal bound is one number that hardly changes. It decides where the copy of the plant
goes, and what the copy misses tells of it: so position and speed along the motion and the ratio are three states of
one Kalman filter. Friction acts along the balance of forces b, drive less spring, whether the tip slips or rests: one
component tells its size. That is never more than the bound, and is the bound while the tip slips.
"""

import math
from typing import Any

from ...jit import kernel
from .copy_of_plant import run_copy
from .estimate import MEAN, VALUE
from .load import take_load
from .plant import look, nominal_bound

SS, SV, SR, VV, VR, RR, ACROSS = range(7)
"""Covariances of position and speed along the motion and of the ratio; variance of the position across it."""
_SURE = 3.0
"""Standard deviations beyond which a difference is not noise."""
_TELLS = 0.3
"""Smallest cosine between the motion and x at which the force along x tells friction."""


@kernel
def spread(moved: bool, nominal: float, p: Any, s: Any) -> None:
    """Carry the covariance through a control period in which the copy has moved, or has not."""
    c = s.joint
    if moved:
        ss, sv, sr, vv, vr, rr = c[SS], c[SV], c[SR], c[VV], c[VR], c[RR]
        a, b, d, e = p.free[0, 0], p.free[0, 1], p.free[1, 0], p.free[1, 1]
        g, h = -p.of_drive[0] * nominal, -p.of_drive[1] * nominal
        # Rows of the transition (a, b, g), (d, e, h), (0, 0, 1).
        s_s, s_v, s_r = a * ss + b * sv + g * sr, a * sv + b * vv + g * vr, a * sr + b * vr + g * rr
        v_s, v_v, v_r = d * ss + e * sv + h * sr, d * sv + e * vv + h * vr, d * sr + e * vr + h * rr
        c[SS] = s_s * a + s_v * b + s_r * g + p.left * p.left * p.of_drive[0] * p.of_drive[0]
        c[SV] = s_s * d + s_v * e + s_r * h + p.left * p.left * p.of_drive[0] * p.of_drive[1]
        c[VV] = v_s * d + v_v * e + v_r * h + p.left * p.left * p.of_drive[1] * p.of_drive[1]
        c[SR], c[VR] = s_r, v_r
    c[RR] += p.wander * p.wander


@kernel
def correct(gain_of: int, innovation: float, noise: float, s: Any) -> tuple[float, float, float]:
    """Kalman update by a measurement of position (SS) or ratio (RR): changes of position, speed and ratio."""
    c = s.joint
    if gain_of == SS:
        g_s, g_v, g_r = c[SS], c[SV], c[SR]
        total = c[SS] + noise * noise
    else:
        g_s, g_v, g_r = c[SR], c[VR], c[RR]
        total = c[RR] + noise * noise
    c[SS] -= g_s * g_s / total
    c[SV] -= g_s * g_v / total
    c[SR] -= g_s * g_r / total
    c[VV] -= g_v * g_v / total
    c[VR] -= g_v * g_r / total
    c[RR] -= g_r * g_r / total
    each = innovation / total
    return g_s * each, g_v * each, g_r * each


@kernel
def apply(change: tuple[float, float, float], t_x: float, t_y: float, s: Any) -> None:
    """Change position and speed along t, and the ratio."""
    s.X += change[0] * t_x
    s.Y += change[0] * t_y
    s.V_X += change[1] * t_x
    s.V_Y += change[1] * t_y
    s.ratio[VALUE] += change[2]
    s.ratio[MEAN] = s.ratio[VALUE]


@kernel
def correct_jointly(k: int, x: float, y_: float, y: Any, p: Any, s: Any) -> None:
    """Run the copy up to measurement k, and correct it and the ratio by the lateral force and the positions x, y_."""
    c = s.joint
    at_x, at_y = s.X, s.Y
    run_copy(k, y, p, s)
    moved = s.X != at_x or s.Y != at_y
    take_load(y, p, s)
    look(s.X, s.Y, p, s)
    nominal = nominal_bound(s.load, p, s)
    b_x = y.drive[0] / p.volts[0] - p.stiffness[0] * s.X
    b_y = y.drive[1] / p.volts[1] - p.stiffness[1] * s.Y
    balance = math.sqrt(b_x * b_x + b_y * b_y)
    t_x, t_y = (b_x / balance, b_y / balance) if balance > 0.0 else (1.0, 0.0)
    spread(moved, nominal, p, s)
    slips = s.V_X * t_x + s.V_Y * t_y > 0.0
    if abs(t_x) > _TELLS:
        innovation = y.lateral_force / p.lateral_force / (t_x * nominal) - s.ratio[VALUE]
        noise = p.ratio_noise / abs(t_x)
        if innovation > 0.0 or slips:
            fall = p.ripple * p.wave_number * (abs(s.v[0]) + abs(s.v[1])) * p.hold
            innovation = max(innovation, -fall)
            if innovation > _SURE * math.sqrt(c[RR] + noise * noise):
                c[RR] += innovation * innovation
            apply(correct(RR, innovation, noise, s), t_x, t_y, s)
    i_x, i_y = x - s.X, y_ - s.Y
    along, across = i_x * t_x + i_y * t_y, i_y * t_x - i_x * t_y
    still = s.V_X == 0.0 and s.V_Y == 0.0
    if not still or along * along > _SURE * _SURE * (c[SS] + p.position_noise * p.position_noise):
        apply(correct(SS, along, p.position_noise, s), t_x, t_y, s)
    else:
        change = correct(SS, along, p.position_noise, s)
        apply((change[0], 0.0, change[2]), t_x, t_y, s)
    gain = max(c[ACROSS] / (c[ACROSS] + p.position_noise * p.position_noise), p.L[0, 0])
    c[ACROSS] *= 1.0 - gain
    s.X -= gain * across * t_y
    s.Y += gain * across * t_x
    if s.V_X * t_x + s.V_Y * t_y <= 0.0:
        s.V_X, s.V_Y = 0.0, 0.0
        c[SV] = c[VV] = c[VR] = 0.0
