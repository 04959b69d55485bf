"""State of the limits of the instrument, and commands to them."""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..compiled.records import place, record_at
from ..parameters import InstrumentParameters, SimParameters
from ..parts.ticks import ticks_of
from .block import Layout, LoopState
from .limits import (
    ANSWERED,
    CONTACT_LOST,
    FORCE,
    INVALID,
    NO_CONTACT,
    NONE,
    RUNNING,
    TOO_HARD,
    TRAVEL,
    GuardCounts,
    GuardState,
    LimitConstants,
    bring_back,
    retract,
)
from .validity import valid_forces

_PHASE, _EVENT, _LIMIT = (place(GuardState, name) for name in ("phase", "event", "limit"))


class Guard:
    """The limits of one instrument (`limits`): whether they control the drive, and why.

    Parameters
    ----------
    layout : Layout
    block : ndarray
    parameters : InstrumentParameters
    """

    def __init__(self, layout: Layout, block: NDArray[np.float64], parameters: InstrumentParameters) -> None:
        self._block, self._parameters = block, parameters
        self._loop = record_at(block, layout.places["loop"], LoopState)
        self._guard = layout.array(block, "guard")
        self._numbers = self._guard.view(np.int64)
        self._record = record_at(block, layout.places["guard"], GuardState)
        self._limits = record_at(block, layout.places["limits"], LimitConstants)
        onboard: Any = layout.parts["onboard"].part
        program: Any = layout.parts["program"].part
        _fill(self._limits, parameters, z_inside=onboard.moves_z, ordered=program.order is not None)

    def reset(self, rest: NDArray[np.float64]) -> None:
        """Give the drive to the controller, as at the start with the drive `rest` [V]."""
        self._guard[:] = 0.0
        self._numbers[_PHASE] = RUNNING
        self._limits.rest[:] = rest

    @property
    def _tick(self) -> int:
        return int(self._loop.k)

    @property
    def phase(self) -> int:
        """Who has the drive: RUNNING, RETRACTED, WITHDRAWN or APPROACHING of `limits`."""
        return self._numbers.item(_PHASE)

    @property
    def event(self) -> int:
        """Why the phase is what it is, by a number of `limits`."""
        return self._numbers.item(_EVENT)

    @property
    def limit(self) -> int:
        """The limit that was passed last, as long as the instrument has the drive because of it; else NONE."""
        return self._numbers.item(_LIMIT)

    def counts(self) -> dict[str, int]:
        """Withdrawals, and ticks in which the instrument had the drive, by their names in `run.Counts`."""
        return {name: int(self._record[name]) for name in GuardCounts.names}

    def retract(self) -> None:
        """Take the drive: the controller is silent."""
        retract(self._block, self._tick)

    def release(self) -> None:
        """Give the drive back to a controller that was silent; a loop inside continues from the present z."""
        self._numbers[[_PHASE, _EVENT]] = RUNNING, ANSWERED

    def bring_back(self) -> str:
        """Bring a withdrawn sample back to the tip; why not, or an empty string: not while a limit is still passed."""
        passed = int(bring_back(self._block, self._tick))
        return self.clause(passed) if passed != NONE else ""

    def clause(self, event: int) -> str:
        """What has passed a limit, or has ended an approach, with its numbers."""
        parameters: Any = self._parameters
        s, p, safety = self._record, self._limits, parameters.safety
        force = f"the normal force is {s.normal_force:.4g} N"
        return {
            TRAVEL: f"the scanner is at x = {s.x:.4g} m, y = {s.y:.4g} m (safety.travel_limit = "
            f"{safety.travel_limit:g} m)",
            FORCE: f"{force} (safety.force_limit = {safety.force_limit:g} N)",
            INVALID: f"{force}: the plant holds from {p.low:.4g} to {p.high:.4g} N (safety.validity)",
            CONTACT_LOST: f"the tip has been out of contact for {safety.contact_timeout:g} s (safety.contact_timeout)",
            TOO_HARD: f"{force} in the approach (safety.approach_force: {p.approach_force:g} N)",
            NO_CONTACT: f"no contact within {safety.approach_timeout:g} s (safety.approach_timeout)",
        }[event]


def _fill(p: Any, parameters: InstrumentParameters, *, z_inside: bool, ordered: bool) -> None:
    """Write a record of LimitConstants. An instrument without `safety` among its parameters has no limits."""
    p.z_inside, p.ordered = z_inside, ordered
    if not isinstance(parameters, SimParameters):
        return
    safety, run, sensitivity = parameters.safety, parameters.run, parameters.piezo.sensitivity_z
    period = parameters.plant.control_period
    p.on = safety.guarded
    p.travel = safety.travel_limit or math.inf
    p.force = safety.force_limit or math.inf
    p.low, p.high = valid_forces(parameters) if safety.validity else (-math.inf, math.inf)
    p.approach_force = safety.approach_force or p.force
    for name, time in (("contact", safety.contact_timeout), ("resume", safety.resume_after)):
        p[f"{name}_ticks"] = max(1, ticks_of(time, period)) if time else 0
    p.settle_ticks = max(1, ticks_of(safety.settle_time, period))
    p.approach_ticks = max(1, ticks_of(safety.approach_timeout, period))
    p.ramp_ticks = max(1, ticks_of(run.retract_time, period))
    p.sign = math.copysign(1.0, sensitivity)
    p.rise = p.sign * (safety.approach_speed * period / abs(sensitivity))
    p.distance = run.retract_distance / abs(sensitivity)
    p.control_period, p.retract_time = period, run.retract_time
    p.retracted = -run.retract_distance / sensitivity
