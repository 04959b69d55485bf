"""law.kind pid: what users of a microscope have, PID on the position sensors; docs/laws.md (3.1), docs/tuning.md.

Tuned by the SIMC rules: Skogestad, DOI 10.1016/S0959-1524(02)00062-8. An axis with gains of one's own has those.
"""

import math
from typing import Annotated, Any, Literal, NamedTuple

import numpy as np
from annotated_types import Ge, Le
from pydantic import Field

from ..compiled.jit import kernel, plain
from ..compiled.records import Vector
from ..core.elementary import square
from ..core.schema import NonNegative, Positive, Unit
from ..parts.part import Law, Numbers, Tree
from ..parts.signals import Measurement, PiezoDrive
from . import sampled
from .sampled import SampledConstants, SampledLaw, SampledState
from .scanner import feed_forward, follow_flight, free_axes, position, reference_at, send

_Proportional = Annotated[NonNegative, Unit("V/m")]
_Integral = Annotated[NonNegative, Unit("V/(m s)")]
_Derivative = Annotated[NonNegative, Unit("V s/m")]
_OF_Z = "the same along z, on the deflection; needs law.z = pid"


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
    kp_x: _Proportional = Field(
        0.0, description="proportional gain along x; an axis whose three gains are 0 is tuned by rule (law.slowness)"
    )
    kp_y: _Proportional = Field(0.0, description="the same along y")
    kp_z: _Proportional = Field(0.0, description=_OF_Z)
    ki_x: _Integral = Field(0.0, description="integral gain along x")
    ki_y: _Integral = Field(0.0, description="the same along y")
    ki_z: _Integral = Field(0.0, description=_OF_Z)
    kd_x: _Derivative = Field(0.0, description="derivative gain along x")
    kd_y: _Derivative = Field(0.0, description="the same along y")
    kd_z: _Derivative = Field(0.0, description=_OF_Z)
    derivative_time: Annotated[NonNegative, Unit("s")] = Field(
        0.0, description="time constant of the low-pass filter of the derivative, for gains of one's own; 0: no filter"
    )
    proportional_weight: Annotated[float, Ge(0.0), Le(1.0)] = Field(
        1.0, description="weight of the reference in the proportional part, for gains of one's own"
    )
    derivative_weight: Annotated[float, Ge(0.0), Le(1.0)] = Field(
        1.0, description="weight of the reference in the derivative part, for gains of one's own"
    )
    drive_limit: Annotated[NonNegative, Unit("V")] = Field(0.0, description="largest drive of each axis; 0: no limit")
    integral_limit: Annotated[NonNegative, Unit("V")] = Field(
        0.0, description="largest integral part of each axis; 0: no limit"
    )
    tracking_time: Annotated[NonNegative, Unit("s")] = Field(
        0.0,
        description="time constant by which the integral part follows a drive that was cut off, at least law.period; "
        "0: sqrt(kd / ki), without kd kp / ki; by rule the integral time",
    )


class Gains(NamedTuple):
    """PI after a filter (b_0 + b_1 / z + b_2 / z^2) / (1 + a_1 / z + a_2 / z^2), of one axis."""

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
    own: Vector  # 1.0: gains of one's own
    gain: Vector
    integral: Vector
    reset: Vector
    b_0: Vector
    b_1: Vector
    b_2: Vector
    a_1: Vector
    a_2: Vector
    derivative: Vector  # [1/w0]
    kept: float  # of the filtered derivative in each period
    fresh: Annotated[float, "w0"]  # share of a new difference in it
    proportional_weight: float
    derivative_weight: float
    most: Vector  # of the integral part [U]


class State(SampledState):
    started: float
    integrated: Vector
    one: Vector
    two: Vector
    filtered: Vector  # error after the filter of the rule
    slope: Vector  # filtered derivative of the weighted error
    reference: Vector  # of the last measurement, as `measured` and `forward`
    measured: Vector
    forward: Vector  # drive of the free scanner [U], fed forward or not


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
    gains: dict[str, Any] = {name: [getattr(axis, name) for axis in axes] for name in Gains._fields}
    own, derivative, w0, period = [0.0, 0.0, 0.0], [0.0, 0.0, 0.0], values["w0"], law.period
    for i, (kp, ki, kd) in enumerate(_given(law)):
        if kp or ki or kd:
            # By default the time constant of control_toolbox.
            time = law.tracking_time or (math.sqrt(kd / ki) if kd and ki else kp / ki if ki else 0.0)
            unit = values["length"][i] / values["volts"][i]
            own[i], gains["gain"][i], gains["integral"][i] = 1.0, kp * unit, ki * unit * period
            gains["reset"][i] = period / max(time, period) if ki else 0.0
            derivative[i] = kd * unit * w0
        elif law.tracking_time:
            gains["reset"][i] = period / max(law.tracking_time, period)
    filtering = w0 * (law.derivative_time + period)
    chosen = {
        "feedforward": law.feedforward,
        "pid_z": law.z == "pid",
        "own": own,
        "derivative": derivative,
        "kept": w0 * law.derivative_time / filtering,
        "fresh": 1.0 / filtering,
        "most": [law.integral_limit / volts if law.integral_limit else math.inf for volts in values["volts"]],
    }
    if law.drive_limit:
        pairs = zip(values["limit"], values["volts"], strict=True)
        chosen["limit"] = [min(limit, law.drive_limit / volts) for limit, volts in pairs]
    return values | chosen | gains


