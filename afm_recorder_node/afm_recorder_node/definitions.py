"""Definitions of messages as text, as they stand in a record, and messages of our own for it."""

from functools import cache
from pathlib import Path
from typing import Any

from ament_index_python.packages import get_package_share_directory
from rclpy.serialization import serialize_message
from rosbags.typesys import get_types_from_msg
from rosbags.typesys.store import Typestore

_RULE = 80 * "="
_PLAIN = frozenset(
    "bool byte char float32 float64 int8 uint8 int16 uint16 int32 uint32 int64 uint64 string wstring".split()
)


_types = Typestore()


def kind_of(message: Any) -> str:
    """Type of a message, such as afm_msgs/msg/Waveform."""
    return f"{type(message).__module__.partition('.')[0]}/msg/{type(message).__name__}"


def serialized(message: Any) -> bytes:
    """A message as it would arrive: what rclpy makes of it in memory may have some bytes too many behind its end."""
    kind = kind_of(message)
    if kind not in _types.fielddefs:
        found = get_types_from_msg(definition(kind), kind)
        _types.register({name: what for name, what in found.items() if name not in _types.fielddefs})
    data, form = serialize_message(message), _types.get_msgdef(kind)
    return bytes(data[: 4 + form.deserialize_cdr_le(data[4:], 0, form.cls, _types)[1]])


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
