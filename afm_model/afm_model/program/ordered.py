"""The program `verbs`: x and y move, z is opened, moved and closed, as ordered between two control ticks.

Who orders is no part of the program (`afm_model.instrument.Instrument.order`, `afm_model.microscope`): scan lines,
force curves and an approach run here, at the rate of the virtual ADC. x and y are a function of time alone; the table
of z depends on the deflection and has a state. At the start the tip is withdrawn, at rest.
"""

import math
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from ..compiled.jit import kernel
from ..compiled.records import Array, Record, numbers_at, pointer_at, record_at, size
from ..core.elementary import cos, sin, square
from ..core.schema import Unit
from ..parts.groups import ProgramParameters
from ..parts.part import Channel, Numbers, Program, Tree
from ..parts.signals import FOLLOW as FOLLOWED
from ..parts.signals import OPEN, Detection, Setpoint
from ..parts.ticks import ticks_of
from .orders import (
    AMPLITUDE,
    DEGREES,
    END,
    FOLLOW,
    LINES,
    POLYNOMIAL,
    PROFILE,
    RAMP,
    REST,
    SAMPLED,
    Lines,
    Order,
    Sampled,
    StepRecord,
)

_STEP = size(StepRecord)


class VerbsParameters(ProgramParameters):
    """Nothing but what is ordered; at the start the scanner is at a place, the tip withdrawn (plant.gap)."""

    kind: str = Field("verbs", description="program of the reference")
    x: Annotated[float, Unit("m")] = Field(0.0, description="place of the scanner along x at the start")
    y: Annotated[float, Unit("m")] = Field(0.0, description="place of the scanner along y at the start")


class Constants(Record):
    z_r: float
    number: float  # of the order, from 1
    motion: float  # POLYNOMIAL, LINES or SAMPLED
    begin: Annotated[float, "s"]  # of the order
    curve_time: Annotated[float, "s"]  # whole, of a curve
    last: Annotated[float, "s"]  # time behind which the motion is at its end with this control tick
    curve_x: Annotated[Array, (DEGREES,), "m"]
    curve_y: Annotated[Array, (DEGREES,), "m"]
    centre_x: Annotated[float, "m"]  # of lines: middle, direction
    centre_y: Annotated[float, "m"]
    cos: float
    sin: float
    speed: Annotated[float, "m/s"]
    width: Annotated[float, "m"]
    first: Annotated[float, "m"]  # slow coordinate of the first line
    step: Annotated[float, "m"]
    lines: float
    image: Annotated[float, "s"]
    turn: Annotated[float, "s"]
    shift: Annotated[float, "s"]
    half_sample: Annotated[float, "s"]
    numbers: int  # address of the order's numbers, see Order.numbers
    length: int  # how many
    piece_time: Annotated[float, "s"]  # of a motion SAMPLED: of a piece
    pieces: int
    first_piece: int  # where among the numbers


class State(Record):
    number: float  # of the order in force
    done: float  # 1.0: it is
    at: float  # step of the table; END: none
    since: Annotated[float, "s"]  # when it began
    mode: float  # of z
    offset: Annotated[float, "m"]  # of z
    origin: Annotated[float, "m"]  # the same when the step began
    total: Annotated[float, "V"]  # of the deflection in the last REST
    samples: float
    fired: float  # 1.0 if the last step with a trigger has ended by it


def values(parameters: Tree) -> Numbers:
    program = parameters.reference
    zeros: dict[str, Any] = {name: 0.0 for name in Constants.names}
    x, y = (((place,) + (0.0,) * (DEGREES - 1)) for place in (program.x, program.y))
    half = 0.5 * parameters.detector.sample_period
    return zeros | {"z_r": program.z_r, "curve_time": 1.0, "curve_x": x, "curve_y": y, "half_sample": half}


def start(parameters: Tree) -> Numbers:
    zeros = {name: 0.0 for name in State.names}
    return zeros | {"done": 1.0, "at": END, "mode": OPEN}


def _check(parameters: Tree) -> None:
    if parameters.onboard.kind == "none":
        raise ValueError(
            "reference.kind = verbs needs a loop inside the instrument that moves z: give onboard.kind = pi"
        )
    if not getattr(parameters.plant, "gap", 0.0) > 0.0:
        raise ValueError(
            "reference.kind = verbs begins with the tip off the sample: plant.gap must be > 0 m, with plant.kind = "
            "lever or compliant"
        )


