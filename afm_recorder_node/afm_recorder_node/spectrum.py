"""Spectral density of a signal of a recording."""

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from .questions import AXES, split
from .reader import read_signals
from .recording import RecordingError

_Array = NDArray[np.float64]
_SEGMENTS, _SHORTEST = 16, 64
"""Stretches that a spectrum is the mean of, at least (they overlap by half), and samples of the shortest one."""
_LINE = 20.0
"""Times the median level that a line stands out."""
_LATE = 1.5
"""Periods between two rows from which on something is missing between them."""


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


def longest_stretch(times: _Array, values: _Array) -> tuple[_Array, float]:
    """The longest stretch without a gap and without NaN, and its period [s].

    Raises
    ------
    RecordingError
        If it is too short for a spectrum.
    """
    if len(times) < 2:
        raise RecordingError(f"{len(times)} samples without a gap have no spectrum: {_SHORTEST} are the least")
    period = float(np.median(np.diff(times)))
    breaks = np.flatnonzero(np.diff(times) > _LATE * period) + 1
    unknown = np.flatnonzero(np.isnan(values))
    edges = np.unique(np.concatenate([[0], breaks, unknown, unknown + 1, [len(values)]]))
    longest = int(np.argmax(np.diff(edges)))
    part = slice(int(edges[longest]), int(edges[longest + 1]))
    if part.stop - part.start < _SHORTEST:
        raise RecordingError(
            f"{part.stop - part.start} samples without a gap have no spectrum: {_SHORTEST} are the least"
        )
    return values[part], float((times[part.stop - 1] - times[part.start]) / (part.stop - part.start - 1))


def spectrum(values: _Array, period: float) -> Spectrum:
    """Spectral density of samples at a period [s], by Welch's method: Hann windows, half overlapped, about their means.

    Source: P. D. Welch, IEEE Transactions on Audio and Electroacoustics 15 (1967) 70, doi:10.1109/TAU.1967.1161901.
    """
    from scipy.signal import welch

    length = max(2 ** math.floor(math.log2(2 * len(values) / (_SEGMENTS + 1))), _SHORTEST)
    frequency, density = welch(values, 1.0 / period, "hann", length)
    segments = (len(values) - length // 2) // (length - length // 2)
    return Spectrum(frequency[1:], density[1:], float(values.std()), len(values), segments)


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
    read = read_signals(path, [base], begin, end)[base]
    column, wide = AXES.index(chosen or axis), read.values.ndim > 1
    values = read.values[:, column] if wide else read.values
    found = spectrum(*longest_stretch(read.time, values))
    return (f"{base}.{AXES[column]}" if wide else base), read.unit, found
