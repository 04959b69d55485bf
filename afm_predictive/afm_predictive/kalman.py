"""The Kalman filter of positions alone, one measurement at a time. Its states and their transition: observer.py.

Height is measured as well as a position, and over a surface that was given, or on the map of the line, its slope is
known: on a steep slope the place is seen far better so than by the sensor of x or y, docs/predictive.md (8.12). Without
it a copy whose friction rises and falls with the surface as it lies at the wrong place runs away from the tip.
"""

import math

from afm_model.parts import Block, kernel, square

from .constants import AT_X, AT_Y, LEARNED, Constants
from .nominal_plant import NEAR_BY, look
from .sample_estimate import measured_height, place_variance
from .state import State

SURE = 5.0
"""Standard deviations beyond which a difference is not noise, in none of a million measurements."""
NIS = 0.05
"""Weight of one measurement in a mean normalised innovation squared, which is one where the model is right:
Y. Bar-Shalom, X. R. Li, T. Kirubarajan, *Estimation with Applications to Tracking and Navigation*, Wiley (2001), 5.4.
"""
DOUBTS = 1.5
"""Value of it from which on the model is trusted less."""


@kernel
def carry_covariance(P: Block, F: Block, half: Block) -> None:
    """Replace the covariance P (n, n) by F P F^T; `half` (n, n) is overwritten."""
    size = len(P)
    for i in range(size):
        for j in range(size):
            half[i, j] = 0.0
            for k in range(size):
                half[i, j] += F[i, k] * P[k, j]
    for i in range(size):
        for j in range(size):
            P[i, j] = 0.0
            for k in range(size):
                P[i, j] += half[i, k] * F[j, k]


@kernel
def weigh(noise: float, s: State) -> float:
    """Variance of a measurement of the states by the row `s.weights`; their covariances with it go to `s.gains`."""
    variance = noise
    for i in range(5):
        s.gains[i] = 0.0
        for j in range(5):
            s.gains[i] += s.P[i, j] * s.weights[j]
    for i in range(5):
        variance += s.weights[i] * s.gains[i]
    return variance


@kernel
def correct(innovation: float, variance: float, s: State) -> None:
    """Correct by the measurement last weighed, which differs by `innovation` from the copy as corrected so far."""
    for i in range(5):
        s.change[i] += s.gains[i] * innovation / variance
        for j in range(5):
            s.P[i, j] -= s.gains[i] * s.gains[j] / variance


@kernel
def take(i: int, off: float, noise: float, s: State) -> None:
    """Correct by a measurement of state i that differs from the copy by `off`, with the variance `noise`."""
    s.weights[:] = 0.0
    s.weights[i] = 1.0
    correct(off - s.change[i], weigh(noise, s), s)


@kernel
def along_variance(t_x: float, t_y: float, s: State) -> float:
    """Of the position along t."""
    P = s.P
    return t_x * t_x * P[AT_X, AT_X] + 2.0 * t_x * t_y * P[AT_X, AT_Y] + t_y * t_y * P[AT_Y, AT_Y]


@kernel
def slopes_of_map(x: float, y: float, p: Constants, s: State) -> float:
    """Write the slope of the map at (x, y) into the row; variance of a height read there. The place has been looked at.

    The map knows nothing across its line, where the surface may be as steep as any. Along the line it was written at
    places that were known no better than this one.
    """
    height = s.height
    look(x + NEAR_BY * s.line_tx, y + NEAR_BY * s.line_ty, p, s)
    slope = (s.height - height) / NEAR_BY
    look(x, y, p, s)
    s.weights[AT_X], s.weights[AT_Y] = slope * s.line_tx, slope * s.line_ty
    across = square(p.height * p.wave_number) * along_variance(-s.line_ty, s.line_tx, s)
    return square(slope) * along_variance(s.line_tx, s.line_ty, s) + across


@kernel
def take_height_seen(z: float, p: Constants, s: State) -> None:
    """Correct by the height of the sample with the scanner at the measured z, after positions and force.

    In packets a map shows no place: there the tip goes too far between two measurements.
    """
    single = p.slots == 1
    if s.unknown != 0 and not (single and p.surface == LEARNED):
        s.nis_of_height = 1.0
        return
    x, y = s.X + s.change[AT_X], s.Y + s.change[AT_Y]
    look(x, y, p, s)
    innovation = measured_height(z, p, s) + p.delta_curvature * s.curvature - s.height
    s.weights[:] = 0.0
    noise = square(p.height_noise) + square(p.z_noise)
    if s.unknown == 0:
        s.weights[AT_X], s.weights[AT_Y] = s.slope_x, s.slope_y
        # What it has been off the measured height may be an error of the given surface.
        noise += s.contradicts * square(p.height)
    elif s.mapped_H > 0.0:
        noise += slopes_of_map(x, y, p, s)
    else:
        return
    if single:
        # Heights that positions contradict are measured wrong.
        noise *= 1.0 + max(s.nis - DOUBTS, 0.0)
    # And by how much the surface bends within what the place is uncertain by.
    noise += square(p.height * square(p.wave_number) * place_variance(s))
    variance = weigh(noise, s)
    sure = innovation * innovation <= SURE * SURE * variance
    if not sure and not single:
        return
    if single:
        s.nis_of_height += NIS * (min(innovation * innovation / variance, SURE * SURE) - s.nis_of_height)
    if not sure:
        innovation = math.copysign(SURE * math.sqrt(variance), innovation)
    correct(innovation, variance, s)