def _given(law: PidLaw) -> list[tuple[float, float, float]]:
    """Gains kp, ki, kd of each axis as they are given."""
    x, y, z = (law.kp_x, law.ki_x, law.kd_x), (law.kp_y, law.ki_y, law.kd_y), (law.kp_z, law.ki_z, law.kd_z)
    return [x, y, z]


def _check(parameters: Tree) -> None:
    law = parameters.law
    for name in ("kp_z", "ki_z", "kd_z"):
        if law.z != "pid" and getattr(law, name):
            raise ValueError(
                f"law.{name} = {getattr(law, name):g} is not allowed with law.z = {law.z}, which has no gains: "
                f"set law.z = pid"
            )


@kernel
def rest_filter(p: Constants, s: State, axis: int, e: float) -> float:
    """Put the filter of the rule to rest at a constant error; returns what it makes of it."""
    filtered = e * (p.b_0[axis] + p.b_1[axis] + p.b_2[axis]) / (1.0 + p.a_1[axis] + p.a_2[axis])
    s.two[axis] = p.b_2[axis] * e - p.a_2[axis] * filtered
    s.one[axis] = filtered - p.b_0[axis] * e
    return filtered


@kernel
def differentiate(r: float, m: float, p: Constants, s: State, axis: int) -> None:
    """Bring the filtered derivative of one axis up to a reference r and a measured m."""
    if s.started == 0.0:
        s.reference[axis], s.measured[axis] = r, m
    change = p.derivative_weight * (r - s.reference[axis]) - (m - s.measured[axis])
    s.slope[axis] = p.kept * s.slope[axis] + p.fresh * change
    s.reference[axis], s.measured[axis] = r, m


@kernel
def answer_error(
    r: float, m: float, forward: float, y: Measurement, u: PiezoDrive, p: Constants, s: State, axis: int
) -> None:
    """Write the drive of one axis for reference r, measured m and a drive of the free scanner."""
    differentiate(r, m, p, s, axis)
    s.forward[axis] = forward
    e, added, takes_over = r - m, 0.0, s.started == 0.0 and y.drive_sequence >= 0
    if p.own[axis] != 0.0:
        partly = p.gain[axis] * (p.proportional_weight * r - m) + p.derivative[axis] * s.slope[axis]
        added = p.integral[axis] * e
    else:
        if takes_over:
            rest_filter(p, s, axis, e)
        filtered = p.b_0[axis] * e + s.one[axis]
        s.one[axis] = p.b_1[axis] * e - p.a_1[axis] * filtered + s.two[axis]
        s.two[axis] = p.b_2[axis] * e - p.a_2[axis] * filtered
        s.integrated[axis] += p.integral[axis] * filtered
        s.filtered[axis], partly = filtered, p.gain[axis] * filtered
    if p.feedforward == 0.0:
        forward = 0.0
    if takes_over:
        # Another law has driven the scanner: its drive goes on.
        s.integrated[axis] = y.drive[axis] / p.volts[axis] - forward - partly
    wanted = forward + partly + s.integrated[axis]
    sent = send(u, p, s, axis, wanted)
    # Anti-windup: what was cut off leaves the sum with the integral time, or the tracking time.
    s.integrated[axis] += added + p.reset[axis] * (sent - wanted)
    s.integrated[axis] = min(max(s.integrated[axis], -p.most[axis]), p.most[axis])


@kernel
def control(t: float, y: Measurement, u: PiezoDrive, p: Constants, s: State) -> None:
    """See `afm_model.parts.Law`."""
    follow_flight(y, p, s)
    for axis in range(2):
        now, _ = reference_at(y, p, axis, 0.0)
        answer_error(now, position(y, p, axis), feed_forward(y, p, axis), y, u, p, s, axis)
    # Both follow z, so that either can take over from the other.
    r, m = y.reference_position[2] / p.length[2] - p.a, y.deflection / p.length[2]
    sampled.control_height(y, u, p, s)
    if p.pid_z == 0.0:
        differentiate(r, m, p, s, 2)
    else:
        if s.started == 0.0:
            s.integrated[2] = y.drive[2] / p.volts[2]
        answer_error(r, m, 0.0, y, u, p, s, 2)
    s.started = 1.0


def _partly(p: Constants, s: State) -> Any:
    """Drive but for integral and feedforward, of each axis [U]."""
    own = p.gain * (p.proportional_weight * s.reference - s.measured) + p.derivative * s.slope
    return np.where(p.own != 0.0, own, p.gain * s.filtered)


def _change(before: Constants, now: Constants, s: State) -> None:
    """Give the sum what other gains would add to the drive."""
    drive = before.feedforward * s.forward + _partly(before, s) + s.integrated
    if before.pid_z == 0.0:
        drive[2] = s.last[2]
    for axis in range(3):
        s.filtered[axis] = plain(rest_filter)(now, s, axis, s.reference[axis] - s.measured[axis])
    s.integrated[:] = drive - now.feedforward * s.forward - _partly(now, s)


PID = Law(
    name="pid",
    parameters=PidLaw,
    constants=Constants,
    state=State,
    values=_values,
    check=_check,
    control=control,
    change=_change,
    knowledge="positions of the scanner, deflection; scanner, cantilever",
)
