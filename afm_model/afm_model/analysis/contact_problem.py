"""Solve the least squares problem of `contact_fit`: what is unknown, what is compared, and the results of the fit.

A contact model is fitted to the deflection over the path of the scanner.
"""

import math
from collections.abc import Callable
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..contact.maugis import along, branch
from .estimate import Estimate, correlation_length

_Array = NDArray[np.float64]
_NODES = 501
STRESS = 16.0 / (9.0 * math.sqrt(3.0))
"""Adhesive stress of Maugis and Dugdale times the range over the work of adhesion, docs/lever.md (9)."""
TABOR = 1.157
"""lambda over the Tabor number."""
LEAST, MOST = 0.01, 30.0
"""Transition parameters between which the exact equations are taken: beyond them the limits are as good."""


class FlatContact(NamedTuple):
    """A contact on a flat sample."""

    compliance: float  # K^(-2/3), K = 4/3 E* [Pa^(-2/3)]
    work: float  # of adhesion [J/m^2]
    radius: float  # [m]
    reach: float  # range of the adhesive stress [m]; for `maugis` alone

    @property
    def force(self) -> float:
        """Unit of force, pi w R [N]."""
        return math.pi * self.work * self.radius

    @property
    def length(self) -> float:
        """Unit of indentation [m]."""
        return (math.pi**2 * self.work**2 * self.radius) ** (1.0 / 3.0) * self.compliance

    @property
    def contact_radius(self) -> float:
        """Unit of the contact's radius [m]."""
        return math.sqrt(self.radius * self.length)

    @property
    def transition(self) -> float:
        """lambda of Maugis and Dugdale, docs/lever.md (9)."""
        stress = STRESS * self.work / self.reach
        return 2.0 * stress * (self.radius / (math.pi * self.work)) ** (1.0 / 3.0) * self.compliance


@cache
def _ends() -> tuple[_Array, _Array]:
    """Logarithms of transition parameters, and where the branch ends: a small error there changes nothing, since the
    indentation is least."""
    logarithms = np.linspace(math.log(LEAST), math.log(MOST), 100)
    return logarithms, np.array([branch("maugis", math.exp(each)).end for each in logarithms])


def branch_nodes(model: str, transition: float, largest: float) -> tuple[_Array, _Array, _Array]:
    """Contact radius, force and indentation from the end of the branch to a force, in units of `FlatContact`."""
    a_far = math.sqrt((largest + 2.0) ** (2.0 / 3.0)) + 2.0
    if model != "maugis":
        found = branch(model)
        return found.at(np.linspace(found.end, a_far, _NODES))
    transition = min(max(transition, LEAST), MOST)
    at = along(transition)
    coarse = float(np.interp(math.log(transition), *_ends())) * np.geomspace(1.0, 1e-5, 200)
    _, _, d = at(coarse)
    # Even steps in the root of the indentation, in which force and radius are smooth up to the end.
    s = np.sqrt(np.maximum.accumulate(np.maximum(d - d[0], 0.0)))
    even = np.linspace(0.0, min(a_far, float(s[-1])), _NODES)
    return at(np.exp(np.interp(even, s, np.log(coarse))))


def deflection_nodes(model: str, contact: FlatContact, k: float, largest: float) -> tuple[_Array, _Array]:
    """Way of the scanner from the undeformed surface on, and deflection [m], where they are stable with a spring.

    Parameters
    ----------
    model : str
        One of `afm_model.contact.maugis.MODELS`.
    contact : FlatContact
    k : float [N/m]
    largest : float [N]
        Force to which the branch is needed.
    """
    _, force, indentation = branch_nodes(model, contact.transition, largest / contact.force)
    deflection = contact.force / k * force
    way = contact.length * indentation + deflection
    # The tip comes off where the way has its least value: the contact pulls less from there on than the spring.
    off = int(np.argmin(way))
    return way[off:], deflection[off:]


