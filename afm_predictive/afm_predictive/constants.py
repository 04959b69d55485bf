"""Constants of the friction-predicting law, from the parameters of the controller."""

import math
from typing import Annotated

import numpy as np

from afm_model.contact import bound_of_load, indentation_of_u, radius_at_zero_load, u_of_load
from afm_model.parts import LONGEST_HORIZON, Array, Numbers, Record, Tree, Vector, cbrt, exp, hypot, square

from .gains import gains, grid, observer_gains, transition

INTERVALS = 512
"""Fine intervals that the law can look ahead."""
SLOTS = LONGEST_HORIZON + 1
"""Drives of one answer, those in force before it included."""
ANSWERS = 128
"""Last answers that are kept. Of an older one nothing is left but its last drive, which the measurement reports."""
LONG = 4.0
"""Longest time for which a drive is held before a start warns [1/w0]."""
LONGEST_DELAY = 30
"""Control periods."""
SURFACES = {"known": 0, "observed": 1, "learned": 2}
KNOWN, OBSERVED, LEARNED = range(3)
UNEXPLAINED = 3
"""Numbers of an axis that the model does not explain: gamma, b, c."""
VALUE, SLOPE_X, SLOPE_Y, OF_VALUE, OF_BOTH, OF_SLOPE, WAY_X, WAY_Y, MEAN, GONE, JUMPED = range(11)
"""What is followed of height and friction: value and slopes; covariances of value and slope; direction of the last
step; mean, phase gone in it; one: the last measurement was off."""
FOLLOWED = JUMPED + 1
AT_X, AT_Y, SPEED, RATIO, SLOPE = range(5)
"""States of the filter of positions alone: observer.py."""
NODES = 128
"""Of the map of the surface, map.py."""
SPACING = 0.5
"""Between two nodes, over the inverse of the largest wave number."""
LENGTH = 2.0
"""Correlation length, over the same: the variance of the shortest wave is 0.14 of that of long ones, of half of it
3e-4."""
FLOOR = 2e-4
"""Noise of a height [z0] and of a ratio, from a load that is not quite static."""
FIRST = (0.3, 1.0, 0.03)
"""Standard deviations of what the model does not explain, at the start: gamma, b [w0^2 x0], c [w0^2]."""
FIRST_Z = (0.0, 0.003, 0.03)
"""The same along z [w0^2 z0]. With positions alone the stiffness alone is estimated there, and in packets nothing."""
_WALK = (1e-3, 2e-2, 5e-4)
"""Random walks of these in one time unit."""
_WALK_Z = (0.0, 1e-5, 1e-4)
"""The same along z."""
_SLOWLY = (0.02, 0.002, 0.005)
"""Parts of these random walks that positions alone may follow: their noise would move the copy of the plant."""
_SLOWLY_Z = len(_SLOWLY) * (0.1,)
"""The same along z."""
_WAVE = 63.0
"""Time in which the tip runs over a wave of the surface [1/w0]: 6 ms at the paper's reference."""
_UNEVEN = 3e-5
"""Rms of a ratio about its mean over a known surface, whose correlation lasts a quarter of a wave: from the part
that is not static of the load that the deflection shows."""
_ASTRAY = 1.3e-4
"""Rms change of the position across the motion in a time unit, that the copy does not know [x0]."""
_UNSEEN = 10.0
"""Acceleration along z that is not known, over a surface that is not: what z is estimated wrong by is taken for it."""
_TAKEN, _TAKEN_MEASURED = 3.0, 1.0
"""Error that is taken back in a response at most, in radians of the shortest wave; the same of an estimated one."""
_BUMPS, _LESS_BUMPS = 0.8, 0.55
"""Ripple of friction that positions alone are corrected with, over that of the largest wave, friction being nominal;
the same where a map or the last places give a part of it."""
_SOON, _SOON_MEASURED = 3.0, 4.5
"""Where it takes so long until the drive that answers a measurement is over, friction is sought from lower on [1/w0];
the same with positions alone, where a map that is written meanwhile is worse for it."""
_STEP = 0.125
"""Longest step of the prediction [1/w0], which starts again at each measurement."""
_STEP_COPY = 0.05
"""The same of the copy of the plant of positions alone, which goes on from step to step."""
_STEP_PHASE = 0.25
"""And the phase of the fastest resonance in a step."""


