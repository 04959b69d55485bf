"""Two tones: `dynamic` with a second tone of the drive, and a second lock-in for it; docs/dynamic.md.

Both tones move the same thing, onboard.drive; what is driven moves by their sum. The second lock-in takes the same
signal, through as many low-passes of the same time constant, and measures what is at the frequency of the second tone.
"""

import math
from dataclasses import replace
from typing import Annotated

from pydantic import Field

from ..cantilever import beam
from ..compiled.jit import kernel
from ..compiled.records import Array
from ..core import registry
from ..core.elementary import sincos, square
from ..core.schema import NonNegative, Unit
from ..parts.part import Channel, Numbers, Tree
from ..parts.signals import Actuation, Detection, Setpoint
from . import dynamic
from .dynamic import DYNAMIC, STAGES, DynamicParameters, Phase, check_tone, drive_and_measure, late, mixed, sensitivity

_TURN = 2.0 * math.pi


class BimodalParameters(DynamicParameters):
    """A drive of two tones, each measured by a separate lock-in."""

    kind: str = Field("bimodal", description="loop inside the instrument")
    second_drive_frequency: Annotated[NonNegative, Unit("Hz")] = Field(
        0.0, description="of the second tone; 0: second resonance of bending"
    )
    second_drive_amplitude: Annotated[NonNegative, Unit("m")] = Field(
        0.0, description="of the second tone, as drive_amplitude; 0: no second tone"
    )
    second_drive_phase: Phase = Field(
        0.0, description="by which the second tone is ahead of the reference of its lock-in"
    )
    second_phase_offset: Phase = Field(0.0, description="that the second lock-in takes from the lag it measures")


class Constants(dynamic.Constants):
    second_angular_frequency: float
    second_drive_amplitude: float
    second_drive_phase: float
    second_offset_cos: float
    second_offset_sin: float


class State(dynamic.State):
    second_angular_frequency: Annotated[float, "rad/s"]
    second_turned: Annotated[float, "rad"]  # angle of the second tone when it became this
    second_since: Annotated[float, "s"]
    second_in_phase: Annotated[Array, (STAGES,), "V"]  # behind each low-pass
    second_quadrature: Annotated[Array, (STAGES,), "V"]
    second_x: Annotated[float, "V"]  # behind the last one, turned by second_phase_offset
    second_y: Annotated[float, "V"]
    second_amplitude: Annotated[float, "V"]
    second_phase: Annotated[float, "rad"]  # from 0 to 2 pi: by a base it is 3 pi/2 at the second resonance


def second_frequency(parameters: Tree) -> float:
    """Return the frequency of the second tone [Hz]; 0 if it is not given and the plant has no cantilever."""
    cantilever = parameters.plant.cantilever_numbers
    own = 0.0 if cantilever is None else cantilever.f0 * beam.MODE[1].frequency
    return float(parameters.onboard.second_drive_frequency or own)


def _values(parameters: Tree) -> Numbers:
    part = parameters.onboard
    sin, cos = sincos(part.second_phase_offset)
    return {
        **DYNAMIC.values(parameters),
        "second_angular_frequency": _TURN * second_frequency(parameters),
        "second_drive_amplitude": part.second_drive_amplitude,
        "second_drive_phase": part.second_drive_phase,
        "second_offset_cos": cos,
        "second_offset_sin": sin,
    }


def _check(parameters: Tree) -> None:
    DYNAMIC.check(parameters)
    part, plant = parameters.onboard, parameters.plant
    if registry.find("plant", plant.kind).averages:
        raise ValueError(
            f"onboard.kind = {part.kind} is not allowed with plant.kind = {plant.kind}, which averages over the cycle "
            f"of one tone: take plant.kind = lever"
        )
    if part.second_drive_amplitude == 0.0:
        return
    if part.second_drive_frequency == 0.0 and getattr(plant, "modes", 2) < 2:
        raise ValueError(
            f"plant.modes = {plant.modes} is not allowed with onboard.second_drive_frequency = 0, the second "
            f"resonance: take plant.modes >= 2, or give a frequency"
        )
    check_tone(parameters, second_frequency(parameters), 1)


def _warnings(parameters: Tree) -> list[str]:
    found, part = list(DYNAMIC.warnings(parameters)), parameters.onboard
    apart = abs(second_frequency(parameters) - part.harmonic * dynamic.frequency(parameters))
    passed = math.prod([1.0 / math.sqrt(1.0 + square(_TURN * apart * part.time_constant))] * part.filter_order)
    if part.drive_amplitude > 0.0 and part.second_drive_amplitude > 0.0 and passed > 0.01:
        found.append(
            f"onboard.second_drive_frequency = {second_frequency(parameters):.6g} Hz is {apart:.6g} Hz from what the "
            f"first lock-in measures: of each tone {passed:.2g} passes the low-passes of the other's lock-in; take a "
            f"longer onboard.time_constant, or a higher onboard.filter_order"
        )
    return found


@kernel
def drive_both(t: float, d: Detection, r: Setpoint, u: Actuation, p: Constants, s: State) -> None:
    """See `afm_model.parts.Onboard`. The first tone, its lock-in and the z loop are those of `dynamic`."""
    drive_and_measure(t, d, r, u, p, s)
    omega = p.second_angular_frequency
    if s.second_angular_frequency != omega:
        s.second_turned = (s.second_turned + s.second_angular_frequency * (t - s.second_since)) % _TURN
        s.second_since, s.second_angular_frequency = t, omega
    u.second_amplitude, u.second_angular_frequency = p.second_drive_amplitude, omega
    u.second_phase, u.second_since = s.second_turned + p.second_drive_phase, s.second_since
    angle = s.second_turned + omega * (t - s.second_since)
    x, y = mixed(d, angle, s.second_in_phase, s.second_quadrature, p)
    s.second_amplitude = math.sqrt(x * x + y * y)
    s.second_x = p.second_offset_cos * x + p.second_offset_sin * y
    s.second_y = p.second_offset_cos * y - p.second_offset_sin * x
    s.second_phase = late(s.second_x, s.second_y)
    if s.second_phase < 0.0:
        s.second_phase += _TURN


BIMODAL = replace(
    DYNAMIC,
    name="bimodal",
    parameters=BimodalParameters,
    constants=Constants,
    state=State,
    values=_values,
    check=_check,
    regulate=drive_both,
    warnings=_warnings,
    channels=(
        *DYNAMIC.channels,
        Channel("second_amplitude", "m", "second_amplitude", sensitivity),
        Channel("second_phase", "rad", "second_phase"),
        Channel("second_in_phase", "m", "second_x", sensitivity),
        Channel("second_quadrature", "m", "second_y", sensitivity),
    ),
)
