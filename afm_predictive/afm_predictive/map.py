"""Height and friction along the line of the reference, as a Gaussian process that every measurement updates.

Cubic B-splines on a ring of nodes; their coefficients are jointly Gaussian with a squared exponential covariance, so
that few measurements make a smooth map and its variance shows where it is known.
"""

import math

from afm_model.parts import kernel, routine, square

from .constants import NODES, SPACING, Constants
from .state import State

NEAR = 0.4
"""What is as far from the line still counts as on it [x0]."""
FADE = 1.5e-5
"""Part of the variance of the prior that returns in a radian of the shortest wave: in a few waves that of one
measurement."""
KNOWN_WELL = 3e-2
"""Variance over that of the prior below which the map counts."""
AGE = 2.0 * math.pi
"""Phase of the shortest wave that the tip must have gone since its first visit before the map counts at a place."""
CONSISTENT, CONSISTENT_MEASURED = 4.0, 8.0
"""Mean square of what a measurement is off the map, over its variance, from which on the map is wrong; the same where
positions alone are measured: there noise makes it about 1 where the map is right, otherwise it is far less."""
FARTHEST = 100.0
"""Largest of these squares that counts."""
FORGET = 0.02
"""Weight of one measurement in that mean."""
JUMP = 6.0
"""Standard deviations beyond which an innovation is another surface."""
NOISE = 1.5e-4
"""Variance of a measurement over that of the prior: 0.15 nm of the default height."""


@kernel
def place(x: float, y: float, s: State) -> tuple[float, bool]:
    """Position along the line in nodes, and whether (x, y) is on it."""
    d_x, d_y = x - s.line_x, y - s.line_y
    along = (d_x * s.line_tx + d_y * s.line_ty) / s.pitch
    off = d_x * s.line_ty - d_y * s.line_tx
    return along, s.pitch > 0.0 and abs(off) < NEAR


@kernel
def weights(f: float) -> tuple[float, float, float, float]:
    """Of the four nodes around the fraction f of an interval."""
    g = 1.0 - f
    return (
        g * g * g / 6.0,
        (4.0 - 6.0 * f * f + 3.0 * f * f * f) / 6.0,
        (4.0 - 6.0 * g * g + 3.0 * g * g * g) / 6.0,
        f * f * f / 6.0,
    )


@kernel
def room(s: State) -> float:
    """By how many nodes the ring is longer than the line."""
    return NODES - 8 - (s.most - s.least)


@kernel
def seen_before(i: int, s: State) -> bool:
    """Return whether the tip was at node i and the three after it a wave of its way ago or longer."""
    for a in range(4):
        if s.way - s.visited[(i + a) % NODES] < AGE * s.pitch / SPACING:
            return False
    return True


@kernel
def read_map(x: float, y: float, p: Constants, s: State) -> None:
    """Put height and strength at (x, y) into the state, if the tip was there before."""
    along, on = place(x, y, s)
    # The ring is longer than the line, or it knows nothing.
    if not on or room(s) < 0.0:
        return
    first = math.floor(along)
    w = weights(along - first)
    i = first - 1
    if not seen_before(i, s):
        return
    H, ratio, variance = 0.0, 0.0, 0.0
    for a in range(4):
        at = (i + a) % NODES
        H += w[a] * s.map_H[at]
        ratio += w[a] * s.map_ratio[at]
        for b in range(a):
            other = (i + b) % NODES
            variance += 2.0 * w[a] * w[b] * s.covariance[max(at, other), min(at, other)]
        variance += w[a] * w[a] * s.covariance[at, at]
    if variance > KNOWN_WELL:
        return
    most = CONSISTENT if p.measured == 0 else CONSISTENT_MEASURED
    if s.misfit_H < most:
        s.height = H
        s.mapped_H = 1.0
    if s.gripped != 0.0 and s.misfit < most:
        s.here = ratio
        s.mapped = 1.0


@kernel
def begin_map(p: Constants, s: State) -> None:
    """Nothing is written."""
    s.written = s.gripped = s.misfit = s.misfit_H = 0.0
    for i in range(NODES):
        s.visited[i] = math.inf
        for j in range(i + 1):
            s.covariance[i, j] = s.prior[NODES + j - i]


