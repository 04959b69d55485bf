"""Gains of a held drive by least squares over a horizon: docs/laws.md (8.2) to (8.4)."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

_Array = NDArray[np.float64]


class Grid(NamedTuple):
    """How a horizon is divided."""

    fine: int  # intervals in a hold, in which reference and friction are taken as they are
    holds: int  # in the horizon
    response: float  # T, in which an error is to vanish [1/w0]


class HoldGains(NamedTuple):
    """Of one axis: U = -K e + sum of G_j g_j."""

    K: _Array  # (2,) of the error in position and rate
    G: _Array  # (fine * holds, 2) of what each fine interval asks for
    Phi: _Array  # (2, 2) of a fine interval
    Gamma: _Array  # (2,)


def grid(hold: float, response: float) -> Grid:
    """Fine intervals of at most half a time unit, four a hold at least; a horizon of eight holds and four responses.

    Parameters
    ----------
    hold : float [1/w0]
    response : float [1/w0]
        0: the rule, one time unit, but neither below a hold nor above two.
    """
    T = response if response > 0.0 else min(max(1.0, hold), 2.0 * hold)
    return Grid(max(4, math.ceil(hold / 0.5 - 1e-9)), max(8, math.ceil(4.0 * T / hold - 1e-9)), T)


def transition(stiffness: float, damping: float, time: float) -> tuple[_Array, _Array]:
    """Phi (2, 2) and Gamma (2,) of q'' = U - stiffness q - damping q' over `time` under a constant U."""
    from scipy.linalg import expm  # here: a tenth of a second for nothing in a node without a law

    A = np.zeros((3, 3))
    A[0, 1] = 1.0
    A[1] = -stiffness, -damping, 1.0
    E = expm(A * time)
    return E[:2, :2], E[:2, 2]


def gains(stiffness: float, damping: float, hold: float, division: Grid) -> HoldGains:
    """Gains of q'' = U - stiffness q - damping q' - d under a drive U that is held.

    The drives of all holds of the horizon are the least squares solution of small errors at the ends of the fine
    intervals and of small distance, weighted by fine T^4, from what the reference asks for in the mean of each hold;
    the first of them is applied.

    Parameters
    ----------
    stiffness, damping : float [w0^2], [w0]
    hold : float [1/w0]
    division : Grid

    Returns
    -------
    HoldGains
        With the error e = (q, q') - reference at the start of the hold, and of each interval
        g_j = reference(j+1) - Phi reference(j) + Gamma d_j.
    """
    fine, holds, T = division
    n = fine * holds
    Phi, Gamma = transition(stiffness, damping, hold / fine)
    powers = [np.eye(2)]
    for _ in range(n):
        powers.append(Phi @ powers[-1])
    # Position at the end of interval j from a unit impulse in interval i: powers[j - i] Gamma.
    of_impulse = np.array([power[0] @ Gamma for power in powers[:n]])
    A = np.zeros((n + holds, holds))
    for hold_number in range(holds):
        for i in range(hold_number * fine, (hold_number + 1) * fine):
            A[i:n, hold_number] += of_impulse[: n - i]
    weight = math.sqrt(fine * T**4)
    A[n:] = weight * np.eye(holds)
    of_errors, of_means = np.split(np.linalg.pinv(A)[0], [n])
    K = of_errors @ np.array([power[0] for power in powers[1:]])
    G = np.array([sum(of_errors[j] * powers[j - i][0] for j in range(i, n)) for i in range(n)])
    # The drive asked for in an interval is the rate asked for over Gamma.
    G[:, 1] += np.repeat(of_means, fine) * weight / (fine * Gamma[1])
    return HoldGains(K, G, Phi, Gamma)


def observer_gains(stiffness: float, damping: float, period: float, disturbance: float, noise: float) -> _Array:
    """Steady gains (2,) of the Kalman filter of position and rate, corrected by positions.

    Parameters
    ----------
    stiffness, damping : float [w0^2], [w0]
    period : float [1/w0]
    disturbance : float
        Rms acceleration that is not known, constant over a period and independent of the others.
    noise : float
        Rms noise of the position.
    """
    from scipy.linalg import solve_discrete_are  # as above

    Phi, Gamma = transition(stiffness, damping, period)
    C = np.array([[1.0, 0.0]])
    # In units of the noise, so that the equation is well scaled.
    P = solve_discrete_are(Phi.T, C.T, np.outer(Gamma, Gamma) * (disturbance / noise) ** 2, np.eye(1))
    return P[:, 0] / (P[0, 0] + 1.0)