@kernel
def smooth(s: float) -> tuple[float, float, float]:
    """3 s^2 - 2 s^3 with its integral from 0 and its slope."""
    return s * s * (3.0 - 2.0 * s), s * s * s * (1.0 - 0.5 * s), 6.0 * s * (1.0 - s)


@kernel
def along_line(tau: float, p: Constants) -> tuple[float, float, float, float, float, float]:
    """Fast and slow coordinate, velocities and accelerations at time tau of an order LINES."""
    half = p.image + p.turn
    q = tau - p.turn
    if q < 0.0:
        # From rest to the even speed.
        speed, way, change = smooth(max(tau, 0.0) / p.turn)
        x = -0.5 * p.width + p.speed * p.turn * (way - 0.5)
        return x, p.speed * speed, p.speed * change / p.turn, p.first, 0.0, 0.0
    number = min(math.floor(q / half), 2.0 * p.lines - 1.0)
    line = math.floor(0.5 * number)
    sign = 1.0 if number == 2.0 * line else -1.0
    y = p.first + line * p.step
    late = q - number * half - p.image
    if late <= 0.0:
        return sign * (0.5 * p.width + p.speed * late), sign * p.speed, 0.0, y, 0.0, 0.0
    u = min(late / p.turn, 1.0)
    speed, way, change = smooth(u)
    if number == 2.0 * p.lines - 1.0:
        x = sign * (0.5 * p.width + p.speed * p.turn * (u - way))
        return x, sign * p.speed * (1.0 - speed), -sign * p.speed * change / p.turn, y, 0.0, 0.0
    x = sign * (0.5 * p.width + p.speed * p.turn * (u - 2.0 * way))
    v, a = sign * p.speed * (1.0 - 2.0 * speed), -2.0 * sign * p.speed * change / p.turn
    if sign > 0.0:
        return x, v, a, y, 0.0, 0.0
    y += p.step * u * u * u * (10.0 + u * (6.0 * u - 15.0))
    rate = 30.0 * u * u * square(1.0 - u)
    bend = 60.0 * u * (1.0 - u) * (1.0 - 2.0 * u)
    return x, v, a, y, p.step * rate / p.turn, p.step * bend / (p.turn * p.turn)


@kernel
def polynomial(c: Any, s: float) -> tuple[float, float, float]:
    """Value, slope and second derivative of sum c[i] s^i."""
    value = slope = bend = 0.0
    for i in range(DEGREES - 1, -1, -1):
        bend = bend * s + 2.0 * slope
        slope = slope * s + value
        value = value * s + c[i]
    return value, slope, bend


@kernel
def reference(t: float, r: Setpoint, p: Constants) -> None:
    """See `afm_model.parts.Program`."""
    r.position[2], r.velocity[2], r.acceleration[2] = p.z_r, 0.0, 0.0
    tau = t - p.begin
    if p.motion == LINES:
        x, v_x, a_x, y, v_y, a_y = along_line(tau + p.shift, p)
        r.position[0] = p.centre_x + p.cos * x - p.sin * y
        r.position[1] = p.centre_y + p.sin * x + p.cos * y
        r.velocity[0], r.velocity[1] = p.cos * v_x - p.sin * v_y, p.sin * v_x + p.cos * v_y
        r.acceleration[0], r.acceleration[1] = p.cos * a_x - p.sin * a_y, p.sin * a_x + p.cos * a_y
        return
    if p.motion == SAMPLED:
        late, rate = min(max(tau / p.piece_time, 0.0), float(p.pieces)), 1.0 / p.piece_time
        piece = min(int(late), p.pieces - 1)
        c = pointer_at(numbers_at(p.numbers, p.length), p.first_piece + 2 * DEGREES * piece)
        x, v_x, a_x = polynomial(c, late - piece)
        y, v_y, a_y = polynomial(pointer_at(c, DEGREES), late - piece)
    else:
        s, rate = min(max(tau / p.curve_time, 0.0), 1.0), 1.0 / p.curve_time
        x, v_x, a_x = polynomial(p.curve_x, s)
        y, v_y, a_y = polynomial(p.curve_y, s)
    r.position[0], r.velocity[0], r.acceleration[0] = x, v_x * rate, a_x * rate * rate
    r.position[1], r.velocity[1], r.acceleration[1] = y, v_y * rate, a_y * rate * rate


@kernel
def along_profile(late: float, numbers: Any, step: Any) -> tuple[float, bool]:
    """Return the offset `late` periods after the begin of a profile, and whether it is over."""
    begin, last = int(step.begin), step.count - 1.0
    if late >= last:
        return numbers[begin + int(last)], True
    i = int(late)
    here, there = numbers[begin + i], numbers[begin + i + 1]
    return here + (late - i) * (there - here), False