@kernel
def draw_line(p: Constants, s: State) -> None:
    """Lay the line along the reference, once it moves."""
    speed = math.sqrt(s.v[0] * s.v[0] + s.v[1] * s.v[1])
    if s.pitch > 0.0 or speed == 0.0 or s.lead[0] != 0.0 or s.lead[1] != 0.0:
        return
    s.line_x, s.line_y = s.p[0], s.p[1]
    s.line_tx, s.line_ty = s.v[0] / speed, s.v[1] / speed
    s.pitch = SPACING / (p.wave_number * (abs(s.line_tx) + abs(s.line_ty)))


@kernel
def raise_map(change: float, s: State) -> None:
    """Friction that holds more than the map allows is stronger everywhere."""
    for i in range(NODES):
        s.map_ratio[i] += change


@kernel
def misfit_of(innovation: float, size: float, variance: float) -> float:
    """Square of an innovation over its variance, which is in units of the prior's of a quantity of this size."""
    return min(square(innovation / size) / variance, FARTHEST)


@routine
def write_map(H: float, ratio: float, p: Constants, s: State) -> None:
    """Kalman update by a height, and a ratio if that is positive, measured where the scanner is."""
    draw_line(p, s)
    if s.pitch == 0.0:
        return
    asked, on = place(s.p[0], s.p[1], s)
    s.least, s.most = min(s.least, asked), max(s.most, asked)
    along, on = place(s.X, s.Y, s)
    if not on:
        return
    step_x, step_y = s.X - s.at_x, s.Y - s.at_y
    step = math.sqrt(step_x * step_x + step_y * step_y)
    s.way += step
    # Height and ratio have one covariance: they are written together, while the tip slips. In the first slip the load
    # is not that at rest.
    if step == 0.0 or (p.identified and ratio == 0.0) or s.way < AGE * s.pitch / SPACING:
        return
    if along < s.least - 1.0 or along > s.most + 1.0:
        return
    # What the tip has passed between two measurements is known by both.
    before, _ = place(s.at_x, s.at_y, s)
    before = min(max(before, s.least), s.most)
    first = math.floor(along)
    w = weights(along - first)
    i = first - 1
    q = SPACING / s.pitch
    # The faster the tip runs over the surface the less its load is that at rest.
    ran = s.V_X * s.V_X + s.V_Y * s.V_Y
    if p.slots > 1:
        # A tip that was thrown may stand still again, on a load that has not come to rest.
        ran = max(ran, square(step / p.hold))
    swing = q * q * ran * p.height * p.f_load / p.ripple
    # A load that a drive has just changed still rings.
    ringing = p.ring * s.rise * p.f_load / p.ripple
    variance = NOISE + swing * swing + ringing * ringing + q * q * s.doubt
    if s.written == 0.0:
        for j in range(NODES):
            s.map_H[j] = H
    if ratio > 0.0 and s.gripped == 0.0:
        s.gripped = 1.0
        for j in range(NODES):
            s.map_ratio[j] = ratio
    s.written = 1.0
    innovation, change = H, ratio
    for j in range(NODES):
        s.gain[j] = 0.0
    for a in range(4):
        at = (i + a) % NODES
        for j in range(at):
            s.gain[j] += w[a] * s.covariance[at, j]
        for j in range(at, NODES):
            s.gain[j] += w[a] * s.covariance[j, at]
    for j in range(math.floor(min(before, along)) - 1, math.floor(max(before, along)) + 3):
        s.visited[j % NODES] = min(s.visited[j % NODES], s.way)
    for a in range(4):
        at = (i + a) % NODES
        variance += w[a] * s.gain[at]
        innovation -= w[a] * s.map_H[at]
        change -= w[a] * s.map_ratio[at]
    s.misfit_H += FORGET * (misfit_of(innovation, p.height, variance) - s.misfit_H)
    if ratio > 0.0:
        s.misfit += FORGET * (misfit_of(change, p.ripple, variance) - s.misfit)
    fade = FADE * step * q
    for j in range(NODES):
        weight, row = s.gain[j] / variance, NODES - j
        s.map_H[j] += weight * innovation
        if ratio > 0.0:
            s.map_ratio[j] += weight * change
        for k in range(j + 1):
            seen = s.covariance[j, k] - weight * s.gain[k]
            s.covariance[j, k] = seen + fade * (s.prior[row + k] - seen)
