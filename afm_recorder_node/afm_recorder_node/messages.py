"""What messages of an instrument say, in the words of the recorder: of live topics, and of a bag."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from afm_msgs.msg import ControlTrace, Event, InstrumentStatus
from numpy.typing import NDArray

from afm_model.run import State

from .writer import Level

_STATES = {int(state): state.name for state in State}
_LEVELS: dict[str, Level] = {
    **dict.fromkeys(("STALLED", "RETRACTED", "HELD", "WITHDRAWN", "APPROACHING"), "WARN"),
    "FAULT": "ERROR",
}


@dataclass(frozen=True)
class Told:
    """A state of the instrument as an event."""

    text: str
    level: Level


def state(message: InstrumentStatus) -> Told:
    """The state that a status tells."""
    name = _STATES.get(message.state, f"state {message.state}")
    return Told(f"{name}: {message.detail}" if message.detail else name, _LEVELS.get(name, "INFO"))


def level(message: Event) -> Level:
    """How much an event matters."""
    return "WARN" if message.level >= Event.WARN else "INFO"


def columns(message: ControlTrace) -> dict[str, NDArray[Any]]:
    """The columns of a block of control ticks, as `RecordingWriter.control` takes them."""
    return {
        "position": _rows(message.position),
        "reference": _rows(message.reference_position),
        "deflection": np.frombuffer(message.deflection),
        "drive": _rows(message.drive),
        "round_trip": np.frombuffer(message.round_trip, np.float32),
    }


def plain(value: Any) -> Any:
    """A message as numbers, texts and dicts, for the text of the score."""
    if hasattr(value, "get_fields_and_field_types"):
        return {name: plain(getattr(value, name)) for name in value.get_fields_and_field_types() if name != "header"}
    return value


def _rows(values: Any) -> NDArray[np.float64]:
    return np.frombuffer(values).reshape(-1, 3)
