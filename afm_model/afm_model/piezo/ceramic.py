"""The piezo ceramic as it is: amplifier, hysteresis, creep, in this order; docs/imperfections.md.

Hysteresis is rate independent, by play operators (Prandtl and Ishlinskii): of a drive u, counted from the start,

    h = p u + sum_i w_i P_i,    P_i = max(u - r_i, min(u + r_i, P_i before))

Their thresholds are half octaves of half the stroke, U, and the weights interpolate Rayleigh's law there: the first
curve is p u + c u^2 / 2 with c = 4 hysteresis / U and p = 1 - 2 hysteresis. A loop over the whole stroke then opens by
`hysteresis` of it and has the sensitivity of `piezo.sensitivity_*`; a smaller one opens in proportion to its size, and
is less steep.

Creep is linear. After a step h it follows the logarithm of time, x = h (1 + creep log10(t / 0.1 s)), by exponentials,
two in a decade.
"""

import math
from typing import Annotated, Any

import numpy as np
from annotated_types import Ge, Lt
from pydantic import Field

from ..compiled.jit import kernel
from ..compiled.records import Array, Record, Vector
from ..core.elementary import expm1, power
from ..core.schema import NonNegative, Unit
from ..parts.groups import PiezoParameters
from ..parts.part import Channel, Numbers, Piezo, Tree
from ..parts.signals import Drive

PLAYS = 12
EXPONENTIALS = 15
TIMES = np.array([power(10.0, 0.5 * i - 3.0) for i in range(EXPONENTIALS)])
"""Time constants of creep [s]: the law holds from 3 ms to 1000 s."""
NOMINAL_TIME = 0.1
"""After a step, when the displacement is that of `piezo.sensitivity_*` [s]."""

_Opening = Annotated[float, Ge(0), Lt(0.5)]
_Stroke = Annotated[NonNegative, Unit("m")]
_OPENING = "largest opening of the hysteresis loop over the stroke along {0}, as a part of the stroke"
_SCANNED = "stroke along {0} for that loop; 0: that of the scan, 2 reference.amplitude_{0}"


class CeramicParameters(PiezoParameters):
    """A piezo with hysteresis, creep and an amplifier. By default each is off."""

    kind: str = Field("ceramic", description="the piezo ceramic")
    hysteresis_x: _Opening = Field(0.0, description=_OPENING.format("x"))
    hysteresis_y: _Opening = Field(0.0, description=_OPENING.format("y"))
    hysteresis_z: _Opening = Field(0.0, description=_OPENING.format("z"))
    stroke_x: _Stroke = Field(0.0, description=_SCANNED.format("x"))
    stroke_y: _Stroke = Field(0.0, description=_SCANNED.format("y"))
    stroke_z: _Stroke = Field(0.0, description="stroke along z for that loop; must be given if there is hysteresis")
    creep: Annotated[float, Ge(0), Lt(0.2)] = Field(
        0.0, description="part of a step that follows in every decade of time, from 3 ms to 1000 s after it"
    )
    amplifier_bandwidth: Annotated[NonNegative, Unit("Hz")] = Field(
        0.0, description="first-order low-pass of the amplifier; 0: none"
    )


class Constants(Record):
    lagging: float  # whether the amplifier has a bandwidth
    follow: float  # 1 - exp(-2 pi bandwidth T)
    hysteretic: float
    linear: Vector  # p of each axis
    threshold: Annotated[Array, (PLAYS, 3), "V"]  # r_i
    weight: Annotated[Array, (PLAYS, 3)]  # w_i
    creep: float  # of a step in a decade
    share: float  # of each exponential
    decay: Annotated[Array, (EXPONENTIALS,)]  # 1 - exp(-T / time constant)
    at_once: float  # what of a step is there before any exponential has begun, less 1


class State(Record):
    origin: Annotated[Vector, "V"]  # drive that holds the start
    amplified: Annotated[Vector, "V"]  # behind the amplifier
    play: Annotated[Array, (PLAYS, 3), "V"]  # P_i
    slow: Annotated[Array, (EXPONENTIALS, 3), "V"]  # h behind each exponential
    hysteresis: Annotated[Vector, "V"]  # h - u
    creep: Annotated[Vector, "V"]  # what creep adds


def _strokes(parameters: Tree) -> dict[str, float]:
    """Stroke of each axis [m]."""
    piezo = parameters.piezo
    scanned = [2.0 * abs(each) for each in parameters.reference.amplitude] + [0.0]
    return {a: getattr(piezo, f"stroke_{a}") or scan for a, scan in zip("xyz", scanned, strict=True)}


