"""law.kind pid: what users of a microscope have, PID on the position sensors; docs/laws.md (3.1).

Tuned by the SIMC rules: Skogestad, DOI 10.1016/S0959-1524(02)00062-8.
"""

from typing import Literal, NamedTuple

import numpy as np
from pydantic import Field

from ..compiled.jit import kernel
from ..compiled.records import Vector
from ..core.elementary import square
from ..core.schema import Positive
from ..parts.part import Law, Numbers, Tree
from ..parts.signals import Measurement, PiezoDrive
from . import sampled
from .sampled import SampledConstants, SampledLaw, SampledState
from .scanner import feed_forward, follow_flight, free_axes, position, reference_at, send


class PidLaw(SampledLaw):
    """PID with anti-windup and a notch on the resonance where the loop is slower than it, tuned by rule."""

    kind: str = Field("pid", description="control law")
    slowness: Positive = Field(
        1.0,
        description="closed-loop time constant over the effective delay, tau_c / theta of SIMC; 1: its tight tuning",
    )
    feedforward: bool = Field(True, description="feed the drive of the free scanner forward along x and y")
    z: Literal["tracking", "pid"] = Field(
        "tracking", description="along z: the loop that all sampled laws share, or a PID on the deflection"
    )


class Gains(NamedTuple):
    """PI behind a filter (b_0 + b_1 / z + b_2 / z^2) / (1 + a_1 / z + a_2 / z^2), of one axis."""

    gain: float  # [w0^2]
    integral: float  # added to the sum in each period, over the error [w0^2]
    reset: float  # control period over the integral time
    b_0: float
    b_1: float
    b_2: float
    a_1: float
    a_2: float


class Constants(SampledConstants):
    feedforward: float
    pid_z: float
    gain: Vector
    integral: Vector
    reset: Vector
    b_0: Vector
    b_1: Vector
    b_2: Vector
    a_1: Vector
    a_2: Vector


class State(SampledState):
    integrated: Vector
    one: Vector
    two: Vector


def tustin(b: list[float], a: list[float], hold: float) -> tuple[float, ...]:
    """b_0, b_1, b_2, a_1, a_2 of b(s) / a(s), coefficients of (s^2, s, 1), by s = (2 / hold) (z - 1) / (z + 1)."""
    bases = [np.polymul([1.0, -1.0], [1.0, -1.0]), np.array([1.0, 0.0, -1.0]), np.polymul([1.0, 1.0], [1.0, 1.0])]
    scales = [square(2.0 / hold), 2.0 / hold, 1.0]
    weights = np.array([scale * base for scale, base in zip(scales, bases, strict=True)])
    above, below = (sum(each * row for each, row in zip(of, weights, strict=True)) for of in (b, a))
    numbers = np.concatenate([above, below[1:]]) / below[0]
    return tuple(float(number) for number in numbers)


def simc(eta: float, xi: float, hold: float, delay: float, slowness: float = 1.0, slowest: float = 0.0) -> Gains:
    """Gains of one axis by the SIMC rules, docs/laws.md (3.1) to (3.3).

    Parameters
    ----------
    eta, xi : float
        Resonance [w0] and damping ratio.
    hold, delay : float [1/w0]
        Control period and delay of the drive.
    slowness : float
        tau_c / theta.
    slowest : float [1/w0]
        tau_c + theta is at least this.
    """
    # The derivative's filter, half a hold and the delay act on the loop as one delay.
    smoothing = 0.5 * hold
    closed = max((1.0 + slowness) * (0.5 * hold + delay + smoothing), slowest)
    if closed * eta < 1.0:
        # Faster than the resonance the scanner is a mass, 1 / s^2.
        integral_time = derivative_time = 4.0 * closed
        gain = 1.0 / (4.0 * square(closed))
        coefficients = tustin([0.0, derivative_time, 1.0], [0.0, smoothing, 1.0], hold)
    else:
        # Slower than it, a notch makes two lags 1 / eta of it; the derivative cancels one of them.
        lag = 1.0 / eta
        integral_time = min(lag, 4.0 * closed)
        gain = eta * eta * lag / closed
        below = np.polymul([smoothing, 1.0], [1.0, eta])
        coefficients = tustin([lag, 2.0 * xi, eta], [float(c) for c in below], hold)
    return Gains(gain, gain * hold / integral_time, hold / integral_time, *coefficients)


def _values(parameters: Tree) -> Numbers:
    law = parameters.law
    values = sampled.sampled_values(parameters)
    # Along z, what is faster than the cantilever's resonance is the contact ringing.
    slowest = (0.0, 0.0, 1.0 / values["eta_c"])
    axes = [
        simc(axis.eta, axis.xi, axis.hold, values["ahead"], law.slowness, least)
        for axis, least in zip(free_axes(parameters), slowest, strict=True)
    ]
    gains = {name: [getattr(axis, name) for axis in axes] for name in Gains._fields}
    chosen = {"feedforward": law.feedforward, "pid_z": law.z == "pid"}
    return values | chosen | gains


@kernel
def answer_error(e: float, forward: float, u: PiezoDrive, p: Constants, s: State, axis: int) -> None:
    """Write the drive of one axis for error e, reference minus measured, and a drive fed forward."""
    filtered = p.b_0[axis] * e + s.one[axis]
    s.one[axis] = p.b_1[axis] * e - p.a_1[axis] * filtered + s.two[axis]
    s.two[axis] = p.b_2[axis] * e - p.a_2[axis] * filtered
    s.integrated[axis] += p.integral[axis] * filtered
    wanted = forward + p.gain[axis] * filtered + s.integrated[axis]
    sent = send(u, p, s, axis, wanted)
    # Anti-windup: what the range of the piezo has cut off leaves the sum with the integral time.
    s.integrated[axis] += p.reset[axis] * (sent - wanted)


@kernel
def control(t: float, y: Measurement, u: PiezoDrive, p: Constants, s: State) -> None:
    """See `afm_model.parts.Law`."""
    follow_flight(y, p, s)
    for axis in range(2):
        now, _ = reference_at(y, p, axis, 0.0)
        forward = feed_forward(y, p, axis) if p.feedforward != 0.0 else 0.0
        answer_error(now - position(y, p, axis), forward, u, p, s, axis)
    if p.pid_z == 0.0:
        sampled.control_height(y, u, p, s)
    else:
        if s.started == 0.0:
            s.integrated[2] = y.drive[2] / p.volts[2]
        e = y.reference_position[2] / p.length[2] - p.a - y.deflection / p.length[2]
        answer_error(e, 0.0, u, p, s, 2)
    s.started = 1.0


PID = Law(
    name="pid",
    parameters=PidLaw,
    constants=Constants,
    state=State,
    values=_values,
    control=control,
    knowledge="positions of the scanner, deflection; scanner, cantilever",
)
