"""Lyapunov function of the error dynamics of the paper's section 3 and what it gives, docs/theory.md (29) to (35)."""

import math

import numpy as np
from numpy.typing import NDArray

TANH_GAP = 0.278464542761074
"""sup over s >= 0 of s (1 - tanh s), docs/theory.md (33): |s| - s tanh(alpha s) never exceeds this over alpha."""


def error_matrix(c: float, cdot: float) -> NDArray[np.float64]:
    """A of e' = A e + B psi for one axis: [[0, 1], [-c, -cdot]], docs/theory.md (29)."""
    return np.array([[0.0, 1.0], [-c, -cdot]])


def lyapunov_matrix(c: float, cdot: float, Q: NDArray[np.float64] | None = None) -> NDArray[np.float64]:
    """P > 0 with P A + A^T P = -Q for one axis, docs/theory.md (30).

    Parameters
    ----------
    c, cdot : float
        Gains, both > 0, so that A is Hurwitz.
    Q : ndarray (2, 2), optional
        Symmetric positive definite; the identity if not given, as in section 4.2 of the paper.

    Returns
    -------
    ndarray (2, 2)

    Raises
    ------
    ValueError
        If a gain is not positive: A is then not Hurwitz and no such P exists. If Q is not symmetric positive definite,
        or the gains are so far from 1 that P has no digits.
    """
    if not (c > 0.0 and cdot > 0.0):
        raise ValueError(f"c = {c:g} and cdot = {cdot:g} must both be > 0 for the error dynamics to be stable")
    weight = np.eye(2) if Q is None else np.asarray(Q, float)
    if weight.shape != (2, 2) or not np.array_equal(weight, weight.T) or not _positive(weight):
        raise ValueError(f"Q = {weight.tolist()} must be symmetric and positive definite")
    # The three equations of the symmetric matrix, solved one after the other.
    p12 = 0.5 * weight[0, 0] / c
    p22 = (0.5 * weight[1, 1] + p12) / cdot
    P = np.array([[cdot * p12 + c * p22 - weight[0, 1], p12], [p12, p22]])
    # Gains of very different size leave no digits.
    if not _positive(P):
        raise ValueError(f"c = {c:g} and cdot = {cdot:g} are too far from 1 to solve for P")
    return P


def _positive(symmetric: NDArray[np.float64]) -> bool:
    """Whether a symmetric matrix (2, 2) is positive definite, by its leading minors."""
    (a, b), (_, d) = symmetric
    return bool(a > 0.0 and a * d > b * b)


def ultimate_bound(P: NDArray[np.float64], alpha: float, M: float, lambda_min_Q: float = 1.0) -> float:
    """Radius in which ||e|| of one axis ends under the tanh law, docs/theory.md (35), corrected from the paper.

    |s| - s tanh(alpha s) <= 0.2785 / alpha gives dV/dt < 0 outside ||e||^2 = 0.557 M / (alpha lambda_min(Q)); the
    smallest level set of V = e'Pe that holds this ball reaches sqrt(lambda_max(P) / lambda_min(P)) times farther.

    Parameters
    ----------
    P : ndarray (2, 2)
    alpha : float
        Steepness of tanh(alpha s).
    M : float
        Switching gain, a bound on the disturbance.
    lambda_min_Q : float
        Smallest eigenvalue of Q.

    Returns
    -------
    float
        Bound on ||(e, e')||, nondimensional.

    Raises
    ------
    ValueError
        If P is not positive definite, alpha or lambda_min_Q not > 0, or M negative.
    """
    if not (alpha > 0.0 and lambda_min_Q > 0.0 and M >= 0.0):
        raise ValueError(f"alpha = {alpha:g} and lambda_min_Q = {lambda_min_Q:g} must be > 0, M = {M:g} must be >= 0")
    eigenvalues = np.linalg.eigvalsh(P)  # no part of a run
    if not eigenvalues[0] > 0.0:
        raise ValueError(f"P = {np.asarray(P).tolist()} must be positive definite")
    ball = math.sqrt(2.0 * TANH_GAP * M / (alpha * lambda_min_Q))
    return ball * math.sqrt(float(eigenvalues[-1] / eigenvalues[0]))
