"""The Kalman filter of positions alone, one measurement at a time. Its states and their transition: observer.py."""

from afm_model.parts import Block, kernel

from .constants import AT_X, AT_Y
from .state import State

SURE = 5.0
"""Standard deviations beyond which a difference is not noise, in none of a million measurements."""
NIS = 0.05
"""Weight of one measurement in a mean normalised innovation squared, which is one where the model is right:
Y. Bar-Shalom, X. R. Li, T. Kirubarajan, *Estimation with Applications to Tracking and Navigation*, Wiley (2001), 5.4.
"""
DOUBTS = 1.5
"""Value of it from which on the model is trusted less."""


@kernel
def carry_covariance(P: Block, F: Block, half: Block) -> None:
    """Replace the covariance P (n, n) by F P F^T; `half` (n, n) is overwritten."""
    size = len(P)
    for i in range(size):
        for j in range(size):
            half[i, j] = 0.0
            for k in range(size):
                half[i, j] += F[i, k] * P[k, j]
    for i in range(size):
        for j in range(size):
            P[i, j] = 0.0
            for k in range(size):
                P[i, j] += half[i, k] * F[j, k]


@kernel
def weigh(noise: float, s: State) -> float:
    """Variance of a measurement of the states by the row `s.weights`; their covariances with it go to `s.gains`."""
    variance = noise
    for i in range(5):
        s.gains[i] = 0.0
        for j in range(5):
            s.gains[i] += s.P[i, j] * s.weights[j]
    for i in range(5):
        variance += s.weights[i] * s.gains[i]
    return variance


@kernel
def correct(innovation: float, variance: float, s: State) -> None:
    """Correct by the measurement last weighed, which differs by `innovation` from the copy as corrected so far."""
    for i in range(5):
        s.change[i] += s.gains[i] * innovation / variance
        for j in range(5):
            s.P[i, j] -= s.gains[i] * s.gains[j] / variance


@kernel
def take(i: int, off: float, noise: float, s: State) -> None:
    """Correct by a measurement of state i that differs from the copy by `off`, with the variance `noise`."""
    s.weights[:] = 0.0
    s.weights[i] = 1.0
    correct(off - s.change[i], weigh(noise, s), s)


@kernel
def along_variance(t_x: float, t_y: float, s: State) -> float:
    """Of the position along t."""
    P = s.P
    return t_x * t_x * P[AT_X, AT_X] + 2.0 * t_x * t_y * P[AT_X, AT_Y] + t_y * t_y * P[AT_Y, AT_Y]
