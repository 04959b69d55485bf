"""Spectral density of a signal of a recording, which is never in memory with its times."""

import math
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from .questions import AXES, split
from .reader import read_signals, visit_signals
from .recording import RecordingError

_Array = NDArray[np.float64]
_SEGMENTS, _SHORTEST = 16, 64
"""Stretches that a spectrum is the mean of, at least (they overlap by half), and samples of the shortest one."""
_LINE = 20.0
"""Times the median level that a line stands out."""
_STEPS = 10_000
"""Whose median is the period of a signal."""


@dataclass(frozen=True)
class Spectrum:
    """One-sided spectral density of a signal; by Parseval its integral is the square of `rms`."""

    frequency: _Array
    density: _Array  # [unit^2/Hz]
    rms: float  # about the mean, of the samples that were used
    samples: int
    segments: int

    @property
    def floor(self) -> float:
        """Median level [unit/sqrt(Hz)]: what is left between the lines."""
        return math.sqrt(float(np.median(self.density)))

    def lines(self, most: int = 5) -> list[tuple[float, float]]:
        """The largest lines: frequency [Hz] and rms amplitude, each with all that stands out around it."""
        rest, step, found = self.density.copy(), self.frequency[1] - self.frequency[0], list[tuple[float, float]]()
        least = _LINE * np.median(self.density)
        while len(found) < most and rest.max() > least > 0.0:
            k = int(np.argmax(rest))
            low = np.flatnonzero(np.append(-1.0, rest[:k]) <= least)[-1]
            high = k + np.flatnonzero(np.append(rest[k:], -1.0) <= least)[0]
            weights = rest[low:high]
            found.append(
                (float(weights @ self.frequency[low:high] / weights.sum()), math.sqrt(float(weights.sum()) * step))
            )
            rest[low:high] = 0.0
        return found


class Longest:
    """The longest stretch of a signal without a gap; that one is kept, and the one that grows.

    Rows come block by block, in order of time. A row that is NaN ends a stretch, and so does a longer step of time.
    """

    def __init__(self) -> None:
        self.ordered = True
        """False: a block began before the end of the one before it. What is here is then of no use."""
        self._first: list[tuple[NDArray[np.int64], _Array]] = []  # until the period is known
        self._period = 0.0  # [ns]
        self._best, self._open = _Stretch(), _Stretch()

    def put(self, times: NDArray[np.int64], values: _Array) -> None:
        """Some rows: times (n,) [ns], values (n,); copies are kept."""
        if self._period:
            self._add(times, values)
            return
        self._first.append((times.copy(), values.copy()))
        if sum(len(block) for block, _ in self._first) > _STEPS:
            self._begin()

    def end(self) -> tuple[_Array, float]:
        """Values of the stretch, and their period [s], which is the mean one: times are in whole nanoseconds.

        Raises
        ------
        RecordingError
            If it is too short for a spectrum.
        """
        if not self._period:
            self._begin()
        self._cut()
        best, self._best = self._best, _Stretch()
        if best.count < _SHORTEST:
            raise RecordingError(f"{best.count} samples without a gap have no spectrum: {_SHORTEST} are the least")
        return best.joined(), (best.last - best.first) / 1e9 / (best.count - 1)

    def _begin(self) -> None:
        blocks, self._first = self._first, []
        steps = np.diff(np.concatenate([np.empty(0, np.int64), *(times for times, _ in blocks)])[: _STEPS + 1])
        self._period = float(np.median(steps)) if len(steps) else 1.0
        for block in blocks:
            self._add(*block)

    def _add(self, times: NDArray[np.int64], values: _Array) -> None:
        steps = np.diff(times, prepend=self._open.last if self._open.count else times[0])
        self.ordered &= steps.min() >= 0
        lost = np.isnan(values)
        cuts = np.flatnonzero((steps > 1.5 * self._period) | (lost != np.append(False, lost[:-1]))).tolist()
        for number, (begin, end) in enumerate(pairwise([0, *cuts, len(times)])):
            if number:
                self._cut()
            if begin < end and not lost[begin]:
                self._open.put(times[begin:end], values[begin:end])

    def _cut(self) -> None:
        if self._open.count > self._best.count:
            self._best = self._open
        self._open = _Stretch()


class _Stretch:
    """Rows without a gap, without their times."""

    def __init__(self) -> None:
        self.count, self.first, self.last = 0, 0, 0
        self._values: list[_Array] = []

    def put(self, times: NDArray[np.int64], values: _Array) -> None:
        """Append rows; the values are copied."""
        self.first = self.first if self.count else int(times[0])
        self.count, self.last = self.count + len(times), int(times[-1])
        self._values.append(values.copy())

    def joined(self) -> _Array:
        """All values, which are let go of here."""
        made, at = np.empty(self.count), 0
        while self._values:
            block = self._values.pop(0)
            made[at : at + len(block)] = block
            at += len(block)
        return made


def spectrum(values: _Array, period: float) -> Spectrum:
    """Spectral density of samples at a period [s], by Welch's method: Hann windows, half overlapped, about their means.

    Source: P. D. Welch, IEEE Transactions on Audio and Electroacoustics 15 (1967) 70, doi:10.1109/TAU.1967.1161901.
    scipy's own takes 60 MB and half a second to import, and ten times the memory of the signal.
    """
    length = max(2 ** math.floor(math.log2(2 * len(values) / (_SEGMENTS + 1))), _SHORTEST)
    window = 0.5 - 0.5 * np.cos(2.0 * np.pi * np.arange(length) / length)
    total, segments = np.zeros(length // 2 + 1), 0
    for start in range(0, len(values) - length + 1, length // 2):
        part = values[start : start + length]
        transform = np.fft.rfft((part - part.mean()) * window)
        total += transform.real**2 + transform.imag**2
        segments += 1
    total *= 2.0 * period / (window @ window) / segments
    total[-1] /= 2.0  # as many negative frequencies as positive ones, but for the last one
    mean, square = values.mean(), 0.0
    for start in range(0, len(values), length):
        away = values[start : start + length] - mean
        square += float(away @ away)
    frequency = np.arange(1, len(total)) / (length * period)
    return Spectrum(frequency, total[1:], math.sqrt(square / len(values)), len(values), segments)


def read_spectrum(
    path: Path, name: str, begin: float = -math.inf, end: float = math.inf, axis: str = "x"
) -> tuple[str, str, Spectrum]:
    """Spectral density of the longest stretch without a gap of one column of a recording, position.y for example.

    `axis` counts where the name has none. Raises as `read_signals`, and if the stretch is too short.

    Returns
    -------
    (str, str, Spectrum)
        Name of the column, and its unit.
    """
    base, chosen = split(name)
    column, longest, wide = AXES.index(chosen or axis), Longest(), False

    def see(entity: str, times: NDArray[np.int64], values: _Array) -> None:
        nonlocal wide
        wide = values.shape[1] > 1
        longest.put(times, values[:, column if wide else 0])

    signal = visit_signals(path, [base], see, begin, end)[base]
    factor = signal.factor
    if not longest.ordered:
        read, longest, factor = read_signals(path, [base], begin, end)[base], Longest(), 1.0
        longest.put(np.rint(1e9 * read.time).astype(np.int64), read.values[:, column] if wide else read.values)
    found = spectrum(*longest.end())
    found = replace(found, density=found.density / factor**2, rms=found.rms / factor)
    return (f"{base}.{AXES[column]}" if wide else base), signal.si_unit, found
