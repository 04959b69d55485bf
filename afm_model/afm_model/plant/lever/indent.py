"""The indentation of the tip of the plant `lever` on its sample; docs/lever.md (20), (23).

Everything elastic that holds the tip is one compliance, so that the indentation x is the root of a balance,
target - x - w_n N(x) - w_f F_max(x). Where it has several, it is the first one in the direction in which the tip is
pulled at the last indentation.

Off the sample N is concave, in contact it is convex. So there is no other root between the last indentation and one on
the same side of the end of contact, if there the balance falls and here it pulls to that side; and a tangent from
contact that meets zero beyond the end of contact shows that no root is in contact.
"""

import math

from ...compiled.jit import kernel, routine
from ...compiled.records import Block
from ...compiled.ways import where
from .constants import Constants
from .contact import Pressed, pressed, reach
from .state import State, ledger_of

CLOSE = 1e-6
"""A Newton step so short, in units of indentation, leaves an error of its square."""
_STEEP = 0.1
"""Least fall of the balance over x, of which that without a contact is 1, at which Newton's method is trusted."""
FOUND, NEAR, FAR = range(3)
"""What a step of Newton's method has come to: the solution, to be stepped on from, nowhere."""
Found = tuple[float, float, float, float, float, float]
"""Indentation [m], normal force [N], friction bound [N], contact radius [m], and the slopes of both forces [N/m], taken
within a step of Newton's method of there."""


@kernel
def newton(
    x: float, here: Pressed, target: float, w_n: float, w_f: float, f: State
) -> tuple[float, float, float, float, int]:
    """One step of Newton's method for `indent`, from indentation x, at which `pressed` has found `here`.

    Returns
    -------
    (step, N, F_max, a, outcome) : floats, int
        Of the place to which the step leads, to first order; FOUND, NEAR or FAR.
    """
    N, stiffness, bound, growth, a = here
    slope = 1.0 + w_n * stiffness + w_f * growth
    step = (target - x - w_n * N - w_f * bound) / slope
    unit = f.unit_indentation
    # At the end of the contact the slope has a jump, or grows without limit.
    beyond, reached = x - f.end, x + step - f.end
    found = step * step < (CLOSE * CLOSE) * unit * min(unit, abs(beyond))
    far = (not slope >= _STEEP) | (beyond * reached <= 0.0)
    outcome = where(far, FAR, where(found, FOUND, NEAR))
    return step, N + stiffness * step, bound + growth * step, a, outcome


@kernel
def pulled(delta: float, way: float, target: float, w_n: float, w_f: float, f: State) -> bool:
    """Whether at the last indentation delta the tip is pulled to that side on which a root is found `way` from it [m]:
    by the forces of the last step.
    """
    pull = target - delta - w_n * f.N - w_f * f.F_max
    return (pull * way > 0.0) | (abs(way) <= CLOSE * f.unit_indentation)


@kernel
def indent(
    delta: float, start: float, target: float, w_n: float, w_f: float, f: State, p: Constants, m: Block, at: int
) -> Found:
    """Solve x + w_n N(x) + w_f F_max(x) = target, from the last indentation delta on, beginning at `start`."""
    elastic = p.viscosity == 0.0
    if p.bridge != 0.0:
        elastic = elastic and ledger_of(m).bridge == 0.0
    if elastic and delta > f.end:
        x = start
        for _ in range(4):
            if not x > f.end:
                break
            here = pressed(x, f, p, m, at)
            step, N, bound, a, outcome = newton(x, here, target, w_n, w_f, f)
            x += step
            if outcome == FAR:
                break
            if outcome == FOUND:
                if pulled(delta, x - delta, target, w_n, w_f, f):
                    return x, N, bound, a, here[1], here[3]
                break
    elif elastic:
        bare, force = reach(f, p, m, at)
        if is_off(target, w_n, bare, force, f):
            return off(start, bare, target, w_n, f)
    return _through(delta, start, elastic, target, w_n, w_f, f, p, m, at)


@kernel
def is_off(target: float, w_n: float, bare: float, force: float, f: State) -> bool:
    """Whether the balance falls all the way to where contact begins, and has changed its sign there."""
    steep = (1.0 - _STEEP) * (bare - f.end) >= -2.0 * w_n * force
    return steep and target - f.end - w_n * force <= 0.0


