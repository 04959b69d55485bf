"""Definitions of messages as text, as they stand in a record, and messages of our own for it."""

from functools import cache
from pathlib import Path
from typing import Any

from ament_index_python.packages import get_package_share_directory
from rclpy.serialization import serialize_message
from rosbags.typesys import get_types_from_msg
from rosbags.typesys.store import Typestore

from afm_node_common.decoding import InvalidMessage

_RULE = 80 * "="
_PLAIN = frozenset(
    "bool byte char float32 float64 int8 uint8 int16 uint16 int32 uint32 int64 uint64 string wstring".split()
)


_types = Typestore()


def kind_of(message: Any) -> str:
    """Name of a message, or of its class, as it stands in a record: afm_msgs/msg/Waveform."""
    kind = message if isinstance(message, type) else type(message)
    return f"{kind.__module__.partition('.')[0]}/msg/{kind.__name__}"


def serialized(message: Any) -> bytes:
    """A message as it would arrive: rclpy makes as many bytes as it has estimated."""
    data = serialize_message(message)
    return bytes(data[: decoded(kind_of(message), data)[1]])


def decoded(kind: str, data: bytes) -> tuple[Any, int]:
    """Read a message as the readers of a record do; it, and how many of the bytes it has.

    Raises
    ------
    InvalidMessage
        If the bytes are no such message.
    """
    if kind not in _types.fielddefs:
        found = get_types_from_msg(definition(kind), kind)
        _types.register({name: what for name, what in found.items() if name not in _types.fielddefs})
    try:
        if data[0] != 0 or data[1] > 1:
            raise ValueError("it begins with another encapsulation than that of plain CDR")
        form = _types.get_msgdef(kind)
        read = form.deserialize_cdr_le if data[1] else form.deserialize_cdr_be
        message, length = read(data[4:], 0, form.cls, _types)
    # Each field has another way to fail; a length may ask for all memory.
    except Exception as error:
        short = kind.rpartition("/")[2]
        raise InvalidMessage(f"{len(data)} bytes that are no {short} ({type(error).__name__})") from None
    return message, 4 + length


@cache
def definition(kind: str) -> str:
    """Return the definition of a type, afm_msgs/msg/Waveform for example, followed by those that it is made of.

    The form is that of `ros2 bag record` and of the encoding ros2msg of MCAP.

    Raises
    ------
    LookupError, OSError
        If the package is not installed, or has no such message.
    """
    texts: dict[str, str] = {}
    waiting = [kind]
    while waiting:
        name = waiting.pop(0)
        if name not in texts:
            texts[name] = _text(name)
            waiting += _parts(name, texts[name])
    first, *others = texts.items()
    return "\n".join([first[1], *(f"{_RULE}\nMSG: {name.replace('/msg/', '/')}\n{text}" for name, text in others)])


def _text(kind: str) -> str:
    package, _, name = kind.split("/")
    return (Path(get_package_share_directory(package)) / "msg" / f"{name}.msg").read_text()


def _parts(kind: str, text: str) -> list[str]:
    """Types of the fields of a message that are messages themselves."""
    found = []
    for line in text.splitlines():
        words = line.partition("#")[0].split()
        if len(words) < 2 or "=" in words[1]:
            continue
        name = words[0].partition("[")[0].partition("<")[0]
        if name in _PLAIN:
            continue
        package, _, short = name.rpartition("/")
        found.append(f"{(package or kind).partition('/')[0]}/msg/{short}")
    return found
