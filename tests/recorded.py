"""Signals of a run, and lines of a scan, that are recorded without an instrument."""

import numpy as np

from afm_model.microscope.image import DIRECTIONS, RETRACE, Line
from afm_model.microscope.verbs import Scan
from afm_recorder_node import layout
from afm_recorder_node.scan_lines import ScanLine
from afm_recorder_node.writer import RecordingWriter

PERIOD, CONTROL_PERIOD = 1e-6, 2e-6
UNITS = {"height": "m", "lateral": "N"}
SCAN = Scan(centre_x=1e-6, size_x=2e-6, angle=0.5, pixels=24, lines=40, line_rate=4.0, channels="height, lateral")


class Run:
    """Signals of a run, in volts and SI units."""

    def __init__(self, ticks: int, seed: int = 0) -> None:
        rng = np.random.default_rng(seed)
        self.ticks = ticks
        self.samples = rng.normal(0.0, 1.0, (4, 2 * ticks))
        self.scales = (10e-9, 50e-9, 1.0, 1.0)
        self.position, self.reference = rng.normal(0.0, 5e-9, (2, ticks, 3))
        self.deflection = rng.normal(0.0, 1e-9, ticks)
        self.drive = rng.normal(0.0, 1.0, (ticks, 3))
        self.round_trip = rng.gamma(4.0, 1e-5, ticks).astype(np.float32)

    def write(self, writer: RecordingWriter, start: int, stop: int) -> None:
        at = slice(start, stop)
        for channel, samples, scale in zip(layout.CHANNELS, self.samples, self.scales, strict=True):
            writer.channel(channel, 2 * start, PERIOD, samples[2 * start : 2 * stop], scale)
        writer.control(
            start,
            CONTROL_PERIOD,
            position=self.position[at],
            reference=self.reference[at],
            deflection=self.deflection[at],
            drive=self.drive[at],
            round_trip=self.round_trip[at],
            cantilever_height=3e-9,
        )


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
