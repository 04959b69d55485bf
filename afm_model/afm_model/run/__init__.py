"""A run of the instrument: states, lockstep and realtime, watchdog, counts. Needs no ROS, no sleep, no real clock."""

from .counts import Counts, Snapshot
from .engine import Engine, VerbOperator
from .link import Link, Listeners
from .replay import Replay, recorded_parameters
from .run import Run
from .simulated import Latency, RealtimeSimulation, SimulatedLink, simulate_realtime
from .state import OVER, TICKING, TRANSITIONS, Cause, RunError, RunState
from .timing import Delays, VirtualClock
from .verdict import outside, reasons, retracted_fraction, saturated, shortfall, verdict, warning, warnings

__all__ = [
    "OVER",
    "TICKING",
    "TRANSITIONS",
    "Cause",
    "Counts",
    "Delays",
    "Engine",
    "Latency",
    "Link",
    "Listeners",
    "RealtimeSimulation",
    "Replay",
    "Run",
    "RunError",
    "RunState",
    "SimulatedLink",
    "Snapshot",
    "VerbOperator",
    "VirtualClock",
    "outside",
    "reasons",
    "recorded_parameters",
    "retracted_fraction",
    "saturated",
    "shortfall",
    "simulate_realtime",
    "verdict",
    "warning",
    "warnings",
]
