"""BiasSpectr: sweeps of a bias that nothing here depends on, in the time that they take."""

import time
from typing import Any

import numpy as np

from afm_model.core.errors import VerbError

from .front import Front
from .handlers import handles
from .signal_index import BIAS
from .spectra import Array, header_of, run_spectrum, take, with_channels
from .spectrum_state import SpectrumState

_LOOK = 0.02
"""Wall time between two looks whether the sweep was stopped [s]."""


class _Clock:
    """Waits for moments of a sweep; a second of it is shorter in wall time where simulated time is faster."""

    def __init__(self, front: Front) -> None:
        run = getattr(front.parameters, "run", None)
        self._front, self._factor, self._due = front, getattr(run, "real_time_factor", 1.0), time.monotonic()

    def wait(self, seconds: float) -> bool:
        """Wait for so long after the moment before; False if that is over already."""
        self._due += max(seconds, 0.0) / self._factor
        waited = False
        while (left := self._due - time.monotonic()) > 0.0:
            waited = True
            time.sleep(min(left, _LOOK))
            if self._front.jobs.stopped:
                raise VerbError("the spectrum was stopped")
        return waited


def _swept(front: Front, state: SpectrumState) -> dict[str, Array]:
    """Sweep there and back; columns by their titles. Where points are due sooner than signals, they are as before."""
    begin, end = front.kept("BiasSpectr.LimitsGet")
    bias = np.linspace(begin, end, state.points)
    averaging, _, initial, _, settling, integration, final, control = front.kept("BiasSpectr.TimingGet")
    clock, columns = _Clock(front), {"Bias calc (V)": bias}
    values = front.signals.values(state.channels)
    clock.wait(averaging + initial)
    for suffix in ("", " [bwd]") if state.backward else ("",):
        rows = []
        for _ in bias:
            if clock.wait(settling + integration):
                values = front.signals.values(state.channels)
            rows.append(values)
        found = np.array(rows[::-1] if suffix else rows).T
        for index, column in zip(state.channels, found, strict=True):
            name, unit = front.signals.named(index)
            columns[f"{name}{suffix} ({unit})"] = bias if index == BIAS else column
    clock.wait(final + control)
    return columns


@handles("BiasSpectr.Start")
def _start(front: Front, get: int, base: str) -> list[Any]:
    def work(state: SpectrumState) -> Any:
        return lambda: (header_of(front, "bias spectroscopy", {}), _swept(front, state))

    return run_spectrum(front, "BiasSpectr", get, base, work)


with_channels("BiasSpectr")


@handles("BiasSpectr.PropsSet")
def _set_props(
    front: Front, save_all: int, sweeps: int, backward: int, points: int, offset: float, autosave: int, dialog: int
) -> list[Any]:
    state = front.spectra["BiasSpectr"]
    take(state, points, backward=backward, autosave=autosave, dialog=dialog, save_all=save_all)
    state.sweeps = sweeps if sweeps > 0 else state.sweeps
    return []


@handles("BiasSpectr.PropsGet")
def _props(front: Front) -> list[Any]:
    state = front.spectra["BiasSpectr"]
    titles = [front.signals.title(index) for index in state.channels]
    return [*(state.save_all, state.sweeps, state.backward, state.points), titles, [], [], state.autosave, state.dialog]
