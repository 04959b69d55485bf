"""What messages say, in words of the model: of ROS, or of a bag, whose messages have the same fields. Needs no ROS."""

from collections.abc import Iterable
from typing import Any

import numpy as np

from afm_model.core.errors import ParameterError, Sentence
from afm_model.microscope.arrays import Variable
from afm_model.microscope.image import Line

NANOSECONDS = 1_000_000_000
"""In a second."""
FRAME = (
    *("centre_x", "centre_y", "size_x", "angle", "pixels", "lines"),
    *("line_rate", "overscan", "speed", "slow_axis"),
)
"""Fields of ScanLine that are those of a scan; its `size_y` is the scan's height."""
_VALUES = ("bool", "integer", "double", "string", "byte_array", "bool_array", "integer_array", "double_array",
           "string_array")  # fmt: skip
"""Kinds of values of rcl_interfaces/ParameterValue, from type 1 on."""


class InvalidMessage(Sentence, ValueError):
    """A message with a value that is not valid; says which field, and what is allowed."""


def nanoseconds(stamp: Any) -> int:
    """Time of a stamp [ns]."""
    return int(stamp.sec) * NANOSECONDS + int(stamp.nanosec)


def value_of(value: Any) -> Any:
    """Return the value in an rcl_interfaces/ParameterValue: a number, a text or a list; None without a value.

    Raises
    ------
    InvalidMessage
        If it has a type that there is not.
    """
    kind = value.type
    if not 0 <= kind <= len(_VALUES):
        raise InvalidMessage(f"type {kind} of a parameter: there is no such type")
    if kind == 0:
        return None
    name = _VALUES[kind - 1]
    found = getattr(value, f"{name}_value")
    if name == "byte_array":
        # rosbags reads them as numbers with a sign.
        return [each[0] if isinstance(each, bytes) else int(each) & 0xFF for each in found]
    if name.endswith("_array"):
        return found.tolist() if hasattr(found, "tolist") else list(found)
    return found


def values_of(messages: Iterable[Any]) -> dict[str, Any]:
    """Parameters by name, or texts with their keys.

    Raises
    ------
    ParameterError
        If a name comes twice, or without a value.
    """
    values: dict[str, Any] = {}
    for each in messages:
        texts = hasattr(each, "key")  # diagnostic_msgs/KeyValue
        name = each.key if texts else each.name
        if name in values:
            raise ParameterError(f"the name {name} is given twice: each name needs one value")
        try:
            values[name] = each.value if texts else value_of(each.value)
        except InvalidMessage:
            values[name] = None
        if values[name] is None:
            raise ParameterError(f"{name} has no value: it must have one, with the type that the value has")
    return values


def channels_of(message: Any, length: int) -> tuple[dict[str, Any], dict[str, str]]:
    """Channels of a message that has `channels`, `units` and `data` one after the other; their units."""
    # A message that has arrived is nobody else's: its numbers are not copied.
    data = np.frombuffer(message.data).reshape(len(message.channels), length)
    units = dict(zip(message.channels, message.units, strict=True))
    return dict(zip(message.channels, data, strict=True)), units


def line_of(message: Any) -> Line:
    """The line that an afm_msgs/ScanLine brings."""
    time = nanoseconds(message.header.stamp) / 1e9
    return Line(message.index, message.direction, time, channels_of(message, message.pixels)[0])


def variable_of(message: Any) -> Variable:
    """The array that an afm_msgs/NamedArray brings.

    Raises
    ------
    ValueError
        If it has not the shape that it says.
    ParameterError
        As `values_of` does.
    """
    values = np.array(message.words) if len(message.words) else np.array(message.data, np.float64)
    return Variable(tuple(message.dimensions), values.reshape(tuple(message.shape)), values_of(message.attributes))
