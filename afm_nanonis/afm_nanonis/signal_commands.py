"""Commands that ask for signals."""

from collections.abc import Sequence
from typing import Any

from .codec import ProtocolError
from .front import Front
from .handlers import handles
from .signal_index import CONFIGS, COUNT, CURRENT, HORIZONTAL, SLOTS, VERTICAL, Z
from .table import COMMANDS

_OFFSETS = {0: HORIZONTAL, 1: VERTICAL}
"""Signal by the first argument of BeamDefl.AutoOffset."""


@handles("Signals.NamesGet", "Signals.MeasNamesGet")
def _names(front: Front) -> list[Any]:
    return [[front.signals.title(index) for index in range(COUNT)]]


@handles("Signals.InSlotsGet")
def _slots(front: Front) -> list[Any]:
    return [[front.signals.title(index) for index in range(SLOTS)], list(range(SLOTS))]


@handles("Signals.CalibrGet")
def _calibration(front: Front, index: int) -> list[Any]:
    front.signals.source(index)
    return list(front.signals.config(index)[2:]) if index in CONFIGS else [1.0, 0.0]


@handles("Signals.RangeGet")
def _range(front: Front, index: int) -> list[Any]:
    if index in (Z, 30):
        return list(front.z_limits)
    if index in (15, 16):
        half = 0.5 * front.ranges[index - 15]
        return [half, -half]
    largest = front.signals.source(index).largest
    return [largest, -largest]


@handles("Signals.ValGet")
def _value(front: Front, index: int, wait: int) -> list[Any]:
    return front.signals.values([index])


@handles("Signals.ValsGet")
def _values(front: Front, indices: Sequence[int], wait: int) -> list[Any]:
    return [front.signals.values(indices)]


@handles("Signals.AddRTGet")
def _further(front: Front) -> list[Any]:
    return [[], "", ""]


@handles("BeamDefl.AutoOffset")
def _auto_offset(front: Front, which: int) -> list[Any]:
    if which == 2:
        return []
    if which not in _OFFSETS:
        raise ProtocolError(f"signal {which} is not allowed: it must be 0 (horizontal), 1 (vertical) or 2 (intensity)")
    index = _OFFSETS[which]
    name, unit, calibration, offset = front.signals.config(index)
    (value,) = front.signals.values([index])
    command = COMMANDS[CONFIGS[index].replace("Get", "Set")]
    front.settings.serve(command, [name, unit, calibration, offset - value])
    return []


@handles("Current.Get", "Current.100Get", "Current.BEEMGet")
def _current(front: Front) -> list[Any]:
    return front.signals.values([CURRENT])


@handles("SafeTip.SignalGet")
def _watched(front: Front) -> list[Any]:
    return front.signals.values([VERTICAL])
