"""Scans, line by line."""

from collections.abc import Iterator

from ..program.orders import Order
from .bench import Bench
from .collect import LineCollector, signals
from .jobs import Desk, Job, Task, going
from .notes import notes
from .plan import lines
from .results import Image, Line
from .verbs import Scan

_AT_THE_END = 1e-12
"""Mean over a pixel this close to the end of the range of z [m]: z was there all the time."""


def channel_names(channels: str) -> list[str]:
    """Names out of a list separated by commas."""
    return list(dict.fromkeys(name.strip() for name in channels.split(",") if name.strip()))


class Scanning(Job):
    """Scan."""

    verb: Scan

    def __init__(self, verb: Scan, bench: Bench, desk: Desk) -> None:
        super().__init__(verb, bench, desk)
        self._names = channel_names(verb.channels)
        units = {name: signal.unit for name, signal in signals(bench.instrument, self._names).items()}
        self._image = Image.empty(verb, units)
        self._image.metadata = notes(bench.parameters)
        self._plan = lines(verb, bench)
        self._image.line_rate = self._plan.line_rate
        self._collector: LineCollector | None = None
        self._saturated: set[int] = set()

    def tasks(self) -> Iterator[Task]:
        """See `Job`."""
        bench, verb, plan = self.bench, self.verb, self._plan
        x, y = plan.begin
        duration = plan.motion.samples * bench.sample_period
        way = bench.move(x, y, verb.speed).ticks * bench.control_period
        self.total = way + duration
        yield from going(self, x, y, verb.speed)
        yield Task(Order(plan.motion), duration, "scanning", self._collect)

    def _collect(self, first: int) -> LineCollector:
        plan = self._plan
        shape = {
            "pixels": self.verb.pixels,
            "per_pixel": plan.per_pixel,
            "turn": plan.motion.turn,
            "lines": self.verb.lines,
        }
        self._collector = LineCollector(self.bench.instrument, self._names, first, shape, self._put)
        self._image.start = (first + plan.motion.turn) * self.bench.sample_period
        return self._collector

    def _put(self, line: Line) -> None:
        self._image.put(line)
        if "height" in line.channels:
            low, high = self.bench.z_range
            z = -line.channels["height"]
            if z.min() <= low + _AT_THE_END or z.max() >= high - _AT_THE_END:
                self._saturated.add(line.index)
        self._image.complete = self._image.lines_done == self.verb.lines
        self.on_line(line)

    def result(self) -> Image:
        """The image as far as it came; a remark is among its notes, so that files keep it."""
        if self.remark:
            self._image.metadata["Remark"] = self.remark
        return self._image

    @property
    def remark(self) -> str:
        """See `Job`."""
        if not self._saturated:
            return ""
        return (
            f"z was at the end of its range in {len(self._saturated)} of {self.verb.lines} lines: the height is not "
            f"that of the sample there"
        )

    @property
    def detail(self) -> str:
        """See `Job`."""
        return f"line {self._collector.line + 1} of {self.verb.lines}" if self._collector else ""
