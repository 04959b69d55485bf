"""Mean force of a tip over a cycle, as a table over nearest distance and amplitude; docs/dynamic.md (54).

The tip moves along the normal by z = u + A (1 + cos theta), u being its nearest distance. The force is that of the
contact of the plant `lever`, friction left out. Table of three numbers, each times a power of A by which they hardly
depend on it where A is large against the range of the force:

    sqrt(A) F_0, sqrt(A) F_1,  F_0 = 1/(2 pi) int F dtheta, F_1 = 1/pi int F cos theta dtheta
    A sqrt(A) a_1,             a_1 = 1/pi int a sin^2 theta dtheta, a the radius of the contact

The viscous force eta a d(delta)/dt has the first harmonic -i eta omega A a_1 exp(i theta). A fourth number is the
energy that friction takes in a cycle: the tip of a tilted cantilever moves along it as it moves up and down.
"""

import math
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...compiled.jit import kernel, plain, routine
from ...compiled.records import Block
from ...contact.contact_table import table
from ...core import registry
from ...parts.part import Tree
from ...parts.signals import Surface
from ..lever.constants import Constants as LeverConstants
from ..lever.constants import lever_constants, rows, sample_curvature
from ..lever.contact import normal, place_frame
from ..lever.state import State as LeverState

_Array = NDArray[np.float64]
LEAST, LARGEST = 1e-9, 144e-9
"""Amplitudes in the table [m]. Below it goes on in proportion to the amplitude, beyond as for a large one."""
AMPLITUDES = 45
DEEP, FAR = 240, 200
"""Intervals of the nearest distance in contact, up to the table's depth, and out of it."""
SOFTEN = 0.5e-9
"""Out of contact the table has even steps of x / (x + SOFTEN) [m], x counted from where the contact ends."""
VALUES = 4
_HEAD = 4
NODES = DEEP + FAR + 2
ROW = _HEAD + 2 * VALUES * AMPLITUDES * NODES
"""Numbers of a row: work of adhesion and modulus over those of the plant, indentation at the end of contact [m], depth
[m]; then of each node and amplitude the four values and their slopes over the node. First the nodes in contact, from
its end inwards, then those out of it, from its end outwards.
"""
DEPTH_SHARE = 0.25
"""The table ends where F_1 is this share of k A, for every amplitude: far beyond where the average holds."""
CURVATURES, CURVED_ROWS = 0.2, 12
"""Largest step of 1 + curvature times tip radius from row to row, up to so many rows."""
LEAST_WIDENED = 0.1
"""Least of that: a valley ten times as blunt as the tip is sharp."""
MATERIALS = 16
_ROOT_LEAST, _ROOT_STEP = math.sqrt(LEAST), (math.sqrt(LARGEST) - math.sqrt(LEAST)) / (AMPLITUDES - 1)
_INVERSE_PI = 1.0 / math.pi
_PANELS = 8
_WAY = 200
"""Parts of the way into the contact for its friction."""
_GAUSS = (
    (-0.9061798459386640, 0.2369268850561891),
    (-0.5384693101056831, 0.4786286704993665),
    (0.0, 0.5688888888888889),
    (0.5384693101056831, 0.4786286704993665),
    (0.9061798459386640, 0.2369268850561891),
)


@lru_cache
def _nodes() -> tuple[_Array, _Array, _Array, _Array]:
    """Places from 0 to 1 and weights: of the part of half a cycle in contact, dense at its end, where the radius of the
    contact may grow like a root; of that out of it, dense where the tip is nearest.
    """
    x = np.array([(i + 0.5 + 0.5 * x) / _PANELS for i in range(_PANELS) for x, _ in _GAUSS])
    weight = np.array([w for _ in range(_PANELS) for _, w in _GAUSS]) * 0.5 / _PANELS
    return x * (2.0 - x), 2.0 * (1.0 - x) * weight, x * x * x, 3.0 * x * x * weight


@kernel
def _rub(u: float, along: float, pulls: _Array, f: Any, p: Any, t: Block) -> float:
    """Friction as the tip comes from off the sample to the distance u [m] and goes back, moving by `along` times that
    way along the surface: it sticks by the contact's lateral stiffness, or slides.

    Writes into pulls (_WAY + 1,) its force as one along the normal, mean of both ways [N], at even steps from the end
    of the contact to u. Returns the energy that it takes [J].
    """
    energy = moved = old = 0.0
    z = -f.end
    pulls[:] = 0.0
    for i in range(1, 2 * _WAY + 1):
        j = min(i, 2 * _WAY - i)
        place = -f.end + (u + f.end) * j / _WAY
        step = along * (place - z)
        z = place
        _, _, bound, _, a = normal(-z, f, p, t, 0)
        spring = p.stiffness_per_radius * a
        moved += step
        pull = min(max(spring * moved, -bound), bound)
        if spring > 0.0:
            moved = pull / spring
        energy += 0.5 * (old + pull) * step
        old = pull
        pulls[j] -= along * pull * (1.0 if j == _WAY else 0.5)
    return energy


