"""What the filters of the law share."""

from typing import Any

from ...core.jit import kernel


@kernel
def carry_covariance(P: Any, F: Any, half: Any) -> None:
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
