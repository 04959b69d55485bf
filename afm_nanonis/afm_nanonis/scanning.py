"""Scan: frames, images, files."""

import math
import time
from dataclasses import replace
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np

from afm_model.core.errors import ParameterError, ResultFileError, VerbError
from afm_model.files import write_sxm
from afm_model.microscope import Image, Line, Scan

from .codec import ProtocolError
from .front import Front
from .handlers import handles
from .jobs import SCAN, Work
from .motion import of_sum
from .scan_state import PIXELS, FreeScan
from .signal_index import COUNT

_TURN = 1.2
"""Periods of the scanner's resonance that a turn takes at least."""
_OVERSCAN, _MOST_OVERSCAN = 0.1, 2.0
START, STOP, PAUSE, RESUME, *_, TO_THE_TIP = range(7)


def _overscan(front: Front, rate: float) -> float:
    """Time of a turn over that of the image part of a line: long enough for the scanner."""
    half, turn = 0.5 / rate, _TURN / front.resonance
    return min(max(_OVERSCAN, turn / (half - turn) if half > turn else math.inf), _MOST_OVERSCAN)


def _verb(front: Front, upwards: bool) -> Scan:
    scan = front.scan
    sources = [front.signals.source(index) for index in scan.channels]
    # z is always measured: a scan needs a channel.
    names = dict.fromkeys([*(each.channel or each.signal for each in sources if each.signal), "height"])
    rate = scan.line_rate
    kind = Scan if front.state.approached else FreeScan
    try:
        return kind(
            centre_x=scan.centre[0],
            centre_y=scan.centre[1],
            size_x=scan.size[0],
            size_y=scan.size[1],
            angle=-math.radians(scan.angle),
            pixels=scan.pixels,
            lines=scan.lines,
            line_rate=rate,
            overscan=_overscan(front, rate),
            direction="up" if upwards else "down",
            channels=", ".join(names),
        )
    except ValueError as error:
        raise ProtocolError(f"this scan is not allowed: {str(error).splitlines()[0]}") from None


class _Frame:
    """Takes the lines of a frame into the image that clients see."""

    def __init__(self, front: Front, verb: Scan) -> None:
        self._front, scan = front, front.scan
        self._channels = list(scan.channels)
        titles = {index: front.signals.named(index)[0] for index in self._channels}
        # As files have it: the height is Z.
        self._names = {
            index: "height" if front.signals.source(index).signal == "z" else titles[index] for index in titles
        }
        units = {self._names[index]: front.signals.named(index)[1] for index in self._channels}
        self.image = Image.empty(verb.model_copy(update={"channels": ""}), units)
        scan.shown, scan.image, scan.begun, scan.line = self._names, self.image, datetime.now(), (-1, 3)

    def put(self, line: Line) -> None:
        """Take one way of a line."""
        front, values = self._front, {}
        for index in self._channels:
            source, constant = front.signals.source(index), front.signals.constant(index)
            if constant is None:
                measured = front.signals.scaled(index, line.channels[source.channel or source.signal], of_scan=True)
            else:
                measured = np.full(self.image.scan.pixels, constant)
            values[self._names[index]] = measured
        self.image.put(replace(line, channels=values))
        scan = front.scan
        with scan.changed:
            scan.line, scan.ended = (line.index + 1, line.number % 2), scan.ended + 1
            scan.changed.notify_all()


def _scan(front: Front, upwards: bool, verb: Scan) -> None:
    """Scan frames until it is stopped, or one if it is not continuous."""
    scan, microscope = front.scan, front.microscope
    while True:
        frame, scan.upwards = _Frame(front, verb), upwards
        microscope.on_line = frame.put
        try:
            frame.image.metadata = front.do(verb).metadata
        finally:
            microscope.on_line = None
            frame.image.line_rate = frame.image.line_rate or verb.line_rate
        saved = ""
        if scan.autosave != 2:
            saved = _save(front)
            if scan.autosave == 1:
                scan.autosave = 2
        with scan.changed:
            scan.saved, scan.frames = saved, scan.frames + 1
            scan.changed.notify_all()
        if not scan.continuous or front.jobs.stopped:
            return
        upwards ^= bool(scan.bouncy)
        verb = _verb(front, upwards)


def _save(front: Front) -> str:
    """Write the image under the next free number; its path."""
    scan = front.scan
    assert scan.image is not None
    try:
        return str(write_sxm(front.free_path(scan.series, 4, ".sxm"), scan.image, date=scan.begun))
    except ResultFileError as error:
        raise VerbError(str(error)) from None


@handles("Scan.Action")
def _action(front: Front, what: int, direction: int) -> list[Any]:
    if what == START:

        def prepare() -> Work:
            verb = _verb(front, direction == 1)
            if front.state.approached and (objection := front.microscope.objection(verb)):
                raise ProtocolError(objection)
            front.scan.saved = ""
            return lambda: _scan(front, direction == 1, verb)

        front.jobs.start(SCAN, prepare)
    elif what == STOP:
        front.jobs.stop(SCAN, soon=True)
    elif what in (PAUSE, RESUME) and front.jobs.doing == SCAN:
        (front.microscope.pause if what == PAUSE else front.microscope.resume)()
    elif what == TO_THE_TIP:
        read = front.read("x", "y")
        front.scan.frame((read["x"].value, read["y"].value), front.scan.size, front.scan.angle)
    elif what > TO_THE_TIP:
        raise ProtocolError(f"action {what} is not allowed: it must be 0 to {TO_THE_TIP}")
    return []