@kernel
def watch(t: float, d: Detection, r: Setpoint, p: Constants, s: State) -> None:
    """See `afm_model.parts.Program`. A step is left at most once in a sample."""
    if s.at >= 0.0:
        numbers = numbers_at(p.numbers, p.length)
        step = record_at(numbers, int(s.at) * _STEP, StepRecord)
        kind, after, fired = step.kind, t - s.since + p.half_sample, False
        if kind == RAMP:
            s.mode = OPEN
            way, whole = step.rate * (t - s.since), step.target - s.origin
            over = way >= abs(whole)
            s.offset = step.target if over else s.origin + math.copysign(way, whole)
            if step.trigger > 0.0 and step.watched == AMPLITUDE:
                fired = d.amplitude_voltage <= step.trigger
            elif step.trigger > 0.0 and s.samples > 0.0:
                fired = d.deflection_voltage - s.total / s.samples >= step.trigger
        elif kind == FOLLOW:
            s.mode, s.offset = FOLLOWED, 0.0
            over = after >= step.duration
        elif kind == PROFILE:
            s.mode = OPEN
            s.offset, over = along_profile((t - s.since) / step.period, numbers, step)
        else:
            s.mode = OPEN
            if kind == REST:
                s.total += d.deflection_voltage
                s.samples += 1.0
            over = after >= step.duration
        if fired or over:
            if step.trigger > 0.0:
                s.fired = 1.0 if fired else 0.0
            s.at = step.triggered if fired else step.then
            s.since, s.origin = t, s.offset
            if s.at >= 0.0 and record_at(numbers, int(s.at) * _STEP, StepRecord).kind == REST:
                s.total = s.samples = 0.0
    s.done = 1.0 if s.at < 0.0 and t > p.last else 0.0
    r.z_mode, r.z_offset = s.mode, s.offset


def put_in_force(order: Order, tick: int, parameters: Tree, p: Any, s: Any) -> NDArray[np.float64]:
    """Put an order in force at control tick `tick`; see `afm_model.parts.Program`."""
    numbers = order.numbers()
    control, sample = parameters.plant.control_period, parameters.detector.sample_period
    motion = order.motion
    p.number += 1.0
    p.numbers, p.length = numbers.ctypes.data, len(numbers)
    p.begin = tick * control
    if isinstance(motion, Lines):
        p.motion = LINES
        p.centre_x, p.centre_y, p.cos, p.sin = motion.x, motion.y, cos(motion.angle), sin(motion.angle)
        p.width, p.first, p.step, p.lines = motion.size, motion.first, motion.step, motion.lines
        p.image, p.turn = motion.image * sample, motion.turn * sample
        p.speed = motion.size / p.image
        # A sample is taken in the middle of its interval: then trace and retrace coincide.
        p.shift = 0.5 * sample
        ticks = ticks_of(motion.samples * sample, control)
    elif isinstance(motion, Sampled):
        p.motion, p.piece_time, p.pieces = SAMPLED, motion.period, motion.pieces
        p.first_piece = len(numbers) - 2 * DEGREES * motion.pieces
        ticks = ticks_of(motion.pieces * motion.period, control)
    else:
        ticks = motion.ticks
        p.motion, p.curve_time = POLYNOMIAL, max(ticks, 1) * control
        for name, coefficients in (("curve_x", motion.x), ("curve_y", motion.y)):
            p[name][:] = 0.0
            p[name][: len(coefficients)] = coefficients
    # In the middle between the samples before and in the last control tick.
    p.last = (tick + ticks - 1) * control - 0.5 * sample
    s.number, s.done, s.fired = p.number, 0.0, 0.0
    s.at, s.since, s.origin = (0.0 if order.steps else float(END)), p.begin, s.offset
    if order.steps and order.steps[0].kind == REST:
        s.total = s.samples = 0.0
    return numbers


VERBS = Program(
    name="verbs",
    parameters=VerbsParameters,
    constants=Constants,
    state=State,
    values=values,
    start=start,
    check=_check,
    reference=reference,
    watch=watch,
    order=put_in_force,
    channels=(
        Channel("verb_number", "1", "number"),
        Channel("verb_step", "1", "at"),
        Channel("verb_done", "1", "done"),
        Channel("z_offset", "m", "offset"),
    ),
)
