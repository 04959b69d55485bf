"""Random numbers of a run: functions of a key and a count, so that a run is the same wherever it is cut.

Each stream has a number, and its key is made of that and the seed of the run: to switch one on changes no other.
Bits: SplitMix64 (Steele, Lea, Flood 2014, doi:10.1145/2660193.2660195) of key and count. Normal ones: the ziggurat of
Marsaglia and Tsang (2000, doi:10.18637/jss.v005.i08), with layer and place from separate bits.
"""

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from ..compiled.jit import kernel, routine
from .elementary import exp, log

THERMAL = 1000
"""Stream of the thermal noise; far from the few that the instrument draws in advance."""
_GOLDEN = np.uint64(0x9E3779B97F4A7C15)
_FIRST, _SECOND = np.uint64(0xBF58476D1CE4E5B9), np.uint64(0x94D049BB133111EB)
_30, _27, _31, _11, _ONE, _INDEX = (np.uint64(bits) for bits in (30, 27, 31, 11, 1, 255))
_LAYERS = 256
_LAST = 1.0 / 2**53
_TAIL = 3.6541528853610088
"""Where the tail of the normal distribution begins that has the area of one of 256 layers."""
_AREA = 0.0049286732339746545
"""That area: x exp(-x^2/2) + sqrt(pi/2) erfc(x/sqrt(2)) at _TAIL."""


def _edges() -> NDArray[np.float64]:
    """Width of each layer; of the lowest that of a rectangle of its area, tail included."""
    edges = [_AREA * exp(0.5 * _TAIL * _TAIL), _TAIL]
    for _ in range(_LAYERS - 2):
        edges.append(math.sqrt(-2.0 * log(_AREA / edges[-1] + exp(-0.5 * edges[-1] * edges[-1]))))
    return np.array([*edges, 0.0])


_EDGE = _edges()
_INNER = _EDGE[1:] / _EDGE[:-1]


def key_of(seed: int, stream: int) -> int:
    """Key of a stream of a run, a whole number of 63 bits."""
    return int(np.random.SeedSequence(seed, spawn_key=(stream,)).generate_state(1, np.uint64)[0] >> np.uint64(1))


@kernel
def bits(key: int | np.uint64, count: int) -> np.uint64:
    """The number `count` of the stream, 64 bits."""
    z = np.uint64(key) + np.uint64(count) * _GOLDEN
    z = (z ^ (z >> _30)) * _FIRST
    z = (z ^ (z >> _27)) * _SECOND
    return z ^ (z >> _31)


@kernel
def uniform(z: np.uint64) -> float:
    """Of 64 bits the upper 53: uniform in (0, 1]."""
    return float((z >> _11) + _ONE) * _LAST


@kernel
def normal(key: int | np.uint64, count: int) -> float:
    """Standard normal: the number `count` of the stream."""
    z = bits(key, count)
    i = int(z & _INDEX)
    u = 2.0 * uniform(z) - 1.0
    if abs(u) < _INNER[i]:
        return u * _EDGE[i]
    return _rare(z)


@routine
def _rare(z: np.uint64) -> float:
    """The same where the first try falls outside the inner part of its layer: one in a hundred."""
    for _ in range(100):
        i = int(z & _INDEX)
        u = 2.0 * uniform(z) - 1.0
        x = u * _EDGE[i]
        if abs(u) < _INNER[i]:
            return x
        # Further numbers by hashing these.
        z = bits(z, 1)
        if i == 0:
            for _ in range(100):
                beyond = -log(uniform(z)) / _TAIL
                z = bits(z, 1)
                height = -log(uniform(z))
                z = bits(z, 1)
                if 2.0 * height > beyond * beyond:
                    return math.copysign(_TAIL + beyond, u)
        upper, lower = exp(-0.5 * _EDGE[i + 1] * _EDGE[i + 1]), exp(-0.5 * _EDGE[i] * _EDGE[i])
        if lower + uniform(z) * (upper - lower) < exp(-0.5 * x * x):
            return x
        z = bits(z, 2)
    return 0.0


@routine
def _normals(key: int, count: int, n: int) -> NDArray[np.float64]:
    found = np.empty(n)
    for i in range(n):
        found[i] = normal(key, count + i)
    return found


@routine
def _uniforms(key: int, count: int, n: int) -> NDArray[np.float64]:
    found = np.empty(n)
    for i in range(n):
        found[i] = uniform(bits(key, count + i))
    return found


class RandomStream:
    """One stream of random numbers, taken in order; the methods are those of numpy's Generator.

    Parameters
    ----------
    seed : int
        Of the run.
    number : int
        Of the stream.
    """

    def __init__(self, seed: int, number: int) -> None:
        self._key, self._count = key_of(seed, number), 0

    def standard_normal(self, shape: int | tuple[int, ...]) -> NDArray[np.float64]:
        """Standard normal numbers of a shape."""
        return self._take(_normals, shape)

    def random(self, shape: int | tuple[int, ...]) -> NDArray[np.float64]:
        """Numbers of a shape, uniform in (0, 1]."""
        return self._take(_uniforms, shape)

    def _take(
        self, draw: Callable[[int, int, int], NDArray[np.float64]], shape: int | tuple[int, ...]
    ) -> NDArray[np.float64]:
        n = math.prod(np.atleast_1d(shape).tolist())
        self._count += n
        return draw(self._key, self._count - n, n).reshape(shape)
