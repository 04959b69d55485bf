"""Reference waveforms: sine and triangle start at zero, a constant is there at once."""

import math

from .jit import kernel

SINE, TRIANGLE, CONSTANT = range(3)
SHAPES = {"sine": SINE, "triangle": TRIANGLE, "constant": CONSTANT}


@kernel
def waveform(shape: int, amplitude: float, omega: float, t: float) -> tuple[float, float, float]:
    """Position, velocity and acceleration of a reference at time t.

    Parameters
    ----------
    shape : SINE, TRIANGLE or CONSTANT
    amplitude : float [m]
    omega : float [rad/s]
    t : float [s]

    Returns
    -------
    (position, velocity, acceleration) : floats [m], [m/s], [m/s^2]
        The acceleration of the triangle is given as 0; at its corners it does not exist.
    """
    if shape == CONSTANT:
        return amplitude, 0.0, 0.0
    phase = omega * t
    sine = math.sin(phase)
    if shape == SINE:
        return amplitude * sine, amplitude * omega * math.cos(phase), -amplitude * omega * omega * sine
    slope = amplitude * omega * 2.0 / math.pi
    return amplitude * 2.0 / math.pi * math.asin(sine), slope if math.cos(phase) >= 0.0 else -slope, 0.0