@kernel
def _mean(
    u: float, A: float, pulls: _Array, v: _Array, of_v: _Array, s: _Array, of_s: _Array, f: Any, p: Any, t: Block
) -> tuple[float, float, float]:
    """F_0 [N], F_1 [N], a_1 [m] of the cycle whose nearest distance is u [m].

    Over sin(theta / 2), theta from the nearest place on, the weight has no pole but at the far end. Contact ends at
    sin = edge; out of it 1 - sin = (1 - edge) (1 - s)^2 takes that pole away.
    """
    mean = first = radius = 0.0
    depth = -f.end - u
    edge = math.sqrt(min(max(0.5 * depth / A, 0.0), 1.0))
    if edge > 0.0:
        for i in range(v.size):
            sine = edge * v[i]
            rise = 2.0 * sine * sine
            N, _, _, _, a = normal(-u - A * rise, f, p, t, 0)
            weight = 2.0 * edge * of_v[i] / math.sqrt(1.0 - sine * sine)
            mean += weight * N
            radius += weight * a * rise * (2.0 - rise)
            place = (depth - A * rise) / depth * _WAY
            k = max(min(int(place), _WAY - 1), 0)
            N += pulls[k] + (place - k) * (pulls[k + 1] - pulls[k])
            first += weight * N * (rise - 1.0)
    if edge < 1.0:
        for i in range(s.size):
            left = (1.0 - edge) * (1.0 - s[i]) * (1.0 - s[i])
            sine = 1.0 - left
            rise = 2.0 * sine * sine
            N, _, _, _, _ = normal(-u - A * rise, f, p, t, 0)
            weight = 4.0 * math.sqrt((1.0 - edge) / (1.0 + sine)) * of_s[i]
            mean += weight * N
            first += weight * N * (rise - 1.0)
    return mean * _INVERSE_PI, 2.0 * first * _INVERSE_PI, 2.0 * radius * _INVERSE_PI


@routine
def _fill(
    found: _Array,
    along: float,
    depth: float,
    v: _Array,
    of_v: _Array,
    s: _Array,
    of_s: _Array,
    f: Any,
    p: Any,
    t: Block,
) -> None:
    """Write the scaled values into found (amplitudes, nodes, values)."""
    pulls = np.zeros(_WAY + 1)
    for i in range(NODES):
        if i <= DEEP:
            x = -depth * i / DEEP
        else:
            part = (i - DEEP - 1.0) / (FAR + 1.0)
            x = SOFTEN * part / (1.0 - part)
        u = x - f.end
        energy = _rub(u, along, pulls, f, p, t) if x < 0.0 else 0.0
        for j in range(AMPLITUDES):
            root = _ROOT_LEAST + j * _ROOT_STEP
            A = root * root
            mean, first, radius = _mean(u, A, pulls, v, of_v, s, of_s, f, p, t)
            found[j, i, 0], found[j, i, 1], found[j, i, 2] = root * mean, root * first, root * A * radius
            found[j, i, 3] = energy


@routine
def _depth(k: float, v: _Array, of_v: _Array, s: _Array, of_s: _Array, f: Any, p: Any, t: Block) -> float:
    """Indentation, from the end of the contact on, at which F_1 is beyond DEPTH_SHARE k A for every amplitude [m]."""
    depth = 0.1e-9
    pulls = np.zeros(_WAY + 1)
    for j in range(AMPLITUDES):
        root = _ROOT_LEAST + j * _ROOT_STEP
        A = root * root
        while depth < 2.0 * LARGEST:
            _, first, _ = _mean(-depth - f.end, A, pulls, v, of_v, s, of_s, f, p, t)
            if -first > DEPTH_SHARE * k * A:
                break
            depth *= 1.1
    return depth


def materials(parameters: Tree) -> tuple[tuple[float, float], ...]:
    """Work of adhesion and modulus of each material of the sample over those of the plant; none: they are not few."""
    part = registry.find("sample", parameters.sample.kind)
    if part.materials is not None:
        return tuple(dict.fromkeys(part.materials(parameters)))
    return () if part.contrast is not None else ((1.0, 1.0),)


def curvatures(parameters: Tree) -> _Array:
    """Of each row of a material: 1 + curvature times tip radius."""
    bend = sample_curvature(parameters) * parameters.plant.cantilever_numbers.tip_radius
    if bend < 1e-6:
        return np.ones(1)
    low, high = max(1.0 - bend, LEAST_WIDENED), 1.0 + bend
    return np.linspace(low, high, min(2 + math.floor((high - low) / CURVATURES), CURVED_ROWS))


