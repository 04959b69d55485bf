"""The 128 signals that clients read by index, and what they are here."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from .codec import ProtocolError
from .handlers import handles
from .table import COMMANDS

if TYPE_CHECKING:
    from .front import Front

COUNT, SLOTS = 128, 24
CURRENT, VERTICAL, HORIZONTAL, Z, BIAS = 0, 1, 2, 14, 24
"""Indices that others know."""


@dataclass(frozen=True)
class Source:
    """A signal of the microscope, as clients see it."""

    name: str
    unit: str
    signal: str = ""  # of afm_model; empty: a constant 0
    channel: str = ""  # of a scan, if it has another name there
    factor: float = 1.0
    scan_factor: float = 1.0
    largest: float = 10.0


_Z = Source("Z", "m", "z", "height", -1.0)
_SOURCES = {
    CURRENT: Source("Current", "A", largest=1e-8),
    VERTICAL: Source("Vert. Deflection", "V", "deflection_voltage"),
    HORIZONTAL: Source("Horiz. Deflection", "V", "lateral_voltage"),
    8: Source("Amplitude", "m", "amplitude", largest=1e-6),
    9: Source("Phase", "deg", "phase", factor=180.0 / math.pi, scan_factor=180.0 / math.pi, largest=180.0),
    10: Source("Frequency Shift", "Hz", "frequency_shift", largest=1e4),
    11: Source("Excitation", "m", "drive_amplitude", largest=1e-6),
    Z: _Z,
    15: Source("X", "m", "x"),
    16: Source("Y", "m", "y"),
    BIAS: Source("Bias", "V"),
    30: _Z,
    86: Source("LI Demod 1 X", "A"),
    87: Source("LI Demod 1 Y", "A"),
}
_CONFIGS = {VERTICAL: "BeamDefl.VerConfigGet", HORIZONTAL: "BeamDefl.HorConfigGet"}
_OFFSETS = {0: HORIZONTAL, 1: VERTICAL}
"""Signal by the first argument of BeamDefl.AutoOffset."""


class Signals:
    """Names, units and values of the signals.

    Parameters
    ----------
    front : Front
    """

    def __init__(self, front: "Front") -> None:
        self._front = front
        known = set(front.read())
        self._sources = {
            index: each if each.signal in known or not each.signal else Source(each.name, each.unit)
            for index, each in _SOURCES.items()
        }

    def source(self, index: int) -> Source:
        """What a signal is."""
        if not 0 <= index < COUNT:
            raise ProtocolError(f"signal {index} is not allowed: it must be 0 to {COUNT - 1}")
        return self._sources.get(index) or Source(f"Internal {index}", "V")

    def config(self, index: int) -> tuple[str, str, float, float]:
        """Name, unit, units per volt and offset of a signal of the photodiode."""
        name, unit, calibration, offset = self._front.settings.of(COMMANDS[_CONFIGS[index]])
        return name, unit, calibration, offset

    def named(self, index: int) -> tuple[str, str]:
        """Name and unit."""
        if index in _CONFIGS:
            return self.config(index)[:2]
        source = self.source(index)
        return source.name, source.unit

    def title(self, index: int) -> str:
        """Name with unit."""
        return "{} ({})".format(*self.named(index))

    def scaled(self, index: int, value: Any, *, of_scan: bool = False) -> Any:
        """A value of the microscope as clients see it."""
        source = self.source(index)
        value = (source.scan_factor if of_scan else source.factor) * value
        if index in _CONFIGS:
            _, _, calibration, offset = self.config(index)
            return calibration * value + offset
        return value

    def constant(self, index: int) -> float | None:
        """Value of a signal that the microscope does not have; None: it has it."""
        if index == BIAS:
            return float(self._front.settings.of(COMMANDS["Bias.Get"])[0])
        return None if self.source(index).signal else 0.0

    def values(self, indices: Iterable[int]) -> list[float]:
        """Present values, at one instant."""
        wanted = list(indices)
        sources = {index: self.source(index) for index in wanted}
        names = dict.fromkeys(each.signal for each in sources.values() if each.signal)
        read = self._front.read(*names) if names else {}
        found = []
        for index in wanted:
            constant = self.constant(index)
            value = read[sources[index].signal].value if constant is None else constant
            found.append(self.scaled(index, value) if constant is None else value)
        return found

    def volts(self, value: float) -> float:
        """Vertical deflection [V] of a value in the units of its signal."""
        _, _, calibration, offset = self.config(VERTICAL)
        return (value - offset) / calibration if calibration else 0.0


@handles("Signals.NamesGet", "Signals.MeasNamesGet")
def _names(front: "Front") -> list[Any]:
    return [[front.signals.title(index) for index in range(COUNT)]]


@handles("Signals.InSlotsGet")
def _slots(front: "Front") -> list[Any]:
    return [[front.signals.title(index) for index in range(SLOTS)], list(range(SLOTS))]


@handles("Signals.CalibrGet")
def _calibration(front: "Front", index: int) -> list[Any]:
    front.signals.source(index)
    return list(front.signals.config(index)[2:]) if index in _CONFIGS else [1.0, 0.0]


@handles("Signals.RangeGet")
def _range(front: "Front", index: int) -> list[Any]:
    if index in (Z, 30):
        return list(front.z_limits)
    if index in (15, 16):
        half = 0.5 * front.ranges[index - 15]
        return [half, -half]
    largest = front.signals.source(index).largest
    return [largest, -largest]


@handles("Signals.ValGet")
def _value(front: "Front", index: int, wait: int) -> list[Any]:
    return front.signals.values([index])


@handles("Signals.ValsGet")
def _values(front: "Front", indices: Sequence[int], wait: int) -> list[Any]:
    return [front.signals.values(indices)]


@handles("Signals.AddRTGet")
def _further(front: "Front") -> list[Any]:
    return [[], "", ""]


@handles("BeamDefl.AutoOffset")
def _auto_offset(front: "Front", which: int) -> list[Any]:
    if which == 2:
        return []
    if which not in _OFFSETS:
        raise ProtocolError(f"signal {which} is not allowed: it must be 0 (horizontal), 1 (vertical) or 2 (intensity)")
    index = _OFFSETS[which]
    name, unit, calibration, offset = front.signals.config(index)
    (value,) = front.signals.values([index])
    command = COMMANDS[_CONFIGS[index].replace("Get", "Set")]
    front.settings.serve(command, [name, unit, calibration, offset - value])
    return []


@handles("Current.Get", "Current.100Get", "Current.BEEMGet")
def _current(front: "Front") -> list[Any]:
    return front.signals.values([CURRENT])


@handles("SafeTip.SignalGet")
def _watched(front: "Front") -> list[Any]:
    return front.signals.values([VERTICAL])
