"""Modulus and adhesion from a force curve, by the contact of an adhesive sphere.

The deflection is fitted over the way of the scanner, k d = F(z - z_0 - d), and not the force over the indentation: the
noise of the deflection would be in both then. Models: `jkr` (soft, strong adhesion of short range), `dmt` (stiff, long
range), `maugis` between them (Maugis and Dugdale, doi:10.1016/0021-9797(92)90285-T). Equations: docs/lever.md (8) to
(12).
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ..contact.maugis import MODELS
from .contact_problem import TABOR, Problem, Solution
from .curve_parts import curve_parts
from .estimate import Estimate, binned
from .force_curves import force_curve, in_contact

REACH = 0.165e-9
"""Range of the adhesive stress that is usually taken [m]."""
PARTS = ("both", "approach", "retract")
_MOST = 1000
"""Points of approach or retract that are fitted at most; where there are more samples, means of them."""
_FEWEST = 20
_DOUBT = 1.0 / 3.0
"""Relative uncertainty of the contact's compliance above which the modulus cannot be determined."""
_DMT, _JKR = 0.1, 5.0
"""Tabor numbers up to which DMT and from which on JKR are right within some percent."""


class ContactFit(NamedTuple):
    """Results of a contact fit. Uncertainties are standard ones; those of k, radius and sensitivity are in them."""

    model: str
    modulus: Estimate
    """Reduced modulus E* [Pa]: 1/E* = (1 - nu^2)/E of the sample + the same of the tip."""
    work_of_adhesion: Estimate
    """[J/m^2]."""
    pull_off: Estimate
    """Largest pull by the model [N], positive."""
    contact_point: float
    """z at which the undeformed surfaces touch, of the retract or of the only part [m]."""
    indentation: float
    """Largest [m]."""
    stiffness: float
    """Of the contact at the largest force, 2 E* a [N/m]."""
    tabor: Estimate
    """Tabor number of the result, with `reach`: DMT is right for less than 0.1, JKR for more than 5."""
    rms: float
    """Rms of the residuals [m]."""
    independent: float
    """Points that count as independent of one another, by the correlation of the residuals."""
    told: str
    """A result that the curve does not determine, or why the model is the wrong one; empty if there is no problem."""


