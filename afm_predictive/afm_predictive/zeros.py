"""The zeros of the drive, docs/predictive.md: what piezo and position sensors differ by at the start.

A tip that rests is held by spring, friction and load alone. What the drive leaves over is what the piezo differs by
from the position sensors, or these from it.
"""

from afm_model.parts import Measurement, hypot, kernel

from .constants import FIRST_Z, KNOWN, Constants
from .nominal_plant import (
    drive_in_force,
    held_along_z,
    left_at_rest,
    look_at_known,
)
from .state import State

_SLOW = 0.003
"""Deviation of a slow force at the start, over the bound of friction."""
_FAR = 5.0
"""And by which a drive has to be, to have another zero."""
_ALIKE = 0.1
"""Part of friction by which signal and drive may disagree about it at the start."""
_RESTS = 0.1
"""Way of a tip in a control period up to which it rests at the start [x0]."""


@kernel
def find_zeros_at_start(y: Measurement, p: Constants, s: State) -> None:
    """Take what is left over at the start for the zero of the drive, if the tip rests.

    Either the tip has been set down, and friction holds nothing; or signal and drive show the same friction of x, which
    lies along the reference. Along z the load is measured.
    """
    moves = hypot(y.velocity[0], y.velocity[1]) / (p.x0 * p.w0) * p.hold
    if s.fallbacks > 0.0 or (p.measured == 0 and moves > _RESTS):
        return
    least, least_z = _SLOW * p.f_0, FIRST_Z[1]
    if p.measured != 0:
        least += _FAR * hypot(p.stiffness[0] * p.position_noise, p.force_noise)
        least_z += _FAR * p.stiffness[2] * p.z_noise
    signal = y.lateral_force / p.lateral_force
    off_x = left_at_rest(0, drive_in_force(0, y, p, s), y.position[0] / p.x0, p, s)
    off_y = left_at_rest(1, drive_in_force(1, y, p, s), y.position[1] / p.x0, p, s)
    if abs(signal - off_x) < least + _ALIKE * abs(off_x):
        off_y -= off_x * s.v[1] / s.v[0] if s.v[0] != 0.0 else 0.0
        off_x = 0.0
    z, tip = y.position[2] / p.z0, p.a + y.deflection / p.z0
    off_z = left_at_rest(2, drive_in_force(2, y, p, s), z, p, s) - held_along_z(tip - z, p)
    s.zero_of_drive[0] = off_x if abs(off_x) > least else 0.0
    s.zero_of_drive[1] = off_y if abs(off_y) > least else 0.0
    s.zero_of_drive[2] = off_z if abs(off_z) > least_z else 0.0
    for axis in range(3):
        # Along z the cantilever is a part of the spring, and a sensor that is off tells a wrong load as well.
        spring = p.stiffness[axis] - (p.of_both * p.eta_c2 if axis == 2 else 0.0)
        s.unstretched[axis] = -s.zero_of_drive[axis] / spring
    if p.surface == KNOWN:
        # Where the sample lies tells which of the two is off.
        look_at_known(y.position[0] / p.x0, y.position[1] / p.x0, p, s)
        off = tip - z + p.delta + p.delta_curvature * s.curvature - s.height
        s.zero_of_height = -s.unstretched[2] if abs(off + s.unstretched[2]) < abs(off) else 0.0
