"""State of the plant `lever` at the start: at rest in contact at the setpoint, or free; docs/lever.md (3), (17)."""

import math
from typing import Any

import numpy as np

from ...compiled.jit import plain, routine
from ...compiled.records import Block, record_at
from ...core.elementary import square
from ...core.errors import ParameterError
from ...parts.dispatch import surface
from ...parts.header import BlockHeader
from ...parts.part import Tree
from .apex import require_resolved_apex
from .check import require_blunt_sample
from .contact import normal, place_frame
from .state import ledger_of
from .tip_on_lattice import downhill

_PASSES = 60
"""Of the fixed-point iteration for the place under the tip: the sample moves under it as the tip is pushed aside."""

_PARTS = 1000
"""Of the way down to a minimum of a lattice at most; it takes some ten, and half a lattice constant is 16 of 0.03."""


def rest(parameters: Tree, p: Any, s: Any, m: Any) -> tuple[float, float, float]:
    """The tip at rest without friction, in contact under the load of reference.z_r or plant.gap above the sample.

    Parameters
    ----------
    parameters : InstrumentParameters
    p, s : records of Constants and State
        s is zero, and written.
    m : block of the instrument

    Returns
    -------
    (x, y, z) : floats [V]
        Drive that holds it.

    Raises
    ------
    ParameterError
        If the sample is sharper than the tip, or the cantilever would have to pull harder than the contact holds or
        push harder than it bears.
    """
    require_blunt_sample(parameters)
    plant = parameters.plant
    at = record_at(m, 0, BlockHeader).plant_map
    scanner = plant.scanner_numbers
    # Static compliance: the modes' part is what they take in a step without inertia.
    each = [push / (p.half * w2 * inverse) if w2 else 0.0 for push, w2, inverse in _modes(p)]
    C_yy = p.rest_yy + math.fsum(c * y * y for c, y in zip(each, p.mode_y, strict=True))
    C_yz = p.rest_yz + math.fsum(c * y * z for c, y, z in zip(each, p.mode_y, p.mode_z, strict=True))
    C_zz = p.rest_zz + math.fsum(c * z * z for c, z in zip(each, p.mode_z, strict=True))
    phi_by_x = p.twist_push / (p.half * p.twist_w2 * p.twist_inverse) if p.twist_w2 else 0.0
    C_x = p.rest_x + p.arm * phi_by_x
    # What is given is the deflection that is shown, as to a loop that follows it.
    shown = list(zip(each, p.mode_y, p.mode_z, p.mode_shown, strict=True))
    D_y = p.shown_y + sum(c * y * seen for c, y, _, seen in shown)
    D_z = p.shown_z + sum(c * z * seen for c, _, z, seen in shown)
    raised = parameters.reference.z_r - p.a
    for _ in range(_PASSES):
        before = s.U_x, s.U_y
        H = surface(s.A_x / p.x0, s.A_y / p.x0, m)
        place_frame(H, p, s, m, at)
        # A lattice is flat: its height belongs to its potential.
        n = np.array([0.0, 0.0, 1.0]) if p.lattice else np.array([H.slope_x * p.rise, H.slope_y * p.rise, 1.0])
        n /= math.sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2])
        if p.bridge:
            plain(ledger_of)(m).bridge = float(plant.gap == 0.0 or s.end + plant.gap * n[2] <= p.bridge_begin)
        if plant.gap > 0.0:
            s.delta = -plant.gap * n[2]
        else:
            s.delta = _indentation((raised - D_y * s.T_y) / (D_z * n[2] + D_y * n[1]), parameters, p, s, m, at)
        own = plain(ledger_of)(m)
        s.N, own.stiffness, s.F_max, own.growth, s.a = plain(normal)(s.delta, s, p, m, at)
        s.F_x, s.F_y, s.F_z = s.N * n
        if p.lattice and s.a > 0.0:
            k = 1.0 / (p.apex_compliance + 1.0 / (p.stiffness_per_radius * s.a))
            give = C_x + 1.0 / scanner.k_x + 1.0 / k, C_yy + 1.0 / scanner.k_y + 1.0 / k
            _hold(give, -C_yz * s.N, p, s, m)
            s.F_x, s.F_y = s.T_x, s.T_y
            s.F_max = p.lattice_force + p.lattice_slope * max(s.N, 0.0)
        s.X, s.Y = -s.F_x / scanner.k_x, -s.F_y / scanner.k_y
        s.U_x = s.X - C_x * s.F_x - s.delta * n[0]
        s.U_y = s.Y - C_yy * s.F_y - C_yz * s.F_z - s.delta * n[1]
        if not p.lattice or s.a == 0.0:
            s.A_x, s.A_y = s.U_x, s.U_y
        if before == (s.U_x, s.U_y):
            break
    if p.lattice:
        contact = 1.0 / (p.stiffness_per_radius * s.a) if s.a > 0.0 else 0.0
        require_resolved_apex(parameters, p.apex_compliance + contact, s.N)
    s.stuck = float(s.a > 0.0)
    for i in range(3):
        s.q[i] = each[i] * (p.mode_y[i] * s.F_y + p.mode_z[i] * s.F_z)
    s.tip = C_yz * s.F_y + C_zz * s.F_z
    s.shown = math.fsum(p.mode_shown * s.q) + p.shown_y * s.F_y + p.shown_z * s.F_z
    s.phi = phi_by_x * s.F_x
    s.twist = s.phi + p.twist_x * s.F_x
    s.Z = p.a + s.tip - H.height * p.z0 + s.delta * n[2]
    return 0.0, 0.0, float((s.Z + s.F_z / scanner.k_z) / p.metres[2])


