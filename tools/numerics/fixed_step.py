"""Schemes of fixed step, each a compiled loop over the same problem: positions at every `every`-th step."""

import math
from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

from afm_model.contact.surface import effective_radius_ratio, surface
from afm_model.friction.disc import project_disc
from afm_model.plant import PLANT_RECORD, Z_HELD, state, step_compliant, step_paper
from afm_model.plant.lateral import kick_lateral
from afm_model.plant.paper import friction_of_load

from .problem import AMPLITUDE, OMEGA

_Array = NDArray[np.float64]
compiled = numba.njit(error_model="numpy")


@compiled
def drive(t: float) -> float:
    """U_x = U_y of section 4.1."""
    return AMPLITUDE * math.sin(OMEGA * t)


@compiled
def friction_bound(p: Any, X: float, Y: float, load: float) -> float:
    """Radius of the friction disc at (X, Y)."""
    H = surface(X, Y, p.beta, p.k_x, p.k_y)[0]
    return friction_of_load(p, effective_radius_ratio(H, p.k_x, p.k_y, p.r), load)


@compiled
def project(s0: _Array, c: _Array, every: int, out: _Array) -> None:
    """This project: half drift, kick with friction as an impulse of at most h f, half drift."""
    p = c.view(PLANT_RECORD)[0]
    s = s0.copy()
    half = 0.5 * p.h
    k = 0
    for i in range(len(out)):
        out[i, 0], out[i, 1] = s[state.X], s[state.Y]
        for _ in range(every):
            u = drive((k + 0.5) * p.h)
            s[state.X] += half * s[state.V_X]
            s[state.Y] += half * s[state.V_Y]
            f = friction_bound(p, s[state.X], s[state.Y], s[state.N])
            v_x, v_y, _, _ = kick_lateral(s, p, u, u, f)
            s[state.V_X], s[state.V_Y] = v_x, v_y
            s[state.X] += half * v_x
            s[state.Y] += half * v_y
            k += 1


@compiled
def project_paper_plant(s0: _Array, c: _Array, every: int, out: _Array) -> None:
    """The same step inside the whole of the paper's plant."""
    p = c.view(PLANT_RECORD)[0]
    s = s0.copy()
    k = 0
    for i in range(len(out)):
        out[i, 0], out[i, 1] = s[state.X], s[state.Y]
        for _ in range(every):
            u = drive((k + 0.5) * p.h)
            step_paper(s, p, u, u, 0.0, Z_HELD, 0.0)
            k += 1


@compiled
def project_compliant_plant(s0: _Array, c: _Array, every: int, out: _Array) -> None:
    """The step of the compliant plant with its eight states, for its cost; it solves another problem."""
    p = c.view(PLANT_RECORD)[0]
    s = s0.copy()
    u_z = p.eta_z * p.eta_z * s[state.Z] + s[state.N] / p.mu
    k = 0
    for i in range(len(out)):
        out[i, 0], out[i, 1] = s[state.X], s[state.Y]
        for _ in range(every):
            u = drive((k + 0.5) * p.h)
            step_compliant(s, p, u, u, u_z)
            k += 1


@compiled
def moreau_jean(s0: _Array, c: _Array, every: int, out: _Array) -> None:
    """Moreau-Jean with theta = 1/2: linear forces by the trapezoidal rule, friction implicit by disc projection."""
    p = c.view(PLANT_RECORD)[0]
    h, theta = p.h, 0.5
    X, Y, V, W = s0[state.X], s0[state.Y], s0[state.V_X], s0[state.V_Y]
    load = s0[state.N]
    k_x, k_y = p.eta_x * p.eta_x, p.eta_y * p.eta_y
    c_x, c_y = 2.0 * p.xi_x * p.eta_x, 2.0 * p.xi_y * p.eta_y
    m_x = 1.0 + h * theta * c_x + h * h * theta * theta * k_x
    m_y = 1.0 + h * theta * c_y + h * h * theta * theta * k_y
    step = 0
    for i in range(len(out)):
        out[i, 0], out[i, 1] = X, Y
        for _ in range(every):
            u = drive((step + theta) * h)
            f = friction_bound(p, X + h * (1.0 - theta) * V, Y + h * (1.0 - theta) * W, load)
            q_x = V + h * (u - k_x * (X + h * theta * (1.0 - theta) * V) - (1.0 - theta) * c_x * V)
            q_y = W + h * (u - k_y * (Y + h * theta * (1.0 - theta) * W) - (1.0 - theta) * c_y * W)
            j_x, j_y, stick = project_disc(q_x, q_y, h * f)
            v = 0.0 if stick else (q_x - j_x) / m_x
            w = 0.0 if stick else (q_y - j_y) / m_y
            X += h * (theta * v + (1.0 - theta) * V)
            Y += h * (theta * w + (1.0 - theta) * W)
            V, W = v, w
            step += 1


