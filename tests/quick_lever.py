"""A microscope that is quickly told what to do, and a wedge for it: what tests of verbs share, with and without ROS."""

import math

from afm_model.microscope.verbs import CalibrateLateral

LEVER = {
    "plant.kind": "lever",
    "plant.scanner": "flexure_90um",
    "plant.gap": 20e-9,
    "plant.control_period": 100e-6,
    "piezo.limit": 50.0,
    "detector.sample_period": 10e-6,
    "sample.kind": "patches",
    "sample.width": 10e-9,
    "onboard.kind": "pi",
    "onboard.setpoint_force": 10e-9,
    "onboard.integral_gain": 10e-6,
}
_ARM = 12.5e-6 / 225e-6
PRESSED = 10e-9 / 0.2 * (math.cos(0.2) - 2.0 * _ARM * math.sin(0.2)) / 10e-9
"""Deflection at the setpoint [V]: a vertical force on a tip below a cantilever that is tilted by 0.2 rad."""
INSTRUMENT = LEVER | {"reference.kind": "verbs"}
LAW = {"law.kind": "pid", "law.period": 100e-6}
KNOWN = {f"scanner.f_{axis}": f for axis, f in (("x", 500.0), ("y", 500.0), ("z", 5e3))} | {
    f"scanner.xi_{axis}": 0.025 for axis in "xyz"
}
"""What a controller outside the simulator must be told of the scanner."""

_ANGLE, _STEP, _TOP = math.radians(25.0), 60e-9, 100e-9
_RUN = _STEP / math.tan(_ANGLE)
_PITCH = 2.0 * _RUN + 200e-9
_MIDDLE = 0.5 * (_PITCH - _TOP - _RUN)
WEDGE = {"kind": "grating", "angle": _ANGLE, "step": _STEP, "top": _TOP, "pitch": _PITCH, "edge_radius": 12e-9}
"""Parameters `sample.*` without their prefix."""
OVER_THE_WEDGE = CalibrateLateral(
    slope_from=_MIDDLE - 0.25 * _RUN,
    slope_to=_MIDDLE + 0.25 * _RUN,
    flat_from=-15e-9,
    flat_to=15e-9,
    slope_angle=_ANGLE,
    setpoint_to=30e-9,
    setpoints=3,
    line_rate=4.0,
)
