"""Where the scanner is and how strong friction is, from positions and the lateral force, over a known surface.

The ratio of friction to its nominal bound is one number that hardly changes. It decides where the copy of the plant
goes, and what the copy misses tells of it: so position and speed along the motion and the ratio are three states of
one Kalman filter. Friction acts along the balance of forces b, drive less spring, whether the tip slips or rests: one
component tells its size. That is never more than the bound, and is the bound while the tip slips.
"""

import math
from typing import Any

from ...jit import kernel, routine
from .constants import ANSWERS
from .copy_of_plant import run_copy
from .estimate import MEAN, VALUE
from .load import take_load
from .plant import look, nominal_bound

SS, SV, SR, VV, VR, RR, ACROSS, ALONG_X, ALONG_Y, CALM = range(10)
"""Covariances of position and speed along the motion and of the ratio; variance of the position across it; direction
of the motion; forces in succession that were as expected."""
UNKNOWN = 0.25
"""Standard deviation of the ratio at the start."""
_ENOUGH = 5.0
"""Forces in succession as expected after which one that is not is let pass."""
_SURE = 5.0
"""Standard deviations beyond which a difference is not noise, in none of a million measurements."""
_TELLS = 0.3
"""Smallest cosine between the motion and x at which the force along x tells friction."""


@kernel
def turn_to(t_x: float, t_y: float, s: Any) -> None:
    """Take the covariances along and across another direction. Position and speed that turn back change their sign."""
    c = s.joint
    cos = c[ALONG_X] * t_x + c[ALONG_Y] * t_y
    along, across, square = c[SS], c[ACROSS], cos * cos
    c[SS], c[ACROSS] = square * along + (1.0 - square) * across, square * across + (1.0 - square) * along
    c[SV] *= abs(cos)
    c[SR] *= cos
    c[VR] *= 1.0 if cos >= 0.0 else -1.0
    c[ALONG_X], c[ALONG_Y] = t_x, t_y


@kernel
def spread(moved: bool, nominal: float, p: Any, s: Any) -> None:
    """Carry the covariance through a control period in which the copy has moved, or has not."""
    c = s.joint
    if moved:
        ss, sv, sr, vv, vr, rr = c[SS], c[SV], c[SR], c[VV], c[VR], c[RR]
        a, b, d, e = p.free[0, 0], p.free[0, 1], p.free[1, 0], p.free[1, 1]
        g, h = -p.of_drive[0] * nominal, -p.of_drive[1] * nominal
        # Rows of the transition: (a, b, g), (d, e, h), (0, 0, 1).
        s_s, s_v, s_r = a * ss + b * sv + g * sr, a * sv + b * vv + g * vr, a * sr + b * vr + g * rr
        v_s, v_v, v_r = d * ss + e * sv + h * sr, d * sv + e * vv + h * vr, d * sr + e * vr + h * rr
        q_s, q_v = p.uneven * g, p.uneven * h
        c[SS], c[SV], c[SR] = s_s * a + s_v * b + s_r * g + q_s * q_s, s_s * d + s_v * e + s_r * h + q_s * q_v, s_r
        c[VV], c[VR] = v_s * d + v_v * e + v_r * h + q_v * q_v, v_r
    c[RR] += p.wander * p.wander
    rest(s)


@kernel
def rest(s: Any) -> None:
    """What rests has no speed that is uncertain."""
    if s.V_X == 0.0 and s.V_Y == 0.0:
        s.joint[SV] = s.joint[VV] = s.joint[VR] = 0.0


@kernel
def doubt(miss: float, p: Any, s: Any) -> None:
    """A position that is missed by more than noise: neither it nor the speed nor the ratio was known."""
    c = s.joint
    c[SS] += miss * miss
    c[ACROSS] += miss * miss
    speed = min(abs(miss) / p.hold, s.fastest)
    c[SV] += abs(miss) * speed
    c[VV] += speed * speed
    wrong = min(abs(miss) / (p.of_drive[0] * p.f_0), UNKNOWN)
    c[RR] += wrong * wrong


@kernel
def correct(gain_of: int, innovation: float, noise: float, s: Any) -> tuple[float, float, float]:
    """Kalman update by a measurement of position (SS) or ratio (RR): changes of position, speed and ratio.

    `noise` is its variance.
    """
    c = s.joint
    if gain_of == SS:
        g_s, g_v, g_r = c[SS], c[SV], c[SR]
        total = c[SS] + noise
    else:
        g_s, g_v, g_r = c[SR], c[VR], c[RR]
        total = c[RR] + noise
    c[SS] -= g_s * g_s / total
    c[SV] -= g_s * g_v / total
    c[SR] -= g_s * g_r / total
    c[VV] -= g_v * g_v / total
    c[VR] -= g_v * g_r / total
    c[RR] -= g_r * g_r / total
    each = innovation / total
    return g_s * each, g_v * each, g_r * each


