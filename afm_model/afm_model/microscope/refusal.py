"""Why the microscope cannot do what it is asked for: one sentence that names the value and what is allowed."""

import math
from collections.abc import Iterable, Iterator
from itertools import pairwise

from ..core.errors import VerbError
from .bench import Bench
from .calibrating import curves_of, wedge_plan
from .collect import signals
from .imaging import channel_names
from .jobs import Desk
from .plan import LinePlan, lines
from .tracing import loop_plan
from .verbs import (
    Approach,
    CalibrateLateral,
    CalibrateSensitivity,
    ForceCurve,
    FrictionLoop,
    MoveTo,
    Scan,
    ScanPath,
    ThermalTune,
    Verb,
)

_SLIDING = (FrictionLoop, Scan, ScanPath)
_ON_THE_SAMPLE = (*_SLIDING, ForceCurve, CalibrateSensitivity, CalibrateLateral)
"""Verbs that need an approached tip."""


def objection(verb: Verb, bench: Bench, desk: Desk) -> str:
    """Why `verb` cannot be begun now; empty if it can.

    Parameters
    ----------
    verb : Verb
    bench : Bench
    desk : Desk
        Where the microscope stands.
    """
    try:
        return next(_objections(verb, bench, desk), "")
    except VerbError as error:
        return str(error)


def _objections(verb: Verb, bench: Bench, desk: Desk) -> Iterator[str]:
    yield from _standing(verb, bench, desk)
    match verb:
        case MoveTo():
            yield from _outside(bench, "", [(verb.x, verb.y)])
        case Scan():
            yield from _channels(verb, bench)
            yield from _frame(lines(verb, bench), bench)
        case FrictionLoop():
            if verb.count < 2:
                yield f"count = {verb.count} is not allowed: the first line is not part of the result; it must be >= 2"
            yield from _frame(loop_plan(verb, bench), bench)
        case ScanPath():
            yield from _path(verb, bench)
        case ForceCurve():
            yield from _curve(verb, bench)
        case CalibrateSensitivity():
            yield from _too_fast("rate", verb.rate, verb.trigger_voltage, verb.ramp, bench)
            yield from _curve(curves_of(verb), bench)
        case CalibrateLateral():
            yield from _wedge(verb, bench)


def _standing(verb: Verb, bench: Bench, desk: Desk) -> Iterator[str]:
    """What the state of the microscope does not allow."""
    name = type(verb).__name__
    if desk.doing:
        yield f"{name} is not allowed while {desk.doing} is being done: wait for its end, or cancel it"
    if isinstance(verb, _ON_THE_SAMPLE) and not desk.approached:
        yield f"{name} is not allowed while the tip is withdrawn: it must be approached first"
    if isinstance(verb, _SLIDING) and desk.feedback == "off":
        yield f"{name} is not allowed with feedback = off: it must be on, hold or external"
    if isinstance(verb, CalibrateLateral) and desk.feedback != "on":
        yield f"{name} is not allowed with feedback = {desk.feedback}: it must be on"
    if isinstance(verb, ThermalTune) and desk.near:
        yield f"{name} is not allowed while the tip is on the sample: withdraw it first"
    band = bench.resonance_band
    if isinstance(verb, ThermalTune) and band is not None and band[1] <= band[0] * 1.4:
        yield (
            f"{name} is not allowed with detector.sample_period = {bench.sample_period:g} s: the cantilever's "
            f"resonance is beyond half the rate of the ADC, {0.5 / bench.sample_period:g} Hz"
        )
    if isinstance(verb, Approach):
        if desk.approached:
            yield f"{name} is not allowed: the tip is on the sample already; withdraw it first"
        if not bench.setpoint > 0.0:
            yield f"{name} is not allowed with a setpoint of {bench.setpoint:g} V: it must be > 0 V"
        yield from _saturating("the setpoint", bench.setpoint, bench)
        yield from _too_fast("rate", verb.rate, bench.setpoint, verb.range, bench)


def _outside(bench: Bench, what: str, places: Iterable[tuple[float, float]]) -> Iterator[str]:
    """What is beyond the travel of the scanner."""
    for place in places:
        for axis, value, most in zip("xy", place, bench.travel, strict=True):
            if abs(value) > most:
                yield (
                    f"{what}{axis} = {value:.4g} m is outside the travel of the scanner: it must be within +-{most:g} m"
                )


