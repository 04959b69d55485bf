"""Prandtl and Tomlinson's model by other means than the plant's: closed forms, roots, adaptive integration.

Potential -(E/2) cos(2 pi u / a), spring k from u to X; eta = 2 pi^2 E / (k a^2).
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

BOLTZMANN = 1.380649e-23


@dataclass(frozen=True)
class Tomlinson:
    """The model in one dimension, SI units."""

    k: float
    a: float
    E: float

    @property
    def eta(self) -> float:
        return 2.0 * math.pi**2 * self.E / (self.k * self.a**2)

    @property
    def peak(self) -> float:
        """Largest force of the potential [N]."""
        return math.pi * self.E / self.a

    def slope(self, u: float) -> float:
        """Of the potential [N]."""
        return self.peak * math.sin(2.0 * math.pi * u / self.a)

    @property
    def last_place(self) -> float:
        """Where the minimum vanishes [m]."""
        return self.a * math.acos(-1.0 / self.eta) / (2.0 * math.pi)

    @property
    def last_support(self) -> float:
        """X there [m]."""
        return self.last_place + self.slope(self.last_place) / self.k

    def minimum(self, X: float) -> float:
        """Place in the minimum about u = 0 [m], for |X| < last_support."""
        u = self.last_place
        return brentq(lambda x: self.slope(x) - self.k * (X - x), -u, u, xtol=1e-22, rtol=1e-14)

    def next_minimum(self) -> float:
        """Where the tip lands from the slip, without inertia [m]."""
        X, a = self.last_support, self.a
        u = self.last_place
        return brentq(lambda x: self.slope(x) - self.k * (X - x), a - u, a + u, xtol=1e-22, rtol=1e-14)

    def energy(self, u: float, X: float) -> float:
        """[J]"""
        return -0.5 * self.E * math.cos(2.0 * math.pi * u / self.a) + 0.5 * self.k * (X - u) ** 2

    def mean_force(self) -> float:
        """Over a period without inertia: energy lost in a slip, over a [N]."""
        X = self.last_support
        return (self.energy(self.last_place, X) - self.energy(self.next_minimum(), X)) / self.a

    def motion(self, support: Callable[[float], float], mass: float, damping: float, t: np.ndarray) -> np.ndarray:
        """Places of a mass that starts at rest at u = 0, at the times t, to 1e-9 of the lattice constant."""
        a = self.a

        def rate(time: float, y: np.ndarray) -> list[float]:
            force = self.k * (support(time) - a * y[0]) - self.slope(a * y[0])
            return [y[1], force / (mass * a) - damping * y[1]]

        found = solve_ivp(rate, (0.0, t[-1]), [0.0, 0.0], "DOP853", t, rtol=1e-10, atol=1e-12)
        return a * found.y[0]

    def barrier(self, X: float) -> tuple[float, float, float]:
        """(height [J], curvature in the minimum, curvature on the barrier [N/m])."""
        low = self.minimum(X)
        top = brentq(lambda x: self.slope(x) - self.k * (X - x), self.last_place, self.a - self.last_place)

        def curvature(u: float) -> float:
            return 2.0 * math.pi / self.a * self.peak * math.cos(2.0 * math.pi * u / self.a) + self.k

        return self.energy(top, X) - self.energy(low, X), curvature(low), -curvature(top)

    def kramers_rate(self, X: float, mass: float, damping: float, temperature: float) -> float:
        """Escapes per second over the next barrier, by Kramers for moderate and strong damping."""
        height, low, top = self.barrier(X)
        w_top = math.sqrt(top / mass)
        share = (math.sqrt(0.25 * damping**2 + w_top**2) - 0.5 * damping) / w_top
        return share * math.sqrt(low / mass) / (2.0 * math.pi) * math.exp(-height / (BOLTZMANN * temperature))

    def thermal_slip(self, v: float, mass: float, damping: float, temperature: float) -> tuple[float, float]:
        """Mean and standard deviation of k (X_c - X) where the tip slips when X moves at v [m/s]."""
        # On from where the lower of two minima changes; up to one part in 1e4 of where the upper one vanishes.
        X = np.linspace(0.5 * self.a, self.last_support - 1e-4 * self.a, 4000)
        X = X[X < self.last_support]
        rate = np.array([self.kramers_rate(x, mass, damping, temperature) for x in X])
        passed = np.concatenate([[0.0], np.cumsum(0.5 * (rate[1:] + rate[:-1]) * np.diff(X))]) / v
        left = np.exp(-passed)
        force = self.k * (self.last_support - X)
        share = -np.diff(left)
        at = 0.5 * (force[1:] + force[:-1])
        mean = float((share * at).sum() + left[-1] * force[-1])
        return mean, math.sqrt(float((share * (at - mean) ** 2).sum()))

    def closed_form_slip(self, v: float, mass: float, damping: float, temperature: float) -> float:
        """Mean of k (X_c - X) where it slips [N], near the end of the minimum and for strong damping.

        Sang, Dube and Grant (2001), doi:10.1103/PhysRevLett.87.174301, where force is counted by the support: with
        f = k (X_c - X), dE = (4/3) sqrt(2/c) f^(3/2), c the third derivative of V at X_c; most likely where the rate r
        is dln r/dt, the mean 0.5772 of its width further, as in Gumbel's distribution.
        """
        kT = BOLTZMANN * temperature
        c = (2.0 * math.pi / self.a) ** 2 * self.peak * math.sqrt(1.0 - self.eta**-2)

        def balance(f: float) -> float:
            rate = math.sqrt(2.0 * f * c) / (mass * 2.0 * math.pi * damping)
            growth = self.k * v * 2.0 * math.sqrt(2.0 * f / c) / kT
            return math.log(rate / growth) - 4.0 / 3.0 * math.sqrt(2.0 / c) * f**1.5 / kT

        # The largest root: below it the barrier is smaller than kT.
        f = brentq(balance, 0.5 * (0.75 * kT * math.sqrt(0.5 * c)) ** (2.0 / 3.0), self.peak)
        return f + 0.5772 * kT / (2.0 * math.sqrt(2.0 * f / c))


def waves(lattice: str, a: float, angle: float) -> np.ndarray:
    """Reciprocal vectors (n, 2) [rad/m] of a lattice of minima with a row at an angle against x."""
    q = 2.0 * math.pi / a
    vectors = {
        "square": [[q, 0.0], [0.0, q]],
        "hexagonal": [[q, q / math.sqrt(3.0)], [q, -q / math.sqrt(3.0)], [0.0, 2.0 * q / math.sqrt(3.0)]],
    }[lattice]
    turn = np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])
    return np.array(vectors) @ turn.T


def descent(G: np.ndarray, amplitude: float, k: np.ndarray, supports: np.ndarray, start: np.ndarray) -> np.ndarray:
    """Places (n, 2) of a massless tip in the potential -amplitude sum cos(G u) for each place (n, 2) of the support: by
    integration along the steepest descent.
    """
    u = start
    places = []
    pace = k.min()
    for support in supports:

        def rate(_: float, u: np.ndarray, support: np.ndarray = support) -> np.ndarray:
            return (k * (support - u) - amplitude * np.sin(G @ u) @ G) / pace

        u = solve_ivp(rate, (0.0, 60.0), u, "LSODA", rtol=1e-8, atol=1e-16).y[:, -1]
        places.append(u)
    return np.array(places)
