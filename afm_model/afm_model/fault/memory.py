"""What a schedule of faults remembers from tick to tick, and what it is made of.

None of it is state of the instrument, so none is in `trajectory_sha256`: a run with the same motion has the same hash,
whatever was between instrument and controller.
"""

from typing import Annotated

from ..compiled.records import Array, Integers, Record, Vector, place, size
from ..parts.signals import Measurement, PiezoDrive
from .schedule_entry import LATENCY_TICKS

MOST = 16
"""Faults at a time at most: those that are over, and those that have not begun, take no place."""
SLOTS = LATENCY_TICKS + 1
"""Messages of each direction that may be on their way."""
SENSED = place(Measurement, "reference_position")
"""Numbers at the beginning of a measurement that come from sensors."""


class Constants(Record):
    count: int  # faults
    on_sensors: int  # those of each sort
    on_drives: int
    on_measurements: int
    on_commands: int
    on_sample: int
    kind: Annotated[Integers, (MOST,)]
    target: Annotated[Integers, (MOST,)]
    first: Annotated[Integers, (MOST,)]
    last: Annotated[Integers, (MOST,)]
    seed: Annotated[Integers, (MOST,)]
    magnitude: Annotated[Array, (MOST,)]
    control_period: Annotated[float, "s"]
    dac_period: Annotated[float, "s"]
    deflection_sensitivity: Annotated[float, "m/V"]
    lateral_sensitivity: Annotated[float, "N/V"]
    x0: Annotated[float, "m"]
    z0: Annotated[float, "m"]


class Memory(Record):
    shown: int  # tick of the sensor values that the controller was told last
    in_force: int  # tick of the command that arrived last
    passed: int  # sequence of the command that was passed last
    passed_voltage: Annotated[Vector, "V"]  # and its drive
    begun: Annotated[Integers, (MOST,)]  # of each fault: whether `held` has been taken
    held: Annotated[Array, (MOST,)]  # value of a stuck signal
    messages: int  # address of the record OnTheirWay


class OnTheirWay(Record):
    """Messages on their way, 3.2 MB: kept outside the block, once there is a fault of messages."""

    shown_at: Annotated[Integers, (SLOTS,)]  # tick at which sensor values arrive, by slot
    arrives_at: Annotated[Integers, (SLOTS,)]  # the same of a command; negative: it is lost, or there was none
    sensed: Annotated[Array, (SLOTS, SENSED)]  # sensor values, by slot
    commands: Annotated[Array, (SLOTS, size(PiezoDrive))]  # commands, by slot
