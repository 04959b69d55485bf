"""The loop along z that all sampled laws share: the sample follows what the tip rides on. docs/laws.md (2.1)."""

import math
from typing import Annotated, Any

from ..core.jit import kernel
from ..core.records import Record
from ..parts.part import Tree
from .scanner import drive_between, free_axes, place_poles, position, predict, send


class HeightConstants(Record):
    k_z1: float  # feedback on height and rate of the sample
    k_z2: float
    alpha_h: float  # gains of the filter
    beta_h: float
    eta_c: Annotated[float, "w0"]  # the cantilever
    mu: Annotated[float, "1"]
    w: float  # load
    a: Annotated[float, "z0"]


class HeightState(Record):
    surface: Annotated[float, "z0"]  # what the tip is above the sample's stage, Q - Z
    surface_rate: Annotated[float, "z0 w0"]


def height_values(parameters: Tree) -> dict[str, float]:
    """Values of HeightConstants.

    The time constant of feedback and filter is one control period, and never below that of the cantilever's resonance:
    what is faster than that is the contact ringing, not the surface.
    """
    scales, cantilever = parameters.scales, parameters.cantilever
    axis = free_axes(parameters)[2]
    eta_c = 2.0 * math.pi * cantilever.f_c / scales.w0
    pole = math.exp(-axis.hold / max(axis.hold, 1.0 / eta_c))
    k_z1, k_z2 = place_poles(axis, pole, pole)
    return {
        "k_z1": k_z1,
        "k_z2": k_z2,
        # Critically damped filter of second order with the same pole.
        "alpha_h": 1.0 - pole**2,
        "beta_h": (1.0 - pole) ** 2,
        "eta_c": eta_c,
        "mu": parameters.scanner.mass_ratio,
        "w": cantilever.W / (cantilever.m_c * scales.w0**2 * scales.z0),
        "a": cantilever.a / scales.z0,
    }


@kernel
def control_height(y: Any, u: Any, p: Any, s: Any) -> None:
    """Write the drive of z: the tip to its setpoint, the surface going on as it has."""
    tip = p.a + y.deflection / p.length[2]
    above = tip - position(y, p, 2)
    if s.started == 0.0:
        s.surface, s.surface_rate = above, 0.0
    else:
        s.surface += p.hold * s.surface_rate
        miss = above - s.surface
        s.surface += p.alpha_h * miss
        s.surface_rate += p.beta_h * miss / p.hold
    # The cantilever presses on the scanner through the contact.
    load = (p.w + p.eta_c * p.eta_c * (tip - p.a)) / p.mu
    now = y.reference_position[2] / p.length[2] - s.surface - p.ahead * s.surface_rate
    then = now - p.hold * s.surface_rate
    z, z_rate = predict(y, p, s, 2, load)
    wanted = drive_between(p, 2, now, -s.surface_rate, then, -s.surface_rate) + load
    send(u, p, s, 2, wanted - p.k_z1 * (z - now) - p.k_z2 * (z_rate + s.surface_rate))
