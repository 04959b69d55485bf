"""What has come of each run of an instrument, and what is missing of it. Needs no ROS."""

import math
import time
from dataclasses import dataclass, field

from .heads import MessageHead

SILENCE = 4.0
"""Wall time for which a run that is over may still be sent what it lacks [s]: more than the 3 s after which the
middleware repeats lost messages."""
QUIET = 0.5
"""The same for what comes once and at once, when all blocks are there: score, results, events [s]."""
_LAG = 40
"""Blocks of other streams without one of a stream, from when it counts as not delivered: some seconds."""


@dataclass
class StreamCounts:
    """What a run has brought on one topic of blocks: values received, values missing between them."""

    begin: int = -1  # number of the first value; -1: nothing has come
    next: int = 0  # number that follows the last value
    received: int = 0
    lost: int = 0
    unwritten: int = 0  # values that came while the file could not be written
    lag: int = 0  # blocks of the trace and of the first channel since its last one

    def put(self, block: MessageHead) -> bool:
        """Count a block; False if it has come before."""
        if self.begin >= 0 and block.first < self.next:
            return False
        if self.begin < 0:
            self.begin = block.first
        else:
            self.lost += block.first - self.next
        self.next = block.first + block.count
        self.received += block.count
        return True


@dataclass
class LineCounts:
    """Lines of scans, trace and retrace counted each."""

    received: int = 0
    lost: int = 0
    scan: int = 0
    last: int = -1  # place of the last line in its scan

    def put(self, scan: int, place: int) -> None:
        """Count a line, the `place`-th of its scan from 0 on."""
        if scan != self.scan:
            self.scan, self.last = scan, -1
        self.received += 1
        self.lost += max(place - self.last - 1, 0)
        self.last = max(self.last, place)


@dataclass
class RunProgress:
    """What has come of a run, and what is known of its end.

    Parameters
    ----------
    run_id : int
    trace : str
        Topic of the blocks of control ticks.
    channels : list of str
        Topics of the channels that every instrument has.
    """

    run_id: int
    trace: str
    channels: list[str]
    streams: dict[str, StreamCounts] = field(default_factory=dict)
    lines: LineCounts = field(default_factory=LineCounts)
    time_ns: int = 0  # latest simulated time
    over: bool = False
    finished: bool = False  # it has come to its duration: a score follows
    scored: bool = False
    ticks: int = 0  # as its last status said
    samples: int = 0
    heard_at: float = -math.inf  # steady wall time at which something new came last [s]

    def stream(self, name: str) -> StreamCounts:
        """What has come on a topic of blocks."""
        return self.streams.setdefault(name, StreamCounts())

    def count_block(self, name: str) -> None:
        """Note that a new block has come on a topic."""
        wanted = (self.trace, *self.channels)
        if name in wanted[:2]:
            for each in wanted:
                self.stream(each).lag += 1
        self.stream(name).lag = 0

    @property
    def problem(self) -> str:
        """Streams that bring nothing while others do; empty: none."""
        silent = [name for name in (self.trace, *self.channels) if self.stream(name).lag > _LAG]
        if not silent:
            return ""
        return f"nothing comes on {', '.join(silent)} while other streams arrive: start the simulator again"

    def has(self, ticks: int, samples: int) -> bool:
        """Whether every stream has come up to these numbers of ticks and samples."""
        wanted = {self.trace: ticks} | dict.fromkeys(self.channels, samples)
        return all(self.stream(name).next >= count for name, count in wanted.items())

    def ended(self) -> bool:
        """Whether nothing more is to be waited for."""
        silent = time.monotonic() - self.heard_at
        if not self.over:
            return silent > SILENCE
        whole = self.has(self.ticks, self.samples) and (self.scored or not self.finished)
        return silent > (QUIET if whole else SILENCE)

    def missing(self) -> list[str]:
        """What the record of the run lacks, in clauses; empty: nothing."""
        found = []
        if not self.over:
            found.append("it has not come to an end: the simulator or the recorder was ended during the run")
        begin = self.stream(self.trace).begin, max(self.stream(name).begin for name in self.channels)
        if max(begin) > 0:
            found.append(f"it begins at tick {begin[0]}, sample {begin[1]}: the instrument ran before the recorder")
        ticks = self.stream(self.trace).lost
        samples = max((each.lost for name, each in self.streams.items() if name != self.trace), default=0)
        if ticks or samples:
            found.append(f"{ticks} ticks and {samples} samples a channel are missing between others")
        if self.over and not self.has(self.ticks, self.samples):
            ticks = self.ticks - self.stream(self.trace).next
            samples = max(self.samples - self.stream(name).next for name in self.channels)
            found.append(f"the last {max(ticks, 0)} ticks and {max(samples, 0)} samples a channel are missing")
        if self.lines.lost:
            found.append(f"{self.lines.lost} lines of scans (trace and retrace counted each) are missing")
        if unwritten := self.unwritten():
            found.append(f"{unwritten[0]} ticks and {unwritten[1]} samples a channel could not be written")
        return found

    def unwritten(self) -> tuple[int, int] | None:
        """Ticks, and samples a channel, that came while the file could not be written; None: no block did."""
        ticks = self.stream(self.trace).unwritten
        samples = max((each.unwritten for name, each in self.streams.items() if name != self.trace), default=0)
        return (ticks, samples) if ticks or samples else None
