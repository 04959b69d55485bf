"""A recording as a bag of its instrument's messages. Needs the messages of ROS, and the package rosbags."""

import array
import itertools
import math
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from afm_msgs.msg import ControlTrace, Event, InstrumentStatus, ScanLine, Score, Telemetry, Waveform
from numpy.typing import NDArray
from rcl_interfaces.msg import ParameterEvent
from rclpy.parameter import Parameter
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer, WriterError

from afm_model.microscope.image import DIRECTIONS, Image
from afm_model.run import State
from afm_node_common import topics
from afm_node_common.stamps import stamp
from afm_node_common.verb_codec import FRAME, numbers

from .bag import PARAMETER_EVENTS, kind_of, typestore
from .recording import Recording

_BLOCK = 1000
"""Rows in a message, at most."""
_SHOWN = 20_000
"""Messages of plain numbers, for programs that plot them; of more ticks one in several."""
_OF_ITSELF = re.compile(r"the score of the run is here|scan \d+: \d+ x \d+ pixels, .*")
"""Events that a recorder adds by itself."""
_DTYPES = {
    "double": np.float64,
    "float": np.float32,
    "int64": np.int64,
    "uint8": np.uint8,
    "octet": np.uint8,
    "boolean": np.bool_,
}
_Timed = tuple[int, str, Any]


def export(recording: Recording, folder: Path) -> int:
    """Write a bag in the form of MCAP, compressed by zstd, with simulated time as the time of its messages.

    Parameters
    ----------
    recording : Recording
    folder : Path
        Of the bag: it must not exist.

    Returns
    -------
    int
        Number of messages.

    Raises
    ------
    OSError
        If it exists, or cannot be written.
    """
    count = 0
    try:
        writer = Writer(folder, version=9, storage_plugin=StoragePlugin.MCAP)
        writer.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
        with writer:
            connections: dict[str, Any] = {}
            for time_ns, topic, message in sorted(_messages(recording), key=lambda each: each[0]):
                if topic not in connections:
                    connections[topic] = writer.add_connection(topic, kind_of(message), typestore=typestore())
                if hasattr(message, "header"):
                    message.header.stamp = stamp(time_ns)
                    message.header.frame_id = topics.FRAME
                writer.write(connections[topic], time_ns, _encoded(message))
                count += 1
    except WriterError as error:
        raise OSError(str(error)) from error
    return count


def _messages(recording: Recording) -> Iterator[_Timed]:
    """All messages with their topics, each with its simulated time [ns]."""
    space = f"/{topics.NAMESPACE}"
    changes = recording.parameter_changes
    for node, values in recording.parameters.items():
        new = [Parameter(name, value=value).to_parameter_msg() for name, value in values.items()]
        yield 0, PARAMETER_EVENTS, ParameterEvent(node=_full(node), new_parameters=new)
    for change in changes:
        event = ParameterEvent(node=_full(change.node), stamp=stamp(_ns(change.time)))
        event.changed_parameters = [Parameter(change.name, value=change.new).to_parameter_msg()]
        yield _ns(change.time), PARAMETER_EVENTS, event
    known = recording.parameters.get("afm_sim_node", {})
    height = known.get("cantilever.a", math.nan)
    assert isinstance(height, int | float)
    deflection = recording.error[:, 2] + recording.reference[:, 2] - height
    for first, period, at in _blocks(recording.time_ticks, known.get("plant.control_period")):
        yield (
            _ns(first * period),
            f"{space}/{topics.CONTROL_TRACE}",
            ControlTrace(
                first_sequence=first,
                control_period=period,
                position=numbers(recording.position[at]),
                velocity=numbers(np.full(recording.position[at].shape, np.nan)),
                reference_position=numbers(recording.reference[at]),
                deflection=numbers(deflection[at]),
                drive=numbers(recording.drive[at]),
                round_trip=array.array("f", recording.round_trip[at].astype(np.float32).tobytes()),
            ),
        )
    for name, channel in recording.channels.items():
        scale = channel.scale if math.isfinite(channel.scale) and channel.scale else 1.0
        for first, period, at in _blocks(channel.time, known.get("detector.sample_period")):
            samples = numbers(channel.values[at] / scale)
            message = Waveform(
                first_sample=first, sample_period=period, samples=samples, scale=scale, unit=channel.unit
            )
            yield _ns(first * period), f"{space}/{name}", message
    for (time, text), level in zip(recording.events, recording.event_levels, strict=True):
        name, _, detail = text.partition(": ")
        if name in State.__members__:
            yield _ns(time), f"{space}/{topics.STATUS}", InstrumentStatus(state=int(State[name]), detail=detail)
        elif not (_OF_ITSELF.fullmatch(text) or any(text.startswith(f"{each.node}: {each.name} ") for each in changes)):
            yield (
                _ns(time),
                f"{space}/{topics.EVENTS}",
                Event(text=text, level=Event.INFO if level == "INFO" else Event.WARN),
            )
    for number, image in enumerate(recording.images, 1):
        for time_ns, line in _lines(number, image):
            yield time_ns, f"{space}/{topics.SCAN_LINE}", line
    yield from _telemetry(recording, deflection, f"{space}/{topics.TELEMETRY}")
    if recording.score is not None:
        times = [0.0, *recording.time_ticks[-1:].tolist(), *(time for time, _ in recording.events)]
        yield _ns(max(times)), f"{space}/{topics.SCORE}", _filled(Score(), recording.score)


