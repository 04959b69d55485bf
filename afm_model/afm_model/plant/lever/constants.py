"""Constants of the plant `lever` from its parameters, SI units: docs/lever.md (1) to (7), (14), (15), (26)."""

import math
from typing import Annotated, Any

import numpy as np

from ...cantilever import beam
from ...compiled.records import Array, Record, Vector
from ...contact.contact_table import transitions
from ...core import registry
from ...core.elementary import cbrt, cosh, sincos, sinh, square, tan, tanh
from ...core.random_numbers import THERMAL, key_of
from ...parts.part import Numbers, Tree
from .apex import BOLTZMANN, apex_constants
from .loss import loss_constants

_MODES = ("mode_w2", "mode_inverse", "mode_push", "mode_base", "kick", "mode_y", "mode_z", "mode_shown")
_OfModes = Annotated[Array, (beam.MODES,)]


PARTS = 4
"""Of a step in which the tip moves fast at the sample."""


class Constants(Record):
    half: Annotated[float, "s"]  # half the integration step
    h: Annotated[float, "s"]
    swift: float  # change of the indentation in a step, in its unit, from which on steps are made in parts
    settling: float  # so many steps: 2 e-folds of the fastest mode of bending
    counts: float  # 1 for a whole step, PARTS for a part of one: random numbers are counted in these
    x0: Annotated[float, "m"]  # scales of the sample's coordinates
    z0: Annotated[float, "m"]
    rise: float  # height per place in these, z0/x0
    metres: Annotated[Vector, "m/V"]  # static displacement of the scanner per volt
    w2: Annotated[Vector, "1/s^2"]  # of the scanner: frequency of the scheme squared
    inverse: Vector  # 1/D, D = 1 + h xi w + h^2 w^2 / 4
    push: Annotated[Vector, "m/s/N"]  # change of the rate at mid-step per force
    mode_w2: _OfModes  # the same of the bending modes
    mode_inverse: _OfModes
    mode_push: _OfModes
    mode_base: Annotated[_OfModes, "s"]  # change of the rate at mid-step per acceleration of the base
    kick: Annotated[_OfModes, "m/s"]  # rms change of the rate by the thermal force of a step
    mode_y: Annotated[_OfModes, "1"]  # how the tip moves with a mode, which is counted by the deflection of the end
    mode_z: Annotated[_OfModes, "1"]
    k: Annotated[float, "N/m"]  # spring constant of the cantilever
    base_y: float  # how the base moves when it is excited across
    base_z: float
    pushed_y: float  # way of the tip that follows an exciting force over k without delay
    pushed_z: float
    pushed_shown: float  # and what the photodiode shows of it
    mode_shown: Annotated[_OfModes, "1"]  # deflection that the photodiode shows per deflection of the end in a mode
    twist_w2: float  # as mode_w2, ..., of torsion, which is counted by the twist of the end
    twist_inverse: float
    twist_push: Annotated[float, "rad/s/N"]  # by a force on the tip along x
    twist_kick: Annotated[float, "rad/s"]
    twist_base: Annotated[float, "rad s/m"]  # change of the rate per acceleration of the tip by a base that rocks
    base_twist: Annotated[float, "rad/m"]  # angle of the base per way of the tip
    thermal: float  # 1.0 if there is thermal noise
    thermal_key: int  # of its random numbers
    arm: Annotated[float, "m"]  # from the neutral axis down to the tip
    rest_x: Annotated[float, "m/N"]  # compliance of the tip that follows a force without delay
    rest_yy: Annotated[float, "m/N"]
    rest_yz: Annotated[float, "m/N"]
    rest_zz: Annotated[float, "m/N"]
    shown_y: Annotated[float, "m/N"]  # deflection shown, without delay, per force on the tip
    shown_z: Annotated[float, "m/N"]
    twist_x: Annotated[float, "rad/N"]  # twist that follows without delay, per force on the tip along x
    force_per_twist: Annotated[float, "N/rad"]  # lateral force that the photodiode shows
    W_x: Annotated[float, "m/N"]  # displacement of the sample against the tip at mid-step, per force on the tip
    W_yy: Annotated[float, "m/N"]
    W_yz: Annotated[float, "m/N"]
    W_zz: Annotated[float, "m/N"]
    a: Annotated[float, "m"]  # height of the free tip
    R: Annotated[float, "m"]  # tip radius
    unit_force: float  # of the contact, see afm_model.contact.maugis
    unit_radius: float
    unit_indentation: float
    hamaker_radius: Annotated[float, "J m"]  # Hamaker constant times R
    stiffness_per_radius: Annotated[float, "Pa"]  # 8 G*
    friction_per_area: Annotated[float, "Pa"]  # tau
    strengthening: Annotated[float, "1"]  # growth of friction with the velocity
    slow_way: Annotated[float, "m"]  # velocity from which it grows, times h
    rows: int  # of the contact's table
    row_first: float  # its transition parameter, and the step from row to row
    row_step: float
    transition: float  # transition parameter on a flat sample
    lattice: float  # 1.0 on a sample of atoms
    lattice_period: Annotated[float, "m"]
    lattice_force: Annotated[float, "N"]  # largest force of the potential along a row of minima
    lattice_slope: Annotated[float, "1"]  # and how much more per load
    apex_compliance: Annotated[float, "m/N"]  # of the tip's apex
    apex_hold: Annotated[
        float, "N/m"
    ]  # of its inertia and damping at mid-step: force per way from the start of the step
    apex_carry: Annotated[float, "N s/m"]  # and per rate there
    apex_noise: Annotated[float, "N"]  # rms thermal force in a step
    apex_key: int
    viscosity: Annotated[float, "Pa s"]  # of the contact
    relaxation: Annotated[float, "s"]  # of its force
    viscous_noise: Annotated[float, "N m/s"]  # mean square of its thermal force in a step, over force per rate
    viscous_key: int
    bridge: float  # 1.0 if there can be a liquid bridge
    bridge_pull: Annotated[float, "N"]  # its force as tip and sample touch
    bridge_spread2: Annotated[float, "m^2"]  # its volume over pi R
    bridge_begin: Annotated[float, "m"]  # distance at which it forms, and breaks
    bridge_end: Annotated[float, "m"]


