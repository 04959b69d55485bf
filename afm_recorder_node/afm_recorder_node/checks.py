"""Checks of messages, of ROS or of a record. Invalid ones are dropped: they do not end the recorder, and are not kept.

Needs no ROS.
"""

import math
import re
from collections.abc import Sized
from typing import Any

from afm_model.core.errors import ParameterError
from afm_model.core.schema import build
from afm_model.microscope.image import DIRECTIONS
from afm_model.microscope.verbs import Scan
from afm_node_common.decoding import FRAME, NANOSECONDS, InvalidMessage, line_of, values_of, variable_of

from .gathering import ResultArray
from .scan_lines import ScanLine

_LAST = 2**63 - 1
"""Largest number of a sample, and largest time in nanoseconds, that is recorded."""
_UNIT_LENGTH = 16
_ARRAYS = 100
"""Of a result at most."""
_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,63}(/[A-Za-z][A-Za-z0-9_]{0,63})*")
"""Of a channel of a scan: as of a topic."""


def control_trace(message: Any) -> None:
    """Check that the columns of a block of control ticks have the same length."""
    count = len(message.deflection)
    columns: dict[str, tuple[Sized, int]] = {
        "position": (message.position, 3 * count),
        "reference_position": (message.reference_position, 3 * count),
        "drive": (message.drive, 3 * count),
        "round_trip": (message.round_trip, count),
    }
    for name, (values, wanted) in columns.items():
        if len(values) != wanted:
            raise InvalidMessage(f"{len(values)} values of {name} with {count} of deflection: it must be {wanted}")


def block(first: int, period: float, count: int, name: str = "number") -> None:
    """Check the numbers of a block: first value, period [s], how many; `name` of the first one is for the message."""
    if not (math.isfinite(period) and period > 0.0):
        raise InvalidMessage(f"period {period:g} s: it must be finite and > 0 s")
    if first + count > _LAST or (first + count) * period * 1e9 > _LAST:
        raise InvalidMessage(f"{name} {first} at a period of {period:g} s: a record ends after 292 years")


def check_unit(unit: str) -> None:
    """Check the unit of a channel; U+FFFD stands in place of bytes that are no text."""
    if not ("\ufffd" not in unit and unit.isprintable() and len(unit) <= _UNIT_LENGTH):
        raise InvalidMessage(f"unit {unit[:40]!r}: it must be a unit of at most {_UNIT_LENGTH} characters")


def stamp(message: Any) -> None:
    """Check the time of a message with a header."""
    at = message.header.stamp
    if at.sec < 0 or at.nanosec >= NANOSECONDS:
        raise InvalidMessage(f"stamp {at.sec} s + {at.nanosec} ns: it must be a time since the start")


def scan_line(message: Any) -> ScanLine:
    """Check a line of a scan; it, in words of the model."""
    stamp(message)
    names, count = list(message.channels), len(message.channels)
    if not count or len(message.units) != count or len(set(names)) != count:
        raise InvalidMessage(
            f"channels {names}, {len(message.units)} units: it must be different names, a unit for each"
        )
    for name, unit in zip(names, message.units, strict=True):
        if not _NAME.fullmatch(name):
            raise InvalidMessage(f"channel {name[:40]!r}: it must be a name such as height or truth/place_x")
        check_unit(unit)
    try:
        scan = build(
            Scan,
            {name: getattr(message, name) for name in (*FRAME, "size_y")}
            | {"direction": "up" if message.up else "down", "channels": ", ".join(names)},
        )
    except ParameterError as error:
        raise InvalidMessage(str(error)) from None
    if message.direction not in DIRECTIONS or message.index >= scan.lines:
        raise InvalidMessage(
            f"direction {message.direction[:40]!r}, index {message.index}: it must be {' or '.join(DIRECTIONS)}, "
            f"and less than {scan.lines} lines"
        )
    if len(message.data) != count * scan.pixels:
        raise InvalidMessage(f"{len(message.data)} numbers of {count} channels: it must be {count * scan.pixels}")
    return ScanLine(message.scan, scan, line_of(message), dict(zip(names, message.units, strict=True)))


_ABOUT = {"verb": str, "number": int, "arrays": int, "time_ns": int, "status": str}
"""What an array says of its result, in attributes `result.*`, and the types of that."""


def result_part(message: Any) -> ResultArray:
    """Check an array of a result of a verb; it, in words of the model."""
    try:
        given = values_of(message.attributes)
        variable = variable_of(message)
    except ValueError as error:
        raise InvalidMessage(f"array {message.name[:40]!r}: {error}") from None
    about: dict[str, Any] = {name: given.get(f"result.{name}") for name in _ABOUT}
    for name, kind in _ABOUT.items():
        if type(about[name]) is not kind:
            raise InvalidMessage(f"result.{name} = {str(about[name])[:40]}: it must be of type {kind.__name__}")
    if not (_NAME.fullmatch(about["verb"]) and about["status"].isalpha()):
        raise InvalidMessage(f"result.verb {about['verb'][:40]!r}: it must be a name such as ForceCurve")
    if not (0 <= about["time_ns"] <= _LAST and 0 < about["arrays"] <= _ARRAYS):
        raise InvalidMessage(
            f"result.time_ns {about['time_ns']}, result.arrays {about['arrays']}: it must be a time since the start, "
            f"and 1 to {_ARRAYS} arrays"
        )
    whole = {name.removeprefix("about."): value for name, value in given.items() if name.startswith("about.")}
    own = {name: value for name, value in given.items() if not name.startswith(("result.", "about."))}
    return ResultArray(
        about["verb"],
        about["number"],
        about["arrays"],
        about["time_ns"],
        about["status"],
        message.name,
        message.coordinate,
        variable._replace(attributes=own),
        whole,
    )