_LEAST_NOISE = 1e-4
"""Of the largest deflection: what is taken where a record has less."""
_PASSES = 2
"""Fits before the last one, each with the noise that the one before has left."""
_STIFFEST = (4.0 / 3.0 * 1e12) ** (-2.0 / 3.0)
"""Compliance of a contact of E* = 1e12 Pa: diamond. Stiffer ones are not looked for."""
_FIRST_MODE = 3
"""Unknowns are: compliance over its first guess, logarithm of work over its own, place of the surface over the noise;
how the baseline varies, in its uncertainties; logarithms of what is known with an uncertainty."""
_FACTOR = 12.0
"""Largest logarithm of the ratio of work, or of a number that is known, to its first guess."""


class Solution(NamedTuple):
    """What a fit has found."""

    compliance: Estimate  # K^(-2/3) [Pa^(-2/3)]
    work: Estimate
    pull_off: Estimate
    transition: Estimate  # lambda
    k: float
    surface: float  # z of the undeformed surface [m]
    indentation: float  # at the largest deflection [m]
    bent: float  # the largest deflection [m]
    largest_radius: float  # of the contact there [m]
    rms: float
    independent: float


class Problem:
    """One way of a curve to be fitted: the approach or the retract.

    Parameters
    ----------
    model : str
    z, deflection : ndarray (n,) [m]
        While the tip is in contact; the deflection above the baseline.
    free : ndarray (m,) [m]
        Noise of the free cantilever, sampled like `deflection`.
    varying : ndarray (modes, n + 1) [m]
        How the baseline may vary at `z`, and at the pull-off: independent rows of one uncertainty each.
    depth : Estimate [m]
        Deflection below it at the pull-off.
    known : dict of str to Estimate
        k, radius, reach and sensitivity; without an uncertainty one is fixed.
    contact_point : float [m]
        Where the force is zero on the approach.
    """

    def __init__(
        self,
        model: str,
        z: _Array,
        deflection: _Array,
        free: _Array,
        varying: _Array,
        depth: Estimate,
        known: dict[str, Estimate],
        contact_point: float,
    ) -> None:
        self.model, self.z, self.deflection = model, z, deflection
        self.depth, self.known = depth, known
        self.varying, self.first_known = varying, _FIRST_MODE + len(varying)
        self.bent = float(deflection.max())
        self.noise = max(float(free.std()), _LEAST_NOISE * self.bent)
        self.length = correlation_length(free)
        self.sigma = self.noise
        """Uncertainty of a point: noise times the root of the correlation length."""
        k, radius = known["k"].value, known["radius"].value
        pull = max(k * depth.value, 1e-3 * k * self.bent)
        self.work = pull / (1.75 * math.pi * radius)
        top = float(z.max())
        # Where the force is zero the contact is pressed in already; a hundredth of a nanometre is less than that.
        given_way = max(top - contact_point - self.bent, 1e-11)
        K = (k * self.bent + pull) / (math.sqrt(radius) * given_way**1.5)
        self.compliance = max(K ** (-2.0 / 3.0), 2.0 * _STIFFEST)
        self.most = 1.2 * k * (top - float(z.min())) + pull
        self.free = [name for name, each in known.items() if each.uncertainty > 0.0]
        self.surface = contact_point

    def solve(self) -> Solution:
        """Fit."""
        from scipy.optimize import least_squares  # here: a third of a second for nothing in a recorder

        first_known = self.first_known
        count = first_known + len(self.free)
        x = np.zeros(count)
        x[0] = 1.0
        low, high = np.full(count, -np.inf), np.full(count, np.inf)
        low[0] = _STIFFEST / self.compliance
        low[1], high[1] = -_FACTOR, _FACTOR
        low[first_known:], high[first_known:] = -_FACTOR, _FACTOR
        for _ in range(_PASSES):
            found = least_squares(self._left, x, self._slopes, (low, high), x_scale="jac", max_nfev=60)
            x = found.x
            left = self.sigma * self._left(x)[: self.z.size]
            # A fit follows slow noise, and leaves less of it than there is.
            rms, length = float(np.sqrt(np.mean(left**2))), max(correlation_length(left), self.length)
            self.sigma = max(rms, self.noise) * math.sqrt(length)
        found = least_squares(self._left, x, self._slopes, (low, high), x_scale="jac", max_nfev=60)
        return self._tell(found.x, np.linalg.inv(found.jac.T @ found.jac), rms, left.size / length)

    def _names(self, x: _Array) -> tuple[FlatContact, dict[str, float]]:
        """Contact and the other known numbers at the unknowns x."""
        others = {name: each.value for name, each in self.known.items()}
        for i, name in enumerate(self.free):
            others[name] *= math.exp(x[self.first_known + i])
        contact = FlatContact(x[0] * self.compliance, self.work * math.exp(x[1]), others["radius"], others["reach"])
        return contact, others

    def _model(self, x: _Array) -> tuple[_Array, float]:
        """Deflection as measured, above that of the free cantilever, and the depth of the pull-off [m]."""
        from scipy.interpolate import CubicSpline  # as above

        contact, others = self._names(x)
        way, deflection = deflection_nodes(self.model, contact, others["k"], self.most)
        gain = others["sensitivity"]
        # Over the root of the way the deflection is smooth, up to where the tip comes off.
        at = np.sqrt(np.maximum(self.z - self.surface - self.noise * x[2] - way[0], 0.0))
        predicted = CubicSpline(np.sqrt(way - way[0]), deflection)(at) / gain
        return np.asarray(predicted), -float(deflection.min()) / gain

    def _left(self, x: _Array) -> _Array:
        """Residuals, each divided by its uncertainty: points, pull-off, zero, prior values."""
        predicted, depth = self._model(x)
        away = x[_FIRST_MODE : self.first_known]
        zero = away @ self.varying
        points = (self.deflection - zero[:-1] - predicted) / self.sigma
        rows = [points]
        rows.append(np.array([(depth - zero[-1] - self.depth.value) / max(self.depth.uncertainty, self.noise)]))
        rows.append(away)
        for i, name in enumerate(self.free):
            each = self.known[name]
            rows.append(np.array([x[self.first_known + i] * each.value / each.uncertainty]))
        return np.concatenate(rows)

    def _slopes(self, x: _Array) -> _Array:
        """Return the derivatives of `_left`. The steps are absolute: logarithms and other unknowns may be zero."""
        steps = np.full(x.size, 1e-3)
        steps[2 : self.first_known] = 1e-2
        changes = [step * unit for step, unit in zip(steps, np.eye(x.size), strict=True)]
        columns = [
            (self._left(x + change) - self._left(x - change)) / (2.0 * step)
            for step, change in zip(steps, changes, strict=True)
        ]
        return np.stack(columns, axis=1)

    def _tell(self, x: _Array, covariance: _Array, rms: float, independent: float) -> Solution:
        contact, others = self._names(x)
        k = others["k"]
        spread = np.sqrt(np.maximum(np.diag(covariance), 0.0))

        def of_fit(function: Callable[[_Array], float]) -> Estimate:
            """A number that follows from the unknowns, with its uncertainty."""
            slope = np.zeros(x.size)
            for i in np.flatnonzero(spread > 0.0):
                step = np.where(np.arange(x.size) == i, min(0.1 * spread[i], 0.1), 0.0)
                slope[i] = (function(x + step) - function(x - step)) / (2.0 * step[i])
            return Estimate(float(function(x)), math.sqrt(max(float(slope @ covariance @ slope), 0.0)))

        a, force, indentation = branch_nodes(self.model, contact.transition, self.most / contact.force)
        largest = k * self.bent / contact.force
        return Solution(
            compliance=Estimate(float(contact.compliance), float(spread[0]) * self.compliance),
            work=of_fit(lambda at: self._names(at)[0].work),
            pull_off=of_fit(lambda at: self._names(at)[1]["k"] * self._model(at)[1]),
            transition=of_fit(lambda at: self._names(at)[0].transition),
            k=k,
            surface=float(self.surface + self.noise * x[2]),
            indentation=contact.length * float(np.interp(largest, force, indentation)),
            bent=self.bent,
            largest_radius=contact.contact_radius * float(np.interp(largest, force, a)),
            rms=rms,
            independent=independent,
        )
