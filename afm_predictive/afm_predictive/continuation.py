"""How height and friction go on ahead of the tip, for a prediction that reaches over more than a radian of the surface.

A surface without waves shorter than a known one is determined by places that lie closer than half of that, also for
some way ahead. It is taken for a Gaussian process along the way with all wave numbers up to the largest one alike, and
is continued by its mean under the last measurements.
"""

import math
from typing import TYPE_CHECKING, Any

from afm_model.parts import kernel, log, routine, sincos, square

from .constants import MEAN, POINTS, TABLE, VALUE, Constants

if TYPE_CHECKING:
    from .state import State

HEIGHT, FRICTION = range(2)
_FEWEST = 4.0
"""Places from which on they are continued."""
_APART = 0.1
"""Phase of the shortest wave from one place to the next, at least."""
_COARSE = 1.5
"""Phase in a control period of the reference from which on places lie too far apart."""
_PITCH = 0.5
"""Phase between two places of the table; the tip is in its middle."""
_LEAST = (1e-5, 1e-4)
"""Least variance of a measured height and ratio, over that of the surface."""
_LEVELS = (1e4, 1e3, 1e2, 1e1, 1.0)
"""Variances that are tried, over that."""
_FREEDOM = 4.0
"""Measurements that the assumed variance of the surface counts as much as."""
_LEAST_RATIO = 0.1
"""Of friction, of which what is uneven about it is a part."""
_OTHER = 2.0
"""What is found as far off in these units is another surface."""


@kernel
def forget_places(s: "State") -> None:
    """Nothing was measured yet."""
    for c in range(2):
        s.places[c] = s.goes_on[c] = 0.0


@kernel
def mean_ratio(s: "State") -> float:
    """Mean bound of friction over the nominal one, of which what is uneven about it is a part."""
    return max(s.ratio[MEAN], _LEAST_RATIO)


@kernel
def sinc(x: float, sin: float, cos: float) -> tuple[float, float]:
    """Of sin(x)/x and its derivative."""
    if abs(x) < 1e-3:
        return 1.0 - x * x / 6.0, -x / 3.0
    return sin / x, (cos - sin / x) / x


@kernel
def sinc_between(i: int, j: int, phase: Any, circle: Any) -> float:
    """Of the phase from place j to place i, with sine and cosine of each."""
    sin = circle[i, 0] * circle[j, 1] - circle[i, 1] * circle[j, 0]
    return sinc(phase[i] - phase[j], sin, 1.0)[0]


@kernel
def solve(c: int, noise: float, mean: float, size: float, s: "State") -> float:
    """Solve for the weights of the places with this variance of a measurement, by Cholesky's factor.

    Returns
    -------
    float
        Twice the logarithm of how likely the measurements are with it, but for a constant. The variance of the surface
        has an inverse gamma distribution about that of a wave: D. J. C. MacKay, Neural Comput. 4 (1992) 415,
        doi:10.1162/neco.1992.4.3.415.
    """
    first = POINTS - int(s.places[c])
    misfit, volume = 0.0, 1.0
    for i in range(first, POINTS):
        for j in range(first, i + 1):
            left = s.alike[i, j] + (noise if i == j else 0.0)
            for k in range(first, j):
                left -= s.factor[i, k] * s.factor[j, k]
            s.factor[i, j] = math.sqrt(left) if i == j else left / s.factor[j, j]
        left = s.found[i, c] - mean
        for k in range(first, i):
            left -= s.factor[i, k] * s.weigh[k, c]
        s.weigh[i, c] = left / s.factor[i, i]
        misfit += square(s.weigh[i, c])
        volume *= s.factor[i, i]
    for i in range(POINTS - 1, first - 1, -1):
        left = s.weigh[i, c]
        for k in range(i + 1, POINTS):
            left -= s.factor[k, i] * s.weigh[k, c]
        s.weigh[i, c] = left / s.factor[i, i]
    return -(s.places[c] + _FREEDOM) * log(_FREEDOM + 8.0 * misfit / square(size)) - 2.0 * log(volume)


@kernel
def take_place(H: float, ratio: float, p: Constants, s: "State") -> None:
    """Put height and ratio measured where the tip is behind those before, and the phases between them."""
    for i in range(POINTS - 1):
        for c in range(2):
            s.place[i, c], s.found[i, c] = s.place[i + 1, c], s.found[i + 1, c]
    s.place[POINTS - 1, 0], s.place[POINTS - 1, 1] = s.X, s.Y
    s.found[POINTS - 1, HEIGHT], s.found[POINTS - 1, FRICTION] = H, ratio
    d_x, d_y = s.X - s.at_x, s.Y - s.at_y
    way = math.sqrt(d_x * d_x + d_y * d_y)
    t_x, t_y = d_x / way, d_y / way
    q = p.wave_number * (abs(t_x) + abs(t_y))
    s.wave_x, s.wave_y = q * t_x, q * t_y
    for i in range(POINTS):
        d_x, d_y = s.place[i, 0] - s.X, s.place[i, 1] - s.Y
        s.along[i] = s.wave_x * d_x + s.wave_y * d_y
        s.beside[i] = s.wave_x * d_y - s.wave_y * d_x
        s.circle_along[i, 0], s.circle_along[i, 1] = sincos(s.along[i])
        s.circle_beside[i, 0], s.circle_beside[i, 1] = sincos(s.beside[i])
        for j in range(i + 1):
            alike = sinc_between(i, j, s.along, s.circle_along)
            s.alike[i, j] = alike * sinc_between(i, j, s.beside, s.circle_beside)