@compiled
def semi_implicit_euler(s0: _Array, c: _Array, every: int, out: _Array) -> None:
    """Moreau's time stepping: velocity by disc projection with forces at the start of the step, then the position."""
    p = c.view(PLANT_RECORD)[0]
    h = p.h
    X, Y, V, W = s0[state.X], s0[state.Y], s0[state.V_X], s0[state.V_Y]
    load = s0[state.N]
    step = 0
    for i in range(len(out)):
        out[i, 0], out[i, 1] = X, Y
        for _ in range(every):
            u = drive(step * h)
            f = friction_bound(p, X, Y, load)
            q_x = V + h * (u - p.eta_x * p.eta_x * X - 2.0 * p.xi_x * p.eta_x * V)
            q_y = W + h * (u - p.eta_y * p.eta_y * Y - 2.0 * p.xi_y * p.eta_y * W)
            j_x, j_y, stick = project_disc(q_x, q_y, h * f)
            V = 0.0 if stick else q_x - j_x
            W = 0.0 if stick else q_y - j_y
            X += h * V
            Y += h * W
            step += 1


@compiled
def acceleration(
    p: Any, t: float, X: float, Y: float, V: float, W: float, load: float, v_s: float, by_component: bool
) -> tuple[float, float]:
    """The right-hand side as an ordinary differential equation.

    v_s = 0: the printed friction law with its three cases; v_s > 0: f tanh(|v| / v_s) along the velocity.
    `by_component`: f sgn(x'), f sgn(y') in place of the isotropic law, as it is often written.
    """
    u = drive(t)
    f = friction_bound(p, X, Y, load)
    g_x = u - p.eta_x * p.eta_x * X - 2.0 * p.xi_x * p.eta_x * V
    g_y = u - p.eta_y * p.eta_y * Y - 2.0 * p.xi_y * p.eta_y * W
    if by_component:
        return g_x - f * np.sign(V), g_y - f * np.sign(W)
    speed = math.hypot(V, W)
    if speed > 0.0:
        size = f * math.tanh(speed / v_s) / speed if v_s > 0.0 else f / speed
        return g_x - size * V, g_y - size * W
    if v_s > 0.0:
        return g_x, g_y
    need = math.hypot(g_x, g_y)
    if need <= f:
        return 0.0, 0.0
    return g_x * (1.0 - f / need), g_y * (1.0 - f / need)


@compiled
def runge_kutta_4(s0: _Array, c: _Array, every: int, out: _Array, v_s: float, by_component: bool) -> None:
    """The classical Runge-Kutta scheme on `acceleration`."""
    p = c.view(PLANT_RECORD)[0]
    h = p.h
    X, Y, V, W = s0[state.X], s0[state.Y], s0[state.V_X], s0[state.V_Y]
    load = s0[state.N]
    step = 0
    for i in range(len(out)):
        out[i, 0], out[i, 1] = X, Y
        for _ in range(every):
            t = step * h
            a1, b1 = acceleration(p, t, X, Y, V, W, load, v_s, by_component)
            V2, W2 = V + 0.5 * h * a1, W + 0.5 * h * b1
            a2, b2 = acceleration(p, t + 0.5 * h, X + 0.5 * h * V, Y + 0.5 * h * W, V2, W2, load, v_s, by_component)
            V3, W3 = V + 0.5 * h * a2, W + 0.5 * h * b2
            a3, b3 = acceleration(p, t + 0.5 * h, X + 0.5 * h * V2, Y + 0.5 * h * W2, V3, W3, load, v_s, by_component)
            V4, W4 = V + h * a3, W + h * b3
            a4, b4 = acceleration(p, t + h, X + h * V3, Y + h * W3, V4, W4, load, v_s, by_component)
            X += h / 6.0 * (V + 2.0 * V2 + 2.0 * V3 + V4)
            Y += h / 6.0 * (W + 2.0 * W2 + 2.0 * W3 + W4)
            V += h / 6.0 * (a1 + 2.0 * a2 + 2.0 * a3 + a4)
            W += h / 6.0 * (b1 + 2.0 * b2 + 2.0 * b3 + b4)
            step += 1
