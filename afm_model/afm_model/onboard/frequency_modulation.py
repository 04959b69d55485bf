"""Frequency modulation: `dynamic` with a loop of the drive's frequency and one of its amplitude; docs/dynamic.md.

A phase-locked loop holds the phase at its setpoint by the frequency, drive_frequency + shift; the other one holds the
amplitude by the drive. Both are proportional and integral, and their zero takes away the decay of the cantilever,
tau = Q / (pi f0): after the low-passes of the lock-in each is an integrator with the crossover B that is asked for,

    shift = B (e + I / tau) [Hz],  I' = e = phase_setpoint - phase [rad]

    drive = 2 pi B (tau e + I) drive_amplitude / amplitude_setpoint,  I' = e = amplitude_setpoint - amplitude

The z loop is that of `dynamic`.
"""

import math
from dataclasses import replace
from typing import Annotated

from annotated_types import Gt, Lt
from pydantic import Field

from ..compiled.jit import kernel
from ..core.schema import NonNegative, Unit
from ..parts.part import Channel, Numbers, Tree
from ..parts.signals import Actuation, Detection, Setpoint
from . import dynamic
from .by_amplitude import own_lag
from .dynamic import DYNAMIC, DynamicParameters, drive_at

_TURN = 2.0 * math.pi
_WIDEST = 0.05
"""Largest shift over the frequency of the drive."""
_STRONGEST = 100.0
"""Largest drive over `drive_amplitude`."""


class FrequencyModulationParameters(DynamicParameters):
    """A drive that follows the resonance, and keeps the amplitude."""

    kind: str = Field("frequency_modulation", description="loop inside the instrument")
    phase_bandwidth: Annotated[NonNegative, Unit("Hz")] = Field(
        0.0, description="of the phase-locked loop: crossover of its gain; 0: the frequency stays"
    )
    phase_setpoint: Annotated[float, Gt(0), Lt(math.pi), Unit("rad")] = Field(
        0.5 * math.pi, description="lag that the phase-locked loop keeps"
    )
    amplitude_bandwidth: Annotated[NonNegative, Unit("Hz")] = Field(
        0.0, description="of the loop that keeps the amplitude by the drive; 0: the drive stays"
    )
    amplitude_setpoint: Annotated[NonNegative, Unit("m")] = Field(
        0.0, description="amplitude that it keeps, as the photodiode shows it; drive_amplitude should make about that"
    )


class Constants(dynamic.Constants):
    decay: float
    phase_setpoint: float
    phase_gain: float
    amplitude_setpoint: float
    amplitude_gain: float
    period: float
    widest: float
    strongest: float


class State(dynamic.State):
    shift: Annotated[float, "Hz"]
    shift_integral: Annotated[float, "Hz"]
    drive: Annotated[float, "m"]  # amplitude
    drive_integral: Annotated[float, "m"]


def _values(parameters: Tree) -> Numbers:
    part, metres = parameters.onboard, parameters.detector.deflection_sensitivity
    kept = part.amplitude_setpoint / metres
    return {
        **DYNAMIC.values(parameters),
        "decay": own_lag(parameters),
        "phase_setpoint": part.phase_setpoint,
        "phase_gain": part.phase_bandwidth,
        "amplitude_setpoint": kept,
        "amplitude_gain": _TURN * part.amplitude_bandwidth * part.drive_amplitude / kept if kept else 0.0,
        "period": parameters.detector.sample_period,
        "widest": _WIDEST * dynamic.frequency(parameters),
        "strongest": _STRONGEST * part.drive_amplitude,
    }


def _check(parameters: Tree) -> None:
    DYNAMIC.check(parameters)
    part = parameters.onboard
    if own_lag(parameters) == 0.0:
        raise ValueError(
            f"onboard.kind = {part.kind} is not allowed with plant.kind = {parameters.plant.kind}: take lever"
        )
    if part.amplitude_bandwidth and not part.amplitude_setpoint:
        raise ValueError("onboard.amplitude_bandwidth is not allowed without onboard.amplitude_setpoint: give both")
    for name in ("phase_bandwidth", "amplitude_bandwidth"):
        most = 1.0 / (_TURN * 2.0 * part.filter_order * part.time_constant)
        if (given := getattr(part, name)) > most:
            raise ValueError(
                f"onboard.{name} = {given:g} Hz is not allowed with {part.filter_order} low-passes of "
                f"{part.time_constant:g} s, after which the loop would oscillate: take <= {most:.3g} Hz"
            )


@kernel
def follow(t: float, d: Detection, r: Setpoint, u: Actuation, p: Constants, s: State) -> None:
    """See `afm_model.parts.Onboard`. Both loops use what the lock-in showed at the last sample."""
    if p.phase_gain > 0.0:
        error = p.phase_setpoint - s.phase
        s.shift_integral += p.phase_gain * p.period / p.decay * error
        s.shift_integral = min(max(s.shift_integral, -p.widest), p.widest)
        s.shift = min(max(s.shift_integral + p.phase_gain * error, -p.widest), p.widest)
    if p.amplitude_gain > 0.0:
        short = p.amplitude_setpoint - s.amplitude
        s.drive_integral += p.amplitude_gain * p.period * short
        s.drive_integral = min(max(s.drive_integral, 0.0), p.strongest)
        s.drive = min(max(s.drive_integral + p.amplitude_gain * p.decay * short, 0.0), p.strongest)
    else:
        s.drive = p.drive_amplitude
    drive_at(t, d, r, u, p.angular_frequency + _TURN * s.shift, s.drive, p, s)


FREQUENCY_MODULATION = replace(
    DYNAMIC,
    name="frequency_modulation",
    parameters=FrequencyModulationParameters,
    constants=Constants,
    state=State,
    values=_values,
    check=_check,
    regulate=follow,
    channels=(*DYNAMIC.channels, Channel("frequency_shift", "Hz", "shift"), Channel("drive_amplitude", "m", "drive")),
)
