"""What can be ordered of the program `verbs`: a motion of x, y and a table of what z does meanwhile. SI units.

An order is written between two control ticks and is in force from the next one on. It is done when the motion has come
to its end and the table too; x, y then stay, z stays as its last step left it. Motion and table may be of any length.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..compiled.records import Record, size
from ..core.errors import ParameterError
from ..core.splines import clamped_spline

DEGREES = 6
"""Coefficients of a polynomial."""
POLYNOMIAL, LINES, SAMPLED = range(3)
"""Motions along x and y."""
FOLLOW, DWELL, REST, RAMP, PROFILE = range(5)
"""What z does in a step: follow the setpoint; stay; stay while the mean of the deflection is taken; move at a rate;
move by a profile.
"""
END = -1
"""Number of the next step if no step follows."""
DEFLECTION, AMPLITUDE = range(2)
"""What a trigger looks at: the rise of the deflection; the amplitude of the lock-in, which falls."""


class Step(NamedTuple):
    """One step of the table of z. It is left at a sample of the virtual ADC.

    Offsets are those of z from where it stood when the loop was opened.
    """

    kind: int  # FOLLOW, DWELL, REST, RAMP or PROFILE
    duration: float = 0.0  # of FOLLOW, DWELL and REST [s]
    target: float = 0.0  # of RAMP: offset [m]
    rate: float = 0.0  # of RAMP: |dz/dt| [m/s]
    trigger: float = 0.0  # of RAMP: rise of the deflection over its mean in the last REST, or amplitude [V]; 0: none
    then: int = END  # step behind its end
    triggered: int = END  # step behind its trigger
    profile: ArrayLike = ()  # of PROFILE: offsets over time, linear between, one at least (n,) [m]
    period: float = 1.0  # of PROFILE: from one to the next [s]
    watched: int = DEFLECTION  # of RAMP: what its trigger looks at, DEFLECTION or AMPLITUDE


class StepRecord(Record):
    """A step in an order's numbers; `begin` and `count` say where among them its profile is."""

    kind: float
    duration: float
    target: float
    rate: float
    trigger: float
    then: float
    triggered: float
    period: float
    watched: float
    begin: float
    count: float


@dataclass(frozen=True)
class Polynomial:
    """Polynomials of time: x = sum of x[i] s^i [m], s from 0 to 1 in `ticks` control periods; six coefficients at most.

    With one coefficient each the scanner stays; without ticks it stays for ever, and the order is done with its table.
    """

    x: tuple[float, ...]
    y: tuple[float, ...]
    ticks: int = 0


@dataclass(frozen=True, eq=False)
class Sampled:
    """A motion through samples, from rest to rest: cubic splines, with continuous acceleration."""

    x: ArrayLike  # places over time (n,), two at least [m]
    y: ArrayLike
    period: float  # from one to the next [s]

    @property
    def pieces(self) -> int:
        """From sample to sample."""
        return len(np.asarray(self.x)) - 1

    def coefficients(self) -> NDArray[np.float64]:
        """Of each piece, x and y (pieces, 2, DEGREES): its place is a polynomial of s from 0 to 1."""
        found = np.zeros((self.pieces, 2, DEGREES))
        for axis, values in enumerate((self.x, self.y)):
            found[:, axis, :4] = clamped_spline(np.asarray(values, np.float64))
        return found


@dataclass(frozen=True)
class Lines:
    """Lines to and fro at even speed, with rounded turns of continuous acceleration.

    In order: a lead-in as long as a turn, then for each line trace, turn, retrace, turn; the last turn is a lead-out.
    The slow axis steps during the turn after a retrace. Times are samples of the virtual ADC.
    """

    x: float  # middle of the frame [m]
    y: float
    angle: float  # of the fast direction against x [rad]
    size: float  # of the image part of a line [m]
    first: float  # slow coordinate of the first line [m]
    step: float  # of the slow axis from line to line [m]
    lines: int
    image: int  # samples of the image part of one direction
    turn: int  # samples of a turn

    @property
    def samples(self) -> int:
        """Of all."""
        return self.turn + 2 * self.lines * (self.image + self.turn)


