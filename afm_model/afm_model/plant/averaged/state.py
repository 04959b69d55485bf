"""Constants and state of the plant `averaged`; docs/dynamic.md (54), (55)."""

import math
from typing import Annotated

import numpy as np

from ...cantilever import beam
from ...compiled.records import Array, Record, Vector
from ...core.elementary import sincos
from ...parts.part import Numbers, Tree
from ..lever.constants import lever_constants
from .force_table import curvatures, materials

_OfModes = Annotated[Array, (beam.MODES,)]


class Constants(Record):
    half: Annotated[float, "s"]  # half the integration step
    h: Annotated[float, "s"]
    x0: Annotated[float, "m"]  # scales of the sample's coordinates
    z0: Annotated[float, "m"]
    rise: float  # height per place in these, z0/x0
    metres: Annotated[Vector, "m/V"]  # of the scanner, as of the plant lever
    w2: Annotated[Vector, "1/s^2"]
    inverse: Vector
    push: Annotated[Vector, "m/s/N"]
    Q: float
    w: Annotated[_OfModes, "rad/s"]  # of the bending modes: resonance
    compliance: Annotated[_OfModes, "m/N"]  # static deflection per force
    by_base: _OfModes  # force by a base that moves
    mode_y: _OfModes  # way of the tip, and of what is shown, as in the plant lever
    mode_z: _OfModes
    mode_shown: _OfModes
    k: Annotated[float, "N/m"]
    base_y: float  # way of the tip with the base, and what follows a force on the tip without delay
    base_z: float
    pushed_y: float
    pushed_z: float
    pushed_shown: float
    static_y: Annotated[float, "m/N"]  # static deflection that is shown per force, and way of the tip along z
    static_z: Annotated[float, "m/N"]
    tip_z: Annotated[float, "m/N"]
    a: Annotated[float, "m"]  # height of the free tip
    R: Annotated[float, "m"]
    viscosity: Annotated[float, "Pa s"]
    K: Annotated[float, "Pa"]
    pull: Annotated[float, "N"]  # largest attraction, 2 pi w R
    of_materials: int  # rows of the table: of so many materials, each of so many curvatures
    of_curvatures: int
    curvature_first: float  # 1 + curvature times radius of the first, and the step from row to row
    curvature_step: float


class State(Record):
    X: float  # scanner [m], [m/s]
    V_X: float
    Y: float
    V_Y: float
    Z: float
    V_Z: float
    a_re: Annotated[float, "m"]  # deflection of the end in its first mode: Re(a exp(i theta)), theta that of the drive
    a_im: Annotated[float, "m"]
    tip: Annotated[float, "m"]  # deflection of the tip, upwards, with that of the base
    tip_rate: Annotated[float, "m/s"]
    shown: Annotated[float, "m"]  # deflection that the photodiode shows
    F_0: Annotated[float, "N"]  # mean force of the sample on the tip, along the normal, over a cycle
    F_re: Annotated[float, "N"]  # its first harmonic, in phase with the motion of the tip
    F_im: Annotated[float, "N"]
    nearest: Annotated[float, "m"]  # least distance of tip and sample in a cycle, negative in contact
    amplitude: Annotated[float, "m"]  # of the tip along the normal
    touching: float  # 1.0 if the tip touches the sample in a cycle
    outside: float  # 1.0 where the motion is no oscillation that changes little in a cycle


class Ledger(Record):
    """What follows from the excitation, made again when that changes, and the energy taken since the start."""

    known: float  # 1.0 if the rest has been made
    amplitude: Annotated[float, "m"]  # of which excitation
    angular_frequency: Annotated[float, "rad/s"]
    phase: Annotated[float, "rad"]
    since: Annotated[float, "s"]
    excited: float
    turn: Annotated[float, "rad/s"]  # angular frequency of the frame
    half_re: float  # factor of a free oscillation in half of a step
    half_im: float
    free_re: Annotated[float, "m"]  # the steady free oscillation
    free_im: Annotated[float, "m"]
    give_re: Annotated[float, "m/s/N"]  # change of a per force at the frequency of the drive
    give_im: Annotated[float, "m/s/N"]
    y_re: Annotated[float, "m"]  # way of the tip besides that by its first mode
    y_im: Annotated[float, "m"]
    z_re: Annotated[float, "m"]
    z_im: Annotated[float, "m"]
    shown_re: Annotated[float, "m"]  # and what is shown besides
    shown_im: Annotated[float, "m"]
    viscous: Annotated[float, "J"]  # energy taken since the start, by viscosity
    rubbed: Annotated[float, "J"]  # by friction
    time_outside: Annotated[float, "s"]  # since the start, in which the state was outside


def averaged_constants(parameters: Tree) -> Numbers:
    """Values of Constants."""
    plant = parameters.plant
    c = plant.cantilever_numbers
    lever = lever_constants(parameters)
    arm, L = lever["arm"], c.length
    sin, cos = sincos(plant.tilt)
    w, compliance, base = ([0.0] * beam.MODES for _ in range(3))
    for i, mode in enumerate(beam.MODE[: plant.modes]):
        w[i], compliance[i], base[i] = 2.0 * math.pi * c.f0 * mode.frequency, mode.compliance / c.k, mode.base
    # Static deflection of end and slope under a force along y and along z of the laboratory.
    along, across = np.array([cos, -sin]), np.array([sin, cos])
    turn = (3.0 * arm / L * along + 1.5 * across) / c.k
    end = (1.5 * arm / L * along + across) / c.k
    tip = -sin * arm / L * turn[1] + cos * end[1]
    names = ["x0", "z0", "rise", "metres", "w2", "inverse", "push", "a", "R", "viscosity", "half", "h"]
    names += ("mode_y", "mode_z", "mode_shown", "k", "base_y", "base_z", "pushed_y", "pushed_z", "pushed_shown")
    rows = curvatures(parameters)
    return {name: lever[name] for name in names} | {
        "Q": c.Q,
        "K": plant.pair_numbers.K,
        "pull": 2.0 * math.pi * plant.pair_numbers.work_of_adhesion * c.tip_radius,
        "w": w,
        "compliance": compliance,
        "by_base": base,
        "static_y": 2.0 / 3.0 * turn[0],
        "static_z": 2.0 / 3.0 * turn[1],
        "tip_z": tip,
        "of_materials": len(materials(parameters)),
        "of_curvatures": len(rows),
        "curvature_first": rows[0],
        "curvature_step": rows[1] - rows[0] if len(rows) > 1 else 1.0,
    }
