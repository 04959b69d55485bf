"""One Kalman filter, for all that the law estimates: carry the covariance, weigh a measurement, correct by it."""

from ...core.jit import kernel
from ...core.records import Block


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
def weigh(P: Block, weights: Block, gains: Block) -> float:
    """Variance of the sum of the states with these weights; their covariances with it go to `gains`."""
    size = len(P)
    variance = 0.0
    for i in range(size):
        gains[i] = 0.0
        for j in range(size):
            gains[i] += P[i, j] * weights[j]
    for i in range(size):
        variance += weights[i] * gains[i]
    return variance


@kernel
def correct(P: Block, change: Block, gains: Block, innovation: float, variance: float) -> None:
    """Add to `change` of the states, and take off P, what a measurement of the sum last weighed tells.

    Its innovation has this variance, the noise included.
    """
    size = len(P)
    for i in range(size):
        change[i] += gains[i] * innovation / variance
        for j in range(size):
            P[i, j] -= gains[i] * gains[j] / variance
