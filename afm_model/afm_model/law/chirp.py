"""Excitation of the scanner for its identification: a sine whose frequency rises, the same along every axis."""

import math
from typing import Annotated

from pydantic import Field

from ..compiled.jit import kernel
from ..compiled.records import Record, Vector
from ..core.elementary import sin
from ..core.schema import Positive, Unit
from ..parts.groups import LawParameters
from ..parts.part import Law, Numbers, Tree
from ..parts.signals import Measurement, PiezoDrive


class Chirp(LawParameters):
    """A linear chirp [V] on the drive of the start, with no feedback. The tip must be off the sample."""

    amplitude: Annotated[Positive, Unit("V")] = Field(0.2, description="amplitude of the drive")
    f_low: Annotated[Positive, Unit("Hz")] = Field(100.0, description="frequency at the start")
    f_high: Annotated[Positive, Unit("Hz")] = Field(1500.0, description="frequency after law.sweep_time")
    sweep_time: Annotated[Positive, Unit("s")] = Field(
        0.2, description="time from law.f_low to law.f_high; then the sine continues at law.f_high"
    )


class Constants(Record):
    amplitude: float
    f_low: float
    f_high: float
    sweep_time: float


class State(Record):
    started: float
    held: Vector


def _values(parameters: Tree) -> Numbers:
    law = parameters.law
    return {name: getattr(law, name) for name in Constants.names}


@kernel
def phase(t: float, p: Constants) -> float:
    """Phase of the chirp at time t [rad]."""
    sweep = min(t, p.sweep_time)
    turns = p.f_low * sweep + 0.5 * (p.f_high - p.f_low) * sweep * sweep / p.sweep_time
    return 2.0 * math.pi * (turns + p.f_high * max(t - p.sweep_time, 0.0))


@kernel
def control(t: float, y: Measurement, u: PiezoDrive, p: Constants, s: State) -> None:
    """See `afm_model.parts.Law`."""
    for axis in range(3):
        if s.started == 0.0:
            s.held[axis] = y.drive[axis]
        u.voltage[axis] = s.held[axis] + p.amplitude * sin(phase(t, p))
    s.started = 1.0


CHIRP = Law(name="chirp", parameters=Chirp, constants=Constants, state=State, values=_values, control=control)
