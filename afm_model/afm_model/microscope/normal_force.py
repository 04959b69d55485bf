"""The normal force while a pressed tip slides, against that of the setpoint."""

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from ..core.prefix import text
from .view import InstrumentView

_FAR, _ADHESION = 1.0, 0.25
"""A load is far from the setpoint that differs from it by more than this part of it, and of the pull-off force."""
_MANY = 0.01
"""Part of the time with such a load that is reported."""


class Load:
    """Counts how long the normal force is far from the setpoint.

    The z loop keeps a deflection. Friction along a tilted cantilever bends it as well, and where it is large against
    the setpoint the deflection no longer shows the load: the loop oscillates, or presses the tip into a slope, while
    its error is small.

    Parameters
    ----------
    view : InstrumentView
    """

    def __init__(self, view: InstrumentView) -> None:
        self._view = view
        self._samples = self._far = 0
        self._low, self._high = math.inf, -math.inf

    @property
    def _setpoint(self) -> float:
        """Normal force on a flat sample without friction [N]; NaN where it is not known."""
        per = self._view.volts(1.0)
        return self._view.setpoint / per if per else math.nan

    def take(self, forces: NDArray[np.float64]) -> None:
        """Count samples of the normal force [N]."""
        setpoint = self._setpoint
        if not forces.size or not math.isfinite(setpoint):
            return
        far = max(_FAR * abs(setpoint), _ADHESION * self._view.pull_off)
        self._far += int(np.count_nonzero(np.abs(forces - setpoint) > far))
        self._samples += forces.size
        self._low, self._high = min(self._low, float(forces.min())), max(self._high, float(forces.max()))

    def remarks(self) -> Iterator[str]:
        """What is to be known of the load, a sentence; nothing if it was that of the setpoint."""
        if self._far < _MANY * self._samples or not self._far:
            return
        share = 100.0 * self._far / self._samples
        yield (
            f"the normal force was from {text(self._low, 'N', 3)} to {text(self._high, 'N', 3)}, in {share:.2g} % of "
            f"the time far from the setpoint of {text(self._setpoint, 'N', 3)}: height and friction are not those at "
            f"this load; friction bends the cantilever as a load does, or the z loop oscillates: take a smaller "
            f"integral gain, scan at another speed, or take a sharper tip"
        )
