"""Where the scanner is and how strong friction is, from positions and the lateral force, over a known surface.

The ratio of friction to its nominal bound is one number that hardly changes. It decides where the copy of the plant
goes, and what the copy misses tells of it: so position and speed along the motion, the position across it and the
ratio are the states of one Kalman filter. Friction acts along the balance of forces b, drive less spring, whether the
tip slips or rests: one component tells its size. That is never more than the bound, and is the bound while the tip
slips.
"""

import math
from typing import TYPE_CHECKING

from ...core.jit import kernel, routine
from ...parts.signals import Measurement
from .kalman import carry_covariance, correct, weigh
from .nominal_plant import balance, look, nominal_bound, run_copy, take_load
from .predictive_constants import ANSWERS, Constants
from .sample_estimate import MEAN, VALUE

if TYPE_CHECKING:
    from .predictive_state import State

ALONG, SPEED, ACROSS, RATIO = range(4)
"""States of the filter: position and speed along the motion, position across it, ratio."""
UNKNOWN = 0.25
"""Standard deviation of the ratio at the start."""
_ENOUGH = 5.0
"""Forces in succession as expected after which one that is not is let pass."""
_SURE = 5.0
"""Standard deviations beyond which a difference is not noise, in none of a million measurements."""
_TELLS = 0.3
"""Smallest cosine between the motion and x at which the force along x tells friction."""
_NEAR = 0.01
"""Step of the derivatives of the nominal bound [x0]."""


@kernel
def turn_to(t_x: float, t_y: float, s: "State") -> None:
    """Take the covariance along and across another direction. A speed is one along the motion."""
    cos = s.heading[0] * t_x + s.heading[1] * t_y
    sin = s.heading[0] * t_y - s.heading[1] * t_x
    s.carried[:] = 0.0
    s.carried[ALONG, ALONG], s.carried[ALONG, ACROSS] = cos, sin
    s.carried[ACROSS, ALONG], s.carried[ACROSS, ACROSS] = -sin, cos
    s.carried[SPEED, SPEED], s.carried[RATIO, RATIO] = cos, 1.0
    carry_covariance(s.joint, s.carried, s.half)
    s.heading[0], s.heading[1] = t_x, t_y


@kernel
def rest(s: "State") -> None:
    """What rests has no speed that is uncertain."""
    if s.V_X == 0.0 and s.V_Y == 0.0:
        for i in range(4):
            s.joint[SPEED, i] = s.joint[i, SPEED] = 0.0


@kernel
def spread(moved: bool, nominal: float, p: Constants, s: "State") -> None:
    """Carry the covariance through a control period in which the copy has moved, or has not."""
    if moved:
        s.carried[:] = 0.0
        for i in range(2):
            s.carried[i, ALONG], s.carried[i, SPEED] = p.free[i, 0], p.free[i, 1]
            s.carried[i, RATIO] = -p.of_drive[i] * nominal
        s.carried[ACROSS, ACROSS] = s.carried[RATIO, RATIO] = 1.0
        carry_covariance(s.joint, s.carried, s.half)
        for i in range(2):
            for j in range(2):
                s.joint[i, j] += p.uneven * p.uneven * s.carried[i, RATIO] * s.carried[j, RATIO]
        s.joint[ACROSS, ACROSS] += p.astray * p.astray
    s.joint[RATIO, RATIO] += p.wander * p.wander
    rest(s)


@kernel
def explains(miss: float, p: Constants) -> float:
    """Error of the ratio that displaces the slipping tip by `miss` in a control period."""
    return min(miss / (p.of_drive[0] * p.f_0), UNKNOWN)


@kernel
def doubt(miss: float, p: Constants, s: "State") -> None:
    """A position that is missed by more than noise: neither it nor the speed nor the ratio was known."""
    speed = min(abs(miss) / p.hold, s.fastest)
    wrong = explains(abs(miss), p)
    s.joint[ALONG, ALONG] += miss * miss
    s.joint[ALONG, SPEED] += abs(miss) * speed
    s.joint[SPEED, ALONG] += abs(miss) * speed
    s.joint[SPEED, SPEED] += speed * speed
    s.joint[ACROSS, ACROSS] += miss * miss
    s.joint[RATIO, RATIO] += wrong * wrong


@kernel
def correct_scanner(innovation: float, total: float, s: "State") -> None:
    """Correct scanner, ratio and covariance by the measurement last weighed; `total`: variance of its innovation."""
    s.change[:] = 0.0
    correct(s.joint, s.change, s.gains, innovation, total)
    t_x, t_y = s.heading[0], s.heading[1]
    s.X += s.change[ALONG] * t_x - s.change[ACROSS] * t_y
    s.Y += s.change[ALONG] * t_y + s.change[ACROSS] * t_x
    s.V_X += s.change[SPEED] * t_x
    s.V_Y += s.change[SPEED] * t_y
    s.ratio[VALUE] += s.change[RATIO]
    s.ratio[MEAN] = s.ratio[VALUE]


@kernel
def take_position(state: int, innovation: float, p: Constants, s: "State") -> None:
    """Correct by a position along or across the motion."""
    s.weights[:] = 0.0
    s.weights[state] = 1.0
    total = weigh(s.joint, s.weights, s.gains) + p.position_noise * p.position_noise
    correct_scanner(innovation, total, s)