class Constants(Record):
    hold: float  # control period [1/w0]
    slot: float  # time between two drives of an answer
    slots: int  # slots in a control period
    delay: int  # slots until the drive of an answer is in force, as configured
    count: int  # drives in an answer, without the reserve
    reserve: int  # drives of the reserve
    longest: int  # drives of an answer with all that, those in force before it included
    fine: int  # fine intervals in a slot
    horizon: int  # fine intervals in the horizon
    back: int  # fine intervals in a response, over which z is asked for beside the reference; 0: it is not
    tau: float  # length of a fine interval
    frees: int  # one: a tip that rests behind the reference is freed
    taken: float  # radians of the shortest wave by which an error is taken back at most
    turn: float  # lambda of the direction of friction
    in_steps: int  # one: what is not known is followed in steps
    ring: float  # part of a change of the load by which it still rings after a slot
    steps: int  # of the prediction in a slot
    dt: float
    steps_copy: int  # and of the copy of the plant
    dt_copy: float
    surface: int
    identified: int
    adapts: int  # what the model does not explain is estimated, with these deviations at the start
    first: Annotated[Array, (3, UNEXPLAINED)]
    walk: Annotated[Array, (3, UNEXPLAINED)]  # variance by which that grows in a control period
    of_both: float  # part of a force on tip and scanner, along z, that the scanner feels
    w: float
    a: float
    eta_c2: float
    delta: float  # indentation at the load of the setpoint zero, flat sample [z0]
    delta_load: float  # its change with the load
    delta_curvature: float  # and with the curvature
    f_0: float  # bound of friction at that load: f_0 + f_1 kappa + f_2 kappa^2
    f_1: float
    f_2: float
    f_load: float  # its relative change with the load
    load_0: float
    beta: float  # sample
    k_x: float
    k_y: float
    height: float  # largest height and wave number assumed
    wave_number: float
    ripple: float  # of the strength, from that curvature
    measured: int
    # Over a known surface, over one that is not:
    bumps: Annotated[Array, (2,)]  # ripple of the ratio over the surface as it is known
    bumps_left: float  # part of it that positions alone are corrected with, friction being nominal
    corner: Vector  # where a straight reference turns back; 0: not known
    position_noise: float
    z_noise: float  # the same along z
    force_noise: float  # of friction measured along x
    uneven: Annotated[Array, (2,)]  # rms of the ratio about its mean, in a control period
    astray: float  # the same in a control period
    wander: Annotated[Array, (2,)]  # rms change of the ratio in a control period
    least_bound: float
    height_noise: float
    ratio_noise: float
    x0: float
    z0: float
    w0: float
    lateral_force: float
    normal_force: float
    stiffness: Vector
    damping: Vector
    volts: Vector  # per unit of U
    K: Annotated[Array, (3, 2)]
    Phi: Annotated[Array, (3, 2, 2)]
    Gamma: Annotated[Array, (3, 2)]
    G: Annotated[Array, (3, INTERVALS, 2)]
    Phi_hold: Annotated[Array, (3, 2, 2)]  # of the free axes over a control period
    Gamma_hold: Annotated[Array, (3, 2)]
    L: Annotated[Array, (2, 2)]  # of the observer along z, in the same way
    free: Annotated[Array, (2, 2)]  # a control period of the free scanner, mean of x and y: transition, and of a drive
    of_drive: Annotated[Array, (2,)]


def longest(parameters: Tree) -> int:
    """Return the number of drives of an answer, those in force before it included."""
    law = parameters.law
    return int(law.packet * (law.delay_ticks + 1 + law.spare) + law.reserve)


def first_deviations(law: Tree) -> list[list[float]]:
    """Standard deviations, at the start, of what the model does not explain of each axis; 0: it is believed."""
    full = law.feedback == "full"
    given = law.lateral_gain, law.slow_force, law.stiffness
    of_c = 0.0 if law.packet > 1 else FIRST_Z[2]
    sizes = FIRST, FIRST, FIRST_Z if full else (0.0, 0.0, of_c)
    return [[size if way == "estimated" else 0.0 for size, way in zip(each, given, strict=True)] for each in sizes]


