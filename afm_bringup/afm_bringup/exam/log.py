"""What was sent to a controller and what it answered. Needs no ROS."""

from dataclasses import dataclass, field
from enum import Enum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray


class Phase(Enum):
    """Parts of the examination, in order; the text is for a person."""

    LOCKSTEP = "one measurement after the other"
    REALTIME = "measurements by the clock"
    PAUSE = "no measurement"
    RESUMED = "after the pause"
    AGAIN = "a measurement that is sent again"
    RESET = "after a reset: the numbers begin again"
    FAULT = "sensors that fail, measurements that get lost"
    LONG = "many measurements, one after the other"
    STEPS = "references and measured positions that jump"
    REPEAT = "the first measurements after a reset, again"
    RESTART = "after a restart of the simulator"


IN_LOCKSTEP = tuple(phase for phase in Phase if phase not in (Phase.REALTIME, Phase.PAUSE, Phase.AGAIN))
"""Phases in which the next measurement waits for the answer to this one."""


class Jump(NamedTuple):
    """By what a measurement differs from that of a microscope at rest."""

    axis: int = 0
    sense: int = 0  # in which it has been moved; 0: it has not
    measured: bool = False  # its measured position, else its reference


NO_JUMP = Jump()


@dataclass(frozen=True)
class Sent:
    """A measurement that was published."""

    phase: Phase
    sequence: int
    time: float  # [s]
    jump: Jump = NO_JUMP


@dataclass(frozen=True)
class Answer:
    """A message on `piezo_drive`."""

    phase: Phase
    sequence: int
    time: float  # [s]
    drives: NDArray[np.float64]  # (1 + horizon, 3) [V]
    frame: str = "scanner"
    unreadable: str = ""  # why it is no drive; empty if it is one
    stamp: float = 0.0  # [s]
    horizon_period: float = 0.0  # [s]
    other_run: bool = False  # whether it names another run than that of the measurements


@dataclass
class Log:
    """Everything sent and received, in order, and how the connection began and ended."""

    sent: list[Sent] = field(default_factory=list)
    answers: list[Answer] = field(default_factory=list)
    begun: list[Phase] = field(default_factory=list)
    motion: list[NDArray[np.float64]] = field(default_factory=list)
    """At each tick of the phase LOCKSTEP, (2, 3) [m]: measured position of x and y, deflection; reference of x and y,
    deflection at rest.
    """
    memory: list[int] = field(default_factory=list)  # of the controller, again and again in the phase LONG [bytes]
    ended: str = ""  # how the controller ended before its test was over; empty: it did not
    incompatible: str = ""  # why the middleware does not connect it
    absent: str = ""  # what is missing for a test
    reconnected: bool = True
    went: bool | None = None  # whether it ended on request; None: not tried
