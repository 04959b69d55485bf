"""Position sensors and rates: positions, velocities and the rate of the deflection in a measurement.

Ideal sensors show the true velocities. If the position sensors are not ideal they are read at the rate of the virtual
ADC, and velocities are differences of two readings, divided by the time between them; the same holds for the deflection
and its rate. So nobody has a velocity that is better than the positions. A low-pass of the rates follows,
v[k] = keep v[k-1] + (1 - keep) difference[k].
"""

import math
from typing import Annotated

from ..compiled.jit import kernel
from ..compiled.records import Block, Record, Vector
from ..core import low_pass, registry
from ..core.converter import convert
from ..core.elementary import exp
from ..core.low_pass import LowPass
from ..parameters import InstrumentParameters
from ..parts.part import Numbers
from ..parts.signals import Measurement, Truth
from .drift import DriftState


class SensorConstants(LowPass):
    """Of the low-pass of the positions; whether positions and deflection are imperfect."""

    positions: float
    deflection: float
    lsb: Annotated[float, "m"]
    limit: Annotated[float, "m"]
    period: Annotated[float, "s"]  # of the virtual ADC
    rate_keep: float


class SensorState(Record):
    started: float
    low: Annotated[Vector, "m"]  # positions behind the low-pass
    last: Vector  # before it
    noise: Vector
    position: Annotated[Vector, "m"]  # as read at the last sample
    velocity: Annotated[Vector, "m/s"]
    deflection: Annotated[float, "m"]  # as read at the last sample
    rate: Annotated[float, "m/s"]


def position_noise(parameters: InstrumentParameters) -> float:
    """Rms noise of a position sample [m]."""
    d = parameters.detector
    return d.position_noise or low_pass.noise_of_density(
        d.position_noise_density, d.position_bandwidth, d.sample_period
    )


def sensor_constants(parameters: InstrumentParameters) -> Numbers:
    """Values of SensorConstants."""
    d = parameters.detector
    period = d.sample_period
    rms = position_noise(parameters)
    ideal = rms == 0.0 and d.position_bandwidth == 0.0 and d.position_limit == 0.0
    return {
        "positions": float(not ideal),
        "deflection": float(not registry.find("detector", d.kind).ideal(parameters)),
        **low_pass.constants(d.position_bandwidth, rms, period),
        "lsb": 2.0 * d.position_limit / 2**d.position_bits if d.position_bits > 0 else 0.0,
        "limit": d.position_limit,
        "period": period,
        "rate_keep": exp(-2.0 * math.pi * d.rate_bandwidth * period) if d.rate_bandwidth > 0.0 else 0.0,
    }


@kernel
def sense(o: Truth, deflection: float, drifted: DriftState, p: SensorConstants, s: SensorState, r: Block) -> None:
    """Read the sensors at a sample of the virtual ADC: what is not ideal of positions and deflection.

    Parameters
    ----------
    o : record of Truth
    deflection : float
        As the photodetector has read it [m].
    drifted : record of DriftState
        A displacement that the sensors do not see.
    p, s : records of SensorConstants and SensorState
    r : random numbers, three
    """
    if p.positions != 0.0:
        for axis in range(3):
            x = o.position[axis] - drifted.displacement[axis]
            if p.filtered == 0.0:
                x += p.noise * r[axis]
            else:
                before = s.last[axis]
                s.last[axis] = x
                if s.started == 0.0:
                    s.low[axis], s.noise[axis] = x, p.noise * r[axis]
                else:
                    s.low[axis] = p.keep * s.low[axis] + p.new * x + p.old * before
                    s.noise[axis] = p.keep * s.noise[axis] + p.shake * r[axis]
                x = s.low[axis] + s.noise[axis]
            x = convert(x, p.lsb, p.limit)
            if s.started != 0.0:
                difference = (x - s.position[axis]) / p.period
                s.velocity[axis] = difference + p.rate_keep * (s.velocity[axis] - difference)
            s.position[axis] = x
    if p.deflection != 0.0:
        if s.started != 0.0:
            difference = (deflection - s.deflection) / p.period
            s.rate = difference + p.rate_keep * (s.rate - difference)
        s.deflection = deflection
    s.started = 1.0


@kernel
def tell_sensors(y: Measurement, o: Truth, drifted: DriftState, p: SensorConstants, s: SensorState) -> None:
    """Write positions, velocities and rate of the deflection into the measurement y: what was read, or the truth."""
    if p.positions == 0.0:
        for axis in range(3):
            y.position[axis] = o.position[axis] - drifted.displacement[axis]
            y.velocity[axis] = o.velocity[axis] - drifted.rate[axis]
    else:
        for axis in range(3):
            y.position[axis], y.velocity[axis] = s.position[axis], s.velocity[axis]
    y.deflection_rate = o.tip_rate if p.deflection == 0.0 else s.rate
