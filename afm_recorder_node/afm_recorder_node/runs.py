"""The runs of an instrument, each with its record: messages are sorted by the run that they name."""

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, field

from .heads import Head

SILENCE = 4.0
"""Wall time for which a run that is over may still be sent what it lacks [s]: more than the 3 s after which the middleware
repeats lost messages.
"""
_SCORE = 0.5
"""The same for its score [s], which is sent once and at once."""
KEPT = 2000
"""Messages of a run without a block that are kept, at most."""


@dataclass
class Stream:
    """What a run has brought on one topic of blocks: values received, values missing between them."""

    begin: int = -1  # number of the first value; -1: nothing has come
    next: int = 0  # number that follows the last value
    received: int = 0
    lost: int = 0

    def put(self, block: Head) -> bool:
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
class Lines:
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
class Progress:
    """What has come of a run, and what is known of its end."""

    run_id: int
    streams: dict[str, Stream] = field(default_factory=dict)
    lines: Lines = field(default_factory=Lines)
    time_ns: int = 0  # latest simulated time
    over: bool = False
    finished: bool = False  # it has come to its duration: a score follows
    scored: bool = False
    ticks: int = 0  # as its last status said
    samples: int = 0
    unwritten: int = 0  # blocks that came while the file could not be written
    heard_at: float = -math.inf  # steady wall time at which something new came last [s]

    def whole(self, trace: str, channels: list[str]) -> bool:
        """Whether all has come that a run that is over has brought."""
        if not self.over or (self.finished and not self.scored and time.monotonic() < self.heard_at + _SCORE):
            return False
        wanted = {trace: self.ticks} | dict.fromkeys(channels, self.samples)
        return all(name not in self.streams or self.streams[name].next >= count for name, count in wanted.items())

    def missing(self, trace: str, channels: list[str]) -> list[str]:
        """Why the record of a run is not complete, in clauses; empty if it is."""
        found = []
        if not self.over:
            found.append("it has not come to an end: the simulator or the recorder was ended during the run")
        begin = min((each.begin for name, each in self.streams.items() if name == trace), default=0)
        if begin > 0:
            found.append(f"it begins at tick {begin}: the instrument ran before the recorder was there")
        lost = {name: each.lost for name, each in self.streams.items() if each.lost}
        if trace in lost:
            found.append(f"{lost.pop(trace)} ticks are missing")
        if lost:
            found.append(f"{max(lost.values())} samples a channel are missing")
        if self.over:
            tail = {trace: self.ticks} | dict.fromkeys(channels, self.samples)
            short = [name for name, count in tail.items() if name in self.streams and self.streams[name].next < count]
            if short:
                found.append(f"the last blocks of {', '.join(short)} are missing")
        if self.lines.lost:
            found.append(f"{self.lines.lost} lines of scans (trace and retrace counted each) are missing")
        if self.unwritten:
            found.append(f"{self.unwritten} blocks came while the file could not be written")
        return found


Definition = Callable[[str], str]