def least_bound(law: Tree, hold: float) -> float:
    """Bound of friction over the nominal one from which on it is sought: from below.

    Friction half as strong as given would throw the tip off, in a packet, or with long holds and delays, before any
    drive that answers a measurement can stop it.
    """
    if law.friction == "nominal":
        return 1.0
    soon = (law.delay_ticks + 1) * hold < (_SOON_MEASURED if law.feedback == "measured" else _SOON)
    return 0.75 if law.packet == 1 and soon else 0.45


def values(parameters: Tree) -> Numbers:
    """Values of Constants."""
    law, scanner, cantilever, contact = parameters.law, parameters.scanner, parameters.cantilever, parameters.contact
    scales, piezo, sample = parameters.scales, parameters.piezo, parameters.sample
    w0, x0, z0 = scales.w0, scales.x0, scales.z0
    mu, m_c = scanner.mass_ratio, cantilever.m_c
    lateral_force, normal_force = mu * m_c * square(w0) * x0, m_c * square(w0) * z0
    measured = law.feedback == "measured"
    hold = law.period * w0
    slots, spare = law.packet, law.spare
    slot = hold / slots
    division = grid(slot, law.response * w0, slots)
    eta = {axis: 2.0 * math.pi * getattr(scanner, f"f_{axis}") / w0 for axis in "xyz"}
    xi = {axis: getattr(scanner, f"xi_{axis}") for axis in "xyz"}
    eta_c = 2.0 * math.pi * cantilever.f_c / w0
    w, a = cantilever.W / normal_force, cantilever.a / z0
    # Sample and tip move as one along z: the contact is stiff.
    both = 1.0 + 1.0 / mu
    stiffness = np.array([square(eta["x"]), square(eta["y"]), (square(eta["z"]) + square(eta_c) / mu) / both])
    damping = np.array([2.0 * xi[axis] * eta[axis] for axis in "xyz"])
    damping[2] = (damping[2] + 2.0 * cantilever.xi_c * eta_c / mu) / both
    of_axis = [gains(stiffness[i], damping[i], slot, division) for i in range(3)]
    G = np.zeros((3, INTERVALS, 2))
    n = division.fine * division.holds
    for i in range(3):
        G[i, :n] = of_axis[i].G
    fastest = _STEP_PHASE / math.sqrt(stiffness.max())
    steps, steps_copy = (math.ceil(slot / min(each, fastest) - 1e-9) for each in (_STEP, _STEP_COPY))
    # Contact at the load of a resting cantilever, and how it changes with curvature and load.
    r = contact.R / z0
    L_s = contact.pull_off_force / normal_force
    delta_0 = square(radius_at_zero_load(contact.R, contact.K, contact.surface_energy)) / contact.R / z0
    f_s = contact.friction_at_pull_off / lateral_force
    load_0 = w - square(eta_c) * a

    def indentation(kappa: float, load: float) -> float:
        rho = 1.0 / (1.0 + kappa * r)
        return delta_0 * cbrt(rho) * indentation_of_u(u_of_load(load / (L_s * rho)))

    def bound(kappa: float, load: float) -> float:
        rho = 1.0 / (1.0 + kappa * r)
        return bound_of_load(f_s, rho, load / (L_s * rho))

    small = 0.01 / r
    f_0, up, down = bound(0.0, load_0), bound(small, load_0), bound(-small, load_0)
    identified = law.friction == "identified"
    dn = 1e-3 * L_s
    delta_load = (indentation(0.0, load_0 + dn) - indentation(0.0, load_0 - dn)) / (2.0 * dn)
    height_noise = hypot(FLOOR, law.deflection_noise / z0 if measured else 0.0)
    ratio_noise = hypot(FLOOR, law.force_noise / lateral_force / f_0 if measured else 0.0)
    ripple = abs(up - down) / (2.0 * small * f_0) * square(law.wave_number * x0) * law.height / z0
    noise = law.position_noise / x0
    disturbance = FLOOR * square(eta_c) / mu
    L = [
        observer_gains(stiffness[2], damping[2], hold, factor * disturbance, law.position_noise / z0)
        for factor in (1.0, _UNSEEN)
    ]
    first = first_deviations(law)
    slowly = (_SLOWLY, _SLOWLY, _SLOWLY_Z) if measured else 1.0
    of_hold = [transition(stiffness[i], damping[i], hold) for i in range(3)]
    free, of_drive = transition(stiffness[:2].mean(), damping[:2].mean(), hold)
    return {
        "hold": hold,
        "slot": slot,
        "slots": slots,
        "delay": law.delay_ticks * slots,
        "count": slots * (1 + spare),
        "reserve": law.reserve,
        "longest": longest(parameters),
        "fine": division.fine,
        "horizon": n,
        # In packets the next drive follows soon, and in a long hold z cannot follow.
        "back": round(division.response / (slot / division.fine)) * (slots == 1 and slot <= LONG),
        "tau": slot / division.fine,
        # In packets positions alone do not tell rest.
        "frees": slot <= LONG and not (measured and slots > 1),
        "taken": _TAKEN_MEASURED if measured else _TAKEN,
        "turn": 1.0 - exp(-slot / max(division.response, slot)),
        "in_steps": slots > 1 and not measured,
        "ring": exp(-slot * contact.zeta_n / math.sqrt(delta_load)),
        "steps": steps,
        "dt": slot / steps,
        "steps_copy": steps_copy,
        "dt_copy": slot / steps_copy,
        "surface": SURFACES[law.surface],
        # Friction that is believed in leaves no signal to compare with.
        "adapts": identified and any(map(any, first)),
        "first": first,
        "walk": np.square((_WALK, _WALK, _WALK_Z)) * np.square(slowly) * hold,
        "identified": identified,
        "of_both": 1.0 / (mu + 1.0),
        "w": w,
        "a": a,
        "eta_c2": square(eta_c),
        "delta": indentation(0.0, load_0),
        "delta_load": delta_load,
        "delta_curvature": (indentation(small, load_0) - indentation(-small, load_0)) / (2.0 * small),
        "f_0": f_0,
        "f_1": (up - down) / (2.0 * small),
        "f_2": (up - 2.0 * f_0 + down) / (2.0 * square(small)),
        "f_load": (bound(0.0, load_0 + dn) - bound(0.0, load_0 - dn)) / (2.0 * dn * f_0),
        "load_0": load_0,
        "beta": getattr(sample, "beta", 0.0) / z0,
        "k_x": getattr(sample, "k_x", 0.0) * x0,
        "k_y": getattr(sample, "k_y", 0.0) * x0,
        "height": law.height / z0,
        "wave_number": law.wave_number * x0,
        "ripple": ripple,
        "measured": measured,
        "bumps": [0.0, ripple * identified],
        "bumps_left": _BUMPS if slots == 1 and law.surface != "learned" else _LESS_BUMPS,
        "corner": [law.corner_x / x0, law.corner_y / x0, 0.0],
        "position_noise": noise,
        "z_noise": noise * x0 / z0,
        "force_noise": ratio_noise * f_0,
        "uneven": [_UNEVEN, ratio_noise],
        "astray": _ASTRAY * hold,
        "wander": [each * math.sqrt(hold) * identified for each in (_UNEVEN * math.sqrt(8.0 / _WAVE), FLOOR)],
        "least_bound": least_bound(law, hold),
        "height_noise": height_noise,
        "ratio_noise": ratio_noise,
        "L": np.array(L),
        "Phi_hold": np.array([Phi for Phi, _ in of_hold]),
        "Gamma_hold": np.array([Gamma for _, Gamma in of_hold]),
        "free": free,
        "of_drive": of_drive,
        "x0": x0,
        "z0": z0,
        "w0": w0,
        "lateral_force": lateral_force,
        "normal_force": normal_force,
        "stiffness": stiffness,
        "damping": damping,
        # A static displacement is U / eta^2; along z the drive moves sample and tip.
        "volts": np.array(
            [
                x0 / (square(eta["x"]) * piezo.sensitivity_x),
                x0 / (square(eta["y"]) * piezo.sensitivity_y),
                both * z0 / (square(eta["z"]) * piezo.sensitivity_z),
            ]
        ),
        "K": np.array([each.K for each in of_axis]),
        "Phi": np.array([each.Phi for each in of_axis]),
        "Gamma": np.array([each.Gamma for each in of_axis]),
        "G": G,
    }
