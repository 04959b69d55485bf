"""Event-driven reference of the lateral model, written from the paper's equations and sharing no code with afm_model.

S. Salapaka, M. Dahleh, "A Model for Friction in Atomic Force Microscopy": equations 1 and 5 for x and y with the tip
height held (section 4.1), so that the load N is constant; friction law of section 2; sample H = beta sin(k_x X)
sin(k_y Y); contact of section 1. Nondimensional, as in table 1.

    stick:  X, Y constant as long as |g| <= f, g = (U_x - eta_x^2 X, U_y - eta_y^2 Y)
    slip:   X'' = U_x - eta_x^2 X - 2 xi_x eta_x X' - f X' / |v|,  Y alike

The pieces are smooth; an adaptive integrator covers each of them to about 1e-11 and their ends are located as roots.
The direction v/|v| is singular where a slip starts and where it ends:

- a slip starts with v = c t^2 (n_0 + n_1 t), n_0 = g/f, c = (g'.n_0)/2, n_1 = g'_perp / f (write v = s n and expand
  s n' = g_perp). The direction then relaxes at the rate f/|v|, which is stiff: the first stretch is integrated by an
  implicit method;
- a slip ends when the speed has fallen to `_STOPPED`: what is left of the way, |v|^2 / (2 f), is below round-off of X.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

_RTOL, _ATOL = 1e-11, 1e-12
_LAUNCH = 1e-3
"""Time for which the expansion at the start of a slip is used. What it leaves out of the speed, above all the damping
2 xi eta c t^3 / 3, is of the order t^3 but small: 1e-12."""
_MOVING = 0.2  # speed from which an explicit integrator is the cheaper one
_STOPPED = 1e-7  # speed taken for zero
_SCAN = 0.25  # step in which the end of a stick phase is bracketed; the drive changes over hundreds of units


@dataclass(frozen=True)
class Lateral:
    """Constants of the lateral model, nondimensional."""

    eta: tuple[float, float]
    xi: tuple[float, float]
    beta: float
    k: tuple[float, float]
    r: float
    L_s: float
    f_s: float
    load: float

    def friction(self, X: float, Y: float) -> float:
        """F = F_fs (1 + sqrt(1 + N/|L_s|))^(4/3) with R_e/R = 1/(1 + kappa r), |L_s| ~ R_e and F_fs ~ R_e^(4/3)."""
        H = self.beta * math.sin(self.k[0] * X) * math.sin(self.k[1] * Y)
        kappa = 0.5 * (self.k[0] ** 2 + self.k[1] ** 2) * H
        rho = 1.0 / (1.0 + kappa * self.r)
        return self.f_s * rho ** (4.0 / 3.0) * (1.0 + math.sqrt(1.0 + self.load / (self.L_s * rho))) ** (4.0 / 3.0)


def paper_lateral(load: float, *, beta: float = 0.125) -> Lateral:
    """The constants of section 4 of the paper (tau = 0.91e9 Pa), from its SI values."""
    m_c, mu, w0, x0, z0 = 6e-9, 100.0, 1e4, 2.5e-10, 1e-7
    tau, K, gamma, R = 0.91e9, 44.80e9, 0.404, 40e-9
    pull_off = 3.0 * math.pi * R * gamma
    return Lateral(
        eta=(2.0 * math.pi * 669.07 / w0, 2.0 * math.pi * 407.07 / w0),
        xi=(0.0366, 0.0293),
        beta=beta,
        k=(0.5, 0.5),
        r=R / z0,
        L_s=pull_off / (m_c * w0**2 * z0),
        f_s=math.pi * tau * (R * pull_off / K) ** (2.0 / 3.0) / (mu * m_c * w0**2 * x0),
        load=load,
    )


@dataclass(frozen=True)
class Trajectory:
    """Positions and velocities at the times asked for, and the stick phases as (start, end)."""

    times: np.ndarray
    positions: np.ndarray  # (n, 2)
    velocities: np.ndarray  # (n, 2)
    stick_phases: list[tuple[float, float]]


def event_driven(
    model: Lateral,
    drive: Callable[[float], tuple[float, float]],
    drive_rate: Callable[[float], tuple[float, float]],
    times: np.ndarray,
    initial: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0),
) -> Trajectory:
    """Solve from t = 0 to times[-1], starting at (X, Y, X', Y')."""
    eta2 = (model.eta[0] ** 2, model.eta[1] ** 2)
    damping = (2.0 * model.xi[0] * model.eta[0], 2.0 * model.xi[1] * model.eta[1])
    end = float(times[-1])
    positions, velocities = np.empty((len(times), 2)), np.empty((len(times), 2))
    phases: list[tuple[float, float]] = []

    def needed(t: float, X: float, Y: float) -> tuple[float, float]:
        u = drive(t)
        return u[0] - eta2[0] * X, u[1] - eta2[1] * Y

    def slip(t: float, y: np.ndarray) -> tuple[float, float, float, float]:
        X, Y, V, W = y.tolist()
        g = needed(t, X, Y)
        friction = model.friction(X, Y) / math.hypot(V, W)
        return V, W, g[0] - (damping[0] + friction) * V, g[1] - (damping[1] + friction) * W

    def stopped(t: float, y: np.ndarray) -> float:
        return math.hypot(y[2], y[3]) - _STOPPED

    def moving(t: float, y: np.ndarray) -> float:
        return math.hypot(y[2], y[3]) - _MOVING

    stopped.terminal, stopped.direction = True, -1.0  # type: ignore[attr-defined]
    moving.terminal, moving.direction = True, 1.0  # type: ignore[attr-defined]

    def fill(start: float, stop: float, values: Callable[[np.ndarray], np.ndarray]) -> None:
        inside = (times >= start) & (times <= stop)
        if inside.any():
            y = values(times[inside])
            positions[inside], velocities[inside] = y[:2].T, y[2:].T

    def integrate(
        t: float, y: np.ndarray, method: str, events: list[Callable[..., float]]
    ) -> tuple[float, np.ndarray, int]:
        solution = solve_ivp(slip, (t, end), y, method, events=events, rtol=_RTOL, atol=_ATOL, dense_output=True)
        if solution.status < 0:
            raise RuntimeError(f"the reference failed at t = {t}: {solution.message}")
        fill(t, solution.t[-1], solution.sol)
        which = next((i for i, found in enumerate(solution.t_events) if len(found)), -1)
        return float(solution.t[-1]), solution.y[:, -1], which

    t, y = 0.0, np.array(initial, dtype=float)
    while t < end:
        if math.hypot(y[2], y[3]) == 0.0:
            # Stick until the force needed to hold still leaves the disc of radius f.
            X, Y = float(y[0]), float(y[1])
            f = model.friction(X, Y)
            start = t

            def excess(at: float, X: float = X, Y: float = Y, f: float = f) -> float:
                return math.hypot(*needed(at, X, Y)) - f

            if excess(t) > 0.0:
                raise RuntimeError(f"the speed vanishes at t = {t} where friction cannot hold: not covered")
            while t < end and excess(t + _SCAN) <= 0.0:
                t += _SCAN
            t = end if t >= end else min(end, float(brentq(excess, t, t + _SCAN, xtol=1e-13)))
            phases.append((start, t))
            fill(start, t, lambda at, y=y: np.repeat(y[:, None], len(at), axis=1))
            if t >= end:
                break
            # Launch along the expansion at the start of a slip.
            g, rate = np.array(needed(t, X, Y)), np.array(drive_rate(t))
            n_0 = g / f
            c = 0.5 * float(rate @ n_0)
            n_1 = (rate - (rate @ n_0) * n_0) / f

            def launch(at: np.ndarray, t=t, y=y, n_0=n_0, n_1=n_1, c=c) -> np.ndarray:
                tau = np.asarray(at) - t
                way = c * (n_0[:, None] * tau**3 / 3.0 + n_1[:, None] * tau**4 / 4.0)
                return np.vstack([y[:2, None] + way, c * (n_0[:, None] * tau**2 + n_1[:, None] * tau**3)])

            fill(t, t + _LAUNCH, launch)
            y = launch(np.array([t + _LAUNCH]))[:, 0]
            t += _LAUNCH
            t, y, event = integrate(t, y, "Radau", [stopped, moving])
            if event == 0:
                y = np.array([y[0], y[1], 0.0, 0.0])
                continue
        t, y, event = integrate(t, y, "DOP853", [stopped])
        if event == 0:
            y = np.array([y[0], y[1], 0.0, 0.0])
    return Trajectory(times, positions, velocities, phases)
