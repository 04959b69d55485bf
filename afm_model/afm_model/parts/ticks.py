"""From times to control ticks."""

import math


def ticks_of(time: float, period: float) -> int:
    """Control ticks that cover a time: the first one at or after it [s]."""
    # Round-off in the quotient must not add one.
    return math.ceil(time / period - 1e-6)
