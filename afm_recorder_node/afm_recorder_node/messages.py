"""What messages of an instrument say, in the words of a recording: of ROS, or of a record. Needs no ROS."""

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from afm_model.run import RunState

Level = Literal["INFO", "WARN", "ERROR"]
_STATES = {int(state): state.name for state in RunState}
_LEVELS: dict[str, Level] = {
    **dict.fromkeys(("STALLED", "RETRACTED", "HELD", "WITHDRAWN", "APPROACHING"), "WARN"),
    "FAULT": "ERROR",
}
_WARN = 30
"""Level of an afm_msgs/Event from which on it is a warning."""


@dataclass(frozen=True)
class StateText:
    """A state of the instrument as an event."""

    text: str
    level: Level


def state(message: Any) -> StateText:
    """The state in an afm_msgs/InstrumentStatus."""
    name = _STATES.get(message.state, f"state {message.state}")
    return StateText(f"{name}: {message.detail}" if message.detail else name, _LEVELS.get(name, "INFO"))


def level(message: Any) -> Level:
    """How much an afm_msgs/Event matters; those of earlier versions have no level."""
    return "WARN" if getattr(message, "level", 0) >= _WARN else "INFO"


def columns(message: Any) -> dict[str, NDArray[Any]]:
    """The columns of an afm_msgs/ControlTrace: position, reference, drive (n, 3); deflection, round_trip (n,)."""
    return {
        "position": _rows(message.position),
        "reference": _rows(message.reference_position),
        "deflection": np.frombuffer(message.deflection),
        "drive": _rows(message.drive),
        "round_trip": np.frombuffer(message.round_trip, np.float32),
    }


def score(message: Any) -> dict[str, Any]:
    """The fields of an afm_msgs/Score: numbers and texts by name, vectors and times as dicts."""
    found = {}
    for name in _fields(message):
        value = getattr(message, name)
        if hasattr(value, "x"):
            found[name] = {axis: float(getattr(value, axis)) for axis in "xyz"}
        elif name != "header":
            found[name] = _plain(value)
    return found


def _plain(value: Any) -> Any:
    if isinstance(value, str | int | float):
        return value
    return {name: _plain(getattr(value, name)) for name in _fields(value)} if _fields(value) else list(value)


def _fields(message: Any) -> list[str]:
    """Names of the fields: of a message of ROS, or of a record."""
    if hasattr(message, "get_fields_and_field_types"):
        return list(message.get_fields_and_field_types())
    return [name for name in getattr(message, "__dataclass_fields__", ()) if name != "__msgtype__"]


def _rows(values: Any) -> NDArray[np.float64]:
    return np.frombuffer(values).reshape(-1, 3)
