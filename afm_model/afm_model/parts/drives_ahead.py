"""A drive with further ones to follow, as a law in Python answers it."""

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..compiled.records import place, record_at
from ..core.errors import DriveError
from .signals import LONGEST_HORIZON, PiezoDrive

_Array = NDArray[np.float64]


_REAL = "fiu"
"""Kinds of arrays that are voltages."""


def three_voltages(drive: Any) -> NDArray[Any]:
    """A drive as an array.

    Raises
    ------
    DriveError
        If it is not three real numbers.
    """
    try:
        volts = np.asarray(drive)
    except (TypeError, ValueError):
        volts = np.zeros(0)
    if volts.shape != (3,):
        shown = volts.tolist() if volts.size else drive
        raise DriveError(f"drive {shown} is not allowed: it must be three voltages")
    if volts.dtype.kind not in _REAL:
        raise DriveError(f"drive {volts.tolist()} is not allowed: it must be three real numbers")
    return volts


def _no_horizon() -> _Array:
    return np.zeros((0, 3))


@dataclass(frozen=True, eq=False)
class Command:
    """A drive, and further drives with their times: what holds if the next answer is late.

    Parameters
    ----------
    voltage : ndarray (3,) [V]
        In force from the arrival of the answer on.
    horizon : ndarray (n, 3) [V]
        Drive i is in force from (i + 1) `horizon_period` after the measurement that it answers; the last one is held.
        All are dropped when an answer to a later measurement is put in force.
    horizon_period : float [s]
        Of simulated time.

    Raises
    ------
    DriveError
        If these are not so many numbers, the horizon is longer than `afm_model.parts.signals.LONGEST_HORIZON`, or has
        no period. Whether the drives are finite is judged where they are put in force.
    """

    voltage: _Array
    horizon: _Array = field(default_factory=_no_horizon)
    horizon_period: float = 0.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "voltage", np.array(three_voltages(self.voltage), np.float64))
        horizon = np.asarray(self.horizon)
        if horizon.dtype.kind not in _REAL:
            raise DriveError(f"a horizon of {horizon.dtype} is not allowed: it must be of real numbers")
        object.__setattr__(self, "horizon", np.array(horizon, np.float64))
        if self.horizon.ndim != 2 or self.horizon.shape[1] != 3:
            raise DriveError(
                f"a horizon of shape {self.horizon.shape} is not allowed: it must be n rows of three voltages"
            )
        if len(self.horizon) > LONGEST_HORIZON:
            raise DriveError(_too_long(len(self.horizon)))
        if len(self.horizon) and not (0.0 < self.horizon_period < np.inf):
            raise DriveError(
                f"horizon_period = {self.horizon_period} s is not allowed: with a horizon it must be finite and > 0"
            )

    def covers(self, age: float) -> bool:
        """Return whether it holds a drive for a time this long after the measurement that it answers [s]."""
        return age < (len(self.horizon) + 1) * self.horizon_period * (1.0 - 1e-9)


class CommandRecord:
    """A record of `afm_model.parts.signals.PiezoDrive` as Python reads and writes it.

    Its fields are views that are made once: reading a field of the record itself takes numpy ten microseconds, and
    writing to an array twice as long as to a memoryview.

    Parameters
    ----------
    array : ndarray, float64
        Where it stands, (size(PiezoDrive),).
    """

    def __init__(self, array: _Array) -> None:
        record = record_at(array, 0, PiezoDrive)
        integers: Any = array.view(np.int64)
        self.voltage: _Array = record.voltage
        self.sequence = memoryview(integers[place(PiezoDrive, "sequence") :])
        self.horizon_count = memoryview(integers[place(PiezoDrive, "horizon_count") :])
        self._horizon_period, self._horizon = array[place(PiezoDrive, "horizon_period") :], record.horizon

    def write(self, command: Command) -> None:
        """Write drive and horizon."""
        count = len(command.horizon)
        self.voltage[:] = command.voltage
        self.horizon_count[0] = count
        self._horizon_period[0] = command.horizon_period
        self._horizon[:count] = command.horizon

    def read(self) -> Command:
        """Its contents.

        Raises
        ------
        DriveError
            As `Command` does.
        """
        count: int = self.horizon_count[0]
        if not 0 <= count <= LONGEST_HORIZON:
            raise DriveError(_too_long(count))
        return Command(self.voltage, self._horizon[:count], float(self._horizon_period[0]))


def _too_long(count: int) -> str:
    return f"a horizon of {count} drives is not allowed: {LONGEST_HORIZON} are the most"


def problem(drive: "_Array | Command | DriveError") -> str:
    """What is wrong with a drive, in a sentence; empty if its numbers are all finite."""
    if isinstance(drive, DriveError):
        return str(drive)
    if isinstance(drive, Command):
        rows = np.vstack([drive.voltage, drive.horizon])
        if np.isfinite(rows).all():
            return ""
        at = int(np.flatnonzero(~np.isfinite(rows).all(axis=1))[0])
        if at:
            return f"drive {at - 1} of the horizon, {rows[at].tolist()} V, is not allowed: it must be finite"
        drive = drive.voltage
    # For three numbers five times as fast as numpy: a tick in real time asks it.
    finite = all(map(math.isfinite, drive.tolist()))
    return "" if finite else f"drive {drive.tolist()} V is not allowed: it must be finite"
