"""The nominal plant: what a drive does to the scanner, set-valued friction included; the load on the tip, from the
deflection.
"""

from typing import TYPE_CHECKING, Any

from afm_model.contact import friction_impulse
from afm_model.parts import Block, Measurement, kernel, numbers_at, pointer_at, routine
from afm_model.sample import paper_surface

from .constants import ANSWERS, LEARNED, MEAN, SLOPE_X, SLOPE_Y, VALUE, Constants
from .map import read_map

if TYPE_CHECKING:
    from .state import State

REACH = 0.7
"""Phase of the shortest wave up to which a slope is continued."""
NEAR_BY = 0.01
"""Step of a derivative along the sample [x0]."""
_TURNED = 10.0
"""Drive for the travel over friction, up to which friction turns the drive."""


@kernel
def fade(d_x: float, d_y: float, p: Constants) -> tuple[float, float]:
    """Phase of the shortest wave in a step d, and the part of what is followed that has given way to the mean there."""
    phase = p.wave_number * (abs(d_x) + abs(d_y))
    far = max(phase - REACH, 0.0)
    far *= 1.0 + 0.5 * far
    return phase, far / (1.0 + far)


@kernel
def faded(f: Any, d_x: float, d_y: float, phase: float, gone: float) -> float:
    """A quantity of the sample a step d beyond where it is known, from its value, slopes and mean.

    It is continued along its slope as far as its shortest wave allows; farther on its mean is what is most likely.
    """
    if phase <= REACH:
        return f[VALUE] + f[SLOPE_X] * d_x + f[SLOPE_Y] * d_y
    value = f[VALUE] + (f[SLOPE_X] * d_x + f[SLOPE_Y] * d_y) * REACH / phase
    return value + gone * (f[MEAN] - value)


@kernel
def beyond(f: Any, d_x: float, d_y: float, p: Constants) -> float:
    """As `faded`, for one quantity."""
    return faded(f, d_x, d_y, *fade(d_x, d_y, p))


@kernel
def look_at_known(x: float, y: float, p: Constants, s: "State") -> None:
    """Evaluate height as the z sensor sees it, curvature and strength of friction of the given sample at (x, y)."""
    # State and Constants have the fields of Surface and of the sample's constants.
    known: Any = (s, p)
    paper_surface(x, y, known[0], known[1], 0)
    s.height += s.zero_of_height


@routine
def look(x: float, y: float, p: Constants, s: "State") -> None:
    """Height, curvature and strength of friction of the sample at (x, y)."""
    s.mapped = s.mapped_H = 0.0
    d_x, d_y = x - s.at_x, y - s.at_y
    phase, gone = fade(d_x, d_y, p)
    s.here = faded(s.ratio, d_x, d_y, phase, gone)
    if s.unknown == 0:
        look_at_known(x, y, p, s)
        return
    s.curvature = 0.0
    s.strength = 1.0
    s.height = faded(s.H, d_x, d_y, phase, gone)
    if p.surface == LEARNED:
        read_map(x, y, p, s)


@kernel
def nominal_bound(load: float, p: Constants, s: "State") -> float:
    """Bound of friction of the contact as it is believed to be, at the place looked at."""
    return s.strength * (p.f_0 + s.curvature * (p.f_1 + p.f_2 * s.curvature)) * (1.0 + p.f_load * (load - p.load_0))


@kernel
def bound_at(x: float, y: float, z: float, p: Constants, s: "State") -> float:
    """Bound of friction with the scanner there, the contact at rest; the place is looked at."""
    look(x, y, p, s)
    tip = z + s.height - p.delta - p.delta_curvature * s.curvature
    return s.here * nominal_bound(p.w + p.eta_c2 * (tip - p.a), p, s)


@kernel
def drive_in_force(axis: int, y: Measurement, p: Constants, s: "State") -> float:
    """At a measurement."""
    return y.drive[axis] / p.volts[axis] - s.zero_of_drive[axis]


@kernel
def held_along_z(apart: float, p: Constants) -> float:
    """What the drive of z has to hold of load and cantilever, with the tip so far above the scanner."""
    return p.of_both * (p.w + p.eta_c2 * (apart - p.a))


@kernel
def friction_turns_drive(axis: int, p: Constants, s: "State") -> bool:
    """Whether friction turns the drive by steps: on a long way it is a small part of the drive for the travel."""
    return p.stiffness[axis] * s.reach <= _TURNED * p.f_0


@kernel
def stretched(axis: int, q: float, s: "State") -> float:
    """How far the spring of an axis is stretched at the place q."""
    return q - s.unstretched[axis]


@kernel
def left_at_rest(axis: int, u: float, q: float, p: Constants, s: "State") -> float:
    """What the drive leaves at rest: for friction, or along z for the load."""
    return u - s.slow[axis] - (p.stiffness[axis] + s.softer[axis]) * q + s.softer[axis] * s.unstretched[axis]


@kernel
def balance(axis: int, u: float, q: float, p: Constants, s: "State") -> float:
    """The same for friction in units of the lateral signal."""
    return left_at_rest(axis, u, q, p, s) / s.gain_of[axis]


@kernel
def left_over(axis: int, q: float, v: float, u: float, p: Constants, s: "State") -> float:
    """Mean force on an axis since the last measurement that the prediction from there did not contain."""
    g_0, g_1 = p.Gamma_hold[axis, 0], p.Gamma_hold[axis, 1]
    off, off_rate = s.expected[axis, 0] - q, s.expected[axis, 1] - v
    return (g_0 * off + g_1 * off_rate) / (g_0 * g_0 + g_1 * g_1) + u - s.expected[axis, 2]


