"""What a schedule of faults remembers from tick to tick, and what it is made of.

None of it is state of the instrument, so none is in `trajectory_sha256`: a run with the same motion has the same hash,
whatever was between instrument and controller.
"""

from ..core.records import place, record, size
from ..parts.signals import COMMAND, MEASUREMENT
from .entry import LATENCY_TICKS

MOST = 16
"""Faults at a time at most: those that are over, and those that have not begun, take no place."""
SLOTS = LATENCY_TICKS + 1
"""Messages of each direction that may be on their way."""
COMMAND_SIZE = size(COMMAND)
SENSED = place(MEASUREMENT, "reference_position")
"""Numbers at the begin of a measurement that sensors have told."""

_TABLE = ("kind", "target", "first", "last", "seed", "size")
CONSTANTS = record(
    "count",  # faults
    "on_sensors",  # those of each sort
    "on_drives",
    "on_measurements",
    "on_commands",
    "on_sample",
    *_TABLE,  # of each fault: numbers of kind and target, first tick and the first one after it, seed, size
    "control_period",  # [s]
    "dac_period",  # [s]
    "deflection_sensitivity",  # [m/V]
    "lateral_sensitivity",  # [N/V]
    "x0",  # [m]
    "z0",  # [m]
    integers=("count", "on_sensors", "on_drives", "on_measurements", "on_commands", "on_sample", *_TABLE[:-1]),
    arrays={name: (MOST,) for name in _TABLE},
)

MEMORY = record(
    "lost",  # 1: the measurement of this tick is not sent
    "shown",  # tick of the sensor values that the controller was told last
    "in_force",  # tick of the command that arrived last
    "passed",  # sequence of the command that was passed last
    "passed_voltage",  # and its drive [V]
    "begun",  # of each fault: whether `held` has been taken
    "held",  # value of a stuck signal
    "shown_at",  # tick at which sensor values arrive, by slot
    "arrives_at",  # the same of a command; negative: it is lost, or there was none
    "sensed",  # sensor values, by slot
    "kept",  # the command that arrived last
    "commands",  # commands, by slot
    vectors=("passed_voltage",),
    integers=("lost", "shown", "in_force", "passed", "begun", "shown_at", "arrives_at"),
    arrays={
        "begun": (MOST,),
        "held": (MOST,),
        "shown_at": (SLOTS,),
        "arrives_at": (SLOTS,),
        "sensed": (SLOTS, SENSED),
        "kept": (COMMAND_SIZE,),
        "commands": (SLOTS, COMMAND_SIZE),
    },
)
MEMORY_SIZE = size(MEMORY)
"""3.2 MB: an array of its own, that is there when the first fault is; its address stands in the header."""
KEPT, COMMANDS = place(MEMORY, "kept"), place(MEMORY, "commands")
"""Where in it commands begin."""
