"""The verb Read: settled values of channels, one number each; docs/dynamic.md."""

from collections.abc import Iterator
from typing import ClassVar

import numpy as np
from pydantic import Field

from ...analysis.resonance import lag
from ...onboard.by_amplitude import own_lag
from ...program.orders import Order
from ..arrays import Arrays, attributes, variable
from ..collect import RecordCollector
from ..execution import Execution, Task
from ..quantities import Rest
from ..results import MicroscopeState
from ..verb import Verb
from ..view import InstrumentView
from .scan import unknown
from .tune import DECAYS, of_lock_in

_DRIVEN, _USUAL = "in_phase, quadrature, deflection", "deflection, lateral"
_LEAST = 1e-3
"""Mean where nothing settles [s]."""


class Read(Verb):
    """Wait until cantilever and lock-in have settled, then give means of channels: for a host that reads seldom.

    Everything else stays as it is: place, feedback, drive. Every sample of the ADC is in a mean, so that nothing is
    folded. `NAME_change` shows whether it has settled: the mean of the second half less that of the first.
    """

    returns: ClassVar = Arrays

    channels: str = Field(
        "",
        description="as of a scan; empty: deflection, lateral; with a lock-in in_phase, quadrature, deflection, and "
        "amplitude and phase of them",
    )
    settle: Rest = Field(0.0, description="rest before it; 0: until 6e-6 of a change is left in cantilever and lock-in")
    average: Rest = Field(0.0, description="time of the mean; 0: as long as settling takes, 1 ms at least")

    def names(self, view: InstrumentView) -> list[str]:
        """Channels, each once."""
        usual = _DRIVEN if hasattr(view.parameters.onboard, "lock_in") else _USUAL
        return list(dict.fromkeys(name.strip() for name in (self.channels or usual).split(",") if name.strip()))

    def refusals(self, view: InstrumentView, state: MicroscopeState) -> Iterator[str]:
        """See `Verb`."""
        if not (names := self.names(view)):
            yield "channels is empty: it must name one at least, such as deflection"
        yield from unknown(view, self.channels, names)
        if 0.0 < self.average < (least := 2.0 * view.control_period):
            yield f"average = {self.average:g} s is not allowed: it must be >= {least:g} s, two control ticks"

    def tasks(self, run: Execution) -> Iterator[Task]:
        """See `Verb`."""
        view, part = run.view, run.view.parameters.onboard
        lock_in = of_lock_in(part) if hasattr(part, "lock_in") else 0.0
        settle = self.settle or DECAYS * own_lag(view.parameters) + lock_in
        # Two halves, of as many ticks each.
        half = view.ticks(0.5 * (self.average or max(settle, _LEAST)))
        duration = half * view.control_period
        run.total = settle + 2.0 * duration
        recorder = run.recorder(self.names(view), 1.0 / duration, count=2 * half * view.samples_per_tick)
        run.result = lambda: self._found(recorder)
        if settle > 0.0:
            yield Task(Order(view.stay(settle)), settle, "waiting until it has settled")
        yield Task(Order(view.stay(2.0 * duration)), 2.0 * duration, "taking the mean", recorder)

    def _found(self, recorder: RecordCollector) -> Arrays | None:
        """Means, and by how much they change; None without both halves."""
        record = recorder.record()
        halves = {name: np.asarray(values) for name, values in record.channels.items()}
        if any(values.size < 2 for values in halves.values()):
            return None
        means = {name: float(values.mean()) for name, values in halves.items()}
        units = dict(record.units)
        if not self.channels and "in_phase" in means:
            # Of the mean of both parts: noise makes a mean of amplitudes too large.
            response = complex(means["in_phase"], -means["quadrature"])
            means |= {"amplitude": abs(response), "phase": float(lag(response))}
            units |= {"amplitude": units["in_phase"], "phase": "rad"}
        changes = {f"{name}_change": float(values[1] - values[0]) for name, values in halves.items()}
        return Arrays(
            {name: variable((), value, name, units[name]) for name, value in means.items()},
            {},
            attributes(self, changes),
        )
