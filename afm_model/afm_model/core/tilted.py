"""A tilted cantilever whose tip slides on the sample: end loads of a uniform beam, docs/lever.md (3), (4)."""

import math


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
    return k / _vertical_compliance(tilt, tip_height / length)


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
    arm = tip_height / length
    return (math.cos(tilt) - 2.0 * arm * math.sin(tilt)) / _vertical_compliance(tilt, arm)


def _vertical_compliance(tilt: float, arm: float) -> float:
    """Vertical motion of the tip by a vertical force, over force by spring constant."""
    s, c = math.sin(tilt), math.cos(tilt)
    return c * c - 3.0 * arm * s * c + 3.0 * arm * arm * s * s