@kernel
def see_ratio(nominal: float, size: float, p: Constants, s: "State") -> None:
    """Write the row of the ratio seen in the lateral force: it also tells of the place.

    At another place the surface has another bound, and the balance of forces another direction.
    """
    t_x, t_y = s.heading[0], s.heading[1]
    look(s.X + _NEAR, s.Y, p, s)
    slope_x = (nominal_bound(s.load, p, s) / nominal - 1.0) / _NEAR
    look(s.X, s.Y + _NEAR, p, s)
    slope_y = (nominal_bound(s.load, p, s) / nominal - 1.0) / _NEAR
    k_x, k_y = p.stiffness[0] / size, p.stiffness[1] / size
    ratio = s.ratio[VALUE]
    s.weights[ALONG] = ratio * (slope_x * t_x + slope_y * t_y - t_y * t_y * (k_x - k_y))
    s.weights[SPEED] = 0.0
    s.weights[ACROSS] = ratio * (slope_y * t_x - slope_x * t_y + t_y / t_x * (k_y * t_x * t_x + k_x * t_y * t_y))
    s.weights[RATIO] = 1.0


@kernel
def take_ratio_seen(seen: float, noise: float, missed: float, p: Constants, s: "State") -> None:
    """Correct by the ratio that is seen in the lateral force, with the variance `noise`, by the row `s.weights`.

    It is never more than that of the bound. Less tells something while the tip slips only. As that is estimated, the
    ratio falls no faster than the steepest slope of the surface lets it, or by what explains that the tip went further
    than the copy by `missed`: then it slips.
    """
    fall = 0.0
    if s.V_X * s.heading[0] + s.V_Y * s.heading[1] > 0.0:
        steepest = p.ripple * p.wave_number * (abs(s.v[0]) + abs(s.v[1]))
        fall = steepest * p.hold
    if missed > 0.0:
        fall = max(fall, explains(missed, p))
    innovation = seen - s.ratio[VALUE]
    if innovation < 0.0 and fall == 0.0:
        return
    total = weigh(s.joint, s.weights, s.gains) + noise
    if innovation * innovation > _SURE * _SURE * total:
        calm = s.calm
        s.calm = 0.0
        if calm >= _ENOUGH:
            # Once may be the contact, which rings for a moment.
            return
        wrong = innovation if innovation > 0.0 else min(-innovation, fall)
        s.joint[RATIO, RATIO] += wrong * wrong
        total = weigh(s.joint, s.weights, s.gains) + noise
    else:
        s.calm += 1.0
    if s.gains[RATIO] / total * innovation < -fall:
        innovation = -fall * total / s.gains[RATIO]
    correct_scanner(innovation, total, s)


@routine
def correct_jointly(k: int, x: float, y_: float, y: Measurement, p: Constants, s: "State") -> None:
    """Run the copy up to measurement k, and correct it and the ratio by the lateral force and the positions x, y_."""
    from_x, from_y = s.X, s.Y
    run_copy(k, y, p, s)
    moved = s.X != from_x or s.Y != from_y
    take_load(y, p, s)
    look(s.X, s.Y, p, s)
    nominal = nominal_bound(s.load, p, s)
    b_x = balance(0, y.drive[0] / p.volts[0], s.X, p, s)
    b_y = balance(1, y.drive[1] / p.volts[1], s.Y, p, s)
    size = math.sqrt(b_x * b_x + b_y * b_y)
    if size > 0.0:
        turn_to(b_x / size, b_y / size, s)
    t_x, t_y = s.heading[0], s.heading[1]
    periods = max(k - s.last, 1)
    for _ in range(min(periods, ANSWERS)):
        spread(moved, nominal, p, s)
    along = (x - s.X) * t_x + (y_ - s.Y) * t_y
    noise = p.position_noise * p.position_noise
    missed = along if along * along > _SURE * _SURE * (s.joint[ALONG, ALONG] + noise) else 0.0
    if missed != 0.0:
        doubt(missed, p, s)
    if size > 0.0 and abs(t_x) > _TELLS:
        see_ratio(nominal, size, p, s)
        # Where the tip runs fast, its load is not that at rest.
        went = math.sqrt((x - from_x) ** 2 + (y_ - from_y) ** 2) / (periods * p.hold)
        phase = p.wave_number * (abs(t_x) + abs(t_y)) * min(s.V_X * t_x + s.V_Y * t_y, went)
        swing = p.f_load * p.height * phase * phase
        seen = y.lateral_force / (p.lateral_force * t_x * nominal)
        take_ratio_seen(seen, (p.ratio_noise / t_x) ** 2 + swing * swing, missed, p, s)
    take_position(ALONG, (x - s.X) * t_x + (y_ - s.Y) * t_y, p, s)
    take_position(ACROSS, (y_ - s.Y) * t_x - (x - s.X) * t_y, p, s)
    if s.V_X * t_x + s.V_Y * t_y <= 0.0:
        s.V_X, s.V_Y = 0.0, 0.0
    rest(s)
