"""What can be ordered of the program `verbs`: a motion of x, y and a table of what z does meanwhile. SI units.

An order is written between two control ticks and is in force from the next one on. It is done when the motion has come
to its end and the table too; x, y then stay, z stays as its last step left it.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

MOST_STEPS = 16
"""Of a table."""
CURVE, LINES = range(2)
"""Motions along x and y."""
FOLLOW, DWELL, REST, RAMP = range(4)
"""What z does in a step: follow the setpoint; stay; stay while the mean of the deflection is taken; move."""
END = -1
"""Next step that is none."""


class Step(NamedTuple):
    """One step of the table of z. It is left at a sample of the virtual ADC."""

    kind: int  # FOLLOW, DWELL, REST or RAMP
    duration: float = 0.0  # of all but RAMP [s]
    target: float = 0.0  # of RAMP: offset of z from where it stood when the loop was opened [m]
    rate: float = 0.0  # of RAMP: |dz/dt| [m/s]
    trigger: float = 0.0  # of RAMP: rise of the deflection over its mean in the last REST [V]; 0: none
    then: int = END  # step behind its end
    triggered: int = END  # step behind its trigger


@dataclass(frozen=True)
class Curve:
    """Polynomials of time: x = sum of x[i] s^i [m], s from 0 to 1 in `ticks` control periods; six coefficients at most.

    With one coefficient each the scanner stays; without ticks it stays for ever, and the order is done with its table.
    """

    x: tuple[float, ...]
    y: tuple[float, ...]
    ticks: int = 0


@dataclass(frozen=True)
class Lines:
    """Lines to and fro at even speed, with rounded turns of continuous acceleration.

    In order: a lead-in as long as a turn, then for each line trace, turn, retrace, turn; the last turn is a lead-out.
    The slow axis steps during the turn behind a retrace. Times are samples of the virtual ADC.
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


@dataclass(frozen=True)
class Order:
    """A motion of x and y, and what z does."""

    motion: Curve | Lines
    steps: tuple[Step, ...] = ()
    """At most MOST_STEPS, beginning with the first; none: z stays as it is."""


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


def columns(steps: tuple[Step, ...]) -> dict[str, NDArray[np.float64]]:
    """The table by the names of its columns, each (MOST_STEPS,)."""
    if len(steps) > MOST_STEPS:
        raise ValueError(f"{len(steps)} steps are not allowed: an order has {MOST_STEPS} at most")
    table = {name: np.zeros(MOST_STEPS) for name in Step._fields}
    for number, step in enumerate(steps):
        for name, value in zip(Step._fields, step, strict=True):
            table[name][number] = value
    return table