@kernel
def off(x: float, bare: float, target: float, w_n: float, f: State) -> Found:
    """The root off the sample, from x on, under the attraction alone: the first or second step overshoots outwards, the
    others come in from there.
    """
    N = stiffness = 0.0
    x = min(x, f.end)
    for _ in range(30):
        per = 1.0 / (bare - x)
        N = -f.hamaker_radius / 6.0 * (per * per)
        stiffness = 2.0 * N * per
        slope = 1.0 + w_n * stiffness
        step = (target - x - w_n * N) / slope
        x += step
        N += stiffness * step
        # What its curvature leaves.
        if -1.5 * w_n * stiffness * per * (step * step) < (CLOSE * CLOSE) * f.unit_indentation * slope:
            break
    return x, N, 0.0, 0.0, stiffness, 0.0


@routine
def _through(
    delta: float,
    start: float,
    elastic: bool,
    target: float,
    w_n: float,
    w_f: float,
    f: State,
    p: Constants,
    m: Block,
    at: int,
) -> Found:
    """The same where it is not as simple: into contact or out of it, with losses, near a fold."""
    inside = delta > f.end
    bare, force = reach(f, p, m, at)
    fall, excess = 1.0 + 2.0 * w_n * force / (bare - f.end), target - f.end - w_n * force
    x = delta
    if elastic and not inside and fall >= _STEEP and w_f == 0.0:
        x = max(start, f.end + excess)
    entering = x > f.end and not inside
    for _ in range(12 if elastic else 8):
        here = pressed(x, f, p, m, at)
        N, stiffness, bound, growth, a = here
        slope = 1.0 + w_n * stiffness + w_f * growth
        step, N, bound, a, outcome = newton(x, here, target, w_n, w_f, f)
        if not elastic:
            # With losses the force may have a jump at the end of contact, near which the tip may stay.
            near = abs(step) < CLOSE * f.unit_indentation
            leap = abs(step) > f.unit_indentation + 0.3 * abs(x - f.end) or (x - f.end) * (x + step - f.end) <= 0.0
            if not slope >= _STEEP or (leap and not near):
                break
            x += step
            if near:
                return x, N, bound, a, stiffness, growth
            continue
        if outcome == FOUND:
            x += step
            if not entering and not pulled(delta, x - delta, target, w_n, w_f, f):
                N_0, _, bound_0, _, _ = pressed(delta, f, p, m, at)
                if not (target - delta - w_n * N_0 - w_f * bound_0) * (x - delta) > 0.0:
                    break
            return x, N, bound, a, stiffness, growth
        if outcome == FAR:
            if entering and not slope >= _STEEP and step * slope > 0.0:
                # Left of the root, where the balance still rises.
                x += max(x - f.end, 0.1 * f.unit_indentation)
                continue
            if entering and slope >= _STEEP:
                x = 0.5 * (x + f.end)
                continue
            if inside and slope >= _STEEP and fall >= _STEEP and excess <= 0.0:
                return off(x + step, bare, target, w_n, f)
            break
        x += step
    return _march(delta, target, w_n, w_f, f, p, m, at)


@kernel
def _march(delta: float, target: float, w_n: float, w_f: float, f: State, p: Constants, m: Block, at: int) -> Found:
    """The same by steps until the balance changes sign, then by bisection: through folds and jumps."""
    N, stiffness, bound, growth, a = pressed(delta, f, p, m, at)
    balance = target - delta - w_n * N - w_f * bound
    step = math.copysign(1e-3 * f.unit_indentation, balance)
    low = high = delta
    for _ in range(300):
        high = low + step
        N, stiffness, bound, growth, a = pressed(high, f, p, m, at)
        if (target - high - w_n * N - w_f * bound) * balance <= 0.0:
            break
        low = high
        step *= 1.1
    for _ in range(60):
        middle = 0.5 * (low + high)
        if middle == low or middle == high:  # no number is between them
            break
        N, _, bound, _, _ = pressed(middle, f, p, m, at)
        if (target - middle - w_n * N - w_f * bound) * balance > 0.0:
            low = middle
        else:
            high = middle
    middle = 0.5 * (low + high)
    N, stiffness, bound, growth, a = pressed(middle, f, p, m, at)
    return middle, N, bound, a, stiffness, growth
