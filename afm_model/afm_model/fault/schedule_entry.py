"""One fault of a schedule: what goes wrong, where, from when on, for how long, how much."""

from dataclasses import dataclass
from typing import Annotated, Any, Literal

from annotated_types import Ge, Le
from pydantic import Field

from ..core.schema import Group, Unit
from ..parts.ticks import ticks_of

SENSORS = {
    "deflection": "m",
    "deflection_rate": "m/s",
    "lateral_force": "N",
    "position_x": "m",
    "position_y": "m",
    "position_z": "m",
    "velocity_x": "m/s",
    "velocity_y": "m/s",
    "velocity_z": "m/s",
}
"""Values that sensors give to the controller, with their units."""
DRIVES = {"drive_x": "V", "drive_y": "V", "drive_z": "V"}
MESSAGES = ("measurement", "drive")
AXES = ("x", "y", "z")
TARGETS = ("none", *SENSORS, *DRIVES, *MESSAGES, *AXES)
"""Everything that a fault may act on; its place in here is its number."""
LATENCY_TICKS = 255
"""Control periods by which a message may be late at most."""


@dataclass(frozen=True)
class Kind:
    """A kind of fault.

    Parameters
    ----------
    targets : tuple of str
        What it may act on.
    what : str
        What it does, for the docs.
    size : str
        What its size is; empty if it has none.
    unit : str
        Unit of the size; {} stands for that of the signal.
    lower, upper : float
        Least and largest size.
    """

    targets: tuple[str, ...]
    what: str
    size: str = ""
    unit: str = ""
    lower: float = 0.0
    upper: float = 0.0


_SIGNALS = (*SENSORS, *DRIVES)
_LARGEST = 1e6
"""A drive stays a finite number, whatever faults come together."""
KINDS = {
    "noise": Kind(_SIGNALS, "white noise is added, new at every tick or update", "rms", "{}", 0.0, _LARGEST),
    "dropout": Kind(_SIGNALS, "it reads 0"),
    "stuck": Kind(_SIGNALS, "it keeps the value that it has when the fault begins"),
    "offset": Kind(_SIGNALS, "a constant is added", "constant", "{}", -_LARGEST, _LARGEST),
    "drift": Kind(_SIGNALS, "an offset is added that grows from 0", "rate", "{}/s", -_LARGEST, _LARGEST),
    "saturation": Kind(_SIGNALS, "it stays within +-size", "limit", "{}", 0.0, _LARGEST),
    "latency": Kind(MESSAGES, "each message is late by so much, in whole control periods", "time", "s", 0.0, _LARGEST),
    "jitter": Kind(
        MESSAGES, "each message is late by a different random time, from 0 to size", "time", "s", 0.0, _LARGEST
    ),
    "loss": Kind(MESSAGES, "messages get lost", "part of them", "1", 0.0, 1.0),
    "friction": Kind(("none",), "friction of the sample is so many times its own", "factor", "1", 0.0, 100.0),
    "thermal": Kind(AXES, "the sample drifts, and stays where it is at the end", "rate", "m/s", -1e-6, 1e-6),
}
"""Kinds of faults by name; the place of a kind in here, from 1 on, is its number."""


class Entry(Group):
    """One fault. Its name is that of the group: `fault.NAME.kind`."""

    kind: Literal[
        "none",
        "noise",
        "dropout",
        "stuck",
        "offset",
        "drift",
        "saturation",
        "latency",
        "jitter",
        "loss",
        "friction",
        "thermal",
    ] = Field("none", description="kind of fault")
    signal: Literal[
        "none",
        "deflection",
        "deflection_rate",
        "lateral_force",
        "position_x",
        "position_y",
        "position_z",
        "velocity_x",
        "velocity_y",
        "velocity_z",
        "drive_x",
        "drive_y",
        "drive_z",
        "measurement",
        "drive",
        "x",
        "y",
        "z",
    ] = Field("none", description="signal that it acts on")
    start: Annotated[float, Ge(0), Le(1e9), Unit("s")] = Field(0.0, description="simulated time at which it begins")
    duration: Annotated[float, Le(1e9), Unit("s")] = Field(
        -1.0, description="how long it lasts; negative: to the end of the run"
    )
    size: float = Field(0.0, description="how much, in the unit of its kind and signal")
    seed: Annotated[int, Ge(0), Le(2**63 - 1)] = Field(0, description="seed of its random numbers")

    def ticks(self, control_period: float) -> tuple[int, int]:
        """First tick at which it acts, and the first at which it acts no more."""
        # Round-off in time / period must not move a tick.
        first = ticks_of(self.start, control_period)
        if self.duration < 0.0:
            return first, NEVER
        return first, max(first, ticks_of(self.start + self.duration, control_period))

    @property
    def of_the_sample(self) -> bool:
        """Whether it acts on the motion itself, not on what is measured or commanded."""
        return self.kind in ("friction", "thermal")

    def describe(self) -> str:
        """Kind, size and signal, for a sentence."""
        kind = KINDS[self.kind]
        unit = kind.unit.replace("{}", (SENSORS | DRIVES).get(self.signal, "")).removeprefix("1")
        size = f" of {self.size:g} {unit}".rstrip() if kind.size else ""
        return f"{self.kind}{size}{'' if self.signal == 'none' else f' on {self.signal}'}"


NEVER = 2**62
"""Tick at which a fault ends that does not end."""


def problem(name: str, entry: Any, control_period: float) -> str:
    """Why a fault is not allowed, in one sentence; empty if it is.

    Parameters
    ----------
    name : str
        Of the fault, with the group: `fault.burst`.
    entry : Entry
    control_period : float [s]
    """
    if entry.kind == "none":
        return f"{name}.kind is missing: it must be one of {', '.join(KINDS)}"
    kind = KINDS[entry.kind]
    if entry.signal not in kind.targets:
        told = f"{name}.signal = {entry.signal} is not allowed for a fault of kind {entry.kind}"
        if kind.targets == ("none",):
            return f"{told}: it has none"
        return f"{told}: it must be one of {', '.join(kind.targets)}"
    if not kind.size:
        return (
            f"{name}.size = {entry.size:g} is not allowed: a fault of kind {entry.kind} has none" if entry.size else ""
        )
    upper = LATENCY_TICKS * control_period if entry.kind in ("latency", "jitter") else kind.upper
    if not kind.lower <= entry.size <= upper:
        return (
            f"{name}.size = {entry.size:g} is not allowed for a fault of kind {entry.kind}: "
            f"it must be >= {kind.lower:g} and <= {upper:g}"
        )
    return ""
