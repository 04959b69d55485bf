"""Schemes of fixed step, each a compiled loop over the same problem: positions at every `every`-th step."""

import math
from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

from afm_model.compiled.records import record_at
from afm_model.contact.friction import bound_of_load, project_disc
from afm_model.contact.jkr import effective_radius_ratio
from afm_model.parts import surface
from afm_model.parts.header import BlockHeader
from afm_model.plant import Constants, State
from afm_model.plant.lateral import kick_lateral

from .problem import AMPLITUDE, OMEGA

_Array = NDArray[np.float64]
compiled = numba.njit(error_model="numpy")


@compiled
def drive(t: float) -> float:
    """U_x = U_y of section 4.1."""
    return AMPLITUDE * math.sin(OMEGA * t)


@compiled
def constants_of(m: _Array) -> Any:
    """Record of the plant's constants in the block `m`."""
    return record_at(m, record_at(m, 0, BlockHeader).plant_constants, Constants)


@compiled
def state_of(m: _Array) -> Any:
    """Record of the plant's state in the block `m`."""
    return record_at(m, record_at(m, 0, BlockHeader).plant_state, State)


@compiled
def friction_bound(m: _Array, X: float, Y: float, load: float) -> float:
    """Radius of the friction disc at (X, Y)."""
    p = constants_of(m)
    H = surface(X, Y, m)
    rho = effective_radius_ratio(H, p.r)
    return bound_of_load(p.f_s, rho, load / (p.L_s * rho)) * H.strength


@compiled
def project(m: _Array, every: int, out: _Array) -> None:
    """This project: half drift, kick with friction as an impulse of at most h f, half drift."""
    p, s = constants_of(m), state_of(m)
    half = 0.5 * p.h
    k = 0
    for i in range(len(out)):
        out[i, 0], out[i, 1] = s.X, s.Y
        for _ in range(every):
            u = drive((k + 0.5) * p.h)
            s.X += half * s.V_X
            s.Y += half * s.V_Y
            f = friction_bound(m, s.X, s.Y, s.N)
            v_x, v_y, _, _ = kick_lateral(s, p, u, u, f)
            s.V_X, s.V_Y = v_x, v_y
            s.X += half * v_x
            s.Y += half * v_y
            k += 1


@compiled
def moreau_jean(m: _Array, every: int, out: _Array) -> None:
    """Moreau-Jean with theta = 1/2: linear forces by the trapezoidal rule, friction implicit by disc projection."""
    p, s = constants_of(m), state_of(m)
    h, theta = p.h, 0.5
    X, Y, V, W, load = s.X, s.Y, s.V_X, s.V_Y, s.N
    k_x, k_y = p.eta_x * p.eta_x, p.eta_y * p.eta_y
    c_x, c_y = 2.0 * p.xi_x * p.eta_x, 2.0 * p.xi_y * p.eta_y
    m_x = 1.0 + h * theta * c_x + h * h * theta * theta * k_x
    m_y = 1.0 + h * theta * c_y + h * h * theta * theta * k_y
    step = 0
    for i in range(len(out)):
        out[i, 0], out[i, 1] = X, Y
        for _ in range(every):
            u = drive((step + theta) * h)
            f = friction_bound(m, X + h * (1.0 - theta) * V, Y + h * (1.0 - theta) * W, load)
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
def semi_implicit_euler(m: _Array, every: int, out: _Array) -> None:
    """Moreau's time stepping: velocity by disc projection with forces at the start of the step, then the position."""
    p, s = constants_of(m), state_of(m)
    h = p.h
    X, Y, V, W, load = s.X, s.Y, s.V_X, s.V_Y, s.N
    step = 0
    for i in range(len(out)):
        out[i, 0], out[i, 1] = X, Y
        for _ in range(every):
            u = drive(step * h)
            f = friction_bound(m, X, Y, load)
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
    m: _Array, t: float, X: float, Y: float, V: float, W: float, load: float, v_s: float, by_component: bool
) -> tuple[float, float]:
    """The right-hand side as an ordinary differential equation.

    v_s = 0: the printed friction law with its three cases; v_s > 0: f tanh(|v| / v_s) along the velocity.
    `by_component`: f sgn(x'), f sgn(y') in place of the isotropic law, as it is often written.
    """
    p = constants_of(m)
    u = drive(t)
    f = friction_bound(m, X, Y, load)
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
def runge_kutta_4(m: _Array, every: int, out: _Array, v_s: float, by_component: bool) -> None:
    """The classical Runge-Kutta scheme on `acceleration`."""
    p, s = constants_of(m), state_of(m)
    h = p.h
    X, Y, V, W, load = s.X, s.Y, s.V_X, s.V_Y, s.N
    step = 0
    for i in range(len(out)):
        out[i, 0], out[i, 1] = X, Y
        for _ in range(every):
            t = step * h
            a1, b1 = acceleration(m, t, X, Y, V, W, load, v_s, by_component)
            V2, W2 = V + 0.5 * h * a1, W + 0.5 * h * b1
            a2, b2 = acceleration(m, t + 0.5 * h, X + 0.5 * h * V, Y + 0.5 * h * W, V2, W2, load, v_s, by_component)
            V3, W3 = V + 0.5 * h * a2, W + 0.5 * h * b2
            a3, b3 = acceleration(m, t + 0.5 * h, X + 0.5 * h * V2, Y + 0.5 * h * W2, V3, W3, load, v_s, by_component)
            V4, W4 = V + h * a3, W + h * b3
            a4, b4 = acceleration(m, t + h, X + h * V3, Y + h * W3, V4, W4, load, v_s, by_component)
            X += h / 6.0 * (V + 2.0 * V2 + 2.0 * V3 + V4)
            Y += h / 6.0 * (W + 2.0 * W2 + 2.0 * W3 + W4)
            V += h / 6.0 * (a1 + 2.0 * a2 + 2.0 * a3 + a4)
            W += h / 6.0 * (b1 + 2.0 * b2 + 2.0 * b3 + b4)
            step += 1
