"""Which integration steps resolve a plant, and which setpoints it can rest at; docs/theory.md (27), (42)."""

import math

from ..compiled.jit import plain
from ..contact.jkr import radius_at_zero_load, stiffness_of_u, u_of_load
from ..core import registry
from ..core.elementary import cbrt, hypot, square
from ..parts.part import RIGID, SPRING, Tree

STABLE = 2.0
"""Angle [rad] by which the vertical resonance may turn in a step, docs/theory.md (42); beyond, it grows."""
ACCURATE = 0.5
"""The same for a result that is right, measured in docs/numerics.md."""
ACCURATE_LATERAL = 0.1
"""The same for a lateral resonance of the scanner: rests begin and end with a step, and the shortest turn it by 0.2."""


def contact_of(parameters: Tree) -> str:
    """Return how tip and sample touch, as the plant declares it; empty: it does not."""
    return str(registry.find("plant", parameters.plant.kind).contact)


def static_load_newton(parameters: Tree) -> float:
    """Load on the tip at rest at the setpoint [N]; negative: the cantilever pulls."""
    cantilever = parameters.cantilever
    return _spring(cantilever.m_c, cantilever.f_c) * (parameters.reference.z_r - cantilever.a) + cantilever.W


def reachable_load(parameters: Tree) -> float:
    """Largest load that the run can hold the tip at [N], at least 0.

    It is that of the setpoint or, with piezo.limit, that of the full drive along z, on the top of the sample either
    way. Without piezo.limit the drive knows no bound: see `resolved_load`.
    """
    cantilever, piezo = parameters.cantilever, parameters.piezo
    k_c = _spring(cantilever.m_c, cantilever.f_c)
    k_z = _spring(parameters.scanner.mass_ratio * cantilever.m_c, parameters.scanner.f_z)
    height = registry.find("sample", parameters.sample.kind).height(parameters)
    # Scanner and cantilever are two springs in a row, and the contact is stiff.
    share = k_z / (k_c + k_z)
    load = static_load_newton(parameters) + share * k_c * height
    if piezo.limit > 0.0:
        travel = piezo.sensitivity_z * piezo.limit
        load = max(load, share * (k_c * (travel + height - cantilever.a) + cantilever.W))
    return max(load, 0.0)


def require_contact_at_rest(parameters: Tree) -> None:
    """Raise ValueError if the cantilever pulls harder at the setpoint than adhesion holds."""
    limit = -parameters.contact.pull_off_force
    load = static_load_newton(parameters)
    if load <= limit:
        raise ValueError(
            f"the tip does not touch the sample at rest: the static load is {load:.4g} N and must be > "
            f"{limit:.4g} N, the pull-off load (reference.z_r = {parameters.reference.z_r:g} m, cantilever.a = "
            f"{parameters.cantilever.a:g} m, cantilever.W = {parameters.cantilever.W:g} N): lower a or raise the others"
        )


def require_resolved_step(parameters: Tree, *, with_contact: bool) -> None:
    """Raise ValueError if plant.dt is too long for a result that is right, at the loads within reach."""
    load = reachable_load(parameters) if with_contact else None
    fastest = {"vertical": _vertical(parameters, load), "lateral": _lateral(parameters)}
    longest = {"vertical": ACCURATE / fastest["vertical"], "lateral": ACCURATE_LATERAL / fastest["lateral"]}
    axis = min(longest, key=longest.__getitem__)
    if parameters.plant.dt <= longest[axis]:
        return
    if axis == "lateral":
        what = "faster lateral resonance of the scanner"
    elif load is None:
        what = "vertical resonance of scanner and cantilever"
    else:
        what = (
            f"resonance of the contact under {load:.3g} N, the largest load that setpoint, sample and piezo.limit allow"
        )
    raise ValueError(
        f"plant.dt = {parameters.plant.dt:g} s is not allowed: it must be <= {longest[axis]:.3g} s for the {what}, "
        f"{fastest[axis] / (2.0 * math.pi):.4g} Hz; a longer step gives wrong results"
    )


def resolved_load(parameters: Tree) -> float:
    """Largest load [N] under which plant.dt is accurate.

    It is infinite for a plant whose contact is not declared to be a spring of the parameters `contact`.
    """
    if contact_of(parameters) != SPRING:
        return math.inf
    fastest = ACCURATE / parameters.plant.dt
    low, high = 0.0, parameters.contact.pull_off_force
    if _vertical(parameters, low) > fastest:
        return 0.0
    while _vertical(parameters, high) < fastest and high < 1e9:
        high *= 2.0
    # The stiffness grows with the load; fifty halvings are beyond any round-off.
    for _ in range(50):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if _vertical(parameters, middle) > fastest else (middle, high)
    return low


def stable_step(parameters: Tree, *, with_contact: bool | None = None) -> float:
    """Largest stable step [s]: 2 / omega of the fastest resonance of the scanner and, compliant, of the contact.

    That of the contact, docs/theory.md (42), is taken at the static load of the setpoint (zero load if it pulls), where
    the sample makes the contact stiffest. Results are right with much shorter ones: see `require_resolved_step`.

    Parameters
    ----------
    parameters : InstrumentParameters
    with_contact : bool, optional
        Whether the contact is a separate spring; by default unless the plant declares that it is rigid.
    """
    if with_contact is None:
        with_contact = contact_of(parameters) != RIGID
    load = max(static_load_newton(parameters), 0.0) if with_contact else None
    return STABLE / max(_vertical(parameters, load), _lateral(parameters))


def _spring(mass: float, frequency: float) -> float:
    """Stiffness [N/m]."""
    return mass * square(2.0 * math.pi * frequency)


def _lateral(parameters: Tree) -> float:
    """Faster lateral resonance of the scanner [rad/s]."""
    return 2.0 * math.pi * max(parameters.scanner.f_x, parameters.scanner.f_y)


def _vertical(parameters: Tree, load: float | None) -> float:
    """Fastest vertical resonance [rad/s], of the contact under a load [N]; None: tip and sample move as one mass."""
    scanner, cantilever = parameters.scanner, parameters.cantilever
    if load is None:
        # On both springs.
        return 2.0 * math.pi * hypot(scanner.f_z, cantilever.f_c / math.sqrt(scanner.mass_ratio))
    # The sum bounds the larger eigenvalue of sample and tip from above.
    mass = cantilever.m_c / (1.0 + 1.0 / scanner.mass_ratio)
    alone = 2.0 * math.pi * max(cantilever.f_c, scanner.f_z)
    return math.sqrt(_stiffest_contact(parameters, load) / mass + square(alone))


def _stiffest_contact(parameters: Tree, load: float) -> float:
    """Contact stiffness [N/m] under a load [N], where the sample makes it largest."""
    contact = parameters.contact
    u = plain(u_of_load)(load / contact.pull_off_force)
    a0_squared = square(radius_at_zero_load(contact.R, contact.K, contact.surface_energy))
    curvature = registry.find("sample", parameters.sample.kind).curvature(parameters)
    rho = 1.0 / (1.0 - curvature * contact.R / parameters.scales.z0)
    return float(plain(stiffness_of_u)(u) * contact.pull_off_force * contact.R / a0_squared * square(cbrt(rho)))