def rows(parameters: Tree) -> Any:
    """Transition parameters of the rows of the contact's table: all that the sample can make of the plant's own."""
    plant = parameters.plant
    lam = plant.transition
    if lam == 0.0:
        return transitions(0.0, 0.0)
    low, high = contrast(parameters)
    return transitions(lam * low, lam * high)


def contrast(parameters: Tree) -> tuple[float, float]:
    """Least and largest (w^2 R_e / K^2)^(1/3) on the sample, over that on a flat one of the plant's own materials."""
    of_sample = registry.find("sample", parameters.sample.kind).contrast
    if of_sample is not None:
        low, high = of_sample(parameters)
    else:
        bend = sample_curvature(parameters) * parameters.plant.cantilever_numbers.tip_radius
        # One that is sharper than the tip is refused at the start.
        low, high = (1.0 / (1.0 + bend), 1.0 / (1.0 - bend)) if bend < 1.0 else (1.0, 1.0)
    return cbrt(low), cbrt(high)


def sample_curvature(parameters: Tree) -> float:
    """Largest |mean curvature| of the sample [1/m]."""
    scales = parameters.scales
    curvature: float = registry.find("sample", parameters.sample.kind).curvature(parameters)
    return curvature * scales.z0 / square(scales.x0)


def _oscillator(frequency: float, damping: float, h: float) -> tuple[float, float]:
    """(w^2, 1/D) of a damped oscillator in the implicit midpoint rule, docs/lever.md (15): its frequency is met."""
    w = 2.0 / h * tan(math.pi * frequency * h)
    return w * w, 1.0 / (1.0 + h * damping * w + 0.25 * h * h * w * w)