def contact_fit(
    z: ArrayLike,
    deflection: ArrayLike,
    k: Estimate | float,
    radius: Estimate | float,
    *,
    model: str = "maugis",
    reach: Estimate | float = REACH,
    part: str = "both",
    sensitivity_error: float = 0.01,
) -> ContactFit:
    """Modulus, work of adhesion and contact point from one force curve.

    Unknown are the modulus, the work of adhesion, the place of the surface, and the zero of the deflection, which the
    free cantilever shows; and k, radius, reach and sensitivity within what is known of them.
    The pull-off is a measured value too: with a soft cantilever the adhesion follows from it. Noise counts with its
    correlation, taken from what the fit leaves. What is wrong about the model is slow, and so counts as well. The slope
    of the sample is not in the curve: it makes the modulus wrong by percents, without a word; see `along_normal`.

    Parameters
    ----------
    z : array_like (n,) [m]
        Way of the scanner towards the tip: it rises to the turn and falls.
    deflection : array_like (n,) [m]
        Voltage times sensitivity.
    k : Estimate or float [N/m]
        Spring constant; of a tilted cantilever `tilted_stiffness`.
    radius : Estimate or float [m]
        Of the tip; on a curved sample the effective one.
    model : str
        maugis, jkr or dmt.
    reach : Estimate or float [m]
        Range z_0 of the adhesive stress, which with `maugis` gives the transition between JKR and DMT. With an
        uncertainty, as Estimate(0.165e-9, 0.1e-9), it is fitted.
    part : str
        retract, approach or both. Friction along the cantilever, which turns while it bends, acts with opposite signs
        on the two: with both the modulus is the mean, half of the difference is in its uncertainty, and the rest is of
        the retract. The approach begins where the force is zero, after most of the ringing that the snap-in causes.
    sensitivity_error : float
        Relative standard uncertainty of the sensitivity by which the deflection was made. On a stiff sample nothing
        else counts: what the contact gives way is the difference of z and the deflection.

    Raises
    ------
    ValueError
        If the curve has no approach and retract or no contact, or an argument is not allowed.
    """
    if model not in MODELS:
        raise ValueError(f"model = {model} is not allowed: it must be one of {', '.join(MODELS)}")
    if part not in PARTS:
        raise ValueError(f"part = {part} is not allowed: it must be one of {', '.join(PARTS)}")
    k, radius = positive(k, "k"), positive(radius, "radius")
    if not 0.0 <= sensitivity_error < 1.0:
        raise ValueError(f"sensitivity_error = {sensitivity_error:g} is not allowed: it must be >= 0 and < 1")
    found = force_curve(z, deflection, k.value)
    parts = curve_parts(z, deflection)
    pressed, pulled = in_contact(parts)
    depth = Estimate(*(each / k.value for each in found.adhesion))
    at = float(parts.z_out[pulled][-1])
    known = {
        "k": k,
        "radius": radius,
        "reach": positive(reach, "reach"),
        "sensitivity": Estimate(1.0, sensitivity_error),
    }
    fits = []
    for name, z_of, d_of in (
        ("approach", parts.z_in[pressed], parts.d_in[pressed]),
        ("retract", parts.z_out[pulled], parts.d_out[pulled]),
    ):
        if part not in (name, "both"):
            continue
        width = max(-(-z_of.size // _MOST), 1)
        way, bent, noise = binned(z_of, width), binned(d_of, width), binned(parts.baseline.noise, width)
        if way.size < _FEWEST:
            raise ValueError(
                f"only {way.size} points of the {name} are in contact, at least {_FEWEST} are needed: sample the curve "
                f"denser"
            )
        varying = parts.baseline.modes(np.append(way, at))
        problem = Problem(model, way, bent, noise, varying, depth, known, found.contact_point)
        fits.append(_result(problem.solve(), model, sensitivity_error, found.told))
    return fits[0] if len(fits) == 1 else _both(*fits)


def _both(approach: ContactFit, retract: ContactFit) -> ContactFit:
    """The retract with the mean modulus of both; half of the difference is in its uncertainty."""
    one, two = approach.modulus, retract.modulus
    # k, radius and sensitivity are the same in both, so that the mean is not better known than one of them.
    spread = math.hypot(max(one.uncertainty, two.uncertainty), 0.5 * (one.value - two.value))
    return retract._replace(
        modulus=Estimate(0.5 * (one.value + two.value), spread),
        stiffness=0.5 * (approach.stiffness + retract.stiffness),
        told=retract.told or approach.told,
    )


def positive(given: Estimate | float, name: str) -> Estimate:
    """A number as Estimate; ValueError unless it is above 0."""
    made = given if isinstance(given, Estimate) else Estimate(float(given))
    if not made.value > 0.0:
        raise ValueError(f"{name} = {made.value:g} is not allowed: it must be > 0")
    return made


def _result(found: Solution, model: str, sensitivity_error: float, of_base: str) -> ContactFit:
    relative = found.compliance.uncertainty / found.compliance.value
    E = 0.75 * found.compliance.value**-1.5
    modulus = Estimate(E, 1.5 * relative * E)
    stiffness = 2.0 * modulus.value * found.largest_radius
    tabor = Estimate(found.transition.value / TABOR, found.transition.uncertainty / TABOR)
    told = doubt_of_model(model, tabor.value) or of_base
    if relative > _DOUBT:
        bound = 0.75 * (found.compliance.value + 2.0 * found.compliance.uncertainty) ** -1.5
        of_sensitivity = f", known within {100.0 * sensitivity_error:g} %" if sensitivity_error > 0.0 else ""
        told = (
            f"the curve does not determine the modulus, only that E* is above {bound:.2g} Pa: the contact is "
            f"compressed by some {1e9 * found.indentation:.1g} nm, and the cantilever of {found.k:.3g} N/m bends by "
            f"{1e9 * found.bent:.3g} nm{of_sensitivity}; take a stiffer cantilever"
        )
    return ContactFit(
        model=model,
        modulus=modulus,
        work_of_adhesion=found.work,
        pull_off=found.pull_off,
        contact_point=found.surface,
        indentation=found.indentation,
        stiffness=stiffness,
        tabor=tabor,
        rms=found.rms,
        independent=found.independent,
        told=told,
    )


def doubt_of_model(model: str, tabor: float) -> str:
    """Why a model is the wrong one at this Tabor number; empty if it is not."""
    if (model == "dmt" and tabor > _DMT) or (model == "jkr" and tabor < _JKR):
        limit = f"DMT is for less than {_DMT:g}" if model == "dmt" else f"JKR is for more than {_JKR:g}"
        return f"the Tabor number of the result is {tabor:.2g}, and {limit}: use maugis"
    return ""


def young(modulus: Estimate, poisson: float, tip: tuple[float, float] | None = None) -> Estimate:
    """Young's modulus of the sample [Pa] from E*.

    Parameters
    ----------
    modulus : Estimate [Pa]
        Reduced modulus E*.
    poisson : float
        Of the sample.
    tip : (float, float), optional
        Young's modulus [Pa] and Poisson's ratio of the tip; without, it is taken as rigid.

    Raises
    ------
    ValueError
        If the tip alone gives way more than E* allows.
    """
    of_tip = (1.0 - tip[1] ** 2) / tip[0] if tip is not None else 0.0
    left = 1.0 / modulus.value - of_tip
    if left <= 0.0:
        raise ValueError(f"E* = {modulus.value:g} Pa is above that of the tip alone, {1.0 / of_tip:g} Pa")
    E = (1.0 - poisson**2) / left
    return Estimate(E, E / left * modulus.uncertainty / modulus.value**2)
