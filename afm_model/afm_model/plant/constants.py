"""Constants of the equations of motion, derived once from the SI parameters, and true values of both plants.

Units: time 1/w0, lateral length x0, vertical length z0, lateral acceleration w0^2 x0, normal force m_c w0^2 z0;
docs/theory.md (22), (23), and (2), (3), (13) for the contact.
"""

import math
from typing import Annotated

from ..compiled.jit import kernel
from ..compiled.records import Record
from ..contact.jkr import radius_at_zero_load
from ..core.elementary import square
from ..parts.part import Numbers, Tree
from ..parts.signals import Truth
from .state import State


class Constants(Record):
    h: Annotated[float, "1/w0"]  # integration step
    eta_x: Annotated[float, "w0"]  # resonances
    eta_y: Annotated[float, "w0"]
    eta_z: Annotated[float, "w0"]
    eta_c: Annotated[float, "w0"]
    xi_x: Annotated[float, "1"]  # damping ratios
    xi_y: Annotated[float, "1"]
    xi_z: Annotated[float, "1"]
    xi_c: Annotated[float, "1"]
    mu: Annotated[float, "1"]  # m_p / m_c
    w: Annotated[float, "m_c w0^2 z0"]  # load
    a: Annotated[float, "z0"]  # height of the cantilever's rest position
    r: Annotated[float, "z0"]  # tip radius
    L_s: Annotated[float, "m_c w0^2 z0"]  # |L_s| on a flat sample
    delta_0: Annotated[float, "z0"]  # a_0^2 / R on a flat sample
    f_s: Annotated[float, "m_p w0^2 x0"]  # friction at pull-off on a flat sample
    zeta_n: Annotated[float, "1"]  # damping ratio of the normal contact
    gain_x: float  # U per volt: a static displacement of one sensitivity
    gain_y: float
    gain_z: float
    x0: Annotated[float, "m"]
    z0: Annotated[float, "m"]
    lateral_speed: Annotated[float, "m/s"]
    vertical_speed: Annotated[float, "m/s"]
    lateral_force: Annotated[float, "N"]
    normal_force: Annotated[float, "N"]
    treatment: float  # of z, by the paper's plant alone
    # Of the above, once for all steps: squares of resonances; damping by the Cayley form, docs/theory.md (38), where a
    # velocity v becomes (keep v + h force) take; inverses.
    spring_x: Annotated[float, "w0^2"]
    spring_y: Annotated[float, "w0^2"]
    spring_z: Annotated[float, "w0^2"]
    spring_c: Annotated[float, "w0^2"]
    keep_x: Annotated[float, "1"]
    keep_y: Annotated[float, "1"]
    keep_z: Annotated[float, "1"]
    keep_c: Annotated[float, "1"]
    take_x: Annotated[float, "1"]
    take_y: Annotated[float, "1"]
    take_z: Annotated[float, "1"]
    take_c: Annotated[float, "1"]
    inverse_h: Annotated[float, "w0"]
    inverse_mu: Annotated[float, "1"]
    inverse_L_s: Annotated[float, "1/(m_c w0^2 z0)"]
    inverse_delta_0: Annotated[float, "1/z0"]


def plant_constants(parameters: Tree, treatment: int = 0) -> Numbers:
    """Values of Constants.

    Raises
    ------
    ArithmeticError
        If a parameter is too large or too small to compute with.
    """
    contact, cantilever, piezo = parameters.contact, parameters.cantilever, parameters.piezo
    scanner, scales, units = parameters.scanner, parameters.scales, parameters.units
    w0, x0, z0 = scales.w0, scales.x0, scales.z0
    gamma = contact.surface_energy
    h = parameters.plant.dt * w0
    frequencies = {"x": scanner.f_x, "y": scanner.f_y, "z": scanner.f_z, "c": cantilever.f_c}
    xi = {"x": scanner.xi_x, "y": scanner.xi_y, "z": scanner.xi_z, "c": cantilever.xi_c}
    eta = {axis: 2.0 * math.pi * f / w0 for axis, f in frequencies.items()}
    L_s = contact.pull_off_force / units.normal_force
    delta_0 = square(radius_at_zero_load(contact.R, contact.K, gamma)) / contact.R / z0
    found = {
        "h": h,
        "mu": scanner.mass_ratio,
        "w": cantilever.W / units.normal_force,
        "a": cantilever.a / z0,
        "r": contact.R / z0,
        "L_s": L_s,
        "delta_0": delta_0,
        "f_s": contact.friction_at_pull_off / units.lateral_force,
        "zeta_n": contact.zeta_n,
        "gain_x": square(eta["x"]) * piezo.sensitivity_x / x0,
        "gain_y": square(eta["y"]) * piezo.sensitivity_y / x0,
        "gain_z": square(eta["z"]) * piezo.sensitivity_z / z0,
        "x0": x0,
        "z0": z0,
        "lateral_speed": x0 * w0,
        "vertical_speed": z0 * w0,
        "lateral_force": units.lateral_force,
        "normal_force": units.normal_force,
        "treatment": treatment,
        "inverse_h": 1.0 / h,
        "inverse_mu": 1.0 / scanner.mass_ratio,
        "inverse_L_s": 1.0 / L_s,
        "inverse_delta_0": 1.0 / delta_0,
    }
    for axis, resonance in eta.items():
        d = h * xi[axis] * resonance
        found |= {f"eta_{axis}": resonance, f"xi_{axis}": xi[axis], f"spring_{axis}": square(resonance)}
        found |= {f"keep_{axis}": 1.0 - d, f"take_{axis}": 1.0 / (1.0 + d)}
    return found


@kernel
def observe(p: Constants, s: State, o: Truth) -> None:
    """See `afm_model.parts.Plant`. Nothing but the scanner moves laterally: at rest, the contact does not slide."""
    o.position[0] = s.X * p.x0
    o.position[1] = s.Y * p.x0
    o.position[2] = s.Z * p.z0
    o.velocity[0] = s.V_X * p.lateral_speed
    o.velocity[1] = s.V_Y * p.lateral_speed
    o.velocity[2] = s.V_Z * p.vertical_speed
    o.tip_height = s.Q * p.z0
    o.tip_rate = s.V_Q * p.vertical_speed
    o.friction[0] = s.F_x * p.lateral_force
    o.friction[1] = s.F_y * p.lateral_force
    o.friction_bound = s.F_max * p.lateral_force
    o.normal_force = s.N * p.normal_force
    o.contact = s.contact
    o.stuck = 1.0 if s.V_X == 0.0 and s.V_Y == 0.0 and s.contact != 0.0 else 0.0
