"""State at the start: at rest, in static contact with the tip at its setpoint, or free; docs/theory.md (21), (27)."""

from typing import Any

from ..contact.friction import bound_of_load
from ..core.errors import ParameterError
from ..parts.dispatch import surface
from ..parts.part import Tree
from .statics import place_sample, static_load

Voltage = tuple[float, float, float]


def rest(parameters: Tree, p: Any, s: Any, m: Any) -> Voltage:
    """Static contact at X = Y = 0 with the tip at its setpoint, as after an approach.

    Parameters
    ----------
    parameters : InstrumentParameters
    p, s : records of Constants and State
        s is zero, and written.
    m : block of the instrument

    Returns
    -------
    (x, y, z) : floats [V]
        Drive that holds it: U_z = eta_z^2 Z + N/mu; with f_z drawn at random (paper's plant), whose mean is zero,
        (eta_z^2 + eta_c^2/mu) Q.

    Raises
    ------
    ParameterError
        If the cantilever would have to pull harder than adhesion holds.
    """
    z_r = parameters.reference.z_r / parameters.scales.z0
    load = static_load(p, z_r)
    if load <= -p.L_s:
        raise ParameterError(
            f"the tip does not touch the sample at rest: at the setpoint z_r = {z_r:g} z0 the static load is "
            f"{load:.4g} m_c w0^2 z0 (cantilever.a = {p.a:g} z0) and must be > {-p.L_s:.4g}, the pull-off load: "
            f"lower cantilever.a, or raise cantilever.W or reference.z_r"
        )
    s.Q = z_r
    s.contact = 1.0
    s.N = load
    s.F_max = bound_of_load(p.f_s, 1.0, load / p.L_s)
    place_sample(s, p, m)
    drawn = parameters.plant.kind == "paper" and parameters.plant.z == "uniform"
    u_z = (p.eta_z * p.eta_z + p.eta_c * p.eta_c / p.mu) * z_r if drawn else p.eta_z * p.eta_z * s.Z + load / p.mu
    return 0.0, 0.0, float(u_z) / p.gain_z


def start_free(parameters: Tree, p: Any, s: Any, m: Any) -> Voltage:
    """The cantilever at rest, the sample plant.gap below it; arguments as in `rest`."""
    s.Q = p.a - p.w / (p.eta_c * p.eta_c)
    s.Z = s.Q - surface(0.0, 0.0, m).height - parameters.plant.gap / p.z0
    return 0.0, 0.0, float(p.eta_z * p.eta_z * s.Z) / p.gain_z
