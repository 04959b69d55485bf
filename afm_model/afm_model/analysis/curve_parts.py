"""The parts of a force curve: where the cantilever is free, where the tip is in contact; the baseline taken off."""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .baseline import SURE, Baseline
from .estimate import same_length

_Array = NDArray[np.float64]
FEWEST = 5
"""Least number of points of a fit."""
_NEAR, _CLOSE = 15e-9, 0.4
"""Within this distance of the contact [m], or this part of the path to it, attraction may bend the cantilever."""
_STEEPEST = 0.3
"""Slope of the free part over that in contact from which on the tip was not free."""
_VISIBLE = 3e-3
"""Rms deviation of the baseline from a straight line, of the range of the curve, from which on it is named."""


class CurveParts(NamedTuple):
    """Approach and retract of a force curve, less the baseline."""

    z_in: _Array
    d_in: _Array
    z_out: _Array
    d_out: _Array
    free: int
    """Samples of the approach in which the cantilever is free, from its begin."""
    baseline: Baseline

    @property
    def noise(self) -> float:
        """Rms noise of a sample."""
        return float(self.baseline.noise.std())

    @property
    def told(self) -> str:
        """What is to be known of the baseline; empty if it is straight."""
        wave, rise = self.baseline.bent, float(self.d_in[-1])
        if self.baseline.wavy < SURE or wave < _VISIBLE * rise:
            return ""
        return (
            f"the baseline is not straight: it deviates by {wave / rise:.2g} of the rise in contact rms, as by "
            f"interference of light or drift; the uncertainties contain how it may go on in contact. Lift the tip "
            f"further for a longer baseline, or move the laser spot"
        )


def curve_parts(z: ArrayLike, signal: ArrayLike) -> CurveParts:
    """Split a force curve at its turn, and take the baseline off; the dwell is not used.

    The contact begins where the approach is furthest below the straight line from its begin to its end, whatever the
    slope of the baseline.

    Raises
    ------
    ValueError
        If there is no approach and retract, the tip is not pressed on, or it is on the sample from the begin on.
    """
    z, signal = same_length(z=z, signal=signal)
    if not (np.isfinite(z).all() and np.isfinite(signal).all()):
        measured = np.isfinite(z) & np.isfinite(signal)
        last = int(np.flatnonzero(measured)[-1]) + 1 if measured.any() else 0
        if not (last and measured[:last].all()):
            raise ValueError("z or the signal is not finite between measured samples: leave these samples out")
        # Curves of different length are padded by NaN to one array.
        z, signal = z[:last], signal[:last]
    top = np.flatnonzero(z == z.max())
    if not (top[0] >= FEWEST and z.size - top[-1] > FEWEST):
        raise ValueError("z must rise and fall: there is no approach, or no retract")
    z_in, s_in, z_out, s_out = z[: top[0] + 1], signal[: top[0] + 1], z[top[-1] :], signal[top[-1] :]
    few = max(FEWEST, z_in.size // 100)
    begin, end = float(s_in[:few].mean()), float(s_in[-FEWEST:].mean())
    chord = begin + (end - begin) * (z_in - z_in[0]) / (z_in[-1] - z_in[0])
    kink = int(np.argmin(s_in - chord))
    path = float(z_in[kink] - z_in[0])
    free = int(np.searchsorted(z_in, z_in[kink] - min(_NEAR, _CLOSE * path), "right"))
    scale = float(np.ptp(signal))
    if scale == 0.0 or kink == z_in.size - 1:
        raise ValueError("the tip is not pressed on at the end of the approach: it does not reach the sample")
    if free < FEWEST:
        raise ValueError("the tip is on the sample from the begin of the approach on: lift it further")
    baseline = Baseline(z_in[:free], s_in[:free], float(z_in[-1]), scale)
    first, last = baseline.mean(z_in[[0, free - 1]])
    pressed = (s_in[-1] - s_in[kink]) / (z_in[-1] - z_in[kink])
    if abs(last - first) > _STEEPEST * abs(pressed) * (z_in[free - 1] - z_in[0]):
        raise ValueError("the tip is on the sample from the begin of the approach on: lift it further")
    d_in, d_out = s_in - baseline.mean(z_in), s_out - baseline.mean(z_out)
    return CurveParts(z_in, d_in, z_out, d_out, free, baseline)
