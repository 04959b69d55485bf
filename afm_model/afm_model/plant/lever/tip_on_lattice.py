"""The tip of the plant `lever` on a sample of atoms: Prandtl and Tomlinson's model in two dimensions; docs/lever.md
(30) to (36).

The potential of the sample takes the place of friction. Unknown at mid-step is the place of the apex; indentation and
load follow from it.
"""

import math

from ...compiled.jit import kernel, routine
from ...compiled.records import Block
from ...core.random_numbers import normal as standard_normal
from ...parts.dispatch import surface
from .constants import Constants
from .contact import normal, place_frame
from .end import show_end
from .indent import indent
from .state import State

_LONGEST = 1.0 / 32.0
"""Way of the apex, in lattice constants, in one part of its way down to a minimum."""
_CLOSE = 1e-6
"""A Newton step so short, in lattice constants, leaves an error of its square."""
_PARTS = 500
"""Of a way down at most: some fifteen lattice constants."""
_NUDGE = 1e-6
"""Way by which it leaves a ridge on which it is balanced."""


@kernel
def downhill(
    g_1: float, g_2: float, J_11: float, J_12: float, J_22: float, longest: float
) -> tuple[float, float, bool]:
    """One step down a potential with slope g and second derivatives J: Newton's, or where that does not lead to a
    minimum or goes too far an implicit Euler step along the steepest descent, of length `longest` at most.

    Returns
    -------
    (step_1, step_2, newton) : floats, bool
    """
    mean, half = 0.5 * (J_11 + J_22), 0.5 * (J_11 - J_22)
    least = mean - math.sqrt(half * half + J_12 * J_12)
    size = math.sqrt(g_1 * g_1 + g_2 * g_2)
    newton = least > 0.0 and size <= least * longest
    if not newton:
        added = size / longest - least
        J_11 += added
        J_22 += added
    determinant = J_11 * J_22 - J_12 * J_12
    if not determinant > 0.0:
        # On a ridge, balanced to the last bit.
        return 0.0, 0.0, False
    return (J_12 * g_2 - J_22 * g_1) / determinant, (J_12 * g_1 - J_11 * g_2) / determinant, newton


@routine
def _indent(
    delta: float, target: float, w_n: float, p: Constants, s: State, m: Block, at: int
) -> tuple[float, float, float, float]:
    """As `indent` without friction; called, not compiled into its callers, which saves seconds of compilation."""
    x, N, bound, a, _, _ = indent(s.delta, delta, target, w_n, 0.0, s, p, m, at)
    return x, N, bound, a


