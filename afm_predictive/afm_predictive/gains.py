"""Gains of a held drive by least squares over a horizon: docs/predictive.md (8.2) to (8.4)."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from afm_model.law import free_axis, times
from afm_model.parts import square

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


def grid(hold: float, response: float, packet: int = 1) -> Grid:
    """Fine intervals of at most half a time unit, two a hold at least; a horizon of eight holds and four responses.

    Parameters
    ----------
    hold : float [1/w0]
    response : float [1/w0]
        0: the rule, one time unit, but at least 1.6 holds (of long ones 8 time units, or one hold) and at most
        two: so that the loop tolerates a drive that is one period late.
    packet : int
        Drives of a packet, all decided on one measurement: then four intervals a hold at least.
    """
    T = response if response > 0.0 else min(max(1.0, min(1.6 * hold, 8.0), hold), 2.0 * hold)
    return Grid(max(2 if packet == 1 else 4, math.ceil(hold / 0.5 - 1e-9)), max(8, math.ceil(4.0 * T / hold - 1e-9)), T)


def transition(stiffness: float, damping: float, time: float) -> tuple[_Array, _Array]:
    """Phi (2, 2) and Gamma (2,) of q'' = U - stiffness q - damping q' over `time` under a constant U."""
    eta = math.sqrt(stiffness)
    axis = free_axis(eta, 0.5 * damping / eta, time)
    return axis.phi, axis.gamma


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
        powers.append(times(Phi, powers[-1]))
    # Position at the end of interval j from a unit impulse in interval i: powers[j - i] Gamma.
    of_impulse = np.array([power[0, 0] * Gamma[0] + power[0, 1] * Gamma[1] for power in powers[:n]])
    A = np.zeros((n + holds, holds))
    for hold_number in range(holds):
        for i in range(hold_number * fine, (hold_number + 1) * fine):
            A[i:n, hold_number] += of_impulse[: n - i]
    weight = math.sqrt(fine) * T * T
    A[n:] = weight * np.eye(holds)
    of_errors, of_means = np.split(_first_of_least_squares(A), [n])
    K = _total(of_errors, np.array([power[0] for power in powers[1:]]))
    G = np.array([_total(of_errors[i:], np.array([power[0] for power in powers[: n - i]])) for i in range(n)])
    # The drive asked for in an interval is the rate asked for over Gamma.
    G[:, 1] += np.repeat(of_means, fine) * weight / (fine * Gamma[1])
    return HoldGains(K, G, Phi, Gamma)


def _total(weights: _Array, rows: _Array) -> _Array:
    """Sum of the rows, each by its weight."""
    return np.array([math.fsum(column) for column in (weights[:, None] * rows).T])


def _first_of_least_squares(A: _Array) -> _Array:
    """First row of the pseudoinverse of A (m, n), whose columns are independent: by the normal equations."""
    n = A.shape[1]
    S = np.array([[math.fsum(A[:, i] * A[:, j]) for j in range(n)] for i in range(n)])
    y = np.zeros(n)
    y[0] = 1.0
    for i in range(n):
        for j in range(i + 1, n):
            share = S[j, i] / S[i, i]
            S[j] -= share * S[i]
            y[j] -= share * y[i]
    for i in range(n - 1, -1, -1):
        y[i] = (y[i] - math.fsum(S[i, i + 1 :] * y[i + 1 :])) / S[i, i]
    return _total(y, np.ascontiguousarray(A.T))


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
    Phi, Gamma = transition(stiffness, damping, period)
    # Riccati's equation by doubling: Chu, Fan, Lin, Wang, Int. J. Control 77 (2004) 767,
    # doi:10.1080/00207170410001714988. In units of the noise, so that it is well scaled.
    A, G, P = Phi.T, np.array([[1.0, 0.0], [0.0, 0.0]]), np.outer(Gamma, Gamma) * square(disturbance / noise)
    for _ in range(60):
        W = np.eye(2) + times(G, P)
        inverse = np.array([[W[1, 1], -W[0, 1]], [-W[1, 0], W[0, 0]]]) / (W[0, 0] * W[1, 1] - W[0, 1] * W[1, 0])
        A_inverse, before = times(A, inverse), P
        P = P + times(times(A.T, P), times(inverse, A))
        G = G + times(A_inverse, times(G, A.T))
        A = times(A_inverse, A)
        if np.array_equal(P, before):
            break
    return P[:, 0] / (P[0, 0] + 1.0)
