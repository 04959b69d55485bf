"""Wall times of a run: durations in histograms of constant size, and the run's own stopwatch."""

import math
from array import array
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..compiled.jit import routine

_Array = NDArray[np.float64]
_LOWEST, _HIGHEST = 1e-7, 1e3
_PER_DECADE = 200


@routine
def _count(durations: _Array, counts: NDArray[np.int64]) -> float:
    """Count durations [s] in the bins of a histogram; return the largest of them, 0 if there are no durations."""
    largest = 0.0
    for duration in durations:
        if not math.isfinite(duration):
            continue
        place = int(math.log10(max(duration, _LOWEST) / _LOWEST) * _PER_DECADE)  # no part of a run
        counts[min(place, len(counts) - 1)] += 1
        largest = max(largest, duration)
    return largest


class Histogram:
    """Durations from 0.1 us to 1000 s in logarithmic bins 1.2 % wide: any number of them in 16 kB."""

    def __init__(self) -> None:
        decades = round(np.log10(_HIGHEST / _LOWEST))  # no part of a run
        self._counts = np.zeros(decades * _PER_DECADE, np.int64)
        self.largest = 0.0

    def add(self, durations: NDArray[np.floating]) -> None:
        """Count durations [s], (n,); NaN and infinite ones are left out."""
        self.largest = max(self.largest, _count(durations.astype(np.float64), self._counts))

    def percentiles(self, *percents: float) -> list[float]:
        """Durations [s] that each so many percent of those counted do not exceed, to 1.2 %; NaN if none was counted."""
        cumulative = np.cumsum(self._counts)
        total = int(cumulative[-1])
        if total == 0:
            return [float("nan")] * len(percents)
        at = np.searchsorted(cumulative, np.array(percents) / 100.0 * total)
        return [min(_LOWEST * 10.0 ** ((int(i) + 1) / _PER_DECADE), self.largest) for i in at]  # no part of a run

    @property
    def summary(self) -> list[float]:
        """Median, 99th and 99.9th percentile, largest [s]; NaN if none was counted."""
        return self.percentiles(50.0, 99.0, 99.9, 100.0)


class VirtualClock:
    """A clock that stands still until it is set."""

    def __init__(self) -> None:
        self.now = 0.0

    def __call__(self) -> float:
        """The time [s]."""
        return self.now


class Stopwatch:
    """Time spent running by `clock`, pauses left out [s]."""

    def __init__(self, clock: Callable[[], float]) -> None:
        self._clock = clock
        self._elapsed = 0.0
        self._since: float | None = None

    def start(self) -> None:
        """Go on counting."""
        if self._since is None:
            self._since = self._clock()

    def stop(self) -> None:
        """Stop counting."""
        self._elapsed = self.elapsed
        self._since = None

    @property
    def elapsed(self) -> float:
        """Time counted up to now [s]."""
        return self._elapsed + (self._clock() - self._since if self._since is not None else 0.0)


class Delays(NamedTuple):
    """Wall times of a run [s], each as median, 99th and 99.9th percentile, largest; NaN: there was none."""

    round_trip: list[float]
    """From publishing a measurement to the arrival of its drive."""
    lateness: list[float]
    """Realtime: from the deadline of a tick to its start."""
    command_age: list[float]
    """Realtime: at each tick, since the measurement was published that the drive in force answers."""


class DelayLog:
    """Collects wall times tick by tick, as cheaply as a list does, and counts them block by block."""

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Forget everything."""
        self._histograms = (Histogram(), Histogram(), Histogram())
        self._lateness, self._ages = array("d"), array("d")

    def note(self, lateness: float, command_age: float) -> None:
        """Note in realtime how late a tick was, and the age of the measurement of the drive in force [s]."""
        self._lateness.append(lateness)
        self._ages.append(command_age)

    def take(self) -> tuple[_Array, _Array]:
        """Lateness and command ages that were noted since the last call [s]."""
        noted = np.frombuffer(self._lateness), np.frombuffer(self._ages)
        self._lateness, self._ages = array("d"), array("d")
        return noted

    def count(self, round_trips: NDArray[np.float32], lateness: _Array, ages: _Array) -> None:
        """Count these wall times [s]."""
        of_round_trips, of_lateness, of_ages = self._histograms
        of_round_trips.add(round_trips)
        of_lateness.add(lateness)
        of_ages.add(ages)

    @property
    def oldest_command(self) -> float:
        """Largest command age counted [s]."""
        return self._histograms[2].largest

    def summary(self) -> Delays:
        """What was counted."""
        return Delays(*(histogram.summary for histogram in self._histograms))