@kernel
def apply(change: tuple[float, float, float], s: Any) -> None:
    """Change position and speed along the motion, and the ratio."""
    t_x, t_y = s.joint[ALONG_X], s.joint[ALONG_Y]
    s.X += change[0] * t_x
    s.Y += change[0] * t_y
    s.V_X += change[1] * t_x
    s.V_Y += change[1] * t_y
    s.ratio[VALUE] += change[2]
    s.ratio[MEAN] = s.ratio[VALUE]


@kernel
def noise_of_ratio(t_x: float, t_y: float, balance: float, went: float, p: Any, s: Any) -> float:
    """Variance of the ratio that is seen in the lateral force, the tip having gone with the mean speed `went`."""
    c = s.joint
    phase = p.wave_number * (abs(t_x) + abs(t_y))
    # Where the tip runs fast, its load is not that at rest.
    fast = min(s.V_X * t_x + s.V_Y * t_y, went)
    swing = p.f_load * p.height * phase * phase * fast * fast
    # A position that is wrong is on another slope of the surface, and turns the balance.
    slope = p.ripple * phase
    turned = t_y / t_x * max(p.stiffness[0], p.stiffness[1]) / balance
    return (p.ratio_noise / t_x) ** 2 + swing * swing + (slope * slope + turned * turned) * (c[SS] + c[ACROSS])


@kernel
def take_ratio_seen(seen: float, noise: float, missed: float, p: Any, s: Any) -> None:
    """Correct by the ratio that is seen in the lateral force, with the variance `noise`.

    It is never more than that of the bound. Less tells something while the tip slips only. As that is estimated, the
    ratio falls no faster than the steepest slope of the surface lets it, or by what explains that the tip went further
    than the copy by `missed`: then it slips.
    """
    c = s.joint
    t_x, t_y = c[ALONG_X], c[ALONG_Y]
    fall = 0.0
    if s.V_X * t_x + s.V_Y * t_y > 0.0:
        steepest = p.ripple * p.wave_number * (abs(s.v[0]) + abs(s.v[1]))
        fall = steepest * p.hold
    if missed > 0.0:
        fall = max(fall, missed / (p.of_drive[0] * p.f_0))
    innovation = seen - s.ratio[VALUE]
    if innovation < 0.0 and fall == 0.0:
        return
    if innovation * innovation > _SURE * _SURE * (c[RR] + noise):
        calm = c[CALM]
        c[CALM] = 0.0
        if calm >= _ENOUGH:
            # Once may be the contact, which rings for a moment.
            return
        wrong = innovation if innovation > 0.0 else min(-innovation, fall)
        c[RR] += wrong * wrong
    else:
        c[CALM] += 1.0
    change = correct(RR, innovation, noise, s)
    part = min(1.0, -fall / change[2]) if change[2] < 0.0 else 1.0
    apply((part * change[0], part * change[1], part * change[2]), s)


@routine
def correct_jointly(k: int, x: float, y_: float, y: Any, p: Any, s: Any) -> None:
    """Run the copy up to measurement k, and correct it and the ratio by the lateral force and the positions x, y_."""
    c = s.joint
    from_x, from_y = s.X, s.Y
    run_copy(k, y, p, s)
    moved = s.X != from_x or s.Y != from_y
    take_load(y, p, s)
    look(s.X, s.Y, p, s)
    nominal = nominal_bound(s.load, p, s)
    b_x = y.drive[0] / p.volts[0] - p.stiffness[0] * s.X
    b_y = y.drive[1] / p.volts[1] - p.stiffness[1] * s.Y
    balance = math.sqrt(b_x * b_x + b_y * b_y)
    if balance > 0.0:
        turn_to(b_x / balance, b_y / balance, s)
    t_x, t_y = c[ALONG_X], c[ALONG_Y]
    periods = max(k - s.last, 1)
    for _ in range(min(periods, ANSWERS)):
        spread(moved, nominal, p, s)
    noise = p.position_noise * p.position_noise
    along = (x - s.X) * t_x + (y_ - s.Y) * t_y
    missed = along if along * along > _SURE * _SURE * (c[SS] + noise) else 0.0
    if missed != 0.0:
        doubt(missed, p, s)
    if balance > 0.0 and abs(t_x) > _TELLS:
        went = math.sqrt((x - from_x) ** 2 + (y_ - from_y) ** 2) / (periods * p.hold)
        seen = y.lateral_force / (p.lateral_force * t_x * nominal)
        take_ratio_seen(seen, noise_of_ratio(t_x, t_y, balance, went, p, s), missed, p, s)
    i_x, i_y = x - s.X, y_ - s.Y
    across = i_y * t_x - i_x * t_y
    apply(correct(SS, i_x * t_x + i_y * t_y, noise, s), s)
    # Nothing moves it across but what turns b.
    gain = max(c[ACROSS] / (c[ACROSS] + noise), p.L[0, 0])
    c[ACROSS] *= 1.0 - gain
    s.X -= gain * across * t_y
    s.Y += gain * across * t_x
    if s.V_X * t_x + s.V_Y * t_y <= 0.0:
        s.V_X, s.V_Y = 0.0, 0.0
    rest(s)
