"""Signals of a run that is recorded without an instrument."""

import numpy as np

from afm_recorder_node import layout
from afm_recorder_node.writer import RecordingWriter

PERIOD, CONTROL_PERIOD = 1e-6, 2e-6


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
