"""The 128 signals that clients read by index, and what they are here."""

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from afm_model.microscope.collect import Reading

from .codec import ProtocolError
from .settings import Settings
from .table import COMMANDS

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
CONFIGS = {VERTICAL: "BeamDefl.VerConfigGet", HORIZONTAL: "BeamDefl.HorConfigGet"}


class Signals:
    """Names, units and values of the signals.

    Parameters
    ----------
    read : callable
        Names -> Readings of the signals of the microscope as they are now; without names of all.
    settings : Settings
    """

    def __init__(self, read: Callable[..., Mapping[str, Reading]], settings: Settings) -> None:
        self._read, self._settings = read, settings
        known = set(read())
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
        name, unit, calibration, offset = self._settings.of(COMMANDS[CONFIGS[index]])
        return name, unit, calibration, offset

    def named(self, index: int) -> tuple[str, str]:
        """Name and unit."""
        if index in CONFIGS:
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
        if index in CONFIGS:
            _, _, calibration, offset = self.config(index)
            return calibration * value + offset
        return value

    def constant(self, index: int) -> float | None:
        """Value of a signal that the microscope does not have; None: it has it."""
        if index == BIAS:
            return float(self._settings.of(COMMANDS["Bias.Get"])[0])
        return None if self.source(index).signal else 0.0

    def values(self, indices: Iterable[int]) -> list[float]:
        """Present values, at one instant."""
        wanted = list(indices)
        sources = {index: self.source(index) for index in wanted}
        names = dict.fromkeys(each.signal for each in sources.values() if each.signal)
        read = self._read(*names) if names else {}
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
