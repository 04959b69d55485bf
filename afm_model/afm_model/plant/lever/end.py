"""What is observed of the contact of the plant `lever` with thermal noise: its forces at the end of a step.

The step is made with those at its middle, which fluctuate less where a step is a good part of a period of the contact.
Linear from the middle on; docs/lever.md (40).
"""

import math

from ...compiled.jit import kernel
from ...compiled.records import Block
from .constants import Constants
from .contact import normal
from .state import State


@kernel
def show_end(
    n_x: float,
    n_y: float,
    n_z: float,
    k: float,
    D_x: float,
    D_y: float,
    D_z: float,
    p: Constants,
    s: State,
    m: Block,
    at: int,
) -> None:
    """Bring forces, indentation and contact radius in the state from the middle of the step to its end.

    Parameters
    ----------
    n_x, n_y, n_z : floats
        Normal of the surface.
    k : float [N/m]
        Lateral stiffness of what holds the tip; 0: it slides, or is off the sample.
    D_x, D_y, D_z : floats [m]
        Way of the sample against the tip in the second half of the step, under the force of its middle but without
        what follows that without delay.
    p, s : records of Constants and State
    m, at : block of the instrument, where the table of the contact begins
    """
    _, stiffness, bound, growth, _ = normal(s.delta, s, p, m, at)
    # The force changes by g along the normal, and by k along the surface, with the way u at the contact.
    g_x, g_y, g_z = (stiffness - k) * n_x, (stiffness - k) * n_y, (stiffness - k) * n_z
    if s.stuck == 0.0 and p.lattice == 0.0 and bound > 0.0:
        per = growth / bound
        g_x, g_y, g_z = g_x + per * s.T_x, g_y + per * s.T_y, g_z + per * (s.F_z - s.N * n_z)
    b_x, b_yy, b_yz, b_zz = 1.0 + k * p.rest_x, 1.0 + k * p.rest_yy, k * p.rest_yz, 1.0 + k * p.rest_zz
    determinant = b_yy * b_zz - b_yz * b_yz
    R_x, R_y, R_z = p.rest_x * g_x, p.rest_yy * g_y + p.rest_yz * g_z, p.rest_yz * g_y + p.rest_zz * g_z
    R_x, R_y, R_z = R_x / b_x, (b_zz * R_y - b_yz * R_z) / determinant, (b_yy * R_z - b_yz * R_y) / determinant
    D_x, D_y, D_z = D_x / b_x, (b_zz * D_y - b_yz * D_z) / determinant, (b_yy * D_z - b_yz * D_y) / determinant
    slope = 1.0 + n_x * R_x + n_y * R_y + n_z * R_z
    deeper = (n_x * D_x + n_y * D_y + n_z * D_z) / max(slope, 0.1)
    # Across a fold, or the end of the contact, nothing is linear: there it stays that of the middle.
    if slope < 0.1 or (s.delta + deeper > s.end) != (s.delta > s.end):
        return
    s.F_x += k * (D_x - R_x * deeper) + g_x * deeper
    s.F_y += k * (D_y - R_y * deeper) + g_y * deeper
    s.F_z += k * (D_z - R_z * deeper) + g_z * deeper
    s.delta += deeper
    s.N += stiffness * deeper
    if p.lattice != 0.0:
        s.T_x, s.T_y = s.F_x, s.F_y
        return
    if bound > 0.0:
        s.a *= 1.0 + 0.5 * growth / bound * deeper
    s.F_max = bound + growth * deeper
    # Friction holds up to its bound.
    T_x, T_y, T_z = s.F_x - s.N * n_x, s.F_y - s.N * n_y, s.F_z - s.N * n_z
    size = math.sqrt(T_x * T_x + T_y * T_y + T_z * T_z)
    part = 1.0 if size <= s.F_max else s.F_max / size
    s.T_x, s.T_y = part * T_x, part * T_y
    s.F_x, s.F_y, s.F_z = s.N * n_x + s.T_x, s.N * n_y + s.T_y, s.N * n_z + part * T_z
