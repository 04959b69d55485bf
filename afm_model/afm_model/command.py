"""A drive with further ones to follow, as a law in Python answers it."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .errors import DriveError
from .signals import LONGEST_HORIZON

_Array = NDArray[np.float64]


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
        If these are not so many numbers, the horizon is longer than `afm_model.signals.LONGEST_HORIZON`, or has no
        period. Whether the drives are finite is judged where they are put in force.
    """

    voltage: _Array
    horizon: _Array = field(default_factory=_no_horizon)
    horizon_period: float = 0.0

    def __post_init__(self) -> None:
        for name in ("voltage", "horizon"):
            object.__setattr__(self, name, np.array(getattr(self, name), np.float64))
        if self.voltage.shape != (3,):
            raise DriveError(f"drive {self.voltage.tolist()} is not allowed: it must be three voltages")
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
        """Whether it holds a drive of its own for a time so long after the measurement that it answers [s]."""
        return age < (len(self.horizon) + 1) * self.horizon_period * (1.0 - 1e-9)


def command_of(u: Any) -> Command:
    """What a record of `afm_model.signals.COMMAND` holds.

    Raises
    ------
    DriveError
        As `Command` does.
    """
    if not 0 <= u.horizon_count <= LONGEST_HORIZON:
        raise DriveError(_too_long(u.horizon_count))
    return Command(u.voltage, u.horizon[: u.horizon_count], float(u.horizon_period))


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
    return "" if np.isfinite(drive).all() else f"drive {drive.tolist()} V is not allowed: it must be finite"
