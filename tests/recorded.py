"""Messages of a run, and records of them, without an instrument."""

import array
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from afm_msgs.msg import ControlTrace, Event, InstrumentStatus, Parameters, Waveform
from afm_msgs.msg import ScanLine as ScanLineMessage
from rclpy.parameter import Parameter
from rclpy.time import Time

from afm_model.microscope.image import DIRECTIONS, RETRACE, Line
from afm_model.microscope.verbs import Scan
from afm_node_common.decoding import FRAME, nanoseconds
from afm_node_common.verb_codec import numbers
from afm_recorder_node import layout
from afm_recorder_node.definitions import definition, kind_of, serialized
from afm_recorder_node.growing import GrowingFile
from afm_recorder_node.record_writer import RecordWriter
from afm_recorder_node.scan_lines import ScanLine

PERIOD, CONTROL_PERIOD = 1e-6, 2e-6
HEIGHT = 3e-9
UNITS = {"height": "m", "lateral": "N"}
SCAN = Scan(centre_x=1e-6, size_x=2e-6, angle=0.5, pixels=24, lines=40, line_rate=4.0, channels="height, lateral")
Topic = tuple[str, Any]
"""Name of a topic and a message."""


class Run:
    """Signals of a run, in volts and SI units."""

    def __init__(self, ticks: int, seed: int = 0, control_period: float = CONTROL_PERIOD) -> None:
        rng = np.random.default_rng(seed)
        self.ticks, self.control_period = ticks, control_period
        self.samples = rng.normal(0.0, 1.0, (4, 2 * ticks))
        self.scales = (10e-9, 50e-9, 1.0, 1.0)
        self.position, self.reference = rng.normal(0.0, 5e-9, (2, ticks, 3))
        self.deflection = rng.normal(0.0, 1e-9, ticks)
        self.drive = rng.normal(0.0, 1.0, (ticks, 3))
        self.round_trip = rng.gamma(4.0, 1e-5, ticks).astype(np.float32)

    def block(self, start: int, stop: int) -> Iterator[Topic]:
        """Messages of some ticks."""
        at = slice(start, stop)
        for channel, samples, scale in zip(layout.CHANNELS, self.samples, self.scales, strict=True):
            yield (
                channel.name,
                waveform(2 * start, samples[2 * start : 2 * stop], channel.si_unit, scale, self.control_period / 2),
            )
        trace = ControlTrace(first_sequence=start, control_period=self.control_period, run_id=1)
        trace.header.stamp = stamp(start * self.control_period)
        trace.position, trace.velocity = numbers(self.position[at].ravel()), numbers(0.0 * self.position[at].ravel())
        trace.reference_position, trace.drive = numbers(self.reference[at].ravel()), numbers(self.drive[at].ravel())
        trace.deflection = numbers(self.deflection[at])
        trace.round_trip = array.array("f", self.round_trip[at].tobytes())
        yield "control_trace", trace

    def messages(self, block: int = 500) -> Iterator[Topic]:
        """Parameters of the instrument, and all blocks."""
        yield parameters("afm_sim_node", {"cantilever.a": HEIGHT})
        for start in range(0, self.ticks, block):
            yield from self.block(start, min(start + block, self.ticks))


def stamp(time: float) -> Any:
    """A simulated time [s] in a message."""
    return Time(nanoseconds=round(time * 1e9)).to_msg()


def waveform(first: int, samples: Any, unit: str = "m", scale: float = 1.0, period: float = PERIOD) -> Waveform:
    """A block of samples."""
    message = Waveform(first_sample=first, sample_period=period, scale=scale, unit=unit, run_id=1)
    message.header.stamp, message.samples = stamp(first * period), numbers(samples)
    return message


def event(time: float, text: str, level: int = Event.INFO) -> Topic:
    """An event."""
    message = Event(text=text, level=level, run_id=1)
    message.header.stamp = stamp(time)
    return "events", message


def status(time: float, state: int, detail: str = "") -> Topic:
    """A state of the instrument."""
    message = InstrumentStatus(state=state, detail=detail, run_id=1)
    message.header.stamp = stamp(time)
    return "status", message


def parameters(node: str, values: Mapping[str, Any], changed_at: float | None = None) -> Topic:
    """All parameters of a node, or changes of them; None: it is not there any more."""
    message = Parameters(node=f"/afm/{node}", changes=changed_at is not None, run_id=1)
    message.header.stamp = stamp(changed_at or 0.0)
    message.parameters = [Parameter(name, value=value).to_parameter_msg() for name, value in values.items()]
    return "parameters", message


def lines_of(scan: Scan = SCAN, number: int = 1, start: float = 1.0) -> list[ScanLine]:
    """All lines of a scan, each pixel another number, in the order of measurement."""
    rng = np.random.default_rng(number)
    return [
        ScanLine(
            number,
            scan,
            Line(
                index,
                direction,
                start + (index + 0.5 * (direction == RETRACE)) / 3.0,
                {name: 1e-9 * rng.normal(size=scan.pixels) for name in UNITS},
            ),
            UNITS,
        )
        for index in range(scan.lines)
        for direction in DIRECTIONS
    ]


def line_message(line: ScanLine) -> Topic:
    """A line of a scan as it is sent."""
    message = ScanLineMessage(
        scan=line.number, index=line.line.index, direction=line.line.direction, up=line.scan.direction == "up", run_id=1
    )
    message.header.stamp = stamp(line.line.time)
    for name in (*FRAME, "size_y"):
        setattr(message, name, getattr(line.scan, name))
    message.channels, message.units = list(line.units), list(line.units.values())
    message.data = numbers(*(line.line.channels[name] for name in line.units))
    return "scan_line", message


def record(
    path: Path, messages: Iterable[Topic], end: Mapping[str, str] | None = None, about: Mapping[str, str] | None = None
) -> Path:
    """A record of messages, whole."""
    writer = begin(path, messages, about)
    writer.close(end or {"missing": ""})
    return path


def begin(path: Path, messages: Iterable[Topic], about: Mapping[str, str] | None = None) -> RecordWriter:
    """A record that grows, with some messages in it."""
    writer = RecordWriter(GrowingFile(path), definition, {"title": "", "namespace": "/afm", **(about or {})})
    put(writer, messages)
    return writer


def put(writer: RecordWriter, messages: Iterable[Topic]) -> None:
    """Add messages to a record as a chunk."""
    for topic, message in messages:
        time_ns = nanoseconds(message.header.stamp) if hasattr(message, "header") else 0
        writer.put(topic, kind_of(message), time_ns, time_ns, serialized(message))
    writer.flush()