def _saturating(what: str, volts: float, bench: Bench) -> Iterator[str]:
    """A deflection that the detector never tells: z would go on into the sample."""
    if volts > bench.most_deflection:
        yield f"{what} of {volts:.4g} V is not allowed: the detector saturates at {bench.most_deflection:.4g} V"


def _too_fast(name: str, rate: float, trigger: float, way: float, bench: Bench) -> Iterator[str]:
    """A rate at which z goes further within a sample than the deflection [V] that it is to stop at, or all its way."""
    most = min(trigger * bench.parameters.detector.deflection_sensitivity or way, way) / bench.sample_period
    if rate > most:
        yield (
            f"{name} = {rate:g} m/s is not allowed: within a sample of {bench.sample_period:g} s z would go further "
            f"than it may; it must be <= {most:.4g} m/s"
        )


def _frame(plan: LinePlan, bench: Bench) -> Iterator[str]:
    yield from _outside(bench, "with its turns the scan goes too far: ", plan.corners)


def _channels(verb: Scan, bench: Bench) -> Iterator[str]:
    names = channel_names(verb.channels)
    if not names:
        yield "channels is empty: it must name one at least, such as height"
    try:
        signals(bench.instrument, names)
    except KeyError as error:
        missing, known = error.args
        yield (
            f"channels = {verb.channels} is not allowed: there is no {', '.join(missing)}; there are {', '.join(known)}"
        )


def _path(verb: ScanPath, bench: Bench) -> Iterator[str]:
    if len(verb.x) != len(verb.y) or len(verb.x) < 2:
        yield (
            f"a path of {len(verb.x)} x and {len(verb.y)} y is not allowed: there must be as many of both, 2 at least"
        )
        return
    places = list(zip(verb.x, verb.y, strict=True))
    for number, (one, other) in enumerate(pairwise(places)):
        if one == other:
            yield (
                f"places {number} and {number + 1} of the path are the same, x = {one[0]:g} m, y = {one[1]:g} m: leave "
                f"one of them out"
            )
    yield from _outside(bench, "", places)
    way = sum(math.dist(one, other) for one, other in pairwise(places))
    most = min(bench.resonance, verb.sample_rate) * way
    if verb.speed > most:
        yield (
            f"speed = {verb.speed:g} m/s is not allowed on a path of {way:.4g} m: it would take less than a period of "
            f"the scanner's resonance or of sample_rate = {verb.sample_rate:g} Hz; it must be <= {most:.4g} m/s"
        )


def _curve(verb: ForceCurve, bench: Bench) -> Iterator[str]:
    if verb.trigger_force > 0.0 and bench.spring_constant == 0.0:
        yield (
            f"trigger_force = {verb.trigger_force:g} N is not allowed with plant.kind = "
            f"{bench.parameters.plant.kind}, which tells no spring constant: give trigger_voltage"
        )
    trigger = verb.trigger_voltage or bench.volts(verb.trigger_force)
    yield from _saturating("a trigger", trigger, bench)
    yield from _too_fast("approach_rate", verb.approach_rate, trigger, verb.ramp, bench)
    yield from _too_fast("retract_rate", verb.retract_rate, 0.0, verb.ramp, bench)
    low, high = bench.reach
    if bench.offset - verb.lift < low:
        yield f"lift = {verb.lift:g} m is not allowed here: z has {bench.offset - low:.4g} m left to go away"
    if bench.offset - verb.lift + verb.ramp > high:
        yield (
            f"ramp = {verb.ramp:g} m is not allowed here: with lift = {verb.lift:g} m z has "
            f"{high - bench.offset + verb.lift:.4g} m to go towards the sample"
        )


def _wedge(verb: CalibrateLateral, bench: Bench) -> Iterator[str]:
    for low, high, unit in (
        ("slope_from", "slope_to", "m"),
        ("flat_from", "flat_to", "m"),
        ("setpoint_from", "setpoint_to", "N"),
    ):
        if getattr(verb, low) >= getattr(verb, high):
            yield (
                f"{low} = {getattr(verb, low):g} {unit} is not allowed: it must be < {high} = "
                f"{getattr(verb, high):g} {unit}"
            )
    if verb.lines < 2:
        yield f"lines = {verb.lines} is not allowed: the first line is not used; it must be >= 2"
    if bench.spring_constant == 0.0:
        yield (
            f"CalibrateLateral is not allowed with plant.kind = {bench.parameters.plant.kind}, which tells no spring "
            f"constant"
        )
    yield from _saturating("a setpoint", bench.volts(verb.setpoint_to), bench)
    yield from _frame(wedge_plan(verb, bench), bench)