def _telemetry(recording: Recording, deflection: NDArray[np.float64], topic: str) -> Iterator[_Timed]:
    """Plain numbers, which programs for plots show without knowing blocks."""
    time = recording.time_ticks
    forces = [
        np.interp(time, channel.time, channel.values) if len(channel.time) else np.full(len(time), np.nan)
        for channel in (recording.channels["lateral_force"], recording.channels["truth/normal_force"])
    ]
    for k in range(0, len(time), max(-(-len(time) // _SHOWN), 1)):
        message = Telemetry(sequence=k, deflection=float(deflection[k]), real_time_factor=math.nan)
        message.lateral_force, message.normal_force = (float(force[k]) for force in forces)
        for i, axis in enumerate("xyz"):
            setattr(message, f"error_{axis}", float(recording.error[k, i]))
            setattr(message, f"drive_{axis}", float(recording.drive[k, i]))
        yield _ns(float(time[k])), topic, message


def _blocks(time: NDArray[np.float64], told: object) -> Iterator[tuple[int, float, slice]]:
    """Rows that follow one another: number of the first one, period [s], and which they are."""
    if not len(time):
        return
    period, lasted = 1.0, float(time[-1] - time[0])
    if lasted > 0.0:
        period = lasted / max(round(lasted / float(np.median(np.diff(time)))), 1)
    if isinstance(told, int | float) and abs(told - period) < 1e-5 * period:
        period = float(told)  # without the round-off of whole nanoseconds
    ticks = np.rint(time / period).astype(np.int64)
    cuts = np.concatenate([[0], np.flatnonzero(np.diff(ticks) != 1) + 1, [len(ticks)]]).tolist()
    for begin, end in itertools.pairwise(cuts):
        for start in range(begin, end, _BLOCK):
            yield int(ticks[start]), period, slice(start, min(start + _BLOCK, end))


def _lines(number: int, image: Image) -> Iterator[tuple[int, ScanLine]]:
    scan = image.scan
    for k, time in sorted(image.times.items()):
        index, direction = k // 2, DIRECTIONS[k % 2]
        rows = [image.data[name, direction][image.row(index)] for name in image.units]
        message = ScanLine(
            **{name: getattr(scan, name) for name in FRAME},
            scan=number,
            index=index,
            direction=direction,
            size_y=scan.height,
            up=scan.direction == "up",
            row=image.row(index),
            channels=list(image.units),
            units=list(image.units.values()),
            data=numbers(np.concatenate(rows)),
        )
        yield _ns(time), message


def _encoded(message: Any) -> bytes:
    """A message as CDR. That of the middleware ends with some bytes of its memory, which strict readers refuse."""
    return bytes(typestore().serialize_cdr(_converted(message), kind_of(message)))


def _converted(message: Any) -> Any:
    """A message as the type of the same name of rosbags."""
    fields = []
    for name, kind in message.get_fields_and_field_types().items():
        value = getattr(message, name)
        if hasattr(value, "get_fields_and_field_types"):
            value = _converted(value)
        elif kind.startswith("sequence<"):
            dtype = _DTYPES.get(kind.removeprefix("sequence<").partition(",")[0].removesuffix(">"))
            if dtype is None:
                value = [each if isinstance(each, str) else _converted(each) for each in value]
            else:
                value = np.array([each[0] if isinstance(each, bytes) else each for each in value], dtype)
        fields.append(value)
    return typestore().types[kind_of(message)](*fields)


def _filled(message: Any, values: Any) -> Any:
    """A message with these values, nested ones too."""
    for name, value in values.items():
        field = getattr(message, name)
        setattr(message, name, _filled(field, value) if isinstance(value, dict) else value)
    return message


def _full(node: str) -> str:
    return node if node.startswith("/") else f"/{topics.NAMESPACE}/{node}"


def _ns(time: float) -> int:
    return round(time * 1e9)
