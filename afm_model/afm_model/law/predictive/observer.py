"""Where the scanner is: as measured, or estimated by a copy of the plant that positions correct."""

from typing import Any

from ...jit import kernel, routine
from .constants import ANSWERS
from .plant import predict


@kernel
def run_copy(k: int, y: Any, p: Any, s: Any) -> None:
    """Move the copy of the plant from the last measurement to measurement k, under the drives that were in force."""
    kept = max(y.drive_sequence, 0) % ANSWERS
    known = y.drive_sequence >= 0 and s.answered[kept] == y.drive_sequence
    for ahead in range(min(max(k - s.last, 1), ANSWERS)):
        for j in range(p.slots):
            x, y_, z = y.drive[0] / p.volts[0], y.drive[1] / p.volts[1], y.drive[2] / p.volts[2]
            if known:
                at = max(0, min((s.last + ahead - y.drive_sequence) * p.slots + j, p.delay + p.count - 1))
                x, y_, z = s.sent[kept, at, 0], s.sent[kept, at, 1], s.sent[kept, at, 2]
            predict(x, y_, z, p, s)


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
    else:
        s.X, s.Y, s.Z = s.estimate[0], s.estimate[1], s.estimate[2]
        s.V_X, s.V_Y, s.V_Z = s.estimate[3], s.estimate[4], s.estimate[5]
        run_copy(k, y, p, s)
        i_x, i_y, i_z = x - s.X, y_ - s.Y, z - s.Z
        s.X += p.L[0, 0] * i_x
        s.Y += p.L[1, 0] * i_y
        # What rests is set in motion by no noise.
        if s.V_X != 0.0 or s.V_Y != 0.0 or i_x * i_x + i_y * i_y > (3.0 * p.position_noise) ** 2:
            s.V_X += p.L[0, 1] * i_x
            s.V_Y += p.L[1, 1] * i_y
        s.Z += p.L[2, 0] * i_z
        s.V_Z += p.L[2, 1] * i_z
    s.estimate[0], s.estimate[1], s.estimate[2] = s.X, s.Y, s.Z
    s.estimate[3], s.estimate[4], s.estimate[5] = s.V_X, s.V_Y, s.V_Z
    s.last = k