@handles("Scan.StatusGet")
def _status(front: Front) -> list[Any]:
    return [int(front.jobs.doing == SCAN)]


@handles("Scan.FrameSet")
def _set_frame(front: Front, x: float, y: float, width: float, height: float, angle: float) -> list[Any]:
    if not (width > 0.0 and height > 0.0 and all(map(math.isfinite, (x, y, width, height, angle)))):
        raise ProtocolError(f"a frame of {width:g} m x {height:g} m is not allowed: both must be > 0 m")
    front.scan.frame((of_sum(x), of_sum(y)), (width, height), of_sum(angle))
    return []


@handles("Scan.FrameGet")
def _frame(front: Front) -> list[Any]:
    scan = front.scan
    return [*scan.centre, *scan.size, scan.angle]


@handles("Scan.BufferSet")
def _set_buffer(front: Front, channels: list[int], pixels: int, lines: int) -> list[Any]:
    scan = front.scan
    if wrong := [index for index in channels if not 0 <= index < COUNT]:
        raise ProtocolError(f"signal {wrong[0]} is not allowed: it must be 0 to {COUNT - 1}")
    if pixels < 0 or pixels > 8192 or lines > 8192:
        raise ProtocolError(f"{pixels} pixels and {lines} lines are not allowed: at most 8192 of each")
    if channels:
        scan.channels = list(dict.fromkeys(channels))
    ratio = scan.lines / scan.pixels
    if pixels > 0:
        scan.pixels = max(PIXELS, PIXELS * round(pixels / PIXELS))
    # 0 lines: with the same ratio as before.
    scan.lines = lines if lines > 0 else max(1, round(ratio * scan.pixels))
    scan.clear()
    return []


@handles("Scan.BufferGet")
def _buffer(front: Front) -> list[Any]:
    return [front.scan.channels, front.scan.pixels, front.scan.lines]


@handles("Scan.PropsSet")
def _set_props(
    front: Front,
    continuous: int,
    bouncy: int,
    autosave: int,
    series: str,
    comment: str,
    modules: list[str],
    autopaste: int,
) -> list[Any]:
    scan = front.scan
    if continuous:
        scan.continuous = int(continuous == 1)
    if bouncy:
        scan.bouncy = int(bouncy == 1)
    if autosave:
        scan.autosave = autosave - 1
    if Path(series).name != series:
        raise ProtocolError(f"series name {series!r} is not allowed: it must be a name of a file")
    scan.series, scan.comment = series or scan.series, comment or scan.comment
    scan.modules = modules or scan.modules
    if autopaste:
        scan.autopaste = autopaste - 1
    return []


@handles("Scan.PropsGet")
def _props(front: Front) -> list[Any]:
    scan = front.scan
    # Old clients read the end of the response where the modules stand: none, unless they were set.
    return [
        *(scan.continuous, scan.bouncy, scan.autosave, scan.series, scan.comment, scan.modules),
        *([0] * len(scan.modules), [[]] * len(scan.modules), scan.autopaste),
    ]


@handles("Scan.SpeedSet")
def _set_speed(
    front: Front, forward: float, backward: float, forth: float, back: float, stays: int, ratio: float
) -> list[Any]:
    front.scan.speed([forward, backward, forth, back], stays, ratio)
    return []


@handles("Scan.SpeedGet")
def _speed(front: Front) -> list[Any]:
    return [*front.scan.speeds, front.scan.stays - 1, front.scan.ratio]


@handles("Scan.FrameDataGrab")
def _grab(front: Front, channel: int, forward: int) -> list[Any]:
    scan, image = front.scan, front.scan.image
    shown = scan.channels if image is None else [*scan.shown]
    if channel not in shown:
        raise ProtocolError(f"channel {channel} is not in the buffer: it holds {', '.join(map(str, shown))}")
    title = front.signals.title(channel)
    if image is None:
        return [title, np.full((scan.lines, scan.pixels), np.nan), int(scan.upwards)]
    return [title, image.data[scan.shown[channel], "trace" if forward else "retrace"][::-1], int(scan.upwards)]


def _ended(front: Front, timeout: int, counter: str) -> bool:
    """Wait for so long [ms] until a counter of the scan goes on, or the scan has ended."""
    scan, before = front.scan, getattr(front.scan, counter)
    limit = math.inf if timeout < 0 else time.monotonic() + 1e-3 * timeout
    with scan.changed:
        while front.jobs.doing == SCAN and getattr(scan, counter) == before:
            # A scan that is stopped ends no frame.
            if not scan.changed.wait(min(max(limit - time.monotonic(), 0.0), 0.05)) and time.monotonic() >= limit:
                return False
    return True


@handles("Scan.WaitEndOfScan")
def _wait_for_scan(front: Front, timeout: int) -> list[Any]:
    return [0, front.scan.saved] if _ended(front, timeout, "frames") else [1, ""]


@handles("Scan.WaitEndOfLine")
def _wait_for_line(front: Front, timeout: int) -> list[Any]:
    return [int(not _ended(front, timeout, "ended")), *front.scan.line, 0]


@handles("Scan.Save")
def _save_now(front: Front, wait: int, timeout: int) -> list[Any]:
    if front.scan.image is None:
        raise ProtocolError("there is no image to save: start a scan first")
    try:
        front.scan.saved = _save(front)
    except (ParameterError, VerbError) as error:
        raise ProtocolError(str(error)) from None
    return [0]