def _problem(step: Step, count: int) -> str:
    """What of a step of a table of so many steps cannot be, a clause; empty if nothing."""
    for name in ("then", "triggered"):
        to = getattr(step, name)
        if not END <= to < count:
            return f"{name} = {to} is not allowed: there are the steps 0 to {count - 1}, and the end, {END}"
    positive = {RAMP: "rate", PROFILE: "period"}.get(step.kind)
    for name in ("duration", "rate", "trigger", "period"):
        value = getattr(step, name)
        # A rest may last for ever.
        if not (value > 0.0 if name == positive else value >= 0.0) or (name != "duration" and math.isinf(value)):
            return f"{name} = {value:g} is not allowed: it must be {'>' if name == positive else '>='} 0 and finite"
    if not math.isfinite(step.target):
        return f"target = {step.target:g} m is not allowed: it must be finite"
    if step.watched not in (DEFLECTION, AMPLITUDE):
        return f"watched = {step.watched} is not allowed: it must be {DEFLECTION} (deflection), {AMPLITUDE} (amplitude)"
    if step.kind == PROFILE and not (np.size(step.profile) and np.isfinite(step.profile).all()):
        return "its profile is not allowed: it must be one finite number at least"
    return ""


@dataclass(frozen=True, eq=False)
class Order:
    """A motion of x and y, and what z does."""

    motion: Polynomial | Lines | Sampled
    steps: tuple[Step, ...] = ()
    """Beginning with the first; none: z stays as it is."""

    def __post_init__(self) -> None:
        for number, step in enumerate(self.steps):
            if problem := _problem(step, len(self.steps)):
                raise ParameterError(f"step {number} of the table of z with {problem}")
        ways = [{step.then, step.triggered if step.trigger > 0.0 else step.then} for step in self.steps]
        ending: set[int] = {END}
        while more := {number for number, way in enumerate(ways) if way & ending} - ending:
            ending |= more
        if never := set(range(len(ways))) - ending:
            raise ParameterError(
                f"step {min(never)} of the table of z never leads to its end: some `then` must be {END}"
            )

    def numbers(self) -> NDArray[np.float64]:
        """What a kernel reads outside the block: steps (StepRecord), their profiles, the pieces of the motion."""
        rows = np.zeros(len(self.steps), StepRecord)
        profiles = [np.asarray(step.profile, np.float64) for step in self.steps]
        begin = len(self.steps) * size(StepRecord)
        for row, step, profile in zip(rows, self.steps, profiles, strict=True):
            for name, value in zip(Step._fields, step, strict=True):
                if name != "profile":
                    row[name] = value
            row["begin"], row["count"] = begin, len(profile)
            begin += len(profile)
        pieces = self.motion.coefficients() if isinstance(self.motion, Sampled) else np.zeros(0)
        return np.concatenate([rows.view(np.float64).ravel(), *profiles, pieces.ravel()])


def quintic(
    ticks: int, period: float, begin: tuple[float, float, float], end: tuple[float, float, float]
) -> tuple[float, ...]:
    """Coefficients of the polynomial of fifth degree between two states.

    Parameters
    ----------
    ticks : int
        Its duration in control periods.
    period : float [s]
        Control period.
    begin, end : (position, velocity, acceleration), SI
    """
    T = ticks * period
    p, v, a = begin[0], begin[1] * T, begin[2] * T * T
    # What the end differs by from going on with the acceleration of the begin.
    dp, dv, da = end[0] - p - v - 0.5 * a, end[1] * T - v - a, end[2] * T * T - a
    return (
        p,
        v,
        0.5 * a,
        10.0 * dp - 4.0 * dv + 0.5 * da,
        -15.0 * dp + 7.0 * dv - da,
        6.0 * dp - 3.0 * dv + 0.5 * da,
    )