def _hold(give: tuple[float, float], y_free: float, p: Any, s: Any, m: Any) -> None:
    """Write into s the minimum of a lattice in which the tip rests, and the force that holds it there.

    Parameters
    ----------
    give : (x, y) [m/N]
        Compliance of everything elastic that holds the apex.
    y_free : float [m]
        Place along y of a tip without lateral force.
    """
    u_x, u_y = 0.0, y_free
    for _ in range(_PARTS):
        H = surface(u_x / p.x0, u_y / p.x0, m)
        s.T_x, s.T_y = -u_x / give[0], (y_free - u_y) / give[1]
        slope, bend = s.N * p.rise, s.N * p.rise / p.x0
        step_x, step_y, _ = plain(downhill)(
            H.potential_x + slope * H.slope_x - s.T_x,
            H.potential_y + slope * H.slope_y - s.T_y,
            1.0 / give[0] + H.potential_xx + bend * H.curvature_xx,
            H.potential_xy + bend * H.curvature_xy,
            1.0 / give[1] + H.potential_yy + bend * H.curvature_yy,
            0.03 * p.lattice_period,
        )
        u_x, u_y = u_x + step_x, u_y + step_y
        if abs(step_x) + abs(step_y) < 1e-10 * p.lattice_period:
            break
    s.A_x, s.A_y = u_x, u_y


def _modes(p: Any) -> list[tuple[float, float, float]]:
    return list(zip(p.mode_push, p.mode_w2, p.mode_inverse, strict=True))


@routine
def _forces(deltas: Block, s: Any, p: Any, m: Block, at: int) -> Block:
    """Normal force at each indentation, of a contact at rest."""
    found = np.empty(len(deltas))
    for i in range(len(deltas)):
        found[i] = normal(deltas[i], s, p, m, at)[0]
    return found


@routine
def _between(low: float, high: float, load: float, s: Any, p: Any, m: Block, at: int) -> float:
    """Indentation between two at which the normal force is the load, by bisection."""
    for _ in range(100):
        middle = 0.5 * (low + high)
        if normal(middle, s, p, m, at)[0] < load:
            low = middle
        else:
            high = middle
    return 0.5 * (low + high)


def _indentation(load: float, parameters: Tree, p: Any, s: Any, m: Any, at: int) -> float:
    """Indentation under a load [N] along the normal, on the branch that is stable under a fixed load."""

    high = s.unit_indentation
    for _ in range(100):
        if plain(normal)(high, s, p, m, at)[0] > load:
            break
        high *= 1.5
    else:
        raise ParameterError(f"the load of {load:.4g} N at reference.z_r is beyond what a contact bears")
    grid = s.end + square(np.linspace(0.0, 1.0, 400)) * (high - s.end)
    forces = _forces(grid, s, p, m, at)
    weakest = int(np.argmin(forces))
    if load <= forces[weakest]:
        raise ParameterError(
            f"the tip does not touch the sample at rest: at reference.z_r = {parameters.reference.z_r:g} m and "
            f"cantilever.a = {parameters.cantilever.a:g} m the load is {load:.4g} N and must be > "
            f"{forces[weakest]:.4g} N, the pull-off force: raise reference.z_r, lower cantilever.a, or start free with "
            f"plant.gap > 0"
        )
    return float(_between(float(grid[weakest]), float(high), load, s, p, m, at))
