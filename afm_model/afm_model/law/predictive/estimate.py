"""What the law learns of the sample: its height under the tip and the strength of friction, with their slopes."""

import math
from typing import Any

from ...jit import kernel
from .constants import KNOWN
from .plant import look, nominal_bound

ROUGH = 0.35
"""Rms second derivative of a surface over height times the square of the wave number along a line."""
_INDEX = 0.6
"""Largest tracking index: beyond it what is measured counts alone."""
_FLOOR = 2e-4
"""Noise of a height [z0] and of a strength, from a load that is not quite static."""


@kernel
def track(rough: float, way: float) -> tuple[float, float]:
    """Gains of a tracking filter over a step `way` of a quantity whose second derivative has rms `rough`.

    The steady state of the Kalman filter of value and slope (P. R. Kalata, IEEE Trans. Aerosp. Electron. Syst. 20 (1984)
    174, doi:10.1109/TAES.1984.310438); where it is sampled coarsely the tracking index is limited.
    """
    spread = rough * way * way
    index = min(spread / _FLOOR, _INDEX)
    r = (4.0 + index - math.sqrt(8.0 * index + index * index)) / 4.0
    alpha = 1.0 - r * r
    return alpha, 2.0 * (2.0 - alpha) - 4.0 * math.sqrt(1.0 - alpha)


@kernel
def wave_number(d_x: float, d_y: float, p: Any) -> float:
    """Largest wave number of the surface along the direction d [1/x0]."""
    return p.wave_number * (abs(d_x) + abs(d_y))


@kernel
def take_height(p: Any, s: Any) -> None:
    """Follow the height of the sample under the tip, H = Q - Z + delta, and its slope along the way."""
    H = s.Q - s.Z + p.delta + p.delta_load * (s.load - p.load_0)
    if s.started == 0.0:
        s.H = H
        return
    d_x, d_y = s.X - s.at_x, s.Y - s.at_y
    way = math.sqrt(d_x * d_x + d_y * d_y)
    if way == 0.0:
        return
    q = wave_number(d_x / way, d_y / way, p)
    alpha, beta = track(ROUGH * p.height * q * q, way)
    innovation = H - (s.H + s.H_x * d_x + s.H_y * d_y)
    s.H += s.H_x * d_x + s.H_y * d_y + alpha * innovation
    s.H_x += beta * innovation * d_x / (way * way)
    s.H_y += beta * innovation * d_y / (way * way)


@kernel
def take_strength(force: float, u_x: float, u_y: float, p: Any, s: Any) -> None:
    """Follow the strength of friction from the lateral force along x while the tip slips, from the balance at rest.

    Parameters
    ----------
    force : float [m_p w0^2 x0]
        Friction along x.
    u_x, u_y : float [w0^2 x0]
        Drive in force until now.
    """
    look(s.X, s.Y, p, s)
    nominal = nominal_bound(s.load, p, s)
    speed = math.sqrt(s.V_X * s.V_X + s.V_Y * s.V_Y)
    if speed == 0.0:
        b_x, b_y = u_x - p.stiffness[0] * s.X, u_y - p.stiffness[1] * s.Y
        s.ratio = max(s.ratio, math.sqrt(b_x * b_x + b_y * b_y) / nominal)
        return
    if abs(s.V_X) < 0.3 * speed:
        return
    measured = force * speed / (s.V_X * nominal)
    d_x, d_y = s.X - s.at_x, s.Y - s.at_y
    way = math.sqrt(d_x * d_x + d_y * d_y)
    if way == 0.0:
        return
    q = wave_number(d_x / way, d_y / way, p)
    s.slips += 1.0
    if p.surface == KNOWN:
        # Nothing of it is left to follow but what changes slowly: the mean over a wave of the surface.
        s.ratio += max(1.0 / s.slips, way * q / (2.0 * math.pi)) * (measured - s.ratio)
        return
    alpha, beta = track(ROUGH * p.ripple * q * q, way)
    alpha = max(alpha, 1.0 / s.slips)
    innovation = measured - (s.ratio + s.ratio_x * d_x + s.ratio_y * d_y)
    s.ratio += s.ratio_x * d_x + s.ratio_y * d_y + alpha * innovation
    if s.slips > 1.0:
        s.ratio_x += beta * innovation * d_x / (way * way)
        s.ratio_y += beta * innovation * d_y / (way * way)
