"""Assigns the blocks of several streams to runs, and counts missing rows. Needs no ROS."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass

HOLD_LIMIT = 500
"""Largest number of blocks held back, some 15 MB: memory is bounded even if the missing ones never come."""


@dataclass
class Stream:
    """What the present run has brought on one topic: values received, and values missing between them."""

    received: int = 0
    lost: int = 0
    expected: int | None = None
    begin: int = 0  # number of the first value
    restarted: bool = False
    next: int = 0  # once it has begun again: number that follows what is held back


@dataclass(frozen=True)
class _Block:
    stream: str
    first: int
    count: int
    write: Callable[[], None]


class Intake:
    """Receives blocks and writes each one once, in order, in its run.

    A run ends when a stream begins again at a lower number: the instrument has been reset. Topics do not arrive in
    step, so blocks of the next run are held back until every stream that there has been has begun again. If a stream
    goes on with its old numbers in place of that, what was held back of it came from somebody else and is dropped.

    Parameters
    ----------
    streams : names of the streams
    new_run : called between the last block of a run and the first one of the next
    """

    def __init__(self, streams: Iterable[str], new_run: Callable[[], None]) -> None:
        self.streams = {name: Stream() for name in streams}
        self._new_run = new_run
        self._held: list[_Block] = []
        self._seen: set[str] = set()
        self._open = False
        self.strays = 0
        """Blocks dropped."""

    def add(self, stream: str) -> None:
        """One more stream."""
        self.streams[stream] = Stream()

    @property
    def begun(self) -> bool:
        """Whether anything has come in the present run."""
        return bool(self._held) or any(stream.expected is not None for stream in self.streams.values())

    def put(self, stream: str, first: int, count: int, write: Callable[[], None]) -> None:
        """Take a block: `count` values from number `first` on, written by `write` now or later."""
        block = _Block(stream, first, count, write)
        if self._open:
            self._sort(block)
        else:
            self._held.append(block)
            if len(self._held) > HOLD_LIMIT:
                self.open()

    def open(self) -> None:
        """Write all blocks held back up to now, and later ones at once."""
        self._open = True
        self._sort_held()

    def finish(self) -> None:
        """Write everything that is still held back."""
        self.open()
        while self._held:
            self._begin_run()

    def _sort(self, block: _Block) -> None:
        stream = self.streams[block.stream]
        if stream.restarted and block.first == stream.expected != stream.next:
            self._drop_held(block.stream)
        elif not stream.restarted and stream.expected is not None and block.first < stream.expected:
            stream.restarted = True
        if not stream.restarted:
            if stream.expected is None:
                stream.begin = block.first
            else:
                stream.lost += block.first - stream.expected
            stream.received += block.count
            stream.expected = block.first + block.count
            self._seen.add(block.stream)
            block.write()
            return
        stream.next = block.first + block.count
        self._held.append(block)
        if all(self.streams[name].restarted for name in self._seen) or len(self._held) > HOLD_LIMIT:
            self._begin_run()

    def _drop_held(self, name: str) -> None:
        kept = [block for block in self._held if block.stream != name]
        self.strays += len(self._held) - len(kept)
        self._held = kept
        self.streams[name].restarted = False

    def _begin_run(self) -> None:
        self._new_run()
        self.streams = {name: Stream() for name in self.streams}
        self._sort_held()

    def _sort_held(self) -> None:
        held, self._held = self._held, []
        for block in held:
            self._sort(block)
