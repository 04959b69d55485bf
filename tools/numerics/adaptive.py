"""scipy's solve_ivp on the same right-hand side: adaptive steps, explicit and stiff."""

import time
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from .fixed_step import acceleration, compiled
from .problem import Trajectory, error, load, start

_Array = NDArray[np.float64]


class _TooManyError(Exception):
    """The solver asked for more evaluations than it was given."""


@dataclass(frozen=True)
class Outcome:
    """What an adaptive solver achieved."""

    error: float  # [x0]; NaN if it did not get to the end
    reached: float  # time it got to [1/w0]
    evaluations: int
    seconds: float


@compiled
def _rates(t: float, y: _Array, m: _Array, n: float, v_s: float) -> _Array:
    a_x, a_y = acceleration(m, t, y[0], y[1], y[2], y[3], n, v_s, False)
    return np.array([y[2], y[3], a_x, a_y])


def solve(exact: Trajectory, method: str, rtol: float, v_s: float, most: int = 200_000) -> Outcome:
    """Integrate from rest with at most `most` evaluations; v_s = 0: the set-valued law as an ordinary function."""
    m, n = start(0.01), load()
    counted = [0, 0.0]

    def rates(t: float, y: _Array) -> _Array:
        counted[0] += 1
        counted[1] = t
        if counted[0] > most:
            raise _TooManyError
        return np.asarray(_rates(t, y, m, n, v_s))

    rates(0.0, np.zeros(4))  # compiled before the clock starts
    begin = time.thread_time()
    reached, difference = float(exact.times[-1]), float("nan")
    try:
        found = solve_ivp(rates, (0.0, reached), np.zeros(4), method, t_eval=exact.times, rtol=rtol, atol=1e-3 * rtol)
        difference = error(found.y[:2].T, exact)
    except _TooManyError:
        reached = float(counted[1])
    return Outcome(difference, reached, int(counted[0]), time.thread_time() - begin)