@routine
def on_lattice(
    P_x: float,
    P_y: float,
    P_z: float,
    D_x: float,
    D_y: float,
    D_z: float,
    p: Constants,
    s: State,
    m: Block,
    at: int,
) -> tuple[float, float, float]:
    """Force of the sample on the tip at mid-step; writes what the contact has come to into the state s.

    Parameters
    ----------
    P_x, P_y, P_z : floats [m]
        Place of the tip on the sample at mid-step and how far the sample without its height stands above it, if it felt
        no force.
    D_x, D_y, D_z : floats [m]
        Path of the sample against the tip in the second half of the step, if it felt no force.
    p, s : records of Constants and State
    m, at : block of the instrument, where the table of the contact begins

    Returns
    -------
    (F_x, F_y, F_z) : floats [N]
    """
    if s.a == 0.0:
        return _off(P_x, P_y, P_z, D_z, p, s, m, at)
    k = 1.0 / (p.apex_compliance + 1.0 / (p.stiffness_per_radius * s.a))
    # Cantilever, scanner and contact in series.
    K_1, K_2 = k / (1.0 + k * p.W_x), k / (1.0 + k * p.W_yy)
    w_n = p.W_zz - p.W_yz * p.W_yz * K_2
    _, stiffness, _, _, _ = normal(s.delta, s, p, m, at)
    give = stiffness / max(1.0 + w_n * stiffness, 0.1)
    noise_x = noise_y = 0.0
    if p.apex_noise != 0.0:
        count = 2 * int(p.counts * s.steps)
        noise_x = p.apex_noise * standard_normal(p.apex_key, count)
        noise_y = p.apex_noise * standard_normal(p.apex_key, count + 1)
    longest, close = _LONGEST * p.lattice_period, _CLOSE * p.lattice_period
    rise, bend = p.rise, p.rise / p.x0
    # One without mass begins where it was: it keeps its minimum. With mass there is one solution.
    u_x, u_y = s.A_x + p.half * s.V_Ax, s.A_y + p.half * s.V_Ay
    delta, N, a = s.delta, s.N, s.a
    S_x = S_y = way_x = way_y = h_x = c_y = 0.0
    stands = newton = True
    for part in range(_PARTS):
        H = surface(u_x / p.x0, u_y / p.x0, m)
        if part == 0:
            place_frame(H, p, s, m, at)
        h_x, h_y = H.slope_x * rise, H.slope_y * rise
        free = K_2 * (P_y - u_y)
        delta, N, _, a = _indent(delta, P_z + H.height * p.z0 - p.W_yz * free, w_n, p, s, m, at)
        S_x, S_y = K_1 * (P_x - u_x), free - K_2 * p.W_yz * N
        g_x = p.apex_hold * (u_x - s.A_x) - p.apex_carry * s.V_Ax - noise_x - S_x + H.potential_x + N * h_x
        g_y = p.apex_hold * (u_y - s.A_y) - p.apex_carry * s.V_Ay - noise_y - S_y + H.potential_y + N * h_y
        # How the load changes with the place.
        c_y = h_y + p.W_yz * K_2
        J_11 = K_1 + H.potential_xx + N * H.curvature_xx * bend + give * h_x * h_x
        J_12 = H.potential_xy + N * H.curvature_xy * bend + give * h_x * c_y
        J_22 = K_2 + H.potential_yy + N * H.curvature_yy * bend + give * c_y * c_y
        stands = stands and J_11 + J_22 > 0.0 and J_11 * J_22 > J_12 * J_12
        way_x, way_y, newton = downhill(g_x, g_y, J_11 + p.apex_hold, J_12, J_22 + p.apex_hold, longest)
        if not newton and abs(way_x) + abs(way_y) < _NUDGE * longest:
            way_x, way_y = way_x + _NUDGE * longest, way_y + _NUDGE * longest
        u_x += way_x
        u_y += way_y
        if newton and abs(way_x) + abs(way_y) < close:
            break
    if a == 0.0:
        return _off(P_x, P_y, P_z, D_z, p, s, m, at)
    # What the last step changes.
    more = h_x * way_x + c_y * way_y
    delta += more * give / stiffness if stiffness != 0.0 else more
    N += give * more
    S_x -= K_1 * way_x
    S_y -= K_2 * (way_y + p.W_yz * give * more)

    s.stuck = 1.0 if stands else 0.0
    if p.apex_hold != 0.0:
        rate = 2.0 / p.h
        s.V_Ax, s.V_Ay = 2.0 * rate * (u_x - s.A_x) - s.V_Ax, 2.0 * rate * (u_y - s.A_y) - s.V_Ay
        s.A_x, s.A_y = 2.0 * u_x - s.A_x, 2.0 * u_y - s.A_y
    else:
        s.A_x, s.A_y = u_x, u_y
    s.U_x, s.U_y = P_x - p.W_x * S_x, P_y - p.W_yy * S_y - p.W_yz * N
    s.delta, s.N, s.a = delta, N, a
    s.F_x, s.F_y, s.F_z = s.T_x, s.T_y, _ = S_x, S_y, N
    if p.thermal != 0.0:
        # An apex with mass has gone on; one without is where it was.
        way_x, way_y = s.A_x - u_x, s.A_y - u_y
        D_x -= (p.W_x - p.rest_x) * S_x + way_x
        D_y -= (p.W_yy - p.rest_yy) * S_y + (p.W_yz - p.rest_yz) * N + way_y
        D_z -= (p.W_yz - p.rest_yz) * S_y + (p.W_zz - p.rest_zz) * N - h_x * way_x - (c_y - p.W_yz * K_2) * way_y
        show_end(0.0, 0.0, 1.0, k if p.apex_hold != 0.0 else 0.0, D_x, D_y, D_z, p, s, m, at)
    s.F_max = p.lattice_force + p.lattice_slope * max(s.N, 0.0)
    return S_x, S_y, N


@routine
def _off(
    P_x: float, P_y: float, P_z: float, D_z: float, p: Constants, s: State, m: Block, at: int
) -> tuple[float, float, float]:
    """The same of a tip that does not touch the sample: no lateral force. One that snaps in is at rest there."""
    H = surface(P_x / p.x0, P_y / p.x0, m)
    place_frame(H, p, s, m, at)
    s.delta, s.N, _, s.a = _indent(s.delta, P_z + H.height * p.z0, p.W_zz, p, s, m, at)
    s.U_x, s.U_y = P_x, P_y - p.W_yz * s.N
    s.A_x, s.A_y = s.U_x, s.U_y
    s.V_Ax = s.V_Ay = s.stuck = s.F_max = s.F_x = s.F_y = s.T_x = s.T_y = 0.0
    N = s.F_z = s.N
    if p.thermal != 0.0:
        show_end(0.0, 0.0, 1.0, 0.0, 0.0, 0.0, D_z - (p.W_zz - p.rest_zz) * N, p, s, m, at)
    return 0.0, 0.0, N
