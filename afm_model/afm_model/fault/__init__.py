"""Faults: what goes wrong between instrument and controller, and with the sample."""

from ..core.registry import register
from ..parts.groups import FaultParameters
from .entry import KINDS, LATENCY_TICKS, NEVER, TARGETS, Entry
from .events import acted, active, events
from .memory import CONSTANTS, MEMORY, ON_THEIR_WAY, SENSED
from .none import NONE
from .schedule import SCHEDULED, Schedule, faults_of, table

register(NONE, SCHEDULED)

__all__ = [
    "CONSTANTS",
    "KINDS",
    "LATENCY_TICKS",
    "MEMORY",
    "NEVER",
    "NONE",
    "ON_THEIR_WAY",
    "SCHEDULED",
    "SENSED",
    "TARGETS",
    "Entry",
    "FaultParameters",
    "Schedule",
    "acted",
    "active",
    "events",
    "faults_of",
    "table",
]
