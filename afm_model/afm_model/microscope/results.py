"""What verbs bring back, as far as several do, and how the microscope stands. SI units."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..analysis import Estimate
from .arrays import Arrays, Variable, variable

_Array = NDArray[np.float64]


@dataclass
class MicroscopeState:
    """Where the microscope stands."""

    approached: bool = False
    """The loop follows the sample."""
    feedback: str = "on"
    """What the loop does when approached: on, hold, off, external."""
    setpoint: float = 0.0  # of the deflection [V]
    proportional_gain: float = 0.0  # [m/V]; NaN: the loop has none
    integral_gain: float = 0.0  # [m/(V s)]; NaN: the loop has none
    place: tuple[float, float] = (0.0, 0.0)
    """Asked for [m]."""
    near: bool = False
    """The tip may touch the sample."""
    doing: str = ""
    """Name of the verb that is being done."""

    def withdrawn(self) -> None:
        """Note that the tip is off the sample, and the feedback off: whatever has taken it away."""
        self.approached = self.near = False
        self.feedback = "off"


@dataclass(frozen=True)
class Standing:
    """Where the microscope stands, at the end of Approach, Withdraw and MoveTo."""

    time: float  # simulated [s]
    x: float  # place asked for [m]
    y: float
    z: float  # as driven, positive towards the sample [m]
    deflection_voltage: float  # [V]


@dataclass(frozen=True)
class TimeSeries:
    """Signals over time."""

    time: _Array  # of each sample, in simulated time [s]
    channels: Mapping[str, _Array]
    units: Mapping[str, str]

    def variables(self, dims: tuple[str, ...] = ("time",)) -> dict[str, Variable]:
        """Its channels as labelled arrays."""
        return {name: variable(dims, values, name, self.units.get(name, "1")) for name, values in self.channels.items()}

    def arrays(self, attributes: Mapping[str, Any] | None = None) -> Arrays:
        """Its channels over time as labelled arrays."""
        return Arrays(self.variables(), {"time": variable(("time",), self.time, "time", "s")}, attributes or {})


@dataclass(frozen=True)
class Calibration:
    """A number that was measured, with its standard uncertainty and its unit."""

    value: float
    uncertainty: float
    unit: str
    details: Mapping[str, float] = field(default_factory=dict)
    """What else came out of it, by names that carry their units, as `f0_Hz`."""

    @property
    def estimate(self) -> Estimate:
        """Value and uncertainty."""
        return Estimate(self.value, self.uncertainty)

    def arrays(self) -> Arrays:
        """The number, without a name; its uncertainty and its details are attributes."""
        attributes = {"units": self.unit, "uncertainty": self.uncertainty, **self.details}
        return Arrays({"": Variable((), np.asarray(self.value), attributes)})


COMPLETE, CANCELLED, FAILED = "complete", "cancelled", "failed"


@dataclass(frozen=True)
class Outcome:
    """How a verb has ended."""

    status: str  # COMPLETE, CANCELLED or FAILED
    message: str  # one sentence; of what is complete only where its result needs a remark
    result: Any
    """What was measured, as far as it came: of the type that the verb `returns`, or None."""


@dataclass(frozen=True)
class Progress:
    """How far a verb is."""

    fraction: float  # 0 to 1, of the time that it takes at most
    detail: str  # a clause
