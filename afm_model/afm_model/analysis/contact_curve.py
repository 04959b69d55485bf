"""Deflection of a cantilever over the way of the scanner, by a contact model: what a fit compares with a curve."""

import math
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..contact.maugis import along, branch

_Array = NDArray[np.float64]
_NODES = 501
STRESS = 16.0 / (9.0 * math.sqrt(3.0))
"""Adhesive stress of Maugis and Dugdale times the range over the work of adhesion, docs/lever.md (9)."""
TABOR = 1.157
"""lambda over the Tabor number."""
LEAST, MOST = 0.01, 30.0
"""Transition parameters between which the exact equations are taken: beyond them the limits are as good."""


class Contact(NamedTuple):
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
    """Contact radius, force and indentation along the branch from its end to a largest force, in units of `Contact`."""
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


def deflection_nodes(model: str, contact: Contact, k: float, largest: float) -> tuple[_Array, _Array]:
    """Way of the scanner from the undeformed surface on, and deflection [m], where they are stable with a spring.

    Parameters
    ----------
    model : str
        One of `afm_model.contact.maugis.MODELS`.
    contact : Contact
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
