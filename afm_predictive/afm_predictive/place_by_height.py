"""Find the place of the tip from the height of the sample under it, with positions alone, docs/predictive.md (8.12).

Of a surface that was given, or of the map of the line, the slope is known. On a slope the heights of two places differ,
and height is measured as well as a position: on a steep one a place is seen far better so than by the sensor of x or y.
Without it a copy whose friction rises and falls with the surface as it lies at the wrong place runs away from the tip.
"""

import math

from afm_model.parts import kernel, square

from .constants import AT_X, AT_Y, LEARNED, Constants
from .kalman import DOUBTS, NIS, SURE, along_variance, correct, weigh
from .nominal_plant import NEAR_BY, look
from .sample_estimate import measured_height, place_variance
from .state import State


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
        # What it has been off the measured height may be so in what was told.
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
