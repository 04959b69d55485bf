"""Thermal drift: the sample moves against the holder of the tip, and no sensor of the scanner sees it.

    D' = rate exp(-t / decay_time) + r(t),   r: Ornstein-Uhlenbeck, rms `wander`, correlation time `wander_time`

It is added after the piezo, as the voltage of an ideal piezo that moves the sample by D, and taken off what the
position sensors read. So it moves the sample in every plant, sticks and slips with it, and a z loop follows it. The
resonances of the scanner are faster than any drift by many orders of magnitude.
"""

import math
from typing import Annotated

from ..compiled.jit import kernel
from ..compiled.records import Block, Record, Vector
from ..core.elementary import exp, expm1
from ..parameters import InstrumentParameters
from ..parts.part import Numbers
from ..parts.signals import Drive


class DriftConstants(Record):
    on: float
    rate: Annotated[Vector, "m/s"]
    decay: Annotated[float, "s"]  # 0: none
    wander: float
    keep: float
    shake: float
    metres: Annotated[Vector, "m/V"]  # of the piezo


class DriftState(Record):
    displacement: Annotated[Vector, "m"]  # of the sample
    rate: Annotated[Vector, "m/s"]
    wandered: Vector  # random part of the displacement at the begin of the tick
    wandering: Vector  # random part of the rate, the same during a tick


def drift_constants(parameters: InstrumentParameters) -> Numbers:
    """Values of DriftConstants."""
    drift, piezo = parameters.drift, parameters.piezo
    ratio = parameters.plant.control_period / drift.wander_time
    return {
        "on": float(drift.on),
        "rate": [drift.rate_x, drift.rate_y, drift.rate_z],
        "decay": drift.decay_time,
        "wander": drift.wander,
        "keep": exp(-ratio),
        "shake": drift.wander * math.sqrt(-expm1(-2.0 * ratio)),
        "metres": piezo.sensitivities,
    }


@kernel
def wander(k: int, period: float, p: DriftConstants, s: DriftState, r: Block) -> None:
    """Begin control tick k, of length `period` [s]: the random part goes on, by the random numbers r."""
    for axis in range(3):
        s.wandered[axis] += period * s.wandering[axis]
        if k == 0:
            s.wandering[axis] = p.wander * r[axis]
        else:
            s.wandering[axis] = p.keep * s.wandering[axis] + p.shake * r[axis]


@kernel
def drift(t: float, late: float, v: Drive, p: DriftConstants, s: DriftState) -> None:
    """Add the drift to what the piezo makes of the drive, v [V], at time t [s], `late` after the begin of the tick."""
    left, way = 1.0, t
    if p.decay > 0.0:
        left = exp(-t / p.decay)
        way = -p.decay * expm1(-t / p.decay)
    for axis in range(3):
        s.displacement[axis] = p.rate[axis] * way + s.wandered[axis] + s.wandering[axis] * late
        s.rate[axis] = p.rate[axis] * left + s.wandering[axis]
        v.voltage[axis] += s.displacement[axis] / p.metres[axis]
