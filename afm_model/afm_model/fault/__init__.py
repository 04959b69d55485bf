"""Faults: what goes wrong between instrument and controller, and with the sample."""

from ..core.registry import register
from ..parts.groups import FaultParameters
from .events import acted, active, events
from .memory import SENSED, Constants, Memory, OnTheirWay
from .none import NONE
from .schedule import SCHEDULED, Schedule, faults_of, table
from .schedule_entry import KINDS, LATENCY_TICKS, NEVER, TARGETS, Entry

register(NONE, SCHEDULED)

__all__ = [
    "KINDS",
    "LATENCY_TICKS",
    "NEVER",
    "NONE",
    "SCHEDULED",
    "SENSED",
    "TARGETS",
    "Constants",
    "Entry",
    "FaultParameters",
    "Memory",
    "OnTheirWay",
    "Schedule",
    "acted",
    "active",
    "events",
    "faults_of",
    "table",
]