def force_table(parameters: Tree) -> _Array:
    """Rows (materials times curvatures, ROW)."""
    widened = [float(each) for each in curvatures(parameters)]
    return np.stack([_row(parameters, *each, c) for each in materials(parameters) for c in widened])


def _row(parameters: Tree, adhesion: float, modulus: float, widened: float) -> _Array:
    plant = parameters.plant
    p: Any = np.zeros(1, LeverConstants.dtype).view(np.recarray)[0]
    for name, value in lever_constants(parameters).items():
        p[name] = value
    f: Any = np.zeros(1, LeverState.dtype).view(np.recarray)[0]
    h: Any = np.zeros(1, Surface.dtype).view(np.recarray)[0]
    h.adhesion, h.modulus, h.strength = adhesion, modulus, 1.0
    h.curvature = (widened - 1.0) / (p.rise / p.x0 * p.R)
    t = table(plant.contact, rows(parameters)).ravel()
    p.viscosity = p.bridge = 0.0
    p.stiffness_per_radius *= modulus
    plain(place_frame)(h, p, f, t, 0)
    nodes = _nodes()
    depth = float(_depth(plant.cantilever_numbers.k, *nodes, f, p, t))
    found = np.empty((AMPLITUDES, NODES, VALUES))
    _fill(found, abs(p.mode_y[0] / p.mode_z[0]), depth, *nodes, f, p, t)
    # Attraction is in proportion to the effective radius: so scaled, rows are nearly alike.
    found *= widened
    both = np.empty((AMPLITUDES, NODES, VALUES, 2))
    both[..., 0] = found
    for part in (slice(0, DEEP + 1), slice(DEEP + 1, NODES)):
        both[:, part, :, 1] = _slopes(found[:, part])
    # Both in one step of memory.
    return np.concatenate([[adhesion, modulus, float(f.end), depth], both.transpose(1, 0, 3, 2).ravel()])


def _slopes(values: _Array) -> _Array:
    """Change over a node (amplitudes, nodes, values), by differences of second order."""
    found = np.empty_like(values)
    found[:, 1:-1] = 0.5 * (values[:, 2:] - values[:, :-2])
    found[:, 0] = -1.5 * values[:, 0] + 2.0 * values[:, 1] - 0.5 * values[:, 2]
    found[:, -1] = 1.5 * values[:, -1] - 2.0 * values[:, -2] + 0.5 * values[:, -3]
    return found


@kernel
def look_up(u: float, A: float, t: Block, at: int) -> tuple[float, float, float, float]:
    """(F_0, F_1 / A, a_1, E / (pi A^2)) [N], [N/m], [m], [N/m] at nearest distance u and amplitude A [m], of the row
    that begins at t[at]; E is the energy that friction takes in a cycle.

    Deeper than the table as at its end.
    """
    x = u + t[at + 2]
    if x <= 0.0:
        place = min(-x / t[at + 3], 1.0) * DEEP
        i = min(int(place), DEEP - 1)
        f = place - i
    else:
        place = x / (x + SOFTEN) * (FAR + 1.0)
        i = min(int(place), FAR - 1)
        f = place - i
        i += DEEP + 1
    root = math.sqrt(max(A, LEAST))
    q = min((root - _ROOT_LEAST) / _ROOT_STEP, AMPLITUDES - 1.0)
    j = min(max(int(q) - 1, 0), AMPLITUDES - 4)
    q -= j
    # Lagrange through four amplitudes, cubic through values and slopes at two nodes.
    r1, r2, r3 = q - 1.0, q - 2.0, q - 3.0
    w0, w1, w2, w3 = -r1 * r2 * r3 / 6.0, 0.5 * q * r2 * r3, -0.5 * q * r1 * r3, q * r1 * r2 / 6.0
    g = 1.0 - f
    h00, h10 = g * g * (1.0 + 2.0 * f), f * g * g
    h01, h11 = f * f * (1.0 + 2.0 * g), -f * f * g
    F0 = F1 = a1 = 0.0
    k = at + _HEAD + (i * AMPLITUDES + j) * 2 * VALUES
    n = k + AMPLITUDES * 2 * VALUES
    for w in (w0, w1, w2, w3):
        F0 += w * (h00 * t[k] + h10 * t[k + 4] + h01 * t[n] + h11 * t[n + 4])
        F1 += w * (h00 * t[k + 1] + h10 * t[k + 5] + h01 * t[n + 1] + h11 * t[n + 5])
        a1 += w * (h00 * t[k + 2] + h10 * t[k + 6] + h01 * t[n + 2] + h11 * t[n + 6])
        k += 2 * VALUES
        n += 2 * VALUES
    # It does not depend on the amplitude.
    E = h00 * t[k - 5] + h10 * t[k - 1] + h01 * t[n - 5] + h11 * t[n - 1]
    per = 1.0 / root
    inside = per * per
    return F0 * per, F1 * per * inside, a1 * per * inside, max(E, 0.0) * inside * inside * _INVERSE_PI