def _values(parameters: Tree) -> Numbers:
    piezo, period = parameters.piezo, parameters.detector.sample_period
    linear, threshold, weight = np.ones(3), np.zeros((PLAYS, 3)), np.zeros((PLAYS, 3))
    for axis, (name, stroke) in enumerate(_strokes(parameters).items()):
        opening = getattr(piezo, f"hysteresis_{name}")
        if opening > 0.0:
            U = 0.5 * stroke / piezo.sensitivities[axis]
            # Knots 0, U / 64, ..., U: the first curve's slope changes at all but the first and the last.
            r = U * np.array([0.0, *(power(2.0, 0.5 * i) for i in range(-PLAYS, 1))])
            c = 4.0 * opening / U
            linear[axis] = 1.0 - 2.0 * opening + 0.5 * c * r[1]
            threshold[:, axis], weight[:, axis] = r[1:-1], 0.5 * c * (r[2:] - r[:-2])
    share = 0.5 * piezo.creep
    return {
        "lagging": float(piezo.amplifier_bandwidth > 0.0),
        "follow": -expm1(-2.0 * math.pi * piezo.amplifier_bandwidth * period),
        "hysteretic": float(np.any(weight > 0.0)),
        "linear": linear,
        "threshold": threshold,
        "weight": weight,
        "share": share,
        "decay": [-expm1(-period / time) for time in TIMES],
        "at_once": share * math.fsum(expm1(-NOMINAL_TIME / time) for time in TIMES),
    }


def _begin(parameters: Tree, s: Any, drive: tuple[float, float, float]) -> None:
    """The start is where the ceramic has rested for long."""
    s.origin[:] = s.amplified[:] = drive


@kernel
def actuate(t: float, u: Drive, v: Drive, p: Constants, s: State) -> None:
    """See `afm_model.parts.Piezo`."""
    for axis in range(3):
        volts = u.voltage[axis]
        if p.lagging != 0.0:
            s.amplified[axis] += p.follow * (volts - s.amplified[axis])
            volts = s.amplified[axis]
        if p.hysteretic != 0.0:
            way = volts - s.origin[axis]
            h = p.linear[axis] * way
            for i in range(PLAYS):
                r = p.threshold[i, axis]
                play = max(way - r, min(way + r, s.play[i, axis]))
                s.play[i, axis] = play
                h += p.weight[i, axis] * play
            s.hysteresis[axis] = h - way
            volts = s.origin[axis] + h
        if p.creep > 0.0:
            h = volts - s.origin[axis]
            crept = 0.0
            for i in range(EXPONENTIALS):
                s.slow[i, axis] += p.decay[i] * (h - s.slow[i, axis])
                crept += s.slow[i, axis]
            s.creep[axis] = p.share * crept + p.at_once * h
            volts += s.creep[axis]
        v.voltage[axis] = volts


def _check(parameters: Tree) -> None:
    for name, stroke in _strokes(parameters).items():
        opening = getattr(parameters.piezo, f"hysteresis_{name}")
        if opening > 0.0 and stroke == 0.0:
            raise ValueError(f"piezo.hysteresis_{name} = {opening:g} needs a stroke: piezo.stroke_{name} must be > 0 m")


def _warnings(parameters: Tree) -> list[str]:
    piezo = parameters.piezo
    found = [
        f"piezo.hysteresis_{axis} = {opening:g} is implausible: piezos have 0.02 to 0.15"
        for axis in "xyz"
        if (opening := getattr(piezo, f"hysteresis_{axis}")) > 0.25
    ]
    if piezo.creep > 0.05:
        found.append(f"piezo.creep = {piezo.creep:g} is implausible: piezos have 0.01 to 0.02")
    if 0.0 < piezo.amplifier_bandwidth < 10.0:
        found.append(
            f"piezo.amplifier_bandwidth = {piezo.amplifier_bandwidth:g} Hz is implausible: amplifiers have 100 to "
            f"1e5 Hz"
        )
    return found


def _channels(what: str) -> tuple[Channel, ...]:
    return (
        Channel(f"truth/{what}_x", "m", f"{what}.x", lambda parameters: parameters.piezo.sensitivity_x),
        Channel(f"truth/{what}_y", "m", f"{what}.y", lambda parameters: parameters.piezo.sensitivity_y),
        Channel(f"truth/{what}_z", "m", f"{what}.z", lambda parameters: parameters.piezo.sensitivity_z),
    )


CERAMIC = Piezo(
    name="ceramic",
    parameters=CeramicParameters,
    constants=Constants,
    state=State,
    values=_values,
    check=_check,
    actuate=actuate,
    begin=_begin,
    warnings=_warnings,
    channels=(*_channels("hysteresis"), *_channels("creep")),
)
