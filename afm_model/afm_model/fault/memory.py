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
    "shown",  # tick of the sensor values that the controller was told last
    "in_force",  # tick of the command that arrived last
    "passed",  # sequence of the command that was passed last
    "passed_voltage",  # and its drive [V]
    "begun",  # of each fault: whether `held` has been taken
    "held",  # value of a stuck signal
    "messages",  # address of the record ON_THEIR_WAY
    vectors=("passed_voltage",),
    integers=("shown", "in_force", "passed", "begun", "messages"),
    arrays={"begun": (MOST,), "held": (MOST,)},
)
ON_THEIR_WAY = record(
    "shown_at",  # tick at which sensor values arrive, by slot
    "arrives_at",  # the same of a command; negative: it is lost, or there was none
    "sensed",  # sensor values, by slot
    "commands",  # commands, by slot
    integers=("shown_at", "arrives_at"),
    arrays={
        "shown_at": (SLOTS,),
        "arrives_at": (SLOTS,),
        "sensed": (SLOTS, SENSED),
        "commands": (SLOTS, size(COMMAND)),
    },
)
"""Messages on their way, 3.2 MB: kept beside the block, once there is a fault of messages."""
