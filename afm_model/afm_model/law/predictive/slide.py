"""Where the scanner is, from positions and the lateral force: friction is measured and not believed.

At the low speed of a reference friction turns the motion at once into the balance of forces b, drive less spring: the
scanner slips along b, and at rest friction is b. In both cases one component of friction tells the other, and the speed
along b changes by |b| - |F|, whether the tip slips or not. What is left is linear: a Kalman filter of position and
speed along b, in which the noise of the force is the only unknown acceleration.
"""

import math

from ...core.jit import kernel
from ...parts.signals import Measurement
from .nominal_plant import balance, look, nominal_bound, run_copy
from .predictive_constants import Constants
from .predictive_state import State
from .sample_estimate import MEAN, OF_VALUE

_SURE = 3.0
"""Standard deviations beyond which a difference is not noise."""
_TELLS = 0.3
"""Smallest cosine between the motion and x at which the force along x tells friction."""


@kernel
def spread_over_hold(noise: float, p: Constants, s: State) -> None:
    """Carry the covariance along the motion through a control period with an unknown acceleration of rms `noise`."""
    xx, xv, vv = s.spread[0], s.spread[1], s.spread[2]
    a, b, c, d = p.free[0, 0], p.free[0, 1], p.free[1, 0], p.free[1, 1]
    q = (noise / p.position_noise) ** 2
    s.spread[0] = a * a * xx + 2.0 * a * b * xv + b * b * vv + q * p.of_drive[0] * p.of_drive[0]
    s.spread[1] = a * c * xx + (a * d + b * c) * xv + b * d * vv + q * p.of_drive[0] * p.of_drive[1]
    s.spread[2] = c * c * xx + 2.0 * c * d * xv + d * d * vv + q * p.of_drive[1] * p.of_drive[1]


@kernel
def would_stop(k: int, force: float, believed: float, y: Measurement, p: Constants, s: State) -> bool:
    """Whether the friction believed in stops the scanner, and the force along x is then the balance there."""
    X, Y, Z, V_X, V_Y, V_Z = s.X, s.Y, s.Z, s.V_X, s.V_Y, s.V_Z
    s.bound = believed
    run_copy(k, y, p, s)
    held = balance(0, y.drive[0] / p.volts[0], s.X, p, s)
    at = p.stiffness[0] * p.position_noise
    doubt = _SURE * math.sqrt(p.force_noise * p.force_noise + at * at * s.spread[0])
    stops = s.V_X == 0.0 and s.V_Y == 0.0 and abs(held - force) <= doubt
    s.X, s.Y, s.Z, s.V_X, s.V_Y, s.V_Z = X, Y, Z, V_X, V_Y, V_Z
    return stops


@kernel
def correct_along(k: int, x: float, y_: float, y: Measurement, p: Constants, s: State) -> None:
    """Run the copy under the measured friction up to measurement k, and correct it by the positions x, y_."""
    ahead = max(k - s.last, 1) * p.hold
    b_x = balance(0, y.drive[0] / p.volts[0], s.X + ahead * s.V_X, p, s)
    b_y = balance(1, y.drive[1] / p.volts[1], s.Y + ahead * s.V_Y, p, s)
    size = math.sqrt(b_x * b_x + b_y * b_y)
    t_x, t_y = (b_x / size, b_y / size) if size > 0.0 else (1.0, 0.0)
    force = y.lateral_force / p.lateral_force
    look(s.X, s.Y, p, s)
    nominal = nominal_bound(s.load, p, s)
    believed = s.here * nominal
    if abs(t_x) > _TELLS:
        grip, noise = force / t_x, p.force_noise / abs(t_x)
    else:
        grip, noise = min(size, believed), p.force_noise / _TELLS
    # Less than friction is anywhere on the surface: the scanner rests.
    rests = grip < (s.ratio[MEAN] - 2.0 * p.ripple) * nominal - _SURE * noise
    stops = False
    if rests:
        s.bound = 2.0 * (size + believed)
        s.V_X, s.V_Y = 0.0, 0.0
        s.spread[1] = s.spread[2] = 0.0
    else:
        bound = 0.5 * (grip + s.grip) if s.grip > 0.0 else grip
        if believed - grip > _SURE * math.sqrt(p.f_0 * p.f_0 * s.ratio[OF_VALUE] + noise * noise):
            stops = would_stop(k, force, believed, y, p, s)
        s.bound = believed if stops else bound
        spread_over_hold(noise, p, s)
    s.grip = 0.0 if rests or stops else max(grip, 0.0)
    run_copy(k, y, p, s)
    s.bound = 0.0
    i_x, i_y = x - s.X, y_ - s.Y
    along, across = i_x * t_x + i_y * t_y, i_y * t_x - i_x * t_y
    xx, xv = s.spread[0], s.spread[1]
    gain, gain_rate = xx / (xx + 1.0), xv / (xx + 1.0)
    s.spread[0], s.spread[1], s.spread[2] = (1.0 - gain) * xx, (1.0 - gain) * xv, s.spread[2] - gain_rate * xv
    # Nothing moves it across but what turns b.
    gain_across = max(s.spread[3] / (s.spread[3] + 1.0), p.L[0, 0])
    s.spread[3] *= 1.0 - gain_across
    s.X += gain * along * t_x - gain_across * across * t_y
    s.Y += gain * along * t_y + gain_across * across * t_x
    s.V_X += gain_rate * along * t_x
    s.V_Y += gain_rate * along * t_y
    if s.V_X * t_x + s.V_Y * t_y <= 0.0:
        s.V_X, s.V_Y = 0.0, 0.0
