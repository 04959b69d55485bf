"""Checks of messages. Invalid ones are dropped: they neither end the recorder nor get into a recording."""

import math
import re
from collections.abc import Sized
from typing import Any

from afm_msgs.msg import ControlTrace, Event, InstrumentStatus, NamedArray, Score, Waveform
from afm_msgs.msg import ScanLine as ScanLineMessage
from std_msgs.msg import Header

from afm_model.core.errors import ParameterError
from afm_model.core.schema import build
from afm_model.microscope.image import DIRECTIONS
from afm_model.microscope.verbs import Scan
from afm_node_common.stamps import NANOSECONDS
from afm_node_common.subscriptions import InvalidMessage
from afm_node_common.verb_codec import FRAME, line_of, values_of, variable_of

from .results import Part, Result, Shown, shown
from .scan_lines import ScanLine

_LAST = 2**63 - 1
"""Largest number of a sample, and largest time in nanoseconds, that a recording can hold."""
_UNIT_LENGTH = 16
_ARRAYS = 100
"""Of a result at most."""
_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,63}(/[A-Za-z][A-Za-z0-9_]{0,63})*")
"""Of a channel of a scan: as of a topic."""


def waveform(message: Waveform, si_unit: str | None) -> None:
    """Check a block of samples; `si_unit` is that of the blocks before, None for the first."""
    _block(message.header, "first_sample", message.first_sample, message.sample_period, len(message.samples))
    if not math.isfinite(message.scale) or message.scale == 0.0:
        raise InvalidMessage(f"scale {message.scale:g}: it must be finite and not 0")
    if si_unit is None and not (message.unit.isprintable() and len(message.unit) <= _UNIT_LENGTH):
        raise InvalidMessage(f"unit {message.unit[:40]!r}: it must be a unit of at most {_UNIT_LENGTH} characters")
    if si_unit is not None and message.unit != si_unit:
        raise InvalidMessage(f"unit {message.unit[:40]!r}: this channel is in {si_unit!r}")


def control_trace(message: ControlTrace) -> None:
    """Check a block of control ticks."""
    count = len(message.deflection)
    _block(message.header, "first_sequence", message.first_sequence, message.control_period, count)
    rows: dict[str, Sized] = {
        "position": message.position,
        "reference_position": message.reference_position,
        "drive": message.drive,
    }
    for name, values in rows.items():
        if len(values) != 3 * count:
            raise InvalidMessage(f"{len(values)} values of {name} with {count} of deflection: it must be {3 * count}")
    if len(message.round_trip) != count:
        raise InvalidMessage(
            f"{len(message.round_trip)} values of round_trip with {count} of deflection: the numbers must be equal"
        )


def stamp(message: InstrumentStatus | Event | Score) -> None:
    """Check the time of a state, an event or a score."""
    _stamp(message.header)


def scan_line(message: ScanLineMessage) -> ScanLine:
    """Check a line of a scan; it, in words of the model."""
    _stamp(message.header)
    names, count = list(message.channels), len(message.channels)
    if not count or len(message.units) != count or len(set(names)) != count:
        raise InvalidMessage(
            f"channels {names}, {len(message.units)} units: it must be different names, a unit for each"
        )
    for name, unit in zip(names, message.units, strict=True):
        if not _NAME.fullmatch(name):
            raise InvalidMessage(f"channel {name[:40]!r}: it must be a name such as height or truth/place_x")
        if not (unit.isprintable() and len(unit) <= _UNIT_LENGTH):
            raise InvalidMessage(f"unit {unit[:40]!r}: it must be a unit of at most {_UNIT_LENGTH} characters")
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


def result_part(message: NamedArray) -> Part:
    """Check an array of a result of a verb; it, in words of the model."""
    try:
        told = values_of(message.attributes)
        variable = variable_of(message)
    except ValueError as error:
        raise InvalidMessage(f"array {message.name[:40]!r}: {error}") from None
    about: dict[str, Any] = {name: told.get(f"result.{name}") for name in _ABOUT}
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
    whole = {name.removeprefix("about."): value for name, value in told.items() if name.startswith("about.")}
    own = {name: value for name, value in told.items() if not name.startswith(("result.", "about."))}
    return Part(
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


def result(whole: Result) -> Shown:
    """A result as it is recorded, if its arrays fit together."""
    try:
        return shown(whole)
    # Arrays of any shape and name may come; what numpy says of them is of any kind.
    except Exception as error:
        raise InvalidMessage(f"a result of {whole.verb} that cannot be drawn: {error}") from None


def _block(header: Header, name: str, first: int, period: float, count: int) -> None:
    _stamp(header)
    if not count:
        raise InvalidMessage("it holds no values")
    if not (math.isfinite(period) and period > 0.0):
        raise InvalidMessage(f"period {period:g} s: it must be finite and > 0 s")
    if first + count > _LAST or (first + count) * period * 1e9 > _LAST:
        raise InvalidMessage(f"{name} {first} at a period of {period:g} s: a recording ends after 292 years")
    # Blocks are placed by their numbers: one that says two times at once has a wrong number, or a wrong period.
    stamp, time = header.stamp.sec + header.stamp.nanosec * 1e-9, first * period
    if abs(stamp - time) > max(period, 1e-6) + 1e-9 * time:
        raise InvalidMessage(f"stamp {stamp:g} s of {name} {first} at a period of {period:g} s: it must be {time:g} s")


def _stamp(header: Header) -> None:
    if header.stamp.sec < 0 or header.stamp.nanosec >= NANOSECONDS:
        raise InvalidMessage(
            f"stamp {header.stamp.sec} s + {header.stamp.nanosec} ns: it must be a time since the start"
        )
