"""Whether what a process uses is flat."""

import statistics
from collections.abc import Sequence
from dataclasses import dataclass

from soak.sampling import Sample

MEMORY_RATE = 1e5 / 60.0
"""Growth of the memory that is called flat [bytes per second]: 0.1 MB a minute, 144 MB a day."""
INDEX_RATE = {"afm_recorder_node": 2e5 / 60.0}
"""Growth in addition, of a process that keeps what it has to: the index of a record, 1.6 kB a chunk until its end."""
RESOLUTION = 1e6
"""Memory that comes and goes with the moment [bytes]: less is no growth, however short the run."""
COUNTS = ("descriptors", "threads", "segments")


@dataclass(frozen=True)
class Use:
    """One quantity of one process, at the begin and at the end of what was judged."""

    begin: float
    """Median of the first third; of a count the smallest."""
    end: float
    """The same of the last third."""
    seconds: float
    """Between the middles of these."""
    flat: bool

    @property
    def rate(self) -> float:
        """Growth per second."""
        return (self.end - self.begin) / self.seconds


def judge(samples: Sequence[Sample], quantity: str, kept: float = 0.0) -> Use:
    """Compare the last third with the first, so that a single moment decides nothing: medians, of counts the smallest.

    Memory has to grow from the first to the middle one and on to the last: while the machine stands still messages
    wait, and memory stays at that mark (docs/reliability.md). What leaks goes on growing.

    Parameters
    ----------
    samples : at least three, in order of time
    quantity : a field of `Sample`
    kept : growth of the memory that is meant [bytes per second]

    Raises
    ------
    ValueError
        If there are fewer than three.
    """
    if len(samples) < 3:
        raise ValueError(f"{len(samples)} samples: at least three are needed to tell a growth")
    third = len(samples) // 3
    parts = samples[:third], samples[third:-third], samples[-third:]
    first, _, last = parts
    # Threads and files come and go with the work of the moment: what leaks is in every sample.
    typical = min if quantity in COUNTS else statistics.median
    begin, between, end = (typical(getattr(one, quantity) for one in part) for part in parts)
    seconds = statistics.median(one.at for one in last) - statistics.median(one.at for one in first)
    if quantity in COUNTS:
        return Use(begin, end, seconds, end <= begin)
    growth = 2.0 * min(between - begin, end - between)
    return Use(begin, end, seconds, growth <= max(RESOLUTION, (MEMORY_RATE + kept) * seconds))
