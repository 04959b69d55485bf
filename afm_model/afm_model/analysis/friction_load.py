"""Friction over load: shear strength and work of adhesion by the area of an adhesive contact, and a straight line.

    friction = tau pi a^2(load),  a of Maugis and Dugdale, JKR or DMT;  friction = mu load + F_0 (Amontons)

A single asperity follows the area: its friction grows less at larger load, and ends at the pull-off. Equations:
docs/lever.md (8) to (12).
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..contact.maugis import MODELS, pull_off
from .contact_problem import LEAST, MOST, TABOR, FlatContact, branch_nodes
from .estimate import Estimate, StraightLine, same_length, straight_line, student
from .modulus import REACH, doubt_of_model, positive

_Array = NDArray[np.float64]
_DOUBT = 1.0 / 3.0
"""Relative uncertainty of the work of adhesion above which it cannot be determined."""
_PASSES = 3
"""Fits, each with the scatter that the one before has left."""
_FACTOR = 12.0
"""Logarithm by which strength and work may be away from their first guess."""


class FrictionLoadFit(NamedTuple):
    """Results of friction over load. Those of modulus, radius and reach are in the standard uncertainties."""

    model: str
    strength: Estimate
    """Interfacial shear strength tau [Pa]."""
    work_of_adhesion: Estimate
    """[J/m^2]."""
    pull_off: Estimate
    """Largest pull by the model [N], positive: friction ends there."""
    tabor: float
    """Tabor number of the result, with `reach`."""
    rms: float
    """Rms of the residuals [N]."""
    line: StraightLine
    """Amontons: slope, the coefficient of friction; intercept, friction without load [N]; rms [N]."""
    told: str
    """What the loads do not determine, or why the model is the wrong one; empty if there is no problem."""


def friction_load_fit(
    load: ArrayLike,
    friction: _Array | Sequence[Estimate | float],
    modulus: Estimate | float,
    radius: Estimate | float,
    *,
    model: str = "maugis",
    reach: Estimate | float = REACH,
    adhesion: Estimate | None = None,
) -> FrictionLoadFit:
    """Shear strength and work of adhesion from friction at several loads, and Amontons' line through them.

    Parameters
    ----------
    load : array_like (n,) [N]
        Vertical force, 0 where the cantilever is not bent; at least four, from below or near 0 on if adhesion is to
        come out.
    friction : array_like (n,) or sequence of Estimate [N]
        Half-widths of friction loops, as of `friction_loop`. Uncertainties weigh; how large they are altogether is
        taken from the scatter.
    modulus : Estimate or float [Pa]
        Reduced modulus E*, as of `contact_fit`.
    radius : Estimate or float [m]
        Of the tip; on a curved sample the effective one.
    model : str
        maugis, jkr or dmt.
    reach : Estimate or float [m]
        Range z_0 of the adhesive stress, as in `contact_fit`.
    adhesion : Estimate, optional [N]
        Pull-off force, as of `force_curve`, with its uncertainty: with few loads the work of adhesion follows from it.

    Raises
    ------
    ValueError
        If there are fewer than four loads, friction does not grow with them, or an argument is not allowed.
    """
    if model not in MODELS:
        raise ValueError(f"model = {model} is not allowed: it must be one of {', '.join(MODELS)}")
    each = [one if isinstance(one, Estimate) else Estimate(float(one)) for one in friction]
    loads, values = same_length(load=load, friction=[one.value for one in each])
    if loads.size < 4:
        raise ValueError(f"friction over load needs four loads at least: there are {loads.size}")
    weights = np.array([one.uncertainty for one in each])
    weights = weights / weights.mean() if (weights > 0.0).all() else np.ones(loads.size)
    line = straight_line(loads, values)
    if not line.slope.value > 0.0:
        raise ValueError("friction does not grow with the load: there is no contact area in it")
    inputs = [positive(modulus, "modulus"), positive(radius, "radius"), positive(reach, "reach")]

    def solved(*numbers: float) -> tuple[_Array, _Array, float, float]:
        return _solved(model, loads, values, weights, adhesion, line, *numbers)

    known = [one.value for one in inputs]
    found, covariance, rms, tabor = solved(*known)
    spread = np.diag(covariance).copy()
    for i, one in enumerate(inputs):
        if one.uncertainty > 0.0:
            ends = [solved(*known[:i], one.value + sign * one.uncertainty, *known[i + 1 :])[0] for sign in (0.5, -0.5)]
            spread += (ends[0] - ends[1]) ** 2
    strength, work, pull = (
        Estimate(float(value), float(value) * math.sqrt(of)) for value, of in zip(np.exp(found), spread, strict=True)
    )
    told = doubt_of_model(model, tabor)
    if work.uncertainty > _DOUBT * work.value:
        told = (
            f"the loads from {loads.min():.3g} N to {loads.max():.3g} N do not determine the adhesion: measure nearer "
            f"to the pull-off, or give the adhesion of a force curve"
        )
    return FrictionLoadFit(model, strength, work, pull, tabor, rms, line, told)


def _solved(
    model: str,
    loads: _Array,
    values: _Array,
    weights: _Array,
    adhesion: Estimate | None,
    line: StraightLine,
    modulus: float,
    radius: float,
    reach: float,
) -> tuple[_Array, _Array, float, float]:
    """Logarithms of strength, work and pull-off, their covariance, rms [N], Tabor number."""
    from scipy.optimize import least_squares  # here: a third of a second for nothing in a recorder

    compliance = (4.0 / 3.0 * modulus) ** (-2.0 / 3.0)
    pull = adhesion.value if adhesion is not None else max(line.intercept.value / line.slope.value, 0.0)
    first = max(pull, -1.2 * float(loads.min()), 1e-2 * float(np.ptp(loads))) / (1.75 * math.pi * radius)

    def contact_at(log_work: float) -> FlatContact:
        return FlatContact(compliance, first * math.exp(log_work), radius, reach)

    def pull_at(log_work: float) -> float:
        contact = contact_at(log_work)
        return contact.force * pull_off(model, min(max(contact.transition, LEAST), MOST))

    def area_at(log_work: float) -> _Array:
        contact = contact_at(log_work)
        a, force, _ = branch_nodes(model, contact.transition, float(loads.max()) / contact.force)
        bottom = int(np.argmin(force))
        # Over the root of the force the area is smooth, up to the pull-off.
        root = np.sqrt(force[bottom:] - force[bottom])
        there = np.interp(np.sqrt(np.maximum(loads / contact.force - force[bottom], 0.0)), root, a[bottom:])
        return np.asarray(math.pi * (contact.contact_radius * there) ** 2)

    scale = float(values.mean()) / float(area_at(0.0).mean())
    sigma = 1e-3 * float(np.ptp(values))

    def left(x: _Array) -> _Array:
        rows = np.asarray((values - scale * math.exp(x[0]) * area_at(x[1])) / (sigma * weights))
        return rows if adhesion is None else np.append(rows, (pull_at(x[1]) - adhesion.value) / adhesion.uncertainty)

    x, freedom = np.zeros(2), loads.size - 2 + (adhesion is not None)
    for _ in range(_PASSES):
        fit = least_squares(left, x, bounds=(-_FACTOR, _FACTOR), x_scale="jac", diff_step=1e-4)
        x, rows = fit.x, fit.fun[: loads.size]
        rms = sigma * float(np.sqrt(np.mean((rows * weights) ** 2)))
        covariance = np.linalg.pinv(fit.jac.T @ fit.jac)
        sigma = max(sigma * math.sqrt(float(rows @ rows) / freedom), 1e-9 * float(values.mean()))
    step = 1e-4
    slope = (math.log(pull_at(x[1] + step)) - math.log(pull_at(x[1] - step))) / (2.0 * step)
    by_x = np.array([[1.0, 0.0], [0.0, 1.0], [0.0, slope]])
    logs = np.array([x[0] + math.log(scale), x[1] + math.log(first), math.log(pull_at(x[1]))])
    return logs, by_x @ covariance @ by_x.T * student(freedom) ** 2, rms, contact_at(x[1]).transition / TABOR
