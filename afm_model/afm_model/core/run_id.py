"""The name of a run: every message carries it, so that nobody takes the data of one run for those of another."""

import time

_given = 0


def next_run_id() -> int:
    """Return a number that names a run: the wall time in microseconds since 1970.

    It is larger than any number that this process has given before, also if the system's clock is set back.
    """
    global _given
    _given = max(time.time_ns() // 1000, _given + 1)
    return _given
