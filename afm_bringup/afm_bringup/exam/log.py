"""What passed between an examiner and a controller. Needs no ROS."""

from dataclasses import dataclass, field
from enum import Enum

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
    RESTART = "after a restart of the simulator"


ASKED_ONE_BY_ONE = (Phase.LOCKSTEP, Phase.RESUMED, Phase.RESET, Phase.FAULT, Phase.RESTART)
"""Phases in which the next measurement waits for the answer to this one."""


@dataclass(frozen=True)
class Asked:
    """A measurement that was published."""

    phase: Phase
    sequence: int
    time: float  # steady wall time [s]


@dataclass(frozen=True)
class Answer:
    """A message on `piezo_drive`."""

    phase: Phase
    sequence: int
    time: float
    drives: NDArray[np.float64]  # (1 + horizon, 3) [V]
    frame: str = "scanner"
    unreadable: str = ""  # why it is no drive; empty if it is one


@dataclass
class Log:
    """Everything that passed, in order, and what was seen besides."""

    asked: list[Asked] = field(default_factory=list)
    answers: list[Answer] = field(default_factory=list)
    begun: list[Phase] = field(default_factory=list)
    ended: str = ""  # how the controller ended by itself; empty: it did not
    unheard: str = ""  # why the middleware does not connect it
    absent: str = ""  # what it lacks that it could be tested at all
    reconnected: bool = True
    went: bool | None = None  # whether it ended when it was asked to; None: not tried
