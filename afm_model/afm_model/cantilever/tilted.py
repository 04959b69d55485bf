"""A tilted cantilever whose tip slides on the sample: end loads of a uniform beam, docs/lever.md (3), (4)."""

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..core.elementary import hypot, sincos


def tilted_stiffness(k: float, tilt: float, tip_height: float, length: float) -> float:
    """Spring constant of a tilted cantilever for vertical forces and vertical motion of its tip [N/m].

        k / (cos^2 b - 3 (h / L) sin b cos b + 3 (h / L)^2 sin^2 b)

    A vertical force acts across the cantilever and, by the height h of the tip, as a couple on its end: end loads of a
    uniform beam. Take it with a sensitivity from a force curve, which is that for vertical motion.

    Parameters
    ----------
    k : float [N/m]
        Of the cantilever, for a force across it.
    tilt : float [rad]
        Angle b by which it points down to the sample.
    tip_height, length : float [m]
        Of the tip below the cantilever's neutral axis; of the cantilever.
    """
    return k / _loaded(tilt, tip_height / length, 0.0)[0]


def tilted_deflection(tilt: float, tip_height: float = 0.0, length: float = math.inf) -> float:
    """Deflection across a tilted cantilever, as a photodiode shows it, over the vertical motion of its tip.

        (cos b - 2 (h / L) sin b) / (cos^2 b - 3 (h / L) sin b cos b + 3 (h / L)^2 sin^2 b)

    1 / cos b with a low tip: the tip slides while the sample moves vertically, so that the end bends by more than the
    sample moves. A sensitivity from a force curve counts vertical motion; times this it is that across the cantilever,
    of which a thermal record consists. (Heim, Kappl, Butt, Langmuir 20 (2004) 2760; Hutter, Langmuir 21 (2005) 2630.)

    Parameters
    ----------
    tilt, tip_height, length
        As in `tilted_stiffness`.
    """
    moved, shown = _loaded(tilt, tip_height / length, 0.0)
    return shown / moved


def along_normal(
    z: ArrayLike, deflection: ArrayLike, k: float, slope: float, tilt: float, tip_height: float, length: float
) -> tuple[NDArray[np.float64], NDArray[np.float64], float]:
    """A force curve on a slope as one along its normal, and the spring constant that belongs to it.

    A force along the normal of a slope has a part along the cantilever, which bends it too. Taken as vertical, a slope
    of 1.6 degrees along a cantilever of 2.8 N/m that is tilted by 0.2 rad makes the modulus of polystyrene 7 % wrong.
    Without friction this is exact.

    Parameters
    ----------
    z, deflection : array_like (n,) [m]
        Vertical, as for `force_curve`: voltage times the sensitivity of a curve on a flat sample.
    k : float [N/m]
        Of the cantilever, for a force across it.
    slope : float
        Rise of the sample over way towards the end of the cantilever (+y), as measured in an image.
    tilt, tip_height, length
        As in `tilted_stiffness`.

    Returns
    -------
    z, deflection, k
        For `force_curve` and `contact_fit`: indentation and force are those along the normal.
    """
    flat, here = _loaded(tilt, tip_height / length, 0.0), _loaded(tilt, tip_height / length, slope)
    n = 1.0 / hypot(1.0, slope)
    # Motion along the normal for the deflection shown, which is `flat.shown / flat.moved` of the vertical one.
    factor = here[0] / here[1] * flat[1] / flat[0]
    return n * np.asarray(z, np.float64), factor * np.asarray(deflection, np.float64), k / here[0]


def _loaded(tilt: float, arm: float, slope: float) -> tuple[float, float]:
    """Motion of the tip along the normal of a slope by a unit force along it, and deflection shown, for k = 1."""
    (s, c), n = sincos(tilt), 1.0 / hypot(1.0, slope)
    s, c = n * (s - slope * c), n * (c + slope * s)
    return c * c - 3.0 * arm * s * c + 3.0 * arm * arm * s * s, c - 2.0 * arm * s
