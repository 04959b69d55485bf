"""Random numbers of a fault: functions of its seed and of the tick alone.

Nothing is drawn in advance and nothing is remembered, so that neither a pause nor another fault nor the size of a
block changes them. Each number is a chain of integer hashes with 32 bits.
"""

import math

from ..core.jit import kernel

_MASK = 0xFFFFFFFF
_FACTOR = 0x45D9F3B
"""Odd, and small enough that a product with 32 bits fits into 63."""


@kernel
def _mix(x: int) -> int:
    """Spread every bit of 32 over all of them, without loss."""
    x = ((x ^ (x >> 16)) * _FACTOR) & _MASK
    x = ((x ^ (x >> 16)) * _FACTOR) & _MASK
    return x ^ (x >> 16)


@kernel
def uniform(seed: int, number: int, which: int) -> float:
    """Draw `which` of message or update `number`: between 0 and 1, neither of them."""
    word = _mix((seed & _MASK) ^ 0x9E3779B9)
    word = _mix(word ^ (seed >> 32))
    word = _mix(word ^ (number & _MASK))
    word = _mix(word ^ (number >> 32))
    word = _mix(word ^ which)
    return (word + 0.5) / 4294967296.0


@kernel
def normal(seed: int, number: int, which: int) -> float:
    """The same, standard normal, by Box and Muller."""
    radius = math.sqrt(-2.0 * math.log(uniform(seed, number, 2 * which)))
    return radius * math.cos(2.0 * math.pi * uniform(seed, number, 2 * which + 1))