def _ringing(frequency: float, damping: float, h: float) -> tuple[float, float]:
    """The same with the decay met as well, docs/lever.md (26): where a step is a good part of a period."""
    turn, root = 2.0 * math.pi * frequency * h, math.sqrt(abs(damping * damping - 1.0))
    if damping < 1.0:
        # The hyperbolic tangents of two conjugate numbers, their product and sum.
        s, c = sincos(turn * root)
        a = turn * damping
        below = cosh(a) + c
        w2, loss = square(2.0 / h) * (square(sinh(a)) + s * s) / square(below), 4.0 / h * sinh(a) / below
    else:
        fast, slow = (2.0 / h * tanh(0.5 * turn * (damping + sign * root)) for sign in (-1.0, 1.0))
        w2, loss = fast * slow, fast + slow
    return w2, 1.0 / (1.0 + 0.5 * h * loss + 0.25 * h * h * w2)


def kick(w2: float, inverse: float, compliance: float, temperature: float, h: float) -> float:
    """Rms change of the rate at mid-step by the thermal force on an oscillator of the scheme, docs/lever.md (28).

    Parameters
    ----------
    w2, inverse : float
        Frequency of the scheme squared [1/s^2], and 1/D.
    compliance : float
        Static displacement per force (or angle per torque).
    temperature : float [K]
    h : float [s]
    """
    loss = (1.0 / inverse - 1.0 - 0.25 * h * h * w2) * 2.0 / h
    return 0.5 * h * inverse * math.sqrt(2.0 * loss * BOLTZMANN * temperature * w2 * compliance / h)


def fine_constants(parameters: Tree) -> Array:
    """Constants of a part of a step, as the numbers of their record."""
    found: Any = np.zeros(1, Constants.dtype)
    values = lever_constants(parameters, PARTS)
    for name in Constants.names:
        found[name] = values[name]
    return np.asarray(found.view(np.float64))


