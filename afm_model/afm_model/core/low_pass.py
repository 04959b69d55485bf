"""A first-order low-pass and its noise, sampled: photodetector and position sensors.

With w = 2 pi bandwidth and the time T between two samples x[k],

    y[k] = keep y[k-1] + new x[k] + old x[k-1],    n[k] = keep n[k-1] + shake xi[k]
    keep = exp(-w T),  new = 1 - (1 - keep)/(w T),  old = (1 - keep)/(w T) - keep,  shake = rms sqrt(1 - keep^2)

The first is exact for a signal that is linear between samples, the second for white noise of any density (exact
Ornstein-Uhlenbeck step): what is above half the sample rate is folded, as in a real ADC.
"""

import math
from collections.abc import Mapping

from ..compiled.records import Record
from .elementary import exp, expm1


class LowPass(Record):
    """Constants of a low-pass: whether it is on, the above, and the rms noise of a sample."""

    filtered: float
    keep: float
    new: float
    old: float
    noise: float
    shake: float


def noise_of_density(density: float, bandwidth: float, period: float) -> float:
    """Rms of a sample of noise of a one-sided density.

    Parameters
    ----------
    density : float
        [unit/sqrt(Hz)]
    bandwidth : float
        Of the first-order low-pass before the sampling [Hz]; 0: none, and the noise ends at half the sample rate.
    period : float
        Time between two samples [s].

    Returns
    -------
    float
        [unit]: density sqrt(pi bandwidth / 2), or density / sqrt(2 period).
    """
    return density * math.sqrt(0.5 * math.pi * bandwidth if bandwidth > 0.0 else 0.5 / period)


def constants(bandwidth: float, rms: float, period: float) -> Mapping[str, float]:
    """Values of LowPass for a bandwidth [Hz], 0: none, and a noise of `rms` in samples `period` [s] apart."""
    if bandwidth == 0.0:
        return {"filtered": 0.0, "keep": 0.0, "new": 1.0, "old": 0.0, "noise": rms, "shake": rms}
    way = 2.0 * math.pi * bandwidth * period
    keep, mean = exp(-way), -expm1(-way) / way
    shake = rms * math.sqrt(-expm1(-2.0 * way))
    return {"filtered": 1.0, "keep": keep, "new": 1.0 - mean, "old": mean - keep, "noise": rms, "shake": shake}
