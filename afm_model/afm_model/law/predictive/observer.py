"""Where the scanner is: as measured, or estimated by a copy of the plant that positions correct."""

from typing import Any

from ...core.jit import routine
from .constants import KNOWN
from .copy_of_plant import run_copy
from .joint import correct_jointly
from .slide import correct_along
from .together import correct_together
from .uncertainty import begin_together


@routine
def observe(k: int, y: Any, p: Any, s: Any) -> None:
    """Put position and rate of the scanner at measurement k into the state."""
    x, y_, z = y.position[0] / p.x0, y.position[1] / p.x0, y.position[2] / p.z0
    if p.measured == 0 or s.started == 0.0:
        speed = p.x0 * p.w0
        s.X, s.Y, s.Z = x, y_, z
        s.V_X = y.velocity[0] / speed if p.measured == 0 else 0.0
        s.V_Y = y.velocity[1] / speed if p.measured == 0 else 0.0
        s.V_Z = y.velocity[2] / (p.z0 * p.w0) if p.measured == 0 else 0.0
        s.spread[0] = s.spread[3] = 1.0
        s.across = p.uncertain
        begin_together(p, s)
    else:
        s.X, s.Y, s.Z = s.estimate[0], s.estimate[1], s.estimate[2]
        s.V_X, s.V_Y, s.V_Z = s.estimate[3], s.estimate[4], s.estimate[5]
        if p.together != 0:
            correct_together(k, x, y_, y, p, s)
        elif p.surface != KNOWN and p.identified:
            correct_along(k, x, y_, y, p, s)
        elif p.identified:
            correct_jointly(k, x, y_, y, p, s)
        else:
            run_copy(k, y, p, s)
            i_x, i_y = x - s.X, y_ - s.Y
            s.X += p.L[0, 0] * i_x
            s.Y += p.L[1, 0] * i_y
            # What rests is set in motion by no noise.
            if s.V_X != 0.0 or s.V_Y != 0.0 or i_x * i_x + i_y * i_y > (3.0 * p.position_noise) ** 2:
                s.V_X += p.L[0, 1] * i_x
                s.V_Y += p.L[1, 1] * i_y
        i_z = z - s.Z
        s.Z += p.L[2, 0] * i_z
        s.V_Z += p.L[2, 1] * i_z
    s.estimate[0], s.estimate[1], s.estimate[2] = s.X, s.Y, s.Z
    s.estimate[3], s.estimate[4], s.estimate[5] = s.V_X, s.V_Y, s.V_Z
    s.last = k
