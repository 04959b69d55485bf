"""Rows that are missing in a recording because its file could not be written. Needs no ROS."""

from collections import Counter

import numpy as np
from numpy.typing import NDArray

from . import layout, pictures

_TICKS = {signal.entity for signal in layout.TICKS}


class Gaps:
    """Counts the missing rows and describes each gap."""

    def __init__(self) -> None:
        self.unwritten: Counter[str] = Counter()
        """Missing rows of each entity, of all gaps."""
        self._rows: Counter[str] = Counter()  # of the present gap
        self._begin_ns = self._end_ns = 0
        self._why = ""

    @property
    def open(self) -> bool:
        """Whether there is a gap that `take` has not described."""
        return bool(self._rows)

    def put(self, entity: str, times: NDArray[np.int64], why: str) -> None:
        """Count rows at simulated times [ns]; `why`: the reason, of which the first one of a gap counts."""
        begin, end = int(times[0]), int(times[-1])
        if self.open:
            begin, end, why = min(begin, self._begin_ns), max(end, self._end_ns), self._why
        self._begin_ns, self._end_ns, self._why = begin, end, why
        self._rows[entity] += len(times)
        self.unwritten[entity] += len(times)

    def take(self) -> tuple[int, str]:
        """End the gap: its begin [ns] and its description."""
        rows, self._rows = self._rows, Counter()
        lines = rows.pop(pictures.LINES, 0)
        samples = max((count for entity, count in rows.items() if entity not in _TICKS), default=0)
        of_scans = f", and {lines} lines of scans (trace and retrace counted each)," if lines else ""
        return self._begin_ns, (
            f"{rows[layout.POSITION.entity]} ticks and {samples} samples a channel{of_scans} are missing from "
            f"{self._begin_ns / 1e9:g} s to {self._end_ns / 1e9:g} s: {self._why}"
        )