@kernel
def solve_likeliest(c: int, mean: float, size: float, s: "State") -> None:
    """Solve for the weights of the places with the variance of a measurement that makes them most likely."""
    likeliest, level = -math.inf, _LEVELS[0]
    for each in _LEVELS:
        likely = solve(c, each * _LEAST[c], mean, size, s)
        if likely > likeliest:
            likeliest, level = likely, each
    if level != _LEVELS[-1]:
        solve(c, level * _LEAST[c], mean, size, s)
    for i in range(POINTS - int(s.places[c])):
        s.weigh[i, c] = 0.0


@kernel
def tabulate(most: tuple[float, float], s: "State") -> None:
    """Write what is ahead of the tip and behind it, over the mean, into the table: values, and slopes in its pitch."""
    for i in range(TABLE):
        s.ahead[i, HEIGHT, 0] = s.ahead[i, HEIGHT, 1] = s.ahead[i, FRICTION, 0] = s.ahead[i, FRICTION, 1] = 0.0
    sin_step, cos_step = sincos(_PITCH)
    for j in range(POINTS):
        beside = sinc(s.beside[j], s.circle_beside[j, 0], 1.0)[0]
        x = -(TABLE // 2) * _PITCH - s.along[j]
        sin, cos = sincos(x)
        for i in range(TABLE):
            value, slope = sinc(x, sin, cos)
            for c in range(2):
                s.ahead[i, c, 0] += s.weigh[j, c] * beside * value
                s.ahead[i, c, 1] += s.weigh[j, c] * beside * slope * _PITCH
            x += _PITCH
            sin, cos = sin * cos_step + cos * sin_step, cos * cos_step - sin * sin_step
    for i in range(TABLE):
        for c in range(2):
            if abs(s.ahead[i, c, 0]) > most[c]:
                s.ahead[i, c, 0], s.ahead[i, c, 1] = math.copysign(most[c], s.ahead[i, c, 0]), 0.0


@kernel
def of_table(x: float, y: float, c: int, s: "State") -> float:
    """What the table has for (x, y), over the mean."""
    d_x, d_y = x - s.place[POINTS - 1, 0], y - s.place[POINTS - 1, 1]
    at = (s.wave_x * d_x + s.wave_y * d_y) / _PITCH + TABLE // 2
    if not 0.0 <= at <= TABLE - 1.001:
        # Nor is what is no number a place of the table.
        at = 0.0 if at < 0.0 else TABLE - 1.001
    i = int(at)
    f, g = at - i, 1.0 - (at - i)
    before = (1.0 + 2.0 * f) * s.ahead[i, c, 0] + f * s.ahead[i, c, 1]
    return g * g * before + f * f * ((1.0 + 2.0 * g) * s.ahead[i + 1, c, 0] - g * s.ahead[i + 1, c, 1])


@kernel
def go_on(x: float, y: float, c: int, s: "State") -> float:
    """Height or ratio at (x, y)."""
    return of_table(x, y, c, s) + s.offset_ahead[c]


@routine
def look_ahead(H: float, ratio: float, p: Constants, s: "State") -> None:
    """Take height and ratio measured where the tip is, and write how they go on from there.

    To be called once both are followed. Without a ratio, at rest, only how far the continuation lies from what is
    followed is new.
    """
    found, mean = (H, ratio), (s.H[MEAN], s.ratio[MEAN])
    sizes = (p.height, p.ripple * mean_ratio(s))
    if ratio > 0.0 and p.wave_number * (abs(s.X - s.at_x) + abs(s.Y - s.at_y)) > _APART:
        for c in range(2):
            if s.goes_on[c] > 0.0 and abs(found[c] - go_on(s.X, s.Y, c, s)) > _OTHER * sizes[c]:
                s.places[c] = 0.0
            s.places[c] = min(s.places[c] + 1.0, float(POINTS))
        take_place(H, ratio, p, s)
        for c in range(2):
            solve_likeliest(c, mean[c], sizes[c], s)
        tabulate((p.most_ahead * sizes[HEIGHT], p.most_ahead * sizes[FRICTION]), s)
    fine = p.wave_number * (abs(s.v[0]) + abs(s.v[1])) * p.hold < _COARSE
    last = POINTS - 1
    near = p.wave_number * (abs(s.X - s.place[last, 0]) + abs(s.Y - s.place[last, 1])) < p.reach
    now = (s.H[VALUE], s.ratio[VALUE])
    for c in range(2):
        s.goes_on[c] = 1.0 if fine and near and s.places[c] >= _FEWEST else 0.0
        s.offset_ahead[c] = now[c] - of_table(s.X, s.Y, c, s)
