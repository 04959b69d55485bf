"""Signals over time while the tip slides: friction loops and paths."""

import math
from collections.abc import Iterator

import numpy as np

from ..program.orders import Order
from .bench import Bench
from .collect import RecordCollector
from .jobs import Desk, Job, Task, going
from .plan import LinePlan, lines, path
from .results import Loop, PathRecord, Record
from .verbs import FrictionLoop, MoveTo, Scan, ScanPath

_OVERSCAN = 0.1
_TURNING = 0.625
"""The scanner goes 5/16 of speed times time of a turn beyond a line, at both ends."""


def recorder(bench: Bench, names: list[str], first: int, sample_rate: float) -> RecordCollector:
    """Collects means at this rate [Hz], or at that of the virtual ADC if it is lower."""
    per = max(1, round(1.0 / (sample_rate * bench.sample_period)))
    return RecordCollector(bench.instrument, names, first, per)


def loop_plan(verb: FrictionLoop, bench: Bench) -> LinePlan:
    """Lines whose turning points are `length` apart, through the place where the scanner is asked to be."""
    x, y = bench.place
    scan = Scan(
        centre_x=x,
        centre_y=y,
        size_x=verb.length / (1.0 + _TURNING * _OVERSCAN),
        angle=verb.angle,
        pixels=2,
        lines=verb.count,
        line_rate=verb.line_rate,
        overscan=_OVERSCAN,
        slow_axis=False,
    )
    return lines(scan, bench)


class Looping(Job):
    """FrictionLoop."""

    verb: FrictionLoop

    def __init__(self, verb: FrictionLoop, bench: Bench, desk: Desk) -> None:
        super().__init__(verb, bench, desk)
        self._plan = loop_plan(verb, bench)
        self._collector: RecordCollector | None = None

    def tasks(self) -> Iterator[Task]:
        """See `Job`."""
        bench, plan = self.bench, self._plan
        motion = plan.motion
        duration = motion.samples * bench.sample_period
        self.total = duration
        speed = MoveTo().speed
        yield from going(self, *plan.begin, speed)
        yield Task(Order(motion), duration, "sliding", self._collect)
        yield from going(self, motion.x, motion.y, speed)

    def _collect(self, first: int) -> RecordCollector:
        motion, count = self._plan.motion, self.verb.count
        # From the first turn to the right to the last one, both of them whole.
        begin = first + motion.turn + motion.image
        names = ["asked_x", "asked_y", "lateral", "deflection"]
        self._collector = recorder(self.bench, names, begin, self.verb.sample_rate)
        self._collector.end = begin + motion.turn + 2 * (count - 1) * (motion.image + motion.turn)
        return self._collector

    def result(self) -> Loop:
        """The loops, from a turn to the right to another."""
        motion, record = self._plan.motion, self._collector.record() if self._collector else _nothing(4)
        x, y, lateral, deflection = record.channels.values()
        along = (x - motion.x) * math.cos(motion.angle) + (y - motion.y) * math.sin(motion.angle)
        return Loop(self.verb, along, lateral, deflection, record.time)


def _nothing(channels: int) -> Record:
    empty = np.empty(0)
    return Record(empty, {str(number): empty for number in range(channels)}, {})


_PATH = {"asked_x": "x", "asked_y": "y", "height": "height", "error": "error", "lateral": "lateral"}


class Following(Job):
    """ScanPath."""

    verb: ScanPath

    def __init__(self, verb: ScanPath, bench: Bench, desk: Desk) -> None:
        super().__init__(verb, bench, desk)
        self._collector: RecordCollector | None = None

    def tasks(self) -> Iterator[Task]:
        """See `Job`."""
        bench, verb = self.bench, self.verb
        places = list(zip(verb.x, verb.y, strict=True))
        pieces = path(places, verb.speed, bench)
        self.total = sum(piece.ticks for piece in pieces) * bench.control_period
        yield from going(self, *places[0], max(verb.speed, MoveTo().speed))
        for number, piece in enumerate(pieces):
            detail = f"piece {number + 1} of {len(pieces)}"
            duration = piece.ticks * bench.control_period
            yield Task(Order(piece), duration, detail, None if number else self._collect, goes_on=number > 0)

    def _collect(self, first: int) -> RecordCollector:
        self._collector = self._recorder(first)
        return self._collector

    def _recorder(self, first: int) -> RecordCollector:
        return recorder(self.bench, list(_PATH), first, self.verb.sample_rate)

    def result(self) -> PathRecord:
        """The path as far as it came."""
        # Without samples, too, every channel has its unit.
        record = (self._collector or self._recorder(0)).record()
        channels = dict(zip(_PATH.values(), record.channels.values(), strict=True))
        units = dict(zip(_PATH.values(), record.units.values(), strict=True))
        return PathRecord(self.verb, Record(record.time, channels, units))