def lever_constants(parameters: Tree, parts: int = 1) -> Numbers:
    """Values of Constants, for a step that is divided into so many."""
    plant, piezo, scales = parameters.plant, parameters.piezo, parameters.scales
    c, s, pair = plant.cantilever_numbers, plant.scanner_numbers, plant.pair_numbers
    h = plant.dt / parts
    half = 0.5 * h
    units = plant.contact_units
    # The tip stands below the neutral axis by `arm`; y runs along the cantilever, towards its end.
    arm, L = c.tip_height + 0.5 * c.thickness, c.length
    sin, cos = sincos(plant.tilt)

    def lab(along: float, across: float) -> tuple[float, float]:
        """(y, z) of a vector given along the cantilever and across it."""
        return cos * along + sin * across, cos * across - sin * along

    modes = {name: [0.0] * beam.MODES for name in _MODES}
    for i, mode in enumerate(beam.MODE[: plant.modes]):
        w2, inverse = _oscillator(c.f0 * mode.frequency, 0.5 / c.Q, h)
        modes["mode_w2"][i], modes["mode_inverse"][i] = w2, inverse
        modes["mode_push"][i] = half * w2 * inverse * mode.compliance / c.k
        modes["mode_base"][i] = half * inverse * mode.base
        modes["kick"][i] = kick(w2, inverse, mode.compliance / c.k, plant.temperature, h)
        modes["mode_y"][i], modes["mode_z"][i] = lab(arm * mode.slope / L, 1.0)
        modes["mode_shown"][i] = 2.0 / 3.0 * mode.slope
    base_y, base_z = lab(0.0, 1.0)
    rest = beam.rest(plant.modes)
    pushed_y, pushed_z = lab(arm / L * rest.turn_by_force, rest.end_by_force)
    # Of torsion the first mode moves, or nothing; bending sideways never does.
    twist = dict.fromkeys(("twist_w2", "twist_inverse", "twist_push", "twist_kick", "twist_base"), 0.0)
    share = 0.0
    if plant.torsion == "moving":
        share = beam.TWIST_COMPLIANCE
        w2, inverse = _ringing(c.f_torsion, 0.5 / c.Q_torsion, h)
        compliance = share / c.k_torsion
        twist = {
            "twist_w2": w2,
            "twist_inverse": inverse,
            "twist_push": half * w2 * inverse * compliance * arm,
            "twist_kick": kick(w2, inverse, compliance, plant.temperature, h),
            "twist_base": half * inverse * beam.TWIST_BASE / arm,
        }
    # What follows without delay, along the cantilever (1) and across it (2); then in the laboratory's y and z.
    r11, r12, r22 = (
        square(arm / L) * rest.turn_by_couple / c.k,
        arm / L * rest.turn_by_force / c.k,
        rest.end_by_force / c.k,
    )
    static = {
        "rest_x": square(arm) * (1.0 - share) / c.k_torsion + 1.0 / c.k_in_plane,
        "rest_yy": cos * cos * r11 + 2.0 * cos * sin * r12 + sin * sin * r22,
        "rest_yz": (cos * cos - sin * sin) * r12 + cos * sin * (r22 - r11),
        "rest_zz": cos * cos * r22 - 2.0 * cos * sin * r12 + sin * sin * r11,
    }
    # Force in the laboratory, split along the cantilever and across it, turns the end.
    by_couple, by_force = arm / L * rest.turn_by_couple / c.k, rest.turn_by_force / c.k
    static["twist_x"] = arm * (1.0 - share) / c.k_torsion
    static["shown_y"], static["shown_z"] = (2.0 / 3.0 * part for part in lab(by_couple, by_force))
    scanner: dict[str, list[float]] = {"w2": [], "inverse": [], "push": []}
    for axis in "xyz":
        w2, inverse = _oscillator(getattr(s, f"f_{axis}"), 0.5 / s.Q, h)
        scanner["w2"].append(w2)
        scanner["inverse"].append(inverse)
        scanner["push"].append(half * w2 * inverse / getattr(s, f"k_{axis}"))
    total = {f"W_{name}": static[f"rest_{name}"] for name in ("x", "yy", "yz", "zz")}
    for name, push in zip(("x", "yy", "zz"), scanner["push"], strict=True):
        total[f"W_{name}"] += half * push
    total["W_x"] += half * twist["twist_push"] * arm
    for push, y, z in zip(modes["mode_push"], modes["mode_y"], modes["mode_z"], strict=True):
        total["W_yy"] += half * push * y * y
        total["W_yz"] += half * push * y * z
        total["W_zz"] += half * push * z * z
    table = rows(parameters)
    numbers = {
        "half": half,
        "h": h,
        # With heat a tip in contact swings by a quarter of a unit.
        "swift": 1.0 if plant.temperature > 0.0 else 0.1,
        "settling": math.ceil(2.0 * c.Q / (math.pi * c.f0 * beam.MODE[plant.modes - 1].frequency * plant.dt)),
        "counts": float(parts),
        "x0": scales.x0,
        "z0": scales.z0,
        "rise": scales.z0 / scales.x0,
        "metres": piezo.sensitivities,
        "thermal": float(plant.temperature > 0.0),
        "thermal_key": key_of(plant.seed, THERMAL),
        "arm": arm,
        "k": c.k,
        "base_y": base_y,
        "base_z": base_z,
        "pushed_y": pushed_y,
        "pushed_z": pushed_z,
        "pushed_shown": 2.0 / 3.0 * rest.turn_by_force,
        "base_twist": 1.0 / arm,
        "force_per_twist": c.k_torsion / arm,
        "a": parameters.cantilever.a,
        "R": c.tip_radius,
        "unit_force": units.force,
        "unit_radius": units.radius,
        "unit_indentation": units.indentation,
        "hamaker_radius": pair.hamaker * c.tip_radius,
        "stiffness_per_radius": 8.0 * pair.G,
        "friction_per_area": pair.tau,
        "strengthening": plant.strengthening,
        "slow_way": plant.slow * h,
        "rows": len(table),
        "row_first": table[0],
        "row_step": table[1] - table[0] if len(table) > 1 else 1.0,
        "transition": plant.transition,
    }
    others = {**apex_constants(parameters, h), **loss_constants(parameters, h)}
    return numbers | scanner | modes | twist | static | total | others
