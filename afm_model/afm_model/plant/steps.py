"""Which integration steps resolve a plant, and which setpoints it can rest at; docs/theory.md (27), (42)."""

import math
from typing import TYPE_CHECKING

from .. import registry
from ..contact.jkr import radius_at_zero_load, stiffness_of_u, u_of_load
from ..jit import plain

if TYPE_CHECKING:
    from ..parameters import InstrumentParameters


def static_load_newton(parameters: "InstrumentParameters") -> float:
    """Load on the tip at rest at the setpoint [N]; negative: the cantilever pulls."""
    cantilever = parameters.cantilever
    stiffness = cantilever.m_c * (2.0 * math.pi * cantilever.f_c) ** 2
    return stiffness * (parameters.reference.z_r - cantilever.a) + cantilever.W


def require_contact_at_rest(parameters: "InstrumentParameters") -> None:
    """Raise ValueError if the cantilever pulls harder at the setpoint than adhesion holds."""
    limit = -parameters.contact.pull_off_force
    load = static_load_newton(parameters)
    if load <= limit:
        raise ValueError(
            f"the tip does not touch the sample at rest: the static load is {load:.4g} N and must be > "
            f"{limit:.4g} N, the pull-off load (reference.z_r = {parameters.reference.z_r:g} m, cantilever.a = "
            f"{parameters.cantilever.a:g} m, cantilever.W = {parameters.cantilever.W:g} N): lower a or raise the others"
        )


def require_resolved_step(parameters: "InstrumentParameters", *, with_contact: bool) -> None:
    """Raise ValueError if plant.dt does not resolve the fastest resonance."""
    limit = stable_step(parameters, with_contact=with_contact)
    if parameters.plant.dt > limit:
        raise ValueError(
            f"plant.dt = {parameters.plant.dt:g} s is not allowed: it must be <= {limit:.3g} s, where the explicit "
            f"step still resolves the fastest resonance of scanner, cantilever and contact"
        )


def stable_step(parameters: "InstrumentParameters", *, with_contact: bool | None = None) -> float:
    """Largest stable step [s]: 2 / omega of the fastest resonance of the scanner and, compliant, of the contact.

    That of the contact, docs/theory.md (42), is taken at the static load of the setpoint (zero load if it pulls), where
    the sample makes the contact stiffest. A run that presses much harder than at rest needs a smaller step.

    Parameters
    ----------
    parameters : InstrumentParameters
    with_contact : bool, optional
        Whether the contact is a spring of its own; by default, as plant.kind has it.
    """
    if with_contact is None:
        with_contact = parameters.plant.kind != "paper"
    scanner, cantilever = parameters.scanner, parameters.cantilever
    if with_contact:
        # The sum bounds the larger eigenvalue of sample and tip from above.
        mass = cantilever.m_c / (1.0 + 1.0 / scanner.mass_ratio)
        alone = 2.0 * math.pi * max(cantilever.f_c, scanner.f_z)
        vertical = math.sqrt(_stiffest_contact(parameters) / mass + alone**2)
    else:
        # Tip and sample move as one mass, on both springs.
        vertical = 2.0 * math.pi * math.hypot(scanner.f_z, cantilever.f_c / math.sqrt(scanner.mass_ratio))
    return 2.0 / max(vertical, 2.0 * math.pi * max(scanner.f_x, scanner.f_y))


def _stiffest_contact(parameters: "InstrumentParameters") -> float:
    """Contact stiffness [N/m] under the static load of the setpoint, where the sample makes it largest."""
    contact = parameters.contact
    u = plain(u_of_load)(max(static_load_newton(parameters), 0.0) / contact.pull_off_force)
    a0_squared = radius_at_zero_load(contact.R, contact.K, contact.surface_energy) ** 2
    curvature = registry.find("sample", parameters.sample.kind).curvature(parameters)
    rho = 1.0 / (1.0 - curvature * contact.R / parameters.scales.z0)
    return float(plain(stiffness_of_u)(u) * contact.pull_off_force * contact.R / a0_squared * rho ** (2.0 / 3.0))