@kernel
def steps(p: Constants, s: "State") -> bool:
    """Return whether the reference is followed by a step in each control period, after which the tip rests.

    In packets friction that is wrong by some percent throws a tip that slides on for a control period and a delay. A
    tip that rests most of the time is stopped by friction, however strong it is.
    """
    return p.in_steps != 0 and (s.distrust > 0.0 or (s.unknown != 0 and p.surface != LEARNED))


@kernel
def as_one_mass(p_x: float, p_y: float, unlike: float, radius: float) -> tuple[float, float]:
    """The momentum p turned to where friction lies near rest, for axes of unequal masses.

    Friction lies along the velocity that is left, n (p - j), and not along p: to first order in what the velocities per
    momentum n differ by, unlike = 4 (n_x - n_y) / (n_x + n_y). Without it the tip would slide off the balance of forces
    by n_y / n_x.
    """
    size2, most2 = p_x * p_x + p_y * p_y, radius * radius
    if size2 <= most2:
        return p_x, p_y
    # 2 (s - 1)/(3 s + 1) is 1 - 1/sqrt(s) for s near one.
    turn = unlike * (size2 - most2) * p_x * p_y / ((3.0 * size2 + most2) * size2)
    return p_x + turn * p_y, p_y - turn * p_x


@routine
def move(u_x: float, u_y: float, u_z: float, h: float, steps: int, p: Constants, s: "State") -> None:
    """Move the scanner on by so many steps of length h [1/w0] under a constant drive.

    Half drift, kick, half drift as in docs/theory.md (37) to (41). Along z tip and sample move as one. The impulse of
    friction on x and y goes to `s.impulse`.
    """
    half = 0.5 * h
    d_x, d_y, d_z = half * p.damping[0], half * p.damping[1], half * p.damping[2]
    # Friction is in units of the lateral signal: a scanner that a unit of it pushes gamma times is lighter.
    m_x, m_y = 1.0 / s.gain_of[0], 1.0 / s.gain_of[1]
    n_x, n_y = s.gain_of[0] / (1.0 + d_x), s.gain_of[1] / (1.0 + d_y)
    unlike = 4.0 * (n_x - n_y) / (n_x + n_y) if s.gain_of[0] != s.gain_of[1] else 0.0
    n_z = 1.0 / (1.0 + d_z)
    sum_x = sum_y = 0.0
    X, Y, Z, V_X, V_Y, V_Z = s.X, s.Y, s.Z, s.V_X, s.V_Y, s.V_Z
    for _ in range(steps):
        X += half * V_X
        Y += half * V_Y
        Z += half * V_Z
        f = bound_at(X, Y, Z, p, s)
        p_x = m_x * ((1.0 - d_x) * V_X + h * left_at_rest(0, u_x, X, p, s))
        p_y = m_y * ((1.0 - d_y) * V_Y + h * left_at_rest(1, u_y, Y, p, s))
        q_x, q_y = as_one_mass(p_x, p_y, unlike, h * f) if unlike != 0.0 else (p_x, p_y)
        j_x, j_y, stick = friction_impulse(q_x, q_y, V_X, V_Y, n_x, n_y, h * f)
        sum_x += j_x
        sum_y += j_y
        V_X = 0.0 if stick else (p_x - j_x) * n_x
        V_Y = 0.0 if stick else (p_y - j_y) * n_y
        held = held_along_z(s.height - p.delta, p)
        V_Z = n_z * ((1.0 - d_z) * V_Z + h * (left_at_rest(2, u_z, Z, p, s) - held))
        X += half * V_X
        Y += half * V_Y
        Z += half * V_Z
    s.X, s.Y, s.Z, s.V_X, s.V_Y, s.V_Z = X, Y, Z, V_X, V_Y, V_Z
    s.impulse[0], s.impulse[1] = sum_x, sum_y


@kernel
def predict(u_x: float, u_y: float, u_z: float, p: Constants, s: "State") -> None:
    """Move the scanner on by a slot under a constant drive."""
    move(u_x, u_y, u_z, p.dt, p.steps, p, s)


@kernel
def take_load(y: Measurement, p: Constants, s: "State") -> None:
    """Put height of and load on the tip at a measurement into the state, with the scanner as it is there."""
    s.Q = p.a + y.deflection / p.z0
    s.load = p.w + p.eta_c2 * (s.Q - p.a)
    # Where the scanner accelerates along z by more than following the surface takes, the tip does too: at rest, and
    # after a correction.
    held = held_along_z(s.Q - s.Z, p)
    rise = left_at_rest(2, drive_in_force(2, y, p, s), s.Z, p, s) - p.damping[2] * s.V_Z - held
    phase_rate = p.wave_number * (abs(s.V_X) + abs(s.V_Y))
    follows = p.height * phase_rate * phase_rate
    s.rise = rise - min(max(rise, -follows), follows)
    s.load += s.rise


@kernel
def drives_of(kept: int, p: Constants, s: "State") -> Block:
    """Return the drives of the answer kept at this place, x, y, z of one slot after the other."""
    count = 3 * p.longest
    return pointer_at(numbers_at(s.sent, ANSWERS * count), kept * count)


@kernel
def drive_of_period(k: int, j: int, axis: int, y: Measurement, p: Constants, s: "State") -> float:
    """Return the drive that was in force in slot j after measurement k, as the measurement y reports it."""
    kept = max(y.drive_sequence, 0) % ANSWERS
    if y.drive_sequence < 0 or s.answered[kept] != y.drive_sequence:
        return drive_in_force(axis, y, p, s)
    at = max(0, min((k - y.drive_sequence) * p.slots + j, s.lengths[kept] - 1))
    return drives_of(kept, p, s)[3 * at + axis]
